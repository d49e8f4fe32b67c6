//! Which boxes a side may cross: conservative tests, eight at a time.

use fearless_simd::{Simd, SimdBase, SimdMask, f64x8};
use glam::DVec3;

use crate::crossing::{Edge, HomogeneousLight};

/// Boxes or sides tested at once.
pub const LANES: usize = 8;

/// Coefficients of a side's four half-spaces g·x + k ≥ 0: two for its plane, which a box must touch from both sides,
/// are one; then past the light's ray through a, past that through b, beyond the edge.
const PLANES: usize = 4;

/// What rounding may do to a sum of products, as a share of the sum of their magnitudes: seven operations of 2⁻⁵³ and
/// the coefficients' own errors, below 2⁻⁴⁸; 2⁻⁴⁴ is sixteen times that.
const SLACK: f64 = 1.0 / 17_592_186_044_416.0;

/// The half-spaces of up to eight sides, a lane each.
#[derive(Clone, Debug)]
pub struct SideGroup {
    planes: [[[f64; LANES]; 4]; PLANES],
    /// Lanes that hold a side with an area.
    used: u32,
}

/// Up to eight boxes by centre and half size, a lane each.
#[derive(Clone, Debug)]
pub struct BoxGroup {
    /// Centres.
    pub center: [[f64; LANES]; 3],
    /// Half sizes; very negative where there is no box.
    pub half: [[f64; LANES]; 3],
}

impl BoxGroup {
    /// No box.
    pub const EMPTY: Self = Self { center: [[0.0; LANES]; 3], half: [[f64::MIN; LANES]; 3] };

    /// Puts the box between two corners into a lane.
    pub fn set(&mut self, lane: usize, min: DVec3, max: DVec3) {
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        for axis in 0..3 {
            self.center[axis][lane] = center[axis];
            self.half[axis][lane] = half[axis];
        }
    }

    /// The boxes that may have a point with g·x + k ≥ 0, or, if `both`, one on the plane itself.
    #[inline(always)]
    pub fn touching<S: Simd>(&self, simd: S, plane: [f64; 4], both: bool) -> u32 {
        let wide = |values: &[[f64; LANES]; 3]| [0, 1, 2].map(|axis| f64x8::from_slice(simd, &values[axis]));
        touches(simd, plane.map(|x| f64x8::splat(simd, x)), wide(&self.center), wide(&self.half), both)
    }
}

impl SideGroup {
    /// The sides of up to eight edges.
    pub fn new(edges: &[Edge], light: &HomogeneousLight) -> Self {
        let mut group = Self { planes: [[[0.0; LANES]; 4]; PLANES], used: 0 };
        for (lane, edge) in edges.iter().take(LANES).enumerate() {
            let (a, b) = (edge.a, edge.b);
            let normal = edge.plane(light);
            if normal == DVec3::ZERO {
                continue;
            }
            group.used |= 1 << lane;
            let (to_a, to_b) = (light.from_point(a), light.from_point(b));
            let towards = |g: DVec3, way: DVec3| if g.dot(way) < 0.0 { -g } else { g };
            let planes = [
                (normal, a),
                (towards(normal.cross(to_a), b - a), a),
                (towards(normal.cross(to_b), a - b), b),
                (towards(normal.cross(b - a), -to_a), a),
            ];
            for (slot, (g, through)) in group.planes.iter_mut().zip(planes) {
                // Of unit length, so that no product of huge coordinates overflows.
                let g = g.normalize_or_zero();
                for axis in 0..3 {
                    slot[axis][lane] = g[axis];
                }
                slot[3][lane] = -g.dot(through);
            }
        }
        group
    }

    /// The lanes whose sides may cross the box.
    #[inline(always)]
    pub fn may_cross_box<S: Simd>(&self, simd: S, center: DVec3, half: DVec3) -> u32 {
        let spread = |v: DVec3| [v.x, v.y, v.z].map(|x| f64x8::splat(simd, x));
        let (center, half) = (spread(center), spread(half));
        let mut possible = self.used;
        for (index, plane) in self.planes.iter().enumerate() {
            let g = [
                f64x8::from_slice(simd, &plane[0]),
                f64x8::from_slice(simd, &plane[1]),
                f64x8::from_slice(simd, &plane[2]),
                f64x8::from_slice(simd, &plane[3]),
            ];
            possible &= touches(simd, g, center, half, index == 0);
            if possible == 0 {
                break;
            }
        }
        possible
    }

    /// The boxes that the side in `lane` may cross.
    #[inline(always)]
    pub fn may_cross_boxes<S: Simd>(&self, simd: S, side: usize, boxes: &BoxGroup) -> u32 {
        let center = [
            f64x8::from_slice(simd, &boxes.center[0]),
            f64x8::from_slice(simd, &boxes.center[1]),
            f64x8::from_slice(simd, &boxes.center[2]),
        ];
        let half = [
            f64x8::from_slice(simd, &boxes.half[0]),
            f64x8::from_slice(simd, &boxes.half[1]),
            f64x8::from_slice(simd, &boxes.half[2]),
        ];
        let mut possible = u32::MAX;
        for (index, plane) in self.planes.iter().enumerate() {
            let g = [
                f64x8::splat(simd, plane[0][side]),
                f64x8::splat(simd, plane[1][side]),
                f64x8::splat(simd, plane[2][side]),
                f64x8::splat(simd, plane[3][side]),
            ];
            possible &= touches(simd, g, center, half, index == 0);
            if possible == 0 {
                break;
            }
        }
        possible
    }
}

/// Where the box may have a point with g·x + k ≥ 0, or, if `both`, one on the plane itself.
#[inline(always)]
fn touches<S: Simd>(
    simd: S,
    [x, y, z, k]: [f64x8<S>; 4],
    center: [f64x8<S>; 3],
    half: [f64x8<S>; 3],
    both: bool,
) -> u32 {
    let value = x * center[0] + y * center[1] + z * center[2] + k;
    let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
    let reach = ax * half[0] + ay * half[1] + az * half[2];
    let size = ax * center[0].abs() + ay * center[1].abs() + az * center[2].abs() + k.abs();
    let reach = reach + (size + reach) * f64x8::splat(simd, SLACK);
    let distance = if both { -value.abs() } else { value };
    (distance + reach).simd_ge(0.0).to_bitmask() as u32
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};
    use glam::Vec3;

    use super::*;

    #[test]
    fn boxes_on_the_side_are_found_and_others_are_not() {
        let level = Level::new();
        let edge = Edge::new(Vec3::new(-1.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 0.0), 1);
        for light in [
            HomogeneousLight { point: DVec3::new(0.0, 3.0, 0.0), at_infinity: false },
            HomogeneousLight { point: DVec3::Y, at_infinity: true },
        ] {
            let group = SideGroup::new(&[edge], &light);
            let half = DVec3::splat(0.1);
            for (place, crossed) in [
                (DVec3::new(0.0, 0.0, 0.0), true),
                (DVec3::new(0.0, -9.0, 0.05), true),
                (DVec3::new(0.0, 1.05, 0.0), true),
                (DVec3::new(0.0, 1.2, 0.0), false),
                (DVec3::new(0.0, 0.0, 0.2), false),
                (DVec3::new(-1.05, 0.95, 0.0), true),
                (DVec3::new(-1.4, 0.9, 0.0), false),
                (DVec3::new(1.4, 0.9, 0.0), false),
            ] {
                assert_eq!(
                    dispatch!(level, simd => group.may_cross_box(simd, place, half)) == 1,
                    crossed,
                    "{place} {light:?}"
                );
                let mut boxes = BoxGroup::EMPTY;
                boxes.set(5, place - half, place + half);
                let found = dispatch!(level, simd => group.may_cross_boxes(simd, 0, &boxes));
                assert_eq!(found, u32::from(crossed) << 5);
            }
        }
    }
}
