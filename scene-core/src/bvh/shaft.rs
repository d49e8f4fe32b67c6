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

use fearless_simd::{Simd, SimdBase, SimdMask, f32x8, mask32x8};
use glam::Vec3;

use super::tree::{Block, Node};

/// Rays of one packet at most: one bit each of a mask.
pub(super) const MAX_RAYS: usize = 64;

/// The largest coordinate, relative to the origin, that the f32 filters take: products of three stay finite.
pub(super) const MAX_REACH: f32 = (1_u64 << 38) as f32;

/// The largest slope of a ray against the shaft's axis; a wider bundle is split.
const MAX_SLOPE: f32 = 1024.0;

/// Rays from one origin, in the frame of their shaft.
pub(super) struct Rays {
    /// Ends (or directions) by coordinate.
    pub(super) ends: [[f32; MAX_RAYS]; 3],
    /// x/z and y/z.
    pub(super) slopes: [[f32; MAX_RAYS]; 2],
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

impl Shaft {
    /// The shaft around the rays from `origin` to (or along) each of `ends` that `mask` names, and the rays in
    /// its frame. `None` if the bundle is too wide for one frame or reaches too far for f32.
    #[inline(always)]
    pub(super) fn new<S: Simd>(
        simd: S,
        origin: Vec3,
        ends: &[[f32; MAX_RAYS]; 3],
        mask: u64,
        finite: bool,
    ) -> Option<(Self, Rays)> {
        let groups = (64 - mask.leading_zeros() as usize).div_ceil(8);
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for axis in 0..3 {
            let mut low = f32x8::splat(simd, f32::INFINITY);
            let mut high = f32x8::splat(simd, f32::NEG_INFINITY);
            for (group, lanes) in ends[axis].as_chunks::<8>().0[..groups].iter().enumerate() {
                let used = mask32x8::from_bitmask(simd, mask >> (8 * group) & 0xff);
                let value = f32x8::load_array_ref(simd, lanes);
                low = low.min(select(used, value, low));
                high = high.max(select(used, value, high));
            }
            lo[axis] = low.reduce_min();
            hi[axis] = high.reduce_max();
        }
        // How far all rays go along an axis, at least.
        let advance = |axis: usize| lo[axis].max(-hi[axis]);
        let z = (0..3).max_by(|&a, &b| advance(a).total_cmp(&advance(b)))?;
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let reach = |axis: usize| hi[axis].max(-lo[axis]);
        let widest = reach(x).max(reach(y));
        let forward = advance(z);
        if !(forward > 0.0 && widest <= forward * MAX_SLOPE && widest.max(reach(z)) <= MAX_REACH) {
            return None;
        }
        let flip = if lo[z] > 0.0 { 1.0 } else { -1.0 };
        let axes = [x, y, z];
        let mut rays = Rays { ends: [[0.0; MAX_RAYS]; 3], slopes: [[0.0; MAX_RAYS]; 2], mask, finite };
        let mut slopes = [[0.0; 2]; 2];
        for group in 0..groups {
            let at = 8 * group..8 * group + 8;
            let used = mask32x8::from_bitmask(simd, mask >> (8 * group) & 0xff);
            let load = |axis: usize| f32x8::from_slice(simd, &ends[axis][at.clone()]);
            // Unused lanes get z = 1, so that they divide quietly.
            let along = select(used, load(z) * flip, f32x8::splat(simd, 1.0));
            along.store_slice(&mut rays.ends[2][at.clone()]);
            for (i, axis) in [x, y].into_iter().enumerate() {
                let across = select(used, load(axis), f32x8::splat(simd, 0.0));
                across.store_slice(&mut rays.ends[i][at.clone()]);
                (across / along).store_slice(&mut rays.slopes[i][at.clone()]);
            }
        }
        for i in 0..2 {
            let mut low = f32x8::splat(simd, f32::INFINITY);
            let mut high = f32x8::splat(simd, f32::NEG_INFINITY);
            for (group, lanes) in rays.slopes[i].as_chunks::<8>().0[..groups].iter().enumerate() {
                let used = mask32x8::from_bitmask(simd, mask >> (8 * group) & 0xff);
                let value = f32x8::load_array_ref(simd, lanes);
                low = low.min(select(used, value, low));
                high = high.max(select(used, value, high));
            }
            slopes[i] = [low.reduce_min().next_down(), high.reduce_max().next_up()];
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

impl<S: Simd> ShaftLanes<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, shaft: &Shaft) -> Self {
        let splat = |v: f32| f32x8::splat(simd, v);
        Self {
            simd,
            axes: shaft.axes,
            flipped: shaft.flip < 0.0,
            flip: splat(shaft.flip),
            origin: shaft.origin.map(splat),
            slopes: shaft.slopes.map(|pair| pair.map(splat)),
            lo: shaft.lo.map(splat),
            hi: shaft.hi.map(splat),
        }
    }

    /// The children of a node that may hold a triangle that a ray of the shaft crosses, as bits, and the least
    /// z of each box.
    #[inline(always)]
    pub(super) fn children(&self, node: &Node) -> (u32, f32x8<S>) {
        let simd = self.simd;
        let relative = |bound: &[[f32; 8]; 3], axis: usize| {
            f32x8::load_array_ref(simd, &bound[self.axes[axis]]) - self.origin[axis]
        };
        let lo = [relative(&node.lo, 0), relative(&node.lo, 1)];
        let hi = [relative(&node.hi, 0), relative(&node.hi, 1)];
        let (near, far) = if self.flipped { (&node.hi, &node.lo) } else { (&node.lo, &node.hi) };
        let near = relative(near, 2) * self.flip;
        let far = relative(far, 2) * self.flip;
        let mut outside = near.simd_gt(self.hi[2]) | far.simd_lt(self.lo[2]);
        for i in 0..2 {
            let [low, high] = self.slopes[i];
            outside = outside | lo[i].simd_gt(self.hi[i]) | hi[i].simd_lt(self.lo[i]);
            outside = outside | hi[i].simd_lt((low * near).min(low * far));
            outside = outside | lo[i].simd_gt((high * near).max(high * far));
        }
        (!outside.to_bitmask() as u32 & ((1 << node.count) - 1), near)
    }

    /// The corners of a block's triangles, in the shaft's frame.
    #[inline(always)]
    pub(super) fn block_corners(&self, block: &Block) -> [[f32x8<S>; 3]; 3] {
        std::array::from_fn(|corner| {
            let axis = |i: usize| {
                f32x8::load_array_ref(self.simd, &block.corners[corner][self.axes[i]]) - self.origin[i]
            };
            [axis(0), axis(1), axis(2) * self.flip]
        })
    }

    /// The triangles that lie wholly outside one plane of the shaft.
    #[inline(always)]
    pub(super) fn outside(&self, corners: &[[f32x8<S>; 3]; 3]) -> mask32x8<S> {
        let [a, b, c] = corners;
        let mut outside =
            a[2].min(b[2]).min(c[2]).simd_gt(self.hi[2]) | a[2].max(b[2]).max(c[2]).simd_lt(self.lo[2]);
        for i in 0..2 {
            let [low, high] = self.slopes[i];
            let below = |v: &[f32x8<S>; 3]| v[i].simd_lt(low * v[2]);
            let above = |v: &[f32x8<S>; 3]| v[i].simd_gt(high * v[2]);
            outside = outside | (below(a) & below(b) & below(c)) | (above(a) & above(b) & above(c));
            outside = outside
                | a[i].min(b[i]).min(c[i]).simd_gt(self.hi[i])
                | a[i].max(b[i]).max(c[i]).simd_lt(self.lo[i]);
        }
        outside
    }
}
