//! Casters with cut-out masks, of which no volume is made: the outline of a hole is in a texture, where there are no edges.
//!
//! Volumes count the solid casters. Where none of these is in the way, a ray asks the others, unless their bounds are not
//! in its way either.

use glam::{DVec3, Vec3};
use scene_core::Scene;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;

/// Boxes held at most: one is tried in a few nanoseconds, a ray takes some hundred.
const MOST_BOXES: usize = 32;

/// Bounds of the casters with masks.
#[derive(Clone, Debug, Default)]
pub struct MaskedCasters {
    boxes: Vec<Aabb>,
}

impl MaskedCasters {
    /// Those of `scene`. Objects that follow one another share a box where there are many.
    pub fn new(scene: &Scene) -> Self {
        let masked = scene.objects().iter().filter(|o| o.flags.casts && o.alpha.is_some());
        let bounds: Vec<Aabb> = masked.map(|o| o.bounds).filter(|bounds| !bounds.is_empty()).collect();
        let shared = bounds.len().div_ceil(MOST_BOXES).max(1);
        let joined = |boxes: &[Aabb]| Aabb {
            min: boxes.iter().fold(Vec3::INFINITY, |min, b| min.min(b.min)),
            max: boxes.iter().fold(Vec3::NEG_INFINITY, |max, b| max.max(b.max)),
        };
        Self { boxes: bounds.chunks(shared).map(joined).collect() }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.boxes.is_empty()
    }

    /// Whether one of them may lie between a point and the light, erring to yes.
    #[inline(always)]
    pub fn may_block(&self, origin: DVec3, light: LightPoint) -> bool {
        !self.is_empty() && self.meets_a_box(origin, light)
    }

    fn meets_a_box(&self, origin: DVec3, light: LightPoint) -> bool {
        let (way, end) = match light {
            LightPoint::At(place) => (place.as_dvec3() - origin, 1.0),
            LightPoint::Towards(direction) => (direction.as_dvec3(), f64::INFINITY),
        };
        self.boxes.iter().any(|bounds| {
            let (mut near, mut far) = (0.0_f64, end);
            for axis in 0..3 {
                let (low, high) = (f64::from(bounds.min[axis]), f64::from(bounds.max[axis]));
                // Rays take corners relative to the origin and round them once: 2⁻²⁴ of the difference.
                let slack = (low - origin[axis]).abs().max((high - origin[axis]).abs()) / 8_388_608.0;
                let (low, high) = (low - origin[axis] - slack, high - origin[axis] + slack);
                if way[axis] == 0.0 {
                    if low > 0.0 || high < 0.0 {
                        return false;
                    }
                } else {
                    let (a, b) = (low / way[axis], high / way[axis]);
                    near = near.max(a.min(b));
                    far = far.min(a.max(b));
                }
            }
            near <= far
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_beside_and_beyond_do_not_block() {
        let masked = MaskedCasters { boxes: vec![Aabb { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) }] };
        let from = DVec3::new(0.0, -3.0, 0.0);
        for (light, blocked) in [
            (LightPoint::At(Vec3::new(0.5, 3.0, 0.5)), true),
            (LightPoint::At(Vec3::new(0.0, -2.0, 0.0)), false),
            (LightPoint::At(Vec3::new(9.0, 3.0, 0.0)), false),
            (LightPoint::Towards(Vec3::Y), true),
            (LightPoint::Towards(Vec3::NEG_Y), false),
            (LightPoint::Towards(Vec3::X), false),
        ] {
            assert_eq!(masked.may_block(from, light), blocked, "{light:?}");
        }
        assert!(!MaskedCasters::default().may_block(from, LightPoint::Towards(Vec3::Y)));
    }
}
