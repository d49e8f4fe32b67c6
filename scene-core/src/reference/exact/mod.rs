//! Ground truth without sampling noise, for flat lights.
//!
//! From each point the casters inside the cone over the light are projected onto it, and what their shadows leave of its
//! area is taken. V is right to some 10⁻¹², far below what the f32 of positions and of the result itself leave. Pixels that
//! are proved wholly lit or dark are left out.
//!
//! # Limits
//! `rect` and `disk` lights (and those of no extent, which one ray decides exactly). A disk is a regular
//! polygon of 256 sides and the same area. Where circle and polygon differ, half each way, lies
//! (π/256)²·0.26 = 4·10⁻⁵ of the area, so V is off by at most half of that, 2·10⁻⁵. A distant light up to 1.3° in radius
//! is a disk of directions, and V is off by at most 10⁻⁴ more; a real sun's, 0.27° in radius, by 4·10⁻⁶.
//!
//! Along the texels of a cut-out mask nothing is gained over samples. V lies between what it would be without the masked
//! casters and what it would be if they had no holes: where the two are one, as where other casters hide all that the
//! masked ones might, it is exact all the same. Other pixels are sampled, which [`Work::sampled`](super::Work::sampled)
//! counts and their standard error tells.
//!
//! Time grows with the triangles inside the cone, and with the crossings of silhouettes before the light.

mod apexes;
mod blocks;
mod cone;
mod lit_area;
#[cfg(test)]
mod oracle;
mod patch;

use std::ops::ControlFlow;

use glam::Vec3;
use thiserror::Error;

use self::blocks::{Gatherer, Receiver};
use self::cone::{Cone, Outline};
use self::patch::{Buffers, Patch};
use super::outline::LightOutline;
use super::proof::{Memory, Proof, Prover};
use super::sampled::{Scratch, Tracer};
use super::tiles::{Estimate, Reference, TILE, Work, estimate_tiles};
use super::{Cancelled, CasterSearch, Occlusion, ReferenceSettings, reference};
use crate::bvh::shadow_origin;
use crate::geometry::weld;
use crate::{GBuffer, Light, Scene};

/// Why there is no exact truth.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ExactError {
    /// Only flat lights, distant ones that are as good as flat, and those of no extent can be done exactly.
    #[error(
        "exact visibility takes rect and disk lights, distant ones up to 1.3° in radius and those without extent, \
         not this {0} light: use samples"
    )]
    Light(&'static str),
    /// Stopped by the progress callback.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Two areas that are the same but for rounding, in units of the light's: less than this is nothing.
const SAME: f64 = 1e-11;

/// V of `light` for every pixel of `gbuffer` that sees a surface, with `std_error` 0 and by the same rules as
/// [`reference()`]; `casters` must be those of `scene`. Pixels whose V hangs on cut-out masks are sampled, by `settings`;
/// without `settings.skip` nothing is proved beforehand.
///
/// # Errors
/// A light that cannot be done exactly, or [`Cancelled`] if `progress` breaks.
pub fn exact_reference<C: CasterSearch + Occlusion>(
    scene: &Scene,
    casters: &C,
    light: &Light,
    gbuffer: &GBuffer,
    settings: &ReferenceSettings,
    progress: &(dyn Fn(f32) -> ControlFlow<()> + Sync),
) -> Result<Reference, ExactError> {
    let is_flat = matches!(light, Light::Rect { .. } | Light::Disk { .. });
    if !is_flat && !light.is_extended() {
        return Ok(reference(scene, casters, light, gbuffer, settings, progress)?);
    }
    let outline = Outline::new(light).or_else(|| Outline::distant(light));
    let outline = outline.ok_or(ExactError::Light(light.kind()))?;
    let tracer = Tracer { casters, light, gbuffer, settings, magnitude: scene.bounds().magnitude() };
    Ok(solve(scene, tracer, &outline, progress)?)
}

fn solve<C: CasterSearch + Occlusion>(
    scene: &Scene,
    tracer: Tracer<'_, C>,
    outline: &Outline,
    progress: &(dyn Fn(f32) -> ControlFlow<()> + Sync),
) -> Result<Reference, Cancelled> {
    let Tracer { casters, light, gbuffer, settings, magnitude } = tracer;
    let tree = casters.tree().filter(|_| settings.skip);
    let solver = Solver {
        prover: tree.map(|tree| Prover::new(tree, light, gbuffer, magnitude)),
        tracer,
        gatherer: Gatherer {
            scene,
            casters,
            representative: weld(scene.positions()).representative,
            outline,
            hull: LightOutline::new(&outline.around(light), farthest_seen(gbuffer), magnitude),
            magnitude,
        },
    };
    let begin = |x, y, thread: &mut Thread| thread.tile = Some([x, y]);
    estimate_tiles(scene, light, gbuffer, progress, Thread::default, begin, |pixel, thread, work| {
        if let Some([x, y]) = thread.tile.take() {
            solver.tile(x, y, thread, work);
        }
        let (x, y) = (pixel as u32 % gbuffer.width % TILE, pixel as u32 / gbuffer.width % TILE);
        thread.found[(y * TILE + x) as usize]
    })
}

/// The largest coordinates of what is seen.
fn farthest_seen(gbuffer: &GBuffer) -> Vec3 {
    let seen = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel));
    seen.fold(Vec3::ZERO, |reach, pixel| reach.max(gbuffer.position[pixel].abs()))
}

/// What a thread keeps from pixel to pixel.
#[derive(Default)]
struct Thread {
    /// The tile begun, until it is solved.
    tile: Option<[u32; 2]>,
    /// By row and column of the tile.
    found: Vec<Estimate>,
    proofs: Memory,
    samples: Scratch,
    areas: Buffers,
}

struct Solver<'a, C> {
    prover: Option<Prover<'a>>,
    tracer: Tracer<'a, C>,
    gatherer: Gatherer<'a, C>,
}

impl<C: CasterSearch + Occlusion> Solver<'_, C> {
    /// Solves the tile whose first pixel is (`x`, `y`).
    fn tile(&self, x: u32, y: u32, thread: &mut Thread, work: &mut Work) {
        let Thread { found, proofs, samples, areas, .. } = thread;
        found.clear();
        found.resize((TILE * TILE) as usize, Estimate::certain(f32::NAN));
        if let Some(prover) = &self.prover {
            prover.begin_tile(x, y, proofs);
        }
        let (gbuffer, objects) = (self.tracer.gbuffer, self.gatherer.scene.objects());
        let mut receivers = Vec::new();
        for at in (0..TILE * TILE).map(|place| [place % TILE, place / TILE]) {
            let [column, row] = [x + at[0], y + at[1]];
            if column >= gbuffer.width || row >= gbuffer.height {
                continue;
            }
            let pixel = row as usize * gbuffer.width as usize + column as usize;
            let object = objects.get(gbuffer.object[pixel] as usize);
            if !gbuffer.is_seen(pixel) || !object.is_none_or(|object| object.flags.receives) {
                continue;
            }
            let proof = self.prover.as_ref().and_then(|prover| prover.prove(pixel, proofs));
            let place = (at[1] * TILE + at[0]) as usize;
            match proof {
                Some(Proof::Lit) => {
                    work.proved_lit += 1;
                    found[place] = Estimate::certain(1.0);
                }
                Some(Proof::Dark) => {
                    work.proved_dark += 1;
                    found[place] = Estimate::certain(0.0);
                }
                None => {
                    let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
                    let origin = shadow_origin(position, normal, self.tracer.magnitude);
                    receivers.push(Receiver { pixel, at, origin, normal });
                }
            }
        }
        self.gatherer.each(receivers, TILE, &mut |receiver, patch| {
            let place = (receiver.at[1] * TILE + receiver.at[0]) as usize;
            found[place] = match self.by_outlines(receiver, patch, areas) {
                Some(estimate) => {
                    work.exact += 1;
                    estimate
                }
                None => {
                    work.sampled += 1;
                    self.tracer.pixel(receiver.pixel, samples, work)
                }
            };
        });
    }

    /// V of a pixel that sees the light through the patch; `None` if it hangs on masks.
    fn by_outlines(&self, receiver: &Receiver, patch: &Patch, buffers: &mut Buffers) -> Option<Estimate> {
        let position = self.tracer.gbuffer.position[receiver.pixel];
        let cone = Cone::new(self.gatherer.outline, receiver.origin, position, receiver.normal);
        if cone.seen_area.is_nan() || cone.seen_area <= 0.0 {
            return Some(Estimate::certain((cone.seen_area / cone.area()) as f32));
        }
        let seen = patch.seen(&cone, buffers);
        let (most, least) = (seen.most / cone.area(), seen.least / cone.area());
        let v = if most <= SAME { 0.0 } else { most.min(1.0) };
        (most - least <= SAME).then_some(Estimate::certain(v as f32))
    }
}

#[cfg(test)]
mod tests;
