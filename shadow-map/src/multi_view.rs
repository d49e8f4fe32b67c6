//! `multi-view`: a hard shadow map from each of k points of an extended light, averaged.
//!
//! Heckbert and Herf, "Simulating soft shadows with graphics hardware" (1997), and Szabó, section 6: the mean over points
//! of the light converges to V as points and texels grow, with no model of occluders in between. It is what other soft
//! shadow maps are judged by, and slow: k drawings of the casters.
//!
//! Maps are drawn and looked up one after another, so memory does not grow with k. `shade` needs the receivers to leave
//! out what none of them needs, so maps are drawn there, and hold for no longer.
//!
//! What is left to err is the texel at a shadow's edge, so each map is fitted to the casters that shadow someone: a slab that
//! is the ground under everything is not drawn ([`relevance::told_apart_with_solids`]).

use std::borrow::Cow;

use glam::Vec3;
use rayon::prelude::*;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::raster::RasterScratch;
use scene_core::relevance::{self, CasterChunks, Receivers, TileBounds};
use scene_core::{GBuffer, Light, Origin, Report, Scene, VisibilityImage};

use crate::cpu;
use crate::light_maps::{LightMaps, ShadowMapView};
use crate::light_points::{light_points, weight};
use crate::light_views::light_views;
use crate::params::HARD_REACH;
use crate::patches::patches_of;
use crate::receiver_plane::plane_tolerance;
use crate::view_casters::{looked_up_behind, looked_up_texels};
use crate::{PreparedVariant, ShadowMapParams};

/// The variant. Nothing is drawn before there are receivers.
#[derive(Debug)]
pub(crate) struct MultiView<'a> {
    /// What coordinates of all that follows, and of all that is asked, are counted from.
    pub(crate) origin: Origin,
    scene: Cow<'a, Scene>,
    light: Light,
    params: ShadowMapParams,
    chunks: CasterChunks,
}

/// What is summed up for a receiver.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    seen: f32,
    all: f32,
}

impl Sum {
    fn add(&mut self, weight: f32, v: f32) {
        self.seen += weight * v;
        self.all += weight;
    }

    /// A receiver to which no point counts is inside a sphere light, or behind all of it.
    fn mean(self) -> f32 {
        if self.all > 0.0 { (self.seen / self.all).min(1.0) } else { 0.0 }
    }
}

impl<'a> MultiView<'a> {
    /// Takes the bounds of runs of triangles, for leaving out casters; draws nothing.
    pub(crate) fn new(
        scene: &'a Scene,
        light: &Light,
        params: &ShadowMapParams,
        report: &mut Report,
    ) -> Self {
        let origin = Origin::near(scene.bounds());
        let scene = origin.scene(scene);
        let chunks = report.time("prepare.chunks", |_| {
            if params.skip { CasterChunks::new(&scene) } else { CasterChunks::default() }
        });
        report.bytes += chunks.bytes() as u64;
        Self { origin, scene, light: origin.light(light), params: *params, chunks }
    }

    /// Calls `shade` with the maps of one point of the light after another.
    fn for_each_point(
        &self,
        boxes: &[Aabb],
        bounds: Aabb,
        report: &mut Report,
        mut shade: impl FnMut(&LightMaps<'_>, LightPoint, &mut Report),
    ) {
        let scene = self.scene.as_ref();
        // Of the whole scene, so that points stay where they are when the camera moves.
        let seen_from = scene.bounds().union(bounds);
        let points = light_points(&self.light, seen_from, self.params.views, self.params.seed);
        let mut scratch = RasterScratch::new();
        let mut maps: Vec<ShadowMapView> = Vec::new();
        for point in points {
            let light = self.light.reduced_to(point);
            // Of a sphere, points on the far side count for nobody: the height above them is largest at a corner.
            let unseen = |corner: Vec3| weight(&self.light, point, corner) <= 0.0;
            if self.params.skip && bounds.corners().into_iter().all(unseen) {
                report.skip("views", 1);
                continue;
            }
            let tolerance = plane_tolerance(scene.bounds(), &light);
            let (casters, views) = report.time("shade.views", |_| {
                let casters = relevance::told_apart_with_solids(scene, &light, tolerance);
                let views = light_views(scene, &light, &casters.drawn, self.params.skip);
                (casters, views)
            });
            report.skip("faces", views.skipped_faces);
            let size = self.params.map_size;
            let mut windows = None;
            let ranges: Vec<_> = if self.params.skip {
                report.time("shade.relevance", |report| {
                    let receivers = Receivers::within(scene, boxes, &light);
                    let of = |view| looked_up_texels(view, &receivers, size, HARD_REACH);
                    windows = Some(views.views.iter().map(of).collect::<Vec<_>>());
                    let region = looked_up_behind(scene, &light, &receivers, &views.views, size, HARD_REACH);
                    let objects = scene.objects();
                    let kept = relevance::relevant_casters(scene, &region, &self.chunks, |id| {
                        !casters.backdrops.iter().any(|b| std::ptr::eq(*b, &objects[id as usize]))
                    });
                    kept.book(report);
                    kept.ranges
                })
            } else {
                casters.drawn.iter().map(|object| object.triangles.clone()).collect()
            };
            report.time("shade.maps", |_| {
                cpu::render_maps_into(
                    scene,
                    &ranges,
                    &views.views,
                    windows.as_deref(),
                    size,
                    &mut scratch,
                    &mut maps,
                );
            });
            let light_maps = LightMaps {
                origin: self.origin,
                scene: Cow::Borrowed(scene),
                light,
                maps: std::mem::take(&mut maps),
                backdrops: casters.backdrops.into_iter().cloned().collect(),
                tolerance,
            };
            report.bytes = report.bytes.max(light_maps.bytes());
            shade(&light_maps, point, report);
            maps = light_maps.maps;
        }
    }
}

impl PreparedVariant for MultiView<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        let (boxes, bounds) = report.time("shade.views", |_| {
            let tiles = TileBounds::of_receivers(&self.scene, gbuffer);
            (tiles.boxes(), tiles.bounds())
        });
        let (patches, mut answers) = report.time("shade.lookup", |_| match self.params.skip {
            true => (patches_of(&self.scene, gbuffer), vec![0.0; gbuffer.pixel_count()]),
            false => Default::default(),
        });
        let mut sums = vec![Sum::default(); gbuffer.pixel_count()];
        let width = gbuffer.width.max(1) as usize;
        self.for_each_point(&boxes, bounds, report, |maps, point, report| {
            if self.params.skip {
                let known = report.time("shade.lookup", |_| {
                    let known = maps.shade_hard(gbuffer, &patches, &mut answers);
                    let pixels = sums.par_iter_mut().zip(&answers).zip(&gbuffer.position);
                    pixels.with_min_len(4096).for_each(|((sum, &v), &position)| {
                        let share = weight(&self.light, point, position);
                        if share > 0.0 {
                            sum.add(share, v);
                        }
                    });
                    known
                });
                report.skip("lookups", known);
                return;
            }
            report.time("shade.lookup", |_| {
                sums.par_chunks_mut(width).enumerate().for_each(|(row, sums)| {
                    for (column, sum) in sums.iter_mut().enumerate() {
                        let pixel = row * width + column;
                        let share = weight(&self.light, point, gbuffer.position[pixel]);
                        // What counts for nothing need not be looked up; NaN is a pixel that sees nothing.
                        if share > 0.0 {
                            let v = cpu::receiver(maps, gbuffer, pixel).map(|receiver| maps.hard(&receiver));
                            sum.add(share, v.unwrap_or_else(|known| known));
                        }
                    }
                });
            });
        });
        for (pixel, (value, sum)) in visibility.values.iter_mut().zip(sums).enumerate() {
            let receives = || self.scene.objects()[gbuffer.object[pixel] as usize].flags.receives;
            *value = match gbuffer.is_seen(pixel) {
                false => f32::NAN,
                true if !receives() => 1.0,
                true => sum.mean(),
            };
        }
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32], report: &mut Report) {
        let finite = points.iter().copied().filter(|point| point.is_finite());
        let bounds = Aabb::from_points(finite);
        let mut sums = vec![Sum::default(); points.len().min(visibility.len())];
        self.for_each_point(&[bounds], bounds, report, |maps, point, report| {
            report.time("shade.lookup", |_| {
                sums.par_iter_mut().zip(points).for_each(|(sum, &receiver)| {
                    let share = weight(&self.light, point, receiver);
                    if share > 0.0 {
                        sum.add(share, maps.hard_at(receiver));
                    }
                });
            });
        });
        for ((value, sum), point) in visibility.iter_mut().zip(sums).zip(points) {
            *value = if point.is_finite() { sum.mean() } else { f32::NAN };
        }
    }

    fn maps(&self) -> &[ShadowMapView] {
        &[]
    }
}
