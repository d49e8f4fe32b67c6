//! The light's footprint: the blur's kernel as the camera sees it (section 6 of the paper, with the light's shape).
//!
//! A blocker stands at share t of the way from the receiver p to the light. The line from p to the light's point
//! s = s₀ + a·u + b·v (u, v the light's half axes) meets the light exactly if the centre's line through the same
//! place of the blocker does. That line reaches the receiver's plane (normal n, w = s₀ − p) at
//!
//! p′ = p + t·(a·U + b·V) / h,  U = u − (n·u)/(n·w)·w,  V likewise,  h = 1 − t − t·(a·n·u + b·n·v)/(n·w),
//!
//! so V(p) is the mean, over the light, of the hard shadow at p′. For a light that lies parallel to the plane this is
//! the penumbra formula, `(d_receiver − d_blocker)·w_light / d_blocker` = `t/(1 − t)·w_light`. Of parallel light t is a
//! distance and h = 1. In homogeneous coordinates p′ is affine in a and b; so is its place in the image, before the
//! division.

use glam::{Mat4, Vec2, Vec3};
use gnomon_shadow_map::light_cone::LightCone;

/// The footprints of a light, one a blocker's distance, around one receiver.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    /// U and V, world space.
    axes: [Vec3; 2],
    /// (n·u)/(n·w) and (n·v)/(n·w); zero for parallel light.
    lean: Vec2,
    parallel: bool,
    /// Clip x, y and w of the receiver, of U and of V.
    clip: [Vec3; 3],
    /// Half the image, pixels.
    half: Vec2,
}

impl Footprint {
    /// Of the light over `cone` on the plane through `point` with unit normal `normal`, in an image of `size` pixels.
    /// `None` if the light's centre does not lie above the plane.
    pub fn new(
        cone: &LightCone,
        point: Vec3,
        normal: Vec3,
        parallel: bool,
        clip_from_world: &Mat4,
        size: Vec2,
    ) -> Option<Self> {
        let rise = normal.dot(cone.w);
        let lean = Vec2::new(normal.dot(cone.u), normal.dot(cone.v)) / rise;
        if !(rise > 0.0 && lean.is_finite()) {
            return None;
        }
        let axes = [cone.u - cone.w * lean.x, cone.v - cone.w * lean.y];
        let clip = |v: Vec3, w: f32| {
            let clip = *clip_from_world * v.extend(w);
            Vec3::new(clip.x, clip.y, clip.w)
        };
        let lean = if parallel { Vec2::ZERO } else { lean };
        let clip = [clip(point, 1.0), clip(axes[0], 0.0), clip(axes[1], 0.0)];
        Some(Self { axes, lean, parallel, clip, half: size * 0.5 })
    }

    /// h of the module's text; not above 0 where the line never comes back to the plane.
    #[inline]
    fn height(&self, at: Vec2, t: f32) -> f32 {
        if self.parallel { 1.0 } else { 1.0 - t - t * at.dot(self.lean) }
    }

    /// p′ − p for the light's point `at` = (a, b).
    #[inline]
    pub fn offset(&self, at: Vec2, t: f32) -> Vec3 {
        (self.axes[0] * at.x + self.axes[1] * at.y) * (t / self.height(at, t))
    }

    /// Where in the image p′ is, pixels (the centre of the first is at ½, ½); `None` behind the camera or where p′ is
    /// nowhere. It may lie outside the image.
    #[inline]
    pub fn pixel(&self, at: Vec2, t: f32) -> Option<Vec2> {
        let h = self.height(at, t);
        let clip = self.clip[0] * h + (self.clip[1] * at.x + self.clip[2] * at.y) * t;
        let pixel = self.half + Vec2::new(clip.x, -clip.y) * self.half / clip.z;
        (h > 0.0 && clip.z > 0.0 && pixel.is_finite()).then_some(pixel)
    }

    /// The pixels around the footprint, `reach` times as wide as the light: least and greatest; `None` where it is
    /// unbounded.
    pub fn bounds(&self, reach: f32, t: f32) -> Option<(Vec2, Vec2)> {
        let (mut min, mut max) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for corner in [Vec2::ONE, Vec2::NEG_ONE, Vec2::new(1.0, -1.0), Vec2::new(-1.0, 1.0)] {
            let pixel = self.pixel(corner * reach, t)?;
            (min, max) = (min.min(pixel), max.max(pixel));
        }
        Some((min, max))
    }
}

/// t/(1 − t): how much larger than the light its footprint is. For parallel light t itself.
#[inline]
pub fn spread(t: f32, parallel: bool) -> f32 {
    if parallel { t } else { t / (1.0 - t).max(f32::MIN_POSITIVE) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene_core::Light;

    const CLIP: Mat4 = Mat4::IDENTITY;

    fn footprint(light: &Light, point: Vec3, normal: Vec3) -> Footprint {
        let cone = LightCone::new(light, point).unwrap();
        let parallel = matches!(light, Light::Directional { .. });
        Footprint::new(&cone, point, normal, parallel, &CLIP, Vec2::ONE).unwrap()
    }

    /// Over a light parallel to the plane, the paper's formula.
    #[test]
    fn a_parallel_light_has_the_paper_s_width() {
        let light = Light::Rect { center: Vec3::Y * 4.0, half_u: Vec3::X * 0.5, half_v: Vec3::Z * 0.25 };
        let footprint = footprint(&light, Vec3::ZERO, Vec3::Y);
        // Blocker at height 1: d_receiver = 4, d_blocker = 3.
        let offset = footprint.offset(Vec2::ONE, 0.25);
        assert!((offset - Vec3::new(0.5, 0.0, 0.25) / 3.0).length() < 1e-6, "{offset}");
    }

    /// The line from the receiver to the light's point and that from p′ to the centre cross, at the blocker's distance.
    #[test]
    fn both_lines_meet_at_the_blocker() {
        let center = Vec3::new(1.0, 5.0, 2.0);
        let point = Vec3::new(0.3, 0.0, -0.2);
        for light in [
            Light::Rect { center, half_u: Vec3::new(0.5, 0.3, 0.0), half_v: Vec3::new(0.0, 0.2, 0.7) },
            Light::Disk { center, normal: Vec3::new(0.3, 1.0, 0.2), radius: 0.6 },
            Light::Directional { direction: -center, angular_radius: 0.1 },
        ] {
            let normal = Vec3::new(0.1, 1.0, 0.3).normalize();
            let cone = LightCone::new(&light, point).unwrap();
            let footprint = footprint(&light, point, normal);
            for at in [Vec2::new(0.5, -0.7), Vec2::new(-1.0, 0.2)] {
                let t = 0.4;
                let blocker = point + cone.direction(at) * t;
                let other = point + footprint.offset(at, t);
                let (to_light, _) = light.center().ray_from(other);
                let apart = (blocker - other).normalize().cross(to_light.normalize()).length();
                assert!(apart < 1e-5 && normal.dot(other - point).abs() < 1e-5, "{light:?}: {apart}");
            }
        }
    }
}
