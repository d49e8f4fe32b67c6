//! The shaft around rays that leave one point, and what of the tree lies outside it.
//!
//! Space is moved so that the rays start at 0, and its axes are renamed so that every ray has z > 0: a ray is
//! then the point (x/z, y/z) of a plane, a bundle of rays is a rectangle in it, and the shaft is the pyramid
//! over that rectangle, cut by the box around the rays' ends.
//!
//! Every test errs to one side only, and no tolerance is needed for that:
//! * moving a corner or a box, fl(v − o), is monotonic, so a moved box still holds the moved corners, which
//!   are what the exact predicate looks at;
//! * the slopes that bound the rectangle are one ulp beyond the rounded quotients, so they bound the exact
//!   ones;
//! * x < fl(m z) implies x < m z for any x of f32, again by monotonicity, so a corner that is found outside a
//!   side plane of the pyramid is outside.

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8, mask32x8};
use glam::Vec3;

use super::filter::{ERROR, TINY};
use super::tree::{Block, Node, WIDTH};

/// Rays of one packet at most: one bit each of a mask.
pub(super) const MAX_RAYS: usize = 64;

/// The largest coordinate, relative to the origin, that the f32 filters take: products of three stay finite.
pub(super) const MAX_REACH: f32 = (1_u64 << 38) as f32;

/// The largest slope of a ray against the shaft's axis; a wider bundle is split.
const MAX_SLOPE: f32 = 1024.0;

/// Up to N rays from one origin, in the frame of their shaft. N is 1 or a multiple of 16.
pub(super) struct Rays<const N: usize> {
    /// Ends (or directions) by coordinate.
    pub(super) ends: [[f32; N]; 3],
    /// x/z and y/z.
    pub(super) slopes: [[f32; N]; 2],
    /// Which rays there are.
    pub(super) mask: u64,
    /// Whether the rays stop at their ends; else they go on for ever.
    pub(super) finite: bool,
}

/// The shaft's frame and bounds.
#[derive(Clone, Debug)]
pub(super) struct Shaft {
    /// World axes that play x, y, z here.
    axes: [usize; 3],
    /// −1 where z runs against its world axis.
    flip: f32,
    /// The origin in world space, by axes of the frame (not flipped).
    origin: [f32; 3],
    /// Bounds of x/z and y/z.
    pub(super) slopes: [[f32; 2]; 2],
    /// The box around origin and ends.
    pub(super) lo: [f32; 3],
    pub(super) hi: [f32; 3],
}

impl<const N: usize> Rays<N> {
    /// Of the rays in `among`, those whose slopes lie in the span of a child box.
    #[inline(always)]
    pub(super) fn within<S: Simd>(
        &self,
        simd: S,
        spans: &[[f32; WIDTH]; 4],
        child: usize,
        among: u64,
    ) -> u64 {
        let width = S::f32s::LEN;
        let [x0, x1, y0, y1] = [0, 1, 2, 3].map(|i: usize| spans[i][child & (WIDTH - 1)]);
        let mut within = 0;
        for group in 0..(64 - among.leading_zeros() as usize).div_ceil(width) {
            let at = group * width..(group + 1) * width;
            let x = S::f32s::from_slice(simd, &self.slopes[0][at.clone()]);
            let y = S::f32s::from_slice(simd, &self.slopes[1][at.clone()]);
            let inside = x.simd_ge(x0) & x.simd_le(x1) & y.simd_ge(y0) & y.simd_le(y1);
            within |= inside.to_bitmask() << at.start;
        }
        within & among
    }
}

impl Shaft {
    /// The shaft around the rays from `origin` to (or along) each of `ends` that `mask` names, and the rays in
    /// its frame. `None` if the bundle is too wide for one frame or reaches too far for f32.
    #[inline(always)]
    pub(super) fn new<S: Simd, const N: usize>(
        simd: S,
        origin: Vec3,
        ends: &[[f32; N]; 3],
        mask: u64,
        finite: bool,
    ) -> Option<(Self, Rays<N>)> {
        let groups = if N == 1 { 0 } else { (64 - mask.leading_zeros() as usize).div_ceil(8) };
        let (mut lo, mut hi) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            (lo[axis], hi[axis]) = range(simd, &ends[axis], mask, groups);
        }
        // How far all rays go along an axis, at least; the frame's z is where that is farthest.
        let advance = [lo[0].max(-hi[0]), lo[1].max(-hi[1]), lo[2].max(-hi[2])];
        let z =
            if advance[2] > advance[0].max(advance[1]) { 2 } else { usize::from(advance[1] > advance[0]) };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let reach = |axis: usize| hi[axis].max(-lo[axis]);
        let (widest, forward) = (reach(x).max(reach(y)), advance[z]);
        if !(forward > 0.0 && widest <= forward * MAX_SLOPE && widest.max(reach(z)) <= MAX_REACH) {
            return None;
        }
        let flip = if lo[z] > 0.0 { 1.0 } else { -1.0 };
        let axes = [x, y, z];
        let mut rays = Rays { ends: [[0.0; N]; 3], slopes: [[0.0; N]; 2], mask, finite };
        let mut slopes = [[0.0; 2]; 2];
        if N == 1 {
            rays.ends = [[ends[x][0]], [ends[y][0]], [ends[z][0] * flip]].map(|[end]| [end; N]);
            rays.slopes = [[rays.ends[0][0] / rays.ends[2][0]; N], [rays.ends[1][0] / rays.ends[2][0]; N]];
        }
        for group in 0..groups {
            let at = 8 * group..8 * group + 8;
            let used = mask32x8::from_bitmask(simd, mask >> (8 * group) & 0xff);
            // Unused lanes get z = 1, so that they divide quietly.
            let along =
                select(used, f32x8::from_slice(simd, &ends[z][at.clone()]) * flip, f32x8::splat(simd, 1.0));
            along.store_slice(&mut rays.ends[2][at.clone()]);
            for i in 0..2 {
                let across = f32x8::from_slice(simd, &ends[axes[i]][at.clone()]);
                let across = select(used, across, f32x8::splat(simd, 0.0));
                across.store_slice(&mut rays.ends[i][at.clone()]);
                (across / along).store_slice(&mut rays.slopes[i][at.clone()]);
            }
        }
        for i in 0..2 {
            let (low, high) = range(simd, &rays.slopes[i], mask, groups);
            slopes[i] = [low.next_down(), high.next_up()];
        }
        let mut shaft =
            Self { axes, flip, origin: axes.map(|a| origin[a]), slopes, lo: [0.0; 3], hi: [0.0; 3] };
        let (mut low, mut high) = (axes.map(|a| lo[a]), axes.map(|a| hi[a]));
        if flip < 0.0 {
            (low[2], high[2]) = (-high[2], -low[2]);
        }
        for axis in 0..3 {
            // A ray without end reaches any distance on the sides it leans to.
            let far = |end: f32| if finite || end == 0.0 { end } else { end * f32::INFINITY };
            shaft.lo[axis] = far(low[axis].min(0.0));
            shaft.hi[axis] = far(high[axis].max(0.0));
        }
        Some((shaft, rays))
    }

    /// The corners of a triangle of a block, in the shaft's frame.
    #[inline(always)]
    pub(super) fn corners(&self, block: &Block, lane: usize) -> [Vec3; 3] {
        block.corners.map(|corner| {
            let [x, y, z] = std::array::from_fn(|i| corner[self.axes[i]][lane] - self.origin[i]);
            Vec3::new(x, y, z * self.flip)
        })
    }

    /// Whether coordinates relative to the origin stay in the range that the f32 filters take.
    pub(super) fn can_reach(origin: Vec3, bounds: crate::geometry::Aabb) -> bool {
        let reach = (bounds.min - origin).abs().max((bounds.max - origin).abs());
        reach.cmple(Vec3::splat(MAX_REACH)).all()
    }
}

/// The least and the largest of the values that `mask` names, among the first `groups` of eight.
#[inline(always)]
fn range<S: Simd, const N: usize>(simd: S, values: &[f32; N], mask: u64, groups: usize) -> (f32, f32) {
    if N == 1 {
        return (values[0], values[0]);
    }
    let mut low = f32x8::splat(simd, f32::INFINITY);
    let mut high = f32x8::splat(simd, f32::NEG_INFINITY);
    for (group, lanes) in values.as_chunks::<8>().0.iter().take(groups).enumerate() {
        let used = mask32x8::from_bitmask(simd, mask >> (8 * group) & 0xff);
        let value = f32x8::load_array_ref(simd, lanes);
        low = low.min(select(used, value, low));
        high = high.max(select(used, value, high));
    }
    (low.reduce_min(), high.reduce_max())
}

/// `if_true` where `mask`, else `if_false`.
#[inline(always)]
pub(super) fn select<S: Simd>(mask: mask32x8<S>, if_true: f32x8<S>, if_false: f32x8<S>) -> f32x8<S> {
    fearless_simd::Select::select(mask, if_true, if_false)
}

/// The shaft, spread over lanes.
#[derive(Clone, Copy)]
pub(super) struct ShaftLanes<S: Simd> {
    simd: S,
    axes: [usize; 3],
    flipped: bool,
    pub(super) flip: f32x8<S>,
    pub(super) origin: [f32x8<S>; 3],
    pub(super) slopes: [[f32x8<S>; 2]; 2],
    pub(super) lo: [f32x8<S>; 3],
    pub(super) hi: [f32x8<S>; 3],
}

/// Moves eight coordinates.
#[inline(always)]
fn relative<S: Simd>(simd: S, values: &[f32; 8], origin: f32x8<S>) -> f32x8<S> {
    f32x8::load_array_ref(simd, values) - origin
}

/// Whether all three corners lie below, and above, the side planes of slope `low` and `high`.
#[inline(always)]
fn beside<S: Simd>(across: [f32x8<S>; 3], along: [f32x8<S>; 3], [low, high]: [f32x8<S>; 2]) -> mask32x8<S> {
    let below = across[0].simd_lt(low * along[0])
        & across[1].simd_lt(low * along[1])
        & across[2].simd_lt(low * along[2]);
    let above = across[0].simd_gt(high * along[0])
        & across[1].simd_gt(high * along[1])
        & across[2].simd_gt(high * along[2]);
    below | above
}

// No closures and no `map` over vectors here: they are not inlined for sure, and what is not inlined does not
// use the vector unit.
impl<S: Simd> ShaftLanes<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, shaft: &Shaft) -> Self {
        let zero = f32x8::splat(simd, 0.0);
        let mut lanes = Self {
            simd,
            axes: shaft.axes,
            flipped: shaft.flip < 0.0,
            flip: f32x8::splat(simd, shaft.flip),
            origin: [zero; 3],
            slopes: [[zero; 2]; 2],
            lo: [zero; 3],
            hi: [zero; 3],
        };
        for axis in 0..3 {
            lanes.origin[axis] = f32x8::splat(simd, shaft.origin[axis]);
            lanes.lo[axis] = f32x8::splat(simd, shaft.lo[axis]);
            lanes.hi[axis] = f32x8::splat(simd, shaft.hi[axis]);
        }
        for axis in 0..2 {
            for side in 0..2 {
                lanes.slopes[axis][side] = f32x8::splat(simd, shaft.slopes[axis][side]);
            }
        }
        lanes
    }

    /// The children of a node that may hold a triangle that a ray of the shaft crosses, as bits; the least z of
    /// each box; and, if asked for, the slopes that each box spans: x from and to, y from and to.
    #[inline(always)]
    pub(super) fn children<const SPANS: bool>(
        &self,
        node: &Node,
        spans: &mut [[f32; WIDTH]; 4],
    ) -> (u32, f32x8<S>) {
        let (simd, z) = (self.simd, self.axes[2]);
        let (near, far) = if self.flipped { (&node.hi, &node.lo) } else { (&node.lo, &node.hi) };
        let near = relative(simd, &near[z], self.origin[2]) * self.flip;
        let far = relative(simd, &far[z], self.origin[2]) * self.flip;
        let mut outside = near.simd_gt(self.hi[2]) | far.simd_lt(self.lo[2]);
        let one = f32x8::splat(simd, 1.0);
        // A box that reaches behind the origin spans all slopes.
        let ahead = near.simd_gt(TINY);
        let (over_near, over_far) = if SPANS { (one / near, one / far) } else { (one, one) };
        for i in 0..2 {
            let lo = relative(simd, &node.lo[self.axes[i]], self.origin[i]);
            let hi = relative(simd, &node.hi[self.axes[i]], self.origin[i]);
            let [low, high] = self.slopes[i];
            outside = outside | lo.simd_gt(self.hi[i]) | hi.simd_lt(self.lo[i]);
            outside = outside | hi.simd_lt((low * near).min(low * far));
            outside = outside | lo.simd_gt((high * near).max(high * far));
            if SPANS {
                // Reciprocal and product are rounded, and so is the slope of a ray: 3 u.
                let from = (lo * over_near).min(lo * over_far);
                let to = (hi * over_near).max(hi * over_far);
                let from = from - from.abs().mul_add(ERROR, TINY);
                let to = to + to.abs().mul_add(ERROR, TINY);
                select(ahead, from, -one * f32::INFINITY).store_array(&mut spans[2 * i]);
                select(ahead, to, one * f32::INFINITY).store_array(&mut spans[2 * i + 1]);
            }
        }
        (!outside.to_bitmask() as u32 & ((1 << node.count) - 1), near)
    }

    /// The corners of a block's triangles, in the shaft's frame.
    #[inline(always)]
    pub(super) fn block_corners(&self, block: &Block) -> [[f32x8<S>; 3]; 3] {
        let mut corners = [self.origin; 3];
        for (corner, values) in corners.iter_mut().zip(&block.corners) {
            for axis in 0..3 {
                corner[axis] = relative(self.simd, &values[self.axes[axis]], self.origin[axis]);
            }
            corner[2] = corner[2] * self.flip;
        }
        corners
    }

    /// The triangles that lie wholly outside one plane of the shaft.
    #[inline(always)]
    pub(super) fn outside(&self, [a, b, c]: &[[f32x8<S>; 3]; 3]) -> mask32x8<S> {
        let mut outside =
            a[2].min(b[2]).min(c[2]).simd_gt(self.hi[2]) | a[2].max(b[2]).max(c[2]).simd_lt(self.lo[2]);
        for i in 0..2 {
            let across = [a[i], b[i], c[i]];
            outside = outside | beside(across, [a[2], b[2], c[2]], self.slopes[i]);
            outside = outside | across[0].min(across[1]).min(across[2]).simd_gt(self.hi[i]);
            outside = outside | across[0].max(across[1]).max(across[2]).simd_lt(self.lo[i]);
        }
        outside
    }
}
