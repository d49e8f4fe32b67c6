//! The tree's test of a ray and a triangle, for a single pair: whoever finds the pairs in another way decides them
//! alike, bit for bit.

use glam::{Vec2, Vec3};

use super::exact::{self, Crossing};
use crate::geometry::AlphaMask;
use crate::light::LightPoint;

/// Whether the triangle `corners` (world space) blocks the light that comes from `target` to `origin`:
/// [`Bvh::is_occluded`](super::Bvh::is_occluded) of a tree that holds this triangle alone. A triangle whose corners
/// lie on a line blocks nothing, nor is anything blocked for input that is not finite.
pub fn blocks(corners: [Vec3; 3], origin: Vec3, target: LightPoint) -> bool {
    relative(corners, origin, target).is_some()
}

/// [`blocks`] for a triangle with a cut-out mask, by the texture coordinates of its corners.
pub fn blocks_cut_out(
    corners: [Vec3; 3],
    uvs: [Vec2; 3],
    mask: &AlphaMask,
    origin: Vec3,
    target: LightPoint,
) -> bool {
    relative(corners, origin, target).is_some_and(|(corners, end)| {
        exact::crossing(corners, end).is_none_or(|crossing| is_solid(mask, uvs, &crossing))
    })
}

/// Whether a mask has a surface where a ray crosses its triangle.
pub(super) fn is_solid(mask: &AlphaMask, uvs: [Vec2; 3], crossing: &Crossing) -> bool {
    let [v, w] = crossing.weights;
    let [a, b, c] = uvs.map(|uv| uv.as_dvec2());
    mask.is_solid((a * (1.0 - v - w) + b * v + c * w).as_vec2())
}

/// Corners and the ray's end relative to its origin, if the triangle blocks.
fn relative(corners: [Vec3; 3], origin: Vec3, target: LightPoint) -> Option<([Vec3; 3], Vec3)> {
    let moved = corners.map(|corner| corner - origin);
    let (end, crosses) = match target {
        LightPoint::At(place) => (place - origin, exact::segment_crosses(moved, place - origin)),
        LightPoint::Towards(direction) => (direction, exact::ray_crosses(moved, direction)),
    };
    (crosses && !exact::is_degenerate(corners)).then_some((moved, end))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [Vec3; 3] =
        [Vec3::new(1.0, 2.0, 0.0), Vec3::new(0.0, 2.0, 1.0), Vec3::new(-1.0, 2.0, -1.0)];

    #[test]
    fn only_what_lies_between_blocks() {
        assert!(blocks(TRIANGLE, Vec3::ZERO, LightPoint::At(Vec3::Y * 3.0)));
        assert!(!blocks(TRIANGLE, Vec3::ZERO, LightPoint::At(Vec3::Y * 2.0)));
        assert!(blocks(TRIANGLE, Vec3::ZERO, LightPoint::Towards(Vec3::Y)));
        assert!(!blocks(TRIANGLE, Vec3::ZERO, LightPoint::Towards(Vec3::NEG_Y)));
        assert!(!blocks(TRIANGLE, Vec3::NAN, LightPoint::Towards(Vec3::Y)));
    }

    #[test]
    fn a_line_blocks_nothing_though_rounding_gives_it_an_area() {
        let third = Vec3::splat(1.0 / 3.0);
        let line = [Vec3::ZERO, third, third * 2.0];
        for i in 0..64 {
            let origin = Vec3::new(0.3, 0.31, 0.29 + i as f32 * 1e-3);
            assert!(!blocks(line, origin, LightPoint::At(Vec3::splat(0.35) - (origin - 0.3))));
        }
    }

    #[test]
    fn holes_let_light_through() {
        let mask = AlphaMask::from_alpha(2, 1, &[255, 0], 0.5, Default::default()).expect("two texels");
        let through = |u: f32| {
            let uvs = [Vec2::new(u, 0.5); 3];
            blocks_cut_out(TRIANGLE, uvs, &mask, Vec3::ZERO, LightPoint::Towards(Vec3::Y))
        };
        assert!(through(0.25) && !through(0.75));
    }
}
