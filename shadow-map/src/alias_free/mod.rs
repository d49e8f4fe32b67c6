//! Alias-free shadow maps: the shadow test at the exact points that the camera sees. No resolution, no bias.
//!
//! After Aila and Laine, "Alias-free shadow maps" (EGSR 2004), and Johnson et al., "The irregular z-buffer" (ACM TOG
//! 2005). Instead of sampling the light's view at a grid of texels and comparing elsewhere, the receivers themselves
//! are the samples: they are projected to the light's window and sorted there, each caster is drawn over them, and
//! every receiver inside of it is tested.
//!
//! 1. `shade.receivers`: the views of the light that hold all receivers (`frame`), and in each of them the receivers,
//!    sorted into blocks and a tree of boxes (`receivers`).
//! 2. `shade.casters`: each triangle (`caster`) goes down the tree to the blocks that it may shadow, and is tested
//!    against sixteen receivers at a time.
//!
//! # What is exact
//! The answer is that of a shadow ray, [`scene_core::bvh::Bvh::is_occluded`], bit for bit: vector arithmetic decides
//! where a derived bound says that it can (see `caster`), and what is closer than that to an edge or a plane is asked
//! of the ray tracer's own exact test. So edges do not leak and nothing shadows itself that does not in ground truth.
//!
//! # Cost
//! Grows with the receivers, and with the casters in the receivers' window. Nothing is built ahead but bounds of runs
//! of triangles; against ray tracing it saves the tree over the casters and pays for a tree over the receivers.

mod caster;
mod frame;
mod receivers;
mod variant;

use std::ops::Range;

use fearless_simd::{Level, Simd, dispatch};
use glam::Vec3;
use rayon::prelude::*;
use scene_core::bvh::{blocks, blocks_cut_out, shadow_origin};
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::relevance::{self, CasterChunks, CasterRegion};
use scene_core::{GBuffer, Light, Report, Scene, VisibilityImage};

use frame::Frame;
use receivers::{Receivers, Tally};
pub(crate) use variant::Prepared;

/// Triangles a task takes.
const TASK: usize = 1024;

/// Receivers whose common box tells which casters matter.
const BOX: usize = 256;

/// The casters of a scene, and whether to leave out those that no receiver needs.
#[derive(Clone, Debug)]
pub struct AliasFree<'a> {
    scene: &'a Scene,
    chunks: CasterChunks,
    skip: bool,
    level: Level,
}

impl<'a> AliasFree<'a> {
    /// Takes a pass over the triangles for their bounds. They hold as long as the scene does, for any light and camera.
    pub fn new(scene: &'a Scene, skip: bool) -> Self {
        let chunks = if skip { CasterChunks::new(scene) } else { CasterChunks::default() };
        Self { scene, chunks, skip, level: Level::new() }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.chunks.bytes()
    }

    /// The hard shadow of `light`'s centre: V of every pixel that sees a surface, 0 or 1, NaN elsewhere. It equals
    /// ray-traced ground truth ([`mod@scene_core::reference`]) of a light without extent.
    ///
    /// # Panics
    /// If `visibility` has another size than the G-buffer.
    pub fn shade(&self, light: &Light, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Report {
        assert_eq!(visibility.values.len(), gbuffer.pixel_count(), "one value a pixel");
        let mut report = Report::default();
        let center = light.center();
        let magnitude = self.scene.bounds().magnitude();
        let objects = self.scene.objects();
        let (mut origins, mut pixels) = (Vec::new(), Vec::new());
        report.time("shade.receivers", |_| {
            let found: Vec<_> = (visibility.values.par_iter_mut().enumerate())
                .filter_map(|(pixel, value)| {
                    *value = f32::NAN;
                    if !gbuffer.is_seen(pixel) {
                        return None;
                    }
                    *value = 1.0;
                    if !objects.get(gbuffer.object[pixel] as usize).is_none_or(|o| o.flags.receives) {
                        return None;
                    }
                    let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
                    let height = match center {
                        LightPoint::At(place) => normal.dot(place - position),
                        LightPoint::Towards(direction) => normal.dot(direction),
                    };
                    if !(height > 0.0 && light.reaches(position)) {
                        *value = 0.0;
                        return None;
                    }
                    Some((shadow_origin(position, normal, magnitude), pixel as u32))
                })
                .collect();
            (origins, pixels) = found.into_iter().unzip();
        });
        self.occluded(center, &origins, &mut report, |origin| {
            visibility.values[pixels[origin as usize] as usize] = 0.0;
        });
        report
    }

    /// Whether anything blocks the light from `light` at each of `origins`:
    /// [`Bvh::is_occluded`](scene_core::bvh::Bvh::is_occluded), bit for bit. Origins on a surface must be lifted
    /// ([`shadow_origin`]); nothing blocks one that is not finite.
    ///
    /// # Panics
    /// If the two slices differ in length.
    pub fn occluded_packet(&self, light: LightPoint, origins: &[Vec3], blocked: &mut [bool]) -> Report {
        assert_eq!(origins.len(), blocked.len(), "one answer an origin");
        let mut report = Report::default();
        blocked.fill(false);
        self.occluded(light, origins, &mut report, |origin| blocked[origin as usize] = true);
        report
    }

    /// Calls `blocked` with the index of every origin that is in shadow; returns what it took.
    fn occluded(
        &self,
        light: LightPoint,
        origins: &[Vec3],
        report: &mut Report,
        mut blocked: impl FnMut(u32),
    ) -> Tally {
        // From the light's own place no ray goes to it.
        let (place, excluded) = match light {
            LightPoint::At(place) => (place, place),
            LightPoint::Towards(direction) => (direction, Vec3::NAN),
        };
        let pieces = report.time("shade.relevance", |report| self.pieces(light, origins, report));
        let views = report.time("shade.receivers", |_| {
            let casters = pieces.iter().map(|piece| &self.scene.objects()[piece.object as usize]);
            let bounds = casters.fold(Aabb::EMPTY, |bounds, object| bounds.union(object.bounds));
            let asks = |&id: &u32| origins[id as usize].is_finite() && origins[id as usize] != excluded;
            let all = if place.is_finite() { origins.len() as u32 } else { 0 };
            let ids = (0..all).into_par_iter().filter(asks).collect();
            let views = frame::views(light, origins, ids, bounds);
            views
                .into_iter()
                .map(|v| (Receivers::new(&v.frame, origins, &v.receivers), v.frame))
                .collect::<Vec<_>>()
        });
        let mut tally = Tally::default();
        for (receivers, frame) in &views {
            report.bytes += receivers.bytes() as u64;
            tally += report.time("shade.casters", |_| {
                let cast = |piece: &Piece| {
                    dispatch!(self.level, simd => self.cast(simd, piece, light, frame, receivers, origins))
                };
                pieces.par_iter().map(cast).reduce(Tally::default, |mut sum, part| {
                    sum += part;
                    sum
                })
            });
            receivers.for_each_shadowed(&mut blocked);
        }
        tally
    }

    /// The triangles that cast and, unless skipping is off, lie where they can shadow one of `origins`, cut into tasks.
    fn pieces(&self, light: LightPoint, origins: &[Vec3], report: &mut Report) -> Vec<Piece> {
        let scene = self.scene;
        let mut pieces = Vec::new();
        let mut add = |range: Range<usize>| {
            let first = scene.objects().partition_point(|object| object.triangles.end <= range.start);
            let objects = (0..).zip(scene.objects()).skip(first);
            for (id, object) in objects.take_while(|(_, object)| object.triangles.start < range.end) {
                let part = range.start.max(object.triangles.start)..range.end.min(object.triangles.end);
                if object.flags.casts {
                    let starts = part.clone().step_by(TASK);
                    pieces.extend(
                        starts
                            .map(|start| Piece { triangles: start..part.end.min(start + TASK), object: id }),
                    );
                }
            }
        };
        if !self.skip {
            add(0..scene.triangles().len());
            return pieces;
        }
        let boxes: Vec<_> = origins
            .par_chunks(BOX)
            .map(|part| Aabb::from_points(part.iter().copied().filter(|origin| origin.is_finite())))
            .collect();
        let light = light.as_light();
        let region = CasterRegion::of_receivers(scene, &boxes, &light);
        let kept = relevance::relevant_casters(scene, &region, &self.chunks, |_| true);
        kept.book(report);
        kept.ranges.into_iter().for_each(&mut add);
        pieces
    }

    /// Draws the triangles of a task over the receivers of a view.
    #[inline(always)]
    fn cast<S: Simd>(
        &self,
        simd: S,
        piece: &Piece,
        light: LightPoint,
        frame: &Frame,
        receivers: &Receivers,
        origins: &[Vec3],
    ) -> Tally {
        let mut tally = Tally::default();
        let scene = self.scene;
        let mask = scene.objects()[piece.object as usize].alpha.as_deref();
        for triangle in piece.triangles.clone() {
            let corners = scene.corners(triangle);
            // Inlined into here, or it would not use the vector unit.
            caster::seen(
                frame,
                corners,
                #[inline(always)]
                |caster| {
                    receivers.shadow(simd, &caster, mask.is_some(), &mut tally, |id| {
                        let origin = origins[id as usize];
                        match mask {
                            None => blocks(corners, origin, light),
                            Some(mask) => {
                                let uvs =
                                    scene.triangles()[triangle].map(|vertex| scene.uvs()[vertex as usize]);
                                blocks_cut_out(corners, uvs, mask, origin, light)
                            }
                        }
                    });
                },
            );
        }
        tally
    }
}

/// Triangles of one object, a task.
#[derive(Clone, Debug)]
struct Piece {
    triangles: Range<usize>,
    object: u32,
}
