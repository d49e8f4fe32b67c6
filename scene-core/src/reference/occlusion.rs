//! What ground truth asks of a ray tracer, so that an analytic shape can stand in for one.

use glam::Vec3;

use crate::light::LightPoint;

/// Something that blocks light.
pub trait Occlusion: Sync {
    /// Sets `blocked[i]` to whether anything lies between `origin` and `targets[i]`. Slices of equal length.
    fn occluded_from(&self, origin: Vec3, targets: &[LightPoint], blocked: &mut [bool]);
}
