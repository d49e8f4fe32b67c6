//! The f32 filter before the exact predicate: eight triangles at a time against the rays of a shaft.
//!
//! A ray is (x, y, 1) in the shaft's frame. The weight of the edge from aᵢ to aⱼ is, up to a factor of 2, the
//! dot product of the ray with n = (aⱼ + aᵢ) × (aⱼ − aᵢ). The edge vector is short where the triangle is far,
//! so the cancellation that aᵢ × aⱼ would suffer is gone.
//!
//! # Error bound
//!
//! Let u = 2⁻²⁴, and let P be n with every product taken absolute: P_x = |s_y e_z| + |s_z e_y| and so on, for sum s and difference e.
//! Difference and sum are rounded once (1 u each), the products and their difference once more (2 u), so
//! |δn| ≤ 4 u P. The slopes are rounded (1 u), multiplied (1 u) and summed (2 u), and |n| ≤ P. In all
//! |δ(n·r)| ≤ 8 u P·|r| + O(u²), with or without fused multiply-add. 12 u P·|r| also covers the rounding of
//! the bound itself. What underflow adds stays below 2⁻¹⁰⁰, as coordinates are at most 2³⁸ and slopes 2¹⁰.
//! The same holds for the plane's normal N = (a₁ − a₀) × (a₂ − a₀) with a difference g: 4 u + 1 u + 3 u.

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};

use super::exact;
use super::shaft::{Shaft, ShaftLanes};
use super::tree::Block;

/// 12 u: see the module's derivation.
pub(super) const ERROR: f32 = 12.0 / (1_u32 << 24) as f32;

/// Above what underflow adds: see the module's derivation.
pub(super) const TINY: f32 = f32::from_bits((127 - 100) << 23);

/// What is left of a block after the shaft has culled its triangles.
pub(super) struct Candidates<S: Simd> {
    /// Lanes that some ray of the shaft may cross.
    pub(super) lanes: u32,
    /// Per edge n_x, n_y and n_z + B, turned so that inside is positive; B is the edge's error bound.
    pub(super) edges: [[f32x8<S>; 3]; 3],
    /// Per edge 2 B.
    pub(super) twice_bound: [f32x8<S>; 3],
    /// The plane's normal N, turned alike.
    pub(super) normal: [f32x8<S>; 3],
    /// The absolute products of N, times the error constant.
    pub(super) normal_error: [f32x8<S>; 3],
    /// The first corner.
    pub(super) corner: [f32x8<S>; 3],
}

/// a × b, and its products taken absolute.
#[inline(always)]
fn cross<S: Simd>(a: [f32x8<S>; 3], b: [f32x8<S>; 3]) -> ([f32x8<S>; 3], [f32x8<S>; 3]) {
    let (xy, yx) = (a[0] * b[1], a[1] * b[0]);
    let (yz, zy) = (a[1] * b[2], a[2] * b[1]);
    let (zx, xz) = (a[2] * b[0], a[0] * b[2]);
    ([yz - zy, zx - xz, xy - yx], [yz.abs() + zy.abs(), zx.abs() + xz.abs(), xy.abs() + yx.abs()])
}

#[inline(always)]
fn subtract<S: Simd>(a: [f32x8<S>; 3], b: [f32x8<S>; 3]) -> [f32x8<S>; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Finds the triangles among the first `count` of a block that a ray of the shaft may cross.
#[inline(always)]
pub(super) fn cull<S: Simd>(
    simd: S,
    shaft: &Shaft,
    lanes: &ShaftLanes<S>,
    block: &Block,
    count: usize,
) -> Option<Candidates<S>> {
    let corners = lanes.block_corners(block);
    let mut left = !lanes.outside(&corners).to_bitmask() as u32 & ((1 << count) - 1);
    if left == 0 {
        return None;
    }
    let [a, b, c] = corners;
    let (normal, products) = cross(subtract(b, a), subtract(c, a));
    let volume = normal[0].mul_add(a[0], normal[1].mul_add(a[1], normal[2] * a[2]));
    let scale = products[0].mul_add(a[0].abs(), products[1].mul_add(a[1].abs(), products[2] * a[2].abs()));
    let certain = volume.abs().simd_gt(scale.mul_add(ERROR, TINY));
    let mut turn = f32x8::splat(simd, 1.0).copysign(volume);
    let mut unsure = left & !(certain.to_bitmask() as u32);
    while unsure != 0 {
        let lane = unsure.trailing_zeros() as usize;
        unsure &= unsure - 1;
        let side = exact::side_of_origin(shaft.corners(block, lane));
        if side == 0.0 {
            left &= !(1 << lane);
        }
        turn[lane] = side.signum() as f32;
    }
    let [x, y] = lanes.slopes;
    let (wide_x, wide_y) = (x[0].abs().max(x[1].abs()), y[0].abs().max(y[1].abs()));
    let mut edges = [[a[0]; 3]; 3];
    let mut twice_bound = [a[0]; 3];
    for (edge, (from, to)) in [(a, b), (b, c), (c, a)].into_iter().enumerate() {
        let sum = [to[0] + from[0], to[1] + from[1], to[2] + from[2]];
        let (n, p) = cross(sum, subtract(to, from));
        let n = [n[0] * turn, n[1] * turn, n[2] * turn];
        let bound = p[0].mul_add(wide_x, p[1].mul_add(wide_y, p[2])).mul_add(ERROR, TINY);
        let lifted = n[2] + bound;
        let most = (n[0] * x[0]).max(n[0] * x[1]) + (n[1] * y[0]).max(n[1] * y[1]) + lifted;
        left &= !(most.simd_lt(0.0).to_bitmask() as u32);
        edges[edge] = [n[0], n[1], lifted];
        twice_bound[edge] = bound + bound;
    }
    if left == 0 {
        return None;
    }
    Some(Candidates {
        lanes: left,
        edges,
        twice_bound,
        normal: [normal[0] * turn, normal[1] * turn, normal[2] * turn],
        normal_error: [products[0] * ERROR, products[1] * ERROR, products[2] * ERROR],
        corner: a,
    })
}
