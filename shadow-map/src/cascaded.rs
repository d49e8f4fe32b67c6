//! `cascaded`: maps of a directional light for parts of what is seen, near parts finer than far ones.
//!
//! See [`crate::cascades`] for where parts end and what their maps hold. A receiver is looked up in its part's map as
//! `hard` does, so a shadow's edge goes on across a split, only with other texels. Nothing is filtered or faded there,
//! and as the test has no bias to scale by texels, no seam shows but by the size of the jags.
//!
//! `shade` draws the maps, as only there the samples are known; they depend on nothing but the G-buffer and so stand
//! still when the camera does. Lights at a place have no cascades: they are shaded as by `hard`.

use std::borrow::Cow;
use std::ops::Range;

use glam::{Mat3, Vec3};
use rayon::prelude::*;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::relevance::{self, Backdrops, CasterChunks, Receivers, TileBounds};
use scene_core::{GBuffer, Light, Origin, Report, Scene, VisibilityImage};

use crate::cascades::{self, MAX_CASCADES, Samples};
use crate::cpu;
use crate::light_maps::{LightMaps, ShadowMapView};
use crate::light_views::{LightView, bounds_along};
use crate::params::HARD_REACH;
use crate::receiver_plane::plane_tolerance;
use crate::view_casters::looked_up_behind;
use crate::{PreparedVariant, ShadowMapParams};

/// How far a window reaches beyond its samples, in texels: a sample on the rim is looked up at a texel's centre, half
/// a texel off at most; the other half is for rounding.
pub(crate) const BORDER: f32 = 1.0;

/// The variant, for a directional light.
#[derive(Debug)]
pub(crate) struct Cascaded<'a> {
    scene: &'a Scene,
    light: Light,
    params: ShadowMapParams,
    to_light: Vec3,
    axes: Mat3,
    casters: Backdrops<'a>,
    /// Of the casters drawn, in the light's axes.
    bounds: Aabb,
    chunks: CasterChunks,
    tolerance: f32,
}

/// The casters that are drawn, told apart from backdrops, and their bounds in the light's axes.
pub(crate) fn drawn_bounds<'a>(
    scene: &'a Scene,
    light: &Light,
    tolerance: f32,
    axes: Mat3,
) -> (Backdrops<'a>, Aabb) {
    let casters = relevance::told_apart(scene, light, tolerance);
    let bounds = bounds_along(scene, axes, &casters.drawn);
    (casters, bounds)
}

impl<'a> Cascaded<'a> {
    /// What holds for any camera; `None` for a light at a place.
    pub(crate) fn new(
        scene: &'a Scene,
        light: &Light,
        params: &ShadowMapParams,
        report: &mut Report,
    ) -> Option<Self> {
        let LightPoint::Towards(to_light) = light.center() else { return None };
        let tolerance = plane_tolerance(scene.bounds(), light);
        let (x, y) = to_light.any_orthonormal_pair();
        let axes = Mat3::from_cols(x, y, to_light);
        let (casters, bounds) = report.time("prepare.views", |_| drawn_bounds(scene, light, tolerance, axes));
        report.skip("casters", casters.backdrops.len() as u64);
        let chunks = report.time("prepare.chunks", |_| {
            if params.skip { CasterChunks::new(scene) } else { CasterChunks::default() }
        });
        report.bytes += chunks.bytes() as u64;
        Some(Self {
            scene,
            light: *light,
            params: *params,
            to_light,
            axes,
            casters,
            bounds,
            chunks,
            tolerance,
        })
    }

    /// `shade.maps`: the map of each cascade with `samples`, drawn from the casters that receivers inside of its
    /// `boxes` may be looked up behind.
    fn draw(
        &self,
        samples: &[Samples],
        boxes: impl Fn(usize) -> Vec<Aabb>,
        report: &mut Report,
    ) -> Vec<LightMaps<'a>> {
        let objects = self.scene.objects();
        let size = self.params.map_size;
        let mut drawn = Vec::new();
        for (cascade, samples) in samples.iter().enumerate() {
            let view = cascades::window(samples, self.bounds, size, BORDER).map(|(min, max)| {
                let bounds = Aabb { min: min.extend(self.bounds.min.z), max: max.extend(self.bounds.max.z) };
                LightView::parallel(self.axes, bounds)
            });
            report.skip("cascades", u64::from(view.is_none()));
            let views = Vec::from_iter(view);
            let ranges: Vec<Range<usize>> = if self.params.skip && !views.is_empty() {
                report.time("shade.relevance", |report| {
                    let receivers = Receivers::within(self.scene, &boxes(cascade), &self.light);
                    let region =
                        looked_up_behind(self.scene, &self.light, &receivers, &views, size, HARD_REACH);
                    let kept = relevance::relevant_casters(self.scene, &region, &self.chunks, |id| {
                        let object = &objects[id as usize];
                        !self.casters.backdrops.iter().any(|backdrop| std::ptr::eq(*backdrop, object))
                    });
                    kept.book(report);
                    kept.ranges
                })
            } else {
                self.casters.drawn.iter().map(|object| object.triangles.clone()).collect()
            };
            let maps = report.time("shade.maps", |_| cpu::render_maps(self.scene, &ranges, &views, size));
            let backdrops = self.casters.backdrops.iter().copied().cloned().collect();
            let maps = LightMaps {
                origin: Origin::WORLD,
                scene: Cow::Borrowed(self.scene),
                light: self.light,
                maps,
                backdrops,
                tolerance: self.tolerance,
            };
            report.bytes += maps.bytes();
            drawn.push(maps);
        }
        drawn
    }
}

impl PreparedVariant for Cascaded<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        let objects = self.scene.objects();
        let (tiles, ends, samples) = report.time("shade.cascades", |_| {
            let asks = |pixel: usize| {
                gbuffer.is_seen(pixel)
                    && objects[gbuffer.object[pixel] as usize].flags.receives
                    && gbuffer.normal[pixel].dot(self.to_light) > 0.0
            };
            let pixels = || (0..gbuffer.pixel_count()).into_par_iter();
            let [near, far] = pixels()
                .filter(|&pixel| asks(pixel))
                .map(|pixel| [gbuffer.depth[pixel]; 2])
                .reduce(|| [f32::INFINITY, f32::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
            let ends = cascades::splits(near, far, self.params.cascades as usize);
            let sample = |pixel| asks(pixel).then(|| (gbuffer.depth[pixel], gbuffer.position[pixel]));
            let samples = cascades::by_cascade(self.axes, &ends, pixels().map(sample));
            (TileBounds::of_receivers(self.scene, gbuffer), ends, samples)
        });
        let boxes = |cascade: usize| {
            let start = if cascade == 0 { f32::NEG_INFINITY } else { ends[cascade - 1] };
            let of_cascade = |tile: &&scene_core::relevance::Tile| {
                tile.seen > 0
                    && tile.depth_max >= start
                    && (tile.depth_min <= ends[cascade] || cascade + 1 == ends.len())
            };
            tiles.tiles.iter().filter(of_cascade).map(|tile| tile.bounds).collect()
        };
        let maps = self.draw(&samples[..ends.len().min(MAX_CASCADES)], boxes, report);
        report.time("shade.lookup", |_| {
            let width = gbuffer.width.max(1) as usize;
            visibility.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
                for (column, value) in values.iter_mut().enumerate() {
                    let pixel = row * width + column;
                    let maps = &maps[cascades::cascade_of(&ends, gbuffer.depth[pixel])];
                    *value = match cpu::receiver(maps, gbuffer, pixel) {
                        Ok(receiver) => maps.hard(&receiver),
                        Err(known) => known,
                    };
                }
            });
        });
    }

    /// All points are one cascade.
    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32], report: &mut Report) {
        let light_from_world = self.axes.transpose();
        let finite = || points.iter().copied().filter(|point| point.is_finite());
        let samples = finite().fold(Samples::NONE, |samples, point| samples.with(light_from_world * point));
        let maps = self.draw(&[samples], |_| vec![Aabb::from_points(finite())], report).remove(0);
        report.time("shade.lookup", |_| cpu::answer_points(points, visibility, |point| maps.hard_at(point)));
    }

    fn maps(&self) -> &[ShadowMapView] {
        &[]
    }
}
