//! Ground truth without sampling noise, for flat lights.
//!
//! From each point the casters inside the cone over the light are projected onto it, and the area of their union is
//! taken. V is right to some 10⁻¹², far below what the f32 of positions and of the result itself leave.
//!
//! Limits: `rect` and `disk` lights (and those of no extent, which one ray decides exactly). A disk is a regular
//! polygon of 256 sides and the same area. Where circle and polygon differ, half each way, lies
//! (π/256)²·0.26 = 4·10⁻⁵ of the area, so V is off by at most half of that, 2·10⁻⁵. Cut-out masks are refused: along
//! texels nothing is gained over samples. Time grows with the triangles inside the cone.

mod cone;
mod union_area;

use std::ops::ControlFlow;

use thiserror::Error;

use self::cone::{Cone, Outline};
use self::union_area::UnionArea;
use super::tiles::{Estimate, Reference, estimate_tiles};
use super::{Cancelled, CasterSearch, Occlusion, ReferenceSettings, reference};
use crate::bvh::shadow_origin;
use crate::{GBuffer, Light, Scene};

/// Why there is no exact truth.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ExactError {
    /// Only flat lights, and those of no extent, can be done exactly.
    #[error(
        "exact visibility takes rect and disk lights and those without extent, not this {0} light: use samples"
    )]
    Light(&'static str),
    /// A caster has a cut-out mask.
    #[error("exact visibility does not take cut-out masks, and object '{0}' has one: use samples")]
    AlphaMask(String),
    /// Stopped by the progress callback.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// V of `light` for every pixel of `gbuffer` that sees a surface, with `std_error` 0 and by the same rules as
/// [`reference()`]; `casters` must be those of `scene`.
///
/// # Errors
/// A light or caster that cannot be done exactly, or [`Cancelled`] if `progress` breaks.
pub fn exact_reference<C: CasterSearch + Occlusion>(
    scene: &Scene,
    casters: &C,
    light: &Light,
    gbuffer: &GBuffer,
    progress: &(dyn Fn(f32) -> ControlFlow<()> + Sync),
) -> Result<Reference, ExactError> {
    if let Some(object) = scene.objects().iter().find(|o| o.flags.casts && o.alpha.is_some()) {
        return Err(ExactError::AlphaMask(object.name.clone()));
    }
    let is_flat = matches!(light, Light::Rect { .. } | Light::Disk { .. });
    if !is_flat && !light.is_extended() {
        let one_ray = ReferenceSettings::default();
        return Ok(reference(scene, casters, light, gbuffer, &one_ray, progress)?);
    }
    let outline = Outline::new(light).ok_or(ExactError::Light(light.kind()))?;
    let magnitude = scene.bounds().magnitude();
    let begin = |_, _, _: &mut UnionArea| {};
    Ok(estimate_tiles(scene, light, gbuffer, progress, UnionArea::default, begin, |pixel, hidden, _work| {
        let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
        let cone = Cone::new(&outline, shadow_origin(position, normal, magnitude), position, normal);
        hidden.clear();
        if cone.seen_area > 0.0 {
            casters.visit(
                |bounds| cone.may_meet(bounds),
                |triangle| cone.add_shadow(scene.corners(triangle as usize), hidden),
            );
        }
        let seen = cone.seen_area - hidden.area();
        Estimate::certain((seen / cone.area()).clamp(0.0, 1.0) as f32)
    })?)
}

#[cfg(test)]
mod tests;
