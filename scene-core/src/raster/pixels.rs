//! What becomes of a covered pixel: nearest depth, nearest triangle, or a count.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, mask32x8, u32x8};

/// Pixels that are filled at once.
pub(super) const BLOCK: usize = 8;

/// The face that covers a pixel.
#[derive(Clone, Copy)]
pub(super) struct Face {
    /// Index of the triangle.
    pub(super) id: u32,
    /// Whether its corners run counter-clockwise as seen.
    pub(super) front: bool,
}

/// The pixels of one band of rows, owned by one thread. An index counts from the band's first pixel.
pub(super) trait Pixels: Send {
    /// Before the band's first triangle.
    fn begin(&mut self);

    /// One covered pixel.
    fn sample(&mut self, index: usize, nearness: f32, face: Face);

    /// Up to eight covered pixels from `index` on. Lanes outside `mask` may lie beyond the band's end and
    /// hold anything.
    fn block<S: Simd>(&mut self, simd: S, index: usize, nearness: f32x8<S>, mask: mask32x8<S>, face: Face);

    /// After the last.
    fn finish(&mut self);
}

/// A block that reaches over the end of the band, pixel by pixel.
#[inline(always)]
pub(super) fn samples<S: Simd>(
    pixels: &mut impl Pixels,
    index: usize,
    nearness: f32x8<S>,
    mask: mask32x8<S>,
    face: Face,
) {
    let nearness = nearness.to_array();
    let mut bits = mask.to_bitmask();
    while bits != 0 {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits - 1;
        pixels.sample(index + lane, nearness[lane], face);
    }
}

/// Nearest depth alone.
pub(super) struct DepthPixels<'a> {
    /// Nearness while drawing, depth when finished.
    pub(super) depth: &'a mut [f32],
    /// Nearness where there is nothing.
    pub(super) clear: f32,
    /// Whether depth is nearness negated.
    pub(super) negate: bool,
}

impl Pixels for DepthPixels<'_> {
    fn begin(&mut self) {
        self.depth.fill(self.clear);
    }

    #[inline(always)]
    fn sample(&mut self, index: usize, nearness: f32, _face: Face) {
        let depth = &mut self.depth[index];
        // Without a branch: which of two overlapping triangles comes first is anyone's guess.
        *depth = if nearness > *depth { nearness } else { *depth };
    }

    #[inline(always)]
    fn block<S: Simd>(&mut self, simd: S, index: usize, nearness: f32x8<S>, mask: mask32x8<S>, face: Face) {
        let Some(depth) = self.depth.get_mut(index..index + BLOCK) else {
            return samples(self, index, nearness, mask, face);
        };
        let old = f32x8::from_slice(simd, depth);
        (mask & nearness.simd_gt(old)).select(nearness, old).store_slice(depth);
    }

    fn finish(&mut self) {
        if self.negate {
            // Subtracting leaves no negative zero, of which vector sets disagree whether it is the lesser.
            self.depth.iter_mut().for_each(|depth| *depth = 0.0 - *depth);
        }
    }
}

/// Nearest depth and its triangle; of equally near ones the lowest index.
pub(super) struct TrianglePixels<'a> {
    /// The depths.
    pub(super) depth: DepthPixels<'a>,
    /// Indices of triangles; `u32::MAX` where there is none.
    pub(super) triangle: &'a mut [u32],
}

impl Pixels for TrianglePixels<'_> {
    fn begin(&mut self) {
        self.depth.begin();
        self.triangle.fill(u32::MAX);
    }

    #[inline(always)]
    fn sample(&mut self, index: usize, nearness: f32, face: Face) {
        let (depth, triangle) = (&mut self.depth.depth[index], &mut self.triangle[index]);
        if nearness > *depth || (nearness == *depth && face.id < *triangle) {
            *depth = nearness;
            *triangle = face.id;
        }
    }

    #[inline(always)]
    fn block<S: Simd>(&mut self, simd: S, index: usize, nearness: f32x8<S>, mask: mask32x8<S>, face: Face) {
        let range = index..index + BLOCK;
        let (Some(depth), Some(triangle)) =
            (self.depth.depth.get_mut(range.clone()), self.triangle.get_mut(range))
        else {
            return samples(self, index, nearness, mask, face);
        };
        let (old, old_id) = (f32x8::from_slice(simd, depth), u32x8::from_slice(simd, triangle));
        let id = u32x8::splat(simd, face.id);
        let wins = mask & (nearness.simd_gt(old) | (nearness.simd_eq(old) & id.simd_lt(old_id)));
        wins.select(nearness, old).store_slice(depth);
        wins.select(id, old_id).store_slice(triangle);
    }

    fn finish(&mut self) {
        self.depth.finish();
    }
}

/// How many front and back faces cover a pixel.
pub(super) struct CountPixels<'a> {
    /// Front faces.
    pub(super) front: &'a mut [u32],
    /// Back faces.
    pub(super) back: &'a mut [u32],
}

impl Pixels for CountPixels<'_> {
    fn begin(&mut self) {
        self.front.fill(0);
        self.back.fill(0);
    }

    #[inline(always)]
    fn sample(&mut self, index: usize, _nearness: f32, face: Face) {
        let counts = if face.front { &mut *self.front } else { &mut *self.back };
        counts[index] += 1;
    }

    #[inline(always)]
    fn block<S: Simd>(&mut self, _simd: S, index: usize, nearness: f32x8<S>, mask: mask32x8<S>, face: Face) {
        samples(self, index, nearness, mask, face);
    }

    fn finish(&mut self) {}
}
