//! Which pixels a comparison with ground truth means anything for.

use glam::Vec3;

use crate::light::LightPoint;
use crate::{GBuffer, Light};

/// Below this cosine between normal and light a surface receives next to nothing, and every shadow algorithm
/// is at the mercy of the last bits of its coordinates.
const GRAZING_COS: f32 = 0.05;

/// Per pixel whether it counts when errors are measured: it sees a surface whose geometric normal, turned to the
/// camera, has n·l > 0.05 towards the light's centre, the whole light lies above that surface's tangent plane,
/// and, under a spot, the point lies within its outer cone. A position or normal that is not finite makes a
/// pixel invalid. Objects that do not receive shadows count: a technique must leave them lit.
pub fn valid_pixels(gbuffer: &GBuffer, light: &Light) -> Vec<bool> {
    let center = light.center();
    (0..gbuffer.pixel_count())
        .map(|pixel| {
            let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
            gbuffer.is_seen(pixel)
                && normal.dot(unit_towards(center, position)) > GRAZING_COS
                && light.is_above_plane(position, normal)
                && light.reaches(position)
        })
        .collect()
}

/// Unit vector from `position` to the light point; zero if they coincide.
fn unit_towards(point: LightPoint, position: Vec3) -> Vec3 {
    match point {
        LightPoint::At(at) => (at - position).normalize_or_zero(),
        LightPoint::Towards(direction) => direction,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One pixel that sees a horizontal surface from above at each of `positions`.
    fn floor_at(positions: &[Vec3]) -> GBuffer {
        let mut gbuffer = GBuffer::new(positions.len() as u32, 1);
        for (pixel, &position) in positions.iter().enumerate() {
            gbuffer.position[pixel] = position;
            gbuffer.normal[pixel] = Vec3::Y;
            gbuffer.triangle[pixel] = 0;
            gbuffer.object[pixel] = 0;
        }
        gbuffer
    }

    #[test]
    fn pixels_that_see_nothing_are_not_valid() {
        let point = Light::Point { position: Vec3::Y };
        assert_eq!(valid_pixels(&GBuffer::new(2, 1), &point), [false, false]);
        assert_eq!(valid_pixels(&floor_at(&[Vec3::ZERO]), &point), [true]);
        assert!(valid_pixels(&GBuffer::new(0, 0), &point).is_empty());
    }

    #[test]
    fn grazing_and_averted_surfaces_are_not_valid() {
        let point = Light::Point { position: Vec3::Y };
        // The cosine is 1/√(1 + x²): 0.0525 at 19, 0.0499 at 20.
        let gbuffer = floor_at(&[Vec3::X * 19.0, Vec3::X * 20.0, Vec3::Y * 2.0, Vec3::Y, Vec3::NAN]);
        assert_eq!(valid_pixels(&gbuffer, &point), [true, false, false, false, false]);
    }

    #[test]
    fn the_whole_light_must_be_above_the_tangent_plane() {
        let under = |light| valid_pixels(&floor_at(&[Vec3::ZERO, Vec3::NEG_Y]), &light);
        assert_eq!(under(Light::Sphere { center: Vec3::Y, radius: 1.5 }), [false, true]);
        let upright = Light::Rect { center: Vec3::Y, half_u: Vec3::X, half_v: Vec3::Y * 1.5 };
        assert_eq!(under(upright), [false, true]);
        assert_eq!(under(Light::Disk { center: Vec3::Y, normal: Vec3::X, radius: 1.5 }), [false, true]);
        let sun = |angle: f32| Light::Directional { direction: Vec3::NEG_ONE, angular_radius: angle };
        // The sun stands asin(1/√3) = 0.615 above the floor.
        assert_eq!(under(sun(0.6)), [true, true]);
        assert_eq!(under(sun(0.63)), [false, false]);
    }

    #[test]
    fn outside_a_spot_nothing_is_valid() {
        let spot =
            Light::Spot { position: Vec3::Y, direction: Vec3::NEG_Y, outer: 45f32.to_radians(), inner: 0.1 };
        let gbuffer = floor_at(&[Vec3::X * 0.99, Vec3::X * 1.01]);
        assert_eq!(valid_pixels(&gbuffer, &spot), [true, false]);
    }
}
