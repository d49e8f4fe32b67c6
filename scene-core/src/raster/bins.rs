//! Sorting triangles into bands of rows, sixteen at a time, and dropping those that cover no pixel centre.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16, mask32x16};

use super::clip::{FlatTriangle, clip_triangle};
use super::depth::Cull;
use super::draw::Frame;
use super::pixels::BLOCK;
use super::projection::{SUBPIXEL_BITS, SUBPIXELS, flags};

/// Rows of a band are 2 to this power. A band of a 1024 pixels wide map is 128 KiB and stays in a core's
/// second cache; with 32 rows a 512² map still makes work for 16 threads.
pub(super) const BAND_BITS: u32 = 5;
/// Rows of a band.
pub(super) const BAND_ROWS: usize = 1 << BAND_BITS;

/// A triangle whose box is at most this many pixels long on both sides is filled lane by lane. Larger trades
/// idle lanes for the set-up of a row-by-row triangle. At most 16, so that its edge functions fit i32.
pub(super) const SMALL_PIXELS: i32 = 8;

/// Triangles of one object to draw.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// Indices into the scene's triangles.
    pub(super) triangles: Range<usize>,
    /// Whether the object has a cut-out mask.
    pub(super) cutout: bool,
}

/// What a band has to draw.
#[derive(Debug, Default)]
pub(super) struct BandBin {
    /// Indices of small triangles.
    pub(super) small: Vec<u32>,
    /// Indices of larger ones.
    pub(super) large: Vec<u32>,
    /// Indices into [`Bins::flat`].
    pub(super) flat: Vec<u32>,
}

/// What one task of the set-up found; reused from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Bins {
    /// By band.
    pub(super) bands: Vec<BandBin>,
    /// Triangles that were clipped, need a depth test against near and far, or have a mask.
    pub(super) flat: Vec<FlatTriangle>,
}

impl Bins {
    /// Forgets everything but the memory.
    pub(super) fn reset(&mut self, bands: usize) {
        if self.bands.len() < bands {
            self.bands.resize_with(bands, BandBin::default);
        }
        for band in &mut self.bands {
            band.small.clear();
            band.large.clear();
            band.flat.clear();
        }
        self.flat.clear();
    }

    fn push_flat(&mut self, frame: &Frame<'_>, triangle: FlatTriangle) {
        let index = self.flat.len() as u32;
        let rows = covered(min3(triangle.y), max3(triangle.y), frame.height);
        let columns = covered(min3(triangle.x), max3(triangle.x), frame.width);
        if rows.is_empty() || columns.is_empty() {
            return;
        }
        for band in &mut self.bands[band_of(rows.start)..=band_of(rows.end - 1)] {
            band.flat.push(index);
        }
        self.flat.push(triangle);
    }
}

fn min3(v: [i32; 3]) -> i32 {
    v[0].min(v[1]).min(v[2])
}

fn max3(v: [i32; 3]) -> i32 {
    v[0].max(v[1]).max(v[2])
}

/// The band a row lies in.
fn band_of(row: i32) -> usize {
    row as usize >> BAND_BITS
}

/// Pixels of `0..size` whose centres lie in the closed interval of snapped coordinates.
#[inline(always)]
pub(super) fn covered(min: i32, max: i32, size: i32) -> Range<i32> {
    let first = (min + (SUBPIXELS / 2 - 1)) >> SUBPIXEL_BITS;
    let last = (max - SUBPIXELS / 2) >> SUBPIXEL_BITS;
    first.max(0)..(last + 1).min(size)
}

/// Sixteen triangles with their corners spread over lanes.
pub(super) struct Corners {
    /// x of the first, second and third corner.
    pub(super) x: [[i32; BLOCK]; 3],
    /// y.
    pub(super) y: [[i32; BLOCK]; 3],
    /// Bits of the nearness.
    pub(super) nearness: [[i32; BLOCK]; 3],
    /// Flags.
    pub(super) flags: [[i32; BLOCK]; 3],
}

impl Corners {
    /// Lanes that hide their triangle.
    pub(super) const EMPTY: Self = Self {
        x: [[0; BLOCK]; 3],
        y: [[0; BLOCK]; 3],
        nearness: [[0; BLOCK]; 3],
        flags: [[flags::BEHIND; BLOCK]; 3],
    };

    /// Puts a triangle into a lane.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, frame: &Frame<'_>, triangle: [u32; 3]) {
        for corner in 0..3 {
            let [x, y, nearness, flags] = frame.vertices[triangle[corner] as usize];
            self.x[corner][lane] = x;
            self.y[corner][lane] = y;
            self.nearness[corner][lane] = nearness;
            self.flags[corner][lane] = flags;
        }
    }
}

/// Sorts the triangles of `piece` into `bins`.
#[inline(always)]
pub(super) fn sort_piece<S: Simd>(simd: S, frame: &Frame<'_>, piece: &Piece, bins: &mut Bins) {
    let lanes = |v: &[i32; BLOCK]| i32x16::from_slice(simd, v);
    let hidden_by = if frame.clamp { flags::SIDES } else { flags::SIDES | flags::NEAR | flags::FAR };
    let (mut first_row, mut last_row) = ([0; BLOCK], [0; BLOCK]);
    let mut start = piece.triangles.start;
    for triangles in frame.scene.triangles()[piece.triangles.clone()].chunks(BLOCK) {
        let mut corners = Corners::EMPTY;
        for (lane, &triangle) in triangles.iter().enumerate() {
            corners.set(lane, frame, triangle);
        }
        let [x0, x1, x2] = corners.x.each_ref().map(lanes);
        let [y0, y1, y2] = corners.y.each_ref().map(lanes);
        let [f0, f1, f2] = corners.flags.each_ref().map(lanes);

        let seen = (f0 & f1 & f2 & hidden_by).simd_eq(0);
        let whole = ((f0 | f1 | f2) & flags::CLIP).simd_eq(0);
        let (x_min, x_max) = (x0.min(x1).min(x2), x0.max(x1).max(x2));
        let (y_min, y_max) = (y0.min(y1).min(y2), y0.max(y1).max(y2));
        let half = SUBPIXELS / 2;
        let column0 = ((x_min + (half - 1)) >> SUBPIXEL_BITS).max(0);
        let column1 = ((x_max - half) >> SUBPIXEL_BITS).min(frame.width - 1);
        let row0 = ((y_min + (half - 1)) >> SUBPIXEL_BITS).max(0);
        let row1 = ((y_max - half) >> SUBPIXEL_BITS).min(frame.height - 1);
        let covers = column0.simd_le(column1) & row0.simd_le(row1);

        let limit = SMALL_PIXELS << SUBPIXEL_BITS;
        let small = (x_max - x_min).simd_lt(limit) & (y_max - y_min).simd_lt(limit);
        // Twice the area, positive where the corners run clockwise as seen. It wraps for large triangles, of
        // which it decides nothing.
        let area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
        let faces = match frame.cull {
            Cull::None => !area.simd_eq(0),
            Cull::Back => area.simd_lt(0),
            Cull::Front => area.simd_gt(0),
        };
        let whole_seen = seen & whole & covers & (faces | !small);
        row0.store_slice(&mut first_row);
        row1.store_slice(&mut last_row);
        let small = small.to_bitmask();
        for lane in set_bits(whole_seen) {
            let id = (start + lane) as u32;
            if piece.cutout {
                bins.push_flat(frame, flat(&corners, lane, id));
                continue;
            }
            for band in &mut bins.bands[band_of(first_row[lane])..=band_of(last_row[lane])] {
                if small >> lane & 1 == 1 { band.small.push(id) } else { band.large.push(id) }
            }
        }
        for lane in set_bits(seen & !whole) {
            let id = start + lane;
            clip_triangle(&frame.projection, frame.scene.corners(id), id as u32, |part| {
                bins.push_flat(frame, part);
            });
        }
        start += BLOCK;
    }
}

/// The lanes of a mask that are set.
#[inline(always)]
pub(super) fn set_bits<S: Simd>(mask: mask32x16<S>) -> impl Iterator<Item = usize> {
    let mut bits = mask.to_bitmask();
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        let more = bits != 0;
        bits &= bits.wrapping_sub(1);
        more.then_some(lane)
    })
}

/// A lane's triangle for filling row by row.
fn flat(corners: &Corners, lane: usize, id: u32) -> FlatTriangle {
    FlatTriangle {
        x: corners.x.map(|x| x[lane]),
        y: corners.y.map(|y| y[lane]),
        nearness: corners.nearness.map(|n| f64::from(f32::from_bits(n[lane] as u32))),
        id,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_centre_on_the_border_of_the_box_counts() {
        assert_eq!(covered(128, 128, 8), 0..1);
        assert_eq!(covered(129, 383, 8), 1..1);
        assert_eq!(covered(129, 384, 8), 1..2);
        assert_eq!(covered(-5000, 5000, 8), 0..8);
        assert!(covered(-5000, -200, 8).is_empty());
        assert!(covered(2048 + 128, 5000, 8).is_empty());
    }
}
