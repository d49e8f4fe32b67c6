//! What ground truth asks of a ray tracer, so that an analytic shape can stand in for one.

use glam::Vec3;

use crate::light::LightPoint;

/// Something that blocks light.
pub trait Occlusion: Sync {
    /// Where a shadow ray starts that belongs to a surface point with the unit normal `normal` (turned to the
    /// viewer), so that the surface does not block itself. A shape without rounding starts on the surface.
    fn shadow_origin(&self, position: Vec3, normal: Vec3) -> Vec3;

    /// Sets `blocked[i]` to whether anything lies between `origin` and `targets[i]`. Slices of equal length.
    fn occluded_from(&self, origin: Vec3, targets: &[LightPoint], blocked: &mut [bool]);
}
