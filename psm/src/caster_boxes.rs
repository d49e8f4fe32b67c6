//! Where shadows may have edges, before there is a map: receivers whose ray to the light passes through the bounds of an object
//! that casts. Elsewhere the density of edges is 0, and how wide texels are makes nothing wrong.

use glam::DVec3;
use rayon::prelude::*;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;

use crate::seen::Sample;

/// Less than this share of a box's diagonal is not passed through: what stands on a flat box, such as the ground, touches it.
pub(crate) const LEAST: f64 = 1.0 / 1024.0;

/// A ray along a side of a box is taken to lean by this share of its length, so that nothing is divided by zero.
pub(crate) const LEAN: f64 = 1e-12;

/// Those of `samples` whose ray to the light passes through one of `boxes`.
pub fn near_shadows(boxes: &[Aabb], light: LightPoint, samples: &[Sample]) -> Vec<Sample> {
    let boxes: Vec<_> = boxes.iter().map(CasterBox::new).collect();
    samples.par_iter().filter(|sample| passes_one(&boxes, light, sample.point)).copied().collect()
}

/// A box, and what must be passed through of it.
#[derive(Clone, Copy, Debug)]
struct CasterBox {
    min: DVec3,
    max: DVec3,
    least: f64,
}

impl CasterBox {
    fn new(bounds: &Aabb) -> Self {
        let least = f64::from(bounds.size().length()) * LEAST;
        Self { min: bounds.min.as_dvec3(), max: bounds.max.as_dvec3(), least }
    }
}

/// Whether the ray from `point` to the light passes through one of `boxes`.
pub fn may_be_shadowed(boxes: &[Aabb], light: LightPoint, point: DVec3) -> bool {
    let boxes: Vec<_> = boxes.iter().map(CasterBox::new).collect();
    passes_one(&boxes, light, point)
}

fn passes_one(boxes: &[CasterBox], light: LightPoint, point: DVec3) -> bool {
    let (ray, end) = match light {
        LightPoint::Towards(towards) => (towards.as_dvec3(), f64::INFINITY),
        LightPoint::At(place) => (place.as_dvec3() - point, 1.0),
    };
    let length = ray.length();
    let least = length * LEAN;
    let inverse = ray.to_array().map(|r| 1.0 / if r.abs() > least { r } else { least });
    let inverse = DVec3::from_array(inverse);
    boxes.iter().any(|b| {
        let (low, high) = ((b.min - point) * inverse, (b.max - point) * inverse);
        let (enter, leave) = (low.min(high).max_element().max(0.0), low.max(high).min_element().min(end));
        (leave - enter) * length > b.least
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn rays_pass_through_boxes_or_beside_them() {
        let ground = Aabb { min: Vec3::new(-9.0, 0.0, -9.0), max: Vec3::new(9.0, 0.0, 9.0) };
        let tower = Aabb { min: Vec3::new(-1.0, 0.0, -1.0), max: Vec3::new(1.0, 4.0, 1.0) };
        let slanting = LightPoint::Towards(Vec3::new(0.8, 0.6, 0.0));
        let is = |light, x: f64, y: f64| may_be_shadowed(&[ground, tower], light, DVec3::new(x, y, 0.0));
        // In its shadow; before it; beyond the shadow's end; on top.
        assert!(is(slanting, -3.0, 0.0) && !is(slanting, 3.0, 0.0) && !is(slanting, -8.0, 0.0));
        assert!(!is(slanting, 0.0, 4.0) && is(LightPoint::Towards(Vec3::Y), 0.5, 0.0));
        // A ray along the box's sides, beside it and within.
        assert!(!is(LightPoint::Towards(Vec3::X), -3.0, 5.0) && is(LightPoint::Towards(Vec3::X), -3.0, 2.0));
        // A lamp this side of the tower, and beyond.
        let lamp = |x| LightPoint::At(Vec3::new(x, 1.0, 0.0));
        assert!(!is(lamp(-2.0), -3.0, 0.0) && is(lamp(3.0), -3.0, 0.0));
        assert!(!may_be_shadowed(&[], slanting, DVec3::ZERO));
    }
}
