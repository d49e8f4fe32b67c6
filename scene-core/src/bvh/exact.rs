//! Whether a ray crosses a triangle, decided exactly.
//!
//! Coordinates are taken relative to the ray's origin, each rounded once to f32; everything after that
//! rounding is exact (`robust`, Shewchuk's adaptive predicates). Triangles that share a vertex see the same
//! rounded one, so around any point the rounded mesh is as closed as the mesh: no ray slips through an edge
//! or a vertex, from either side, and the answer depends on neither the order of the corners, the packet a ray
//! travels in nor the vector unit at hand. The same idea is in Woop, Benthin and Wald, "Watertight
//! Ray/Triangle Intersection" (JCGT 2013), which rounds once more and per ray.
//!
//! With corners a₀ a₁ a₂ and the ray's direction d, V = det(a₀, a₁, a₂) and sₖ = det(aᵢ, aⱼ, d) over the three
//! edges, d = (s₁ a₀ + s₂ a₁ + s₀ a₂) / V. The ray meets the triangle, edges included, where V is not 0 and
//! no sₖ has the sign opposite to V's. A triangle seen exactly edge-on (V = 0) blocks nothing, nor does one
//! that is a line or a point.

use glam::{DVec3, Vec3};
use robust::{Coord3D, orient3d};

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    /// The ray's parameter, in units of its direction.
    pub(super) t: f64,
    /// Weights of the second and third corner.
    pub(super) weights: [f64; 2],
}

fn coord(v: Vec3) -> Coord3D<f64> {
    Coord3D { x: f64::from(v.x), y: f64::from(v.y), z: f64::from(v.z) }
}

const ORIGIN: Coord3D<f64> = Coord3D { x: 0.0, y: 0.0, z: 0.0 };

/// V, if the ray from the origin along `direction` meets the triangle. Nothing for input that is not finite.
fn cone(corners: [Vec3; 3], direction: Vec3) -> Option<f64> {
    let [a, b, c] = corners.map(coord);
    let d = coord(direction);
    let volume = orient3d(a, b, c, ORIGIN);
    let weights = [orient3d(a, b, d, ORIGIN), orient3d(b, c, d, ORIGIN), orient3d(c, a, d, ORIGIN)];
    let forward = if volume > 0.0 {
        weights.iter().all(|&s| s >= 0.0)
    } else if volume < 0.0 {
        weights.iter().all(|&s| s <= 0.0)
    } else {
        false
    };
    (forward && weights != [0.0; 3]).then_some(volume)
}

/// The sign of V: on which side of the triangle's plane the origin lies. 0 in it, and for lines and points.
pub(super) fn side_of_origin(corners: [Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(coord);
    let volume = orient3d(a, b, c, ORIGIN);
    if volume > 0.0 {
        1.0
    } else if volume < 0.0 {
        -1.0
    } else {
        0.0
    }
}

/// Whether the segment from the origin to `target` crosses the triangle, ends excluded.
pub(super) fn segment_crosses(corners: [Vec3; 3], target: Vec3) -> bool {
    let Some(volume) = cone(corners, target) else { return false };
    let [a, b, c] = corners.map(coord);
    let beyond = orient3d(a, b, c, coord(target));
    if volume > 0.0 { beyond < 0.0 } else { beyond > 0.0 }
}

/// Whether the ray from the origin along `direction` crosses the triangle anywhere.
pub(super) fn ray_crosses(corners: [Vec3; 3], direction: Vec3) -> bool {
    cone(corners, direction).is_some()
}

/// Where the ray from the origin along `direction` meets the triangle: whether is exact, where is rounded. The
/// edge vectors are formed first, as in the filter, so that small triangles far away lose nothing.
pub(super) fn crossing(corners: [Vec3; 3], direction: Vec3) -> Option<Crossing> {
    cone(corners, direction)?;
    let [a, b, c] = corners.map(|v| v.as_dvec3());
    let direction = direction.as_dvec3();
    let normal = (b - a).cross(c - a);
    let weight = |from: DVec3, to: DVec3| (to + from).cross(to - from).dot(direction);
    let (of_b, of_c) = (weight(c, a), weight(a, b));
    let sum = weight(b, c) + of_b + of_c;
    Some(Crossing { t: normal.dot(a) / normal.dot(direction), weights: [of_b / sum, of_c / sum] })
}

/// Whether the triangle is a line or a point, exactly: its projections to all three coordinate planes are.
pub(super) fn is_degenerate([a, b, c]: [Vec3; 3]) -> bool {
    let flat = |i: usize, j: usize| {
        let p = |v: Vec3| robust::Coord { x: f64::from(v[i]), y: f64::from(v[j]) };
        robust::orient2d(p(a), p(b), p(c)) == 0.0
    };
    flat(0, 1) && flat(1, 2) && flat(2, 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [Vec3; 3] =
        [Vec3::new(1.0, 0.0, 2.0), Vec3::new(0.0, 1.0, 2.0), Vec3::new(-1.0, -1.0, 2.0)];

    #[test]
    fn both_windings_and_the_edges_count() {
        let flipped = [TRIANGLE[2], TRIANGLE[1], TRIANGLE[0]];
        for corners in [TRIANGLE, flipped] {
            assert!(ray_crosses(corners, Vec3::Z));
            assert!(!ray_crosses(corners, -Vec3::Z));
            assert!(ray_crosses(corners, TRIANGLE[0]));
            assert!(ray_crosses(corners, TRIANGLE[0] + TRIANGLE[1]));
            assert!(!ray_crosses(corners, Vec3::new(1.0, 1.0, 2.0)));
        }
    }

    #[test]
    fn a_segment_must_reach_beyond_the_plane() {
        assert!(segment_crosses(TRIANGLE, Vec3::Z * 2.1));
        assert!(!segment_crosses(TRIANGLE, Vec3::Z * 2.0));
        assert!(!segment_crosses(TRIANGLE, Vec3::Z * 1.9));
        assert!(!segment_crosses(TRIANGLE, Vec3::Z * -9.0));
    }

    #[test]
    fn parameter_and_weights_are_those_of_the_point() {
        let crossing = crossing(TRIANGLE, Vec3::new(0.05, 0.05, 0.5)).unwrap();
        assert!((crossing.t - 4.0).abs() < 1e-6);
        let [u, v] = crossing.weights.map(|w| w as f32);
        let point = TRIANGLE[0] * (1.0 - u - v) + TRIANGLE[1] * u + TRIANGLE[2] * v;
        assert!(point.distance(Vec3::new(0.2, 0.2, 2.0)) < 1e-6);
    }

    #[test]
    fn nothing_is_crossed_by_broken_or_zero_rays_or_by_lines() {
        for direction in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
            assert!(!ray_crosses(TRIANGLE, direction) && !segment_crosses(TRIANGLE, direction));
        }
        let line = [Vec3::Z, Vec3::Z * 2.0, Vec3::Z * 3.0];
        assert!(!ray_crosses(line, Vec3::Z) && is_degenerate(line));
        assert!(is_degenerate([Vec3::X, Vec3::Y, Vec3::X]) && !is_degenerate(TRIANGLE));
        let third = Vec3::splat(1.0 / 3.0);
        assert!(is_degenerate([Vec3::ZERO, third, third * 2.0]));
    }
}
