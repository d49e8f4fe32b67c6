//! The part of a light's image that casters fill. A receiver's ray to the light is a point of the image: where that lies beside
//! all casters the receiver is lit, and no map need hold it. The variant `auto` fits its window to the others.
//!
//! The part is kept as its supports, how far it reaches in 16 directions: what is tested and drawn is the polygon of 16 sides
//! around the casters' boxes, at most 1/cos 11.25° (2 %) longer than what it holds.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::DVec2;
use scene_core::geometry::Aabb;

use crate::light_image::LightImage;
use crate::warp::{MARGIN, Warp};

/// In which directions supports are kept.
pub const DIRECTIONS: usize = 16;

/// Cosines and sines of multiples of 22.5°; written out, so that every machine and shader has the same.
const UNIT: [f64; 5] = [1.0, 0.923_879_532_511_286_7, FRAC_1_SQRT_2, 0.382_683_432_365_089_8, 0.0];

/// Direction `index`, at 22.5° times it from x.
#[inline]
pub(crate) fn direction(index: usize) -> DVec2 {
    let (quarter, step) = (index / 4 % 4, index % 4);
    let (cos, sin) = (UNIT[step], UNIT[4 - step]);
    match quarter {
        0 => DVec2::new(cos, sin),
        1 => DVec2::new(-sin, cos),
        2 => DVec2::new(-cos, -sin),
        _ => DVec2::new(sin, -cos),
    }
}

/// A convex part of a light's image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CasterImage {
    /// For each direction the largest product of it with a place, in units of the image; infinite without a limit.
    pub supports: [f64; DIRECTIONS],
}

impl CasterImage {
    /// All of the image.
    pub const EVERYWHERE: Self = Self { supports: [f64::INFINITY; DIRECTIONS] };

    /// Of what lies in `boxes`. All of the image if one of them reaches to where there are no places.
    pub fn new(image: &LightImage, boxes: &[Aabb]) -> Self {
        let mut supports = [f64::NEG_INFINITY; DIRECTIONS];
        let mut largest = 0f64;
        for corner in boxes.iter().flat_map(|b| b.corners()).map(|corner| corner.as_dvec3()) {
            let place = image.warp.place(corner);
            if !(image.w(corner) > 0.0 && place.is_finite()) {
                return Self::EVERYWHERE;
            }
            largest = largest.max(place.abs().max_element());
            for (index, support) in supports.iter_mut().enumerate() {
                *support = support.max(direction(index).dot(place));
            }
        }
        // Receivers are rounded, and so is a matrix.
        Self { supports: supports.map(|support| support + largest * MARGIN) }
    }

    /// Whether it is all of the image.
    pub fn is_everywhere(&self) -> bool {
        self.supports[0] == f64::INFINITY
    }

    /// Whether it holds a place.
    #[inline]
    pub fn holds(&self, place: DVec2) -> bool {
        self.is_everywhere() || (0..DIRECTIONS).all(|i| direction(i).dot(place) <= self.supports[i])
    }

    /// Whether none of a convex set with these corners, all of which have a place, is in it.
    pub(crate) fn is_beside(&self, places: &[DVec2]) -> bool {
        !self.is_everywhere()
            && (0..DIRECTIONS).any(|i| places.iter().all(|&place| direction(i).dot(place) > self.supports[i]))
    }
}

/// What of a map's receivers counts: those that a light's image has within a part of it.
#[derive(Clone, Copy, Debug)]
pub struct Within<'a> {
    /// The light's own image.
    pub image: &'a Warp,
    /// The part.
    pub part: &'a CasterImage,
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};
    use scene_core::light::LightPoint;

    use super::*;

    #[test]
    fn directions_are_of_unit_length_and_evenly_apart() {
        for index in 0..DIRECTIONS {
            let angle = std::f64::consts::TAU * index as f64 / DIRECTIONS as f64;
            assert!(direction(index).distance(DVec2::from_angle(angle)) < 1e-15);
        }
    }

    #[test]
    fn what_has_no_box_on_its_way_to_the_light_is_outside() {
        let crate_at = Aabb { min: Vec3::new(-1.0, 0.0, -1.0), max: Vec3::new(1.0, 2.0, 1.0) };
        let sun = Vec3::new(0.6, 0.8, 0.0);
        let image = LightImage::new(LightPoint::Towards(sun), sun.as_dvec3(), DVec3::Z);
        let part = CasterImage::new(&image, &[crate_at]);
        let holds = |x: f64, z: f64| part.holds(image.warp.place(DVec3::new(x, 0.0, z)));
        // Its shadow on the ground reaches from -2.5 to 1.
        assert!(
            holds(-2.4, 0.9) && holds(0.9, -0.9) && !holds(-2.7, 0.0) && !holds(1.1, 0.0) && !holds(0.0, 1.2)
        );
        let beside =
            [(1.2, 0.0), (3.0, 1.0), (3.0, -1.0)].map(|(x, z)| image.warp.place(DVec3::new(x, 0.0, z)));
        assert!(part.is_beside(&beside));
        let around =
            [(-9.0, -9.0), (9.0, -9.0), (0.0, 9.0)].map(|(x, z)| image.warp.place(DVec3::new(x, 0.0, z)));
        assert!(!part.is_beside(&around) && !CasterImage::EVERYWHERE.is_beside(&beside));
        // Nothing casts: nothing is held. A lamp among the boxes: everything is.
        assert!(!CasterImage::new(&image, &[]).holds(DVec2::ZERO));
        let lamp = LightImage::new(LightPoint::At(Vec3::Y), DVec3::Y, DVec3::Z);
        assert!(CasterImage::new(&lamp, &[crate_at]).is_everywhere());
    }
}
