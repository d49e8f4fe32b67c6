//! Sorting triangles into bands of rows, sixteen at a time, and dropping those that cover no pixel centre.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x4, i32x16, mask32x16};

use super::clip::{FlatTriangle, clip_triangle};
use super::depth::Cull;
use super::draw::Frame;
use super::projection::{SUBPIXEL_BITS, SUBPIXELS, flags};

/// Rows of a band are 2 to this power. A band of a 1024 pixels wide map is 128 KiB and stays in a core's
/// second cache; with 32 rows a 512² map still makes work for 16 threads.
pub(super) const BAND_BITS: u32 = 5;
/// Rows of a band.
pub(super) const BAND_ROWS: usize = 1 << BAND_BITS;

/// Triangles that are set up at once.
pub(super) const LANES: usize = 16;

/// A triangle whose box is at most this many pixels long on both sides is tested together with fifteen others.
/// Larger would leave lanes idle; smaller pays the start of a row of pixels too often.
pub(super) const TINY_PIXELS: i32 = 4;
/// One whose box is at most this long has its rows tested eight pixels at once. Larger would test pixels in vain;
/// at most 64, so that edge functions fit i32.
pub(super) const SMALL_PIXELS: i32 = 32;

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
    /// Indices of triangles of at most [`TINY_PIXELS`].
    pub(super) tiny: Vec<u32>,
    /// Indices of triangles of at most [`SMALL_PIXELS`].
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
            band.tiny.clear();
            band.small.clear();
            band.large.clear();
            band.flat.clear();
        }
        self.flat.clear();
    }

    fn push_flat(&mut self, frame: &Frame<'_>, triangle: FlatTriangle) {
        let index = self.flat.len() as u32;
        let within = |covered: Range<i32>, window: &Range<i32>| {
            covered.start.max(window.start)..covered.end.min(window.end)
        };
        let rows = within(covered(min3(triangle.y), max3(triangle.y), frame.height), &frame.window[1]);
        let columns = within(covered(min3(triangle.x), max3(triangle.x), frame.width), &frame.window[0]);
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

/// Sixteen triangles, a lane each: first, second and third corners.
pub(super) struct Corners<S: Simd> {
    pub(super) x: [i32x16<S>; 3],
    pub(super) y: [i32x16<S>; 3],
    /// Bits of the nearness.
    pub(super) nearness: [i32x16<S>; 3],
    pub(super) flags: [i32x16<S>; 3],
}

impl<S: Simd> Corners<S> {
    /// The triangles with these vertices.
    #[inline(always)]
    pub(super) fn gather(simd: S, frame: &Frame<'_>, triangles: &[[u32; 3]; LANES]) -> Self {
        // Spelled out: a closure handed to the standard library may be compiled without vector instructions.
        let first = gather_corner::<S, 0>(simd, frame, triangles);
        let second = gather_corner::<S, 1>(simd, frame, triangles);
        let third = gather_corner::<S, 2>(simd, frame, triangles);
        Self {
            x: [first[0], second[0], third[0]],
            y: [first[1], second[1], third[1]],
            nearness: [first[2], second[2], third[2]],
            flags: [first[3], second[3], third[3]],
        }
    }
}

/// The four components of one corner of sixteen triangles.
#[inline(always)]
fn gather_corner<S: Simd, const CORNER: usize>(
    simd: S,
    frame: &Frame<'_>,
    triangles: &[[u32; 3]; LANES],
) -> [i32x16<S>; 4] {
    let a =
        gather_four::<S, CORNER>(simd, frame, [&triangles[0], &triangles[1], &triangles[2], &triangles[3]]);
    let b =
        gather_four::<S, CORNER>(simd, frame, [&triangles[4], &triangles[5], &triangles[6], &triangles[7]]);
    let c =
        gather_four::<S, CORNER>(simd, frame, [&triangles[8], &triangles[9], &triangles[10], &triangles[11]]);
    let d = gather_four::<S, CORNER>(
        simd,
        frame,
        [&triangles[12], &triangles[13], &triangles[14], &triangles[15]],
    );
    [
        a[0].combine(b[0]).combine(c[0].combine(d[0])),
        a[1].combine(b[1]).combine(c[1].combine(d[1])),
        a[2].combine(b[2]).combine(c[2].combine(d[2])),
        a[3].combine(b[3]).combine(c[3].combine(d[3])),
    ]
}

/// A vertex is a row of four; the transpose of four rows has a component a row.
#[inline(always)]
fn gather_four<S: Simd, const CORNER: usize>(
    simd: S,
    frame: &Frame<'_>,
    triangles: [&[u32; 3]; 4],
) -> [i32x4<S>; 4] {
    let a = i32x4::from_slice(simd, &frame.vertices[triangles[0][CORNER] as usize]);
    let b = i32x4::from_slice(simd, &frame.vertices[triangles[1][CORNER] as usize]);
    let c = i32x4::from_slice(simd, &frame.vertices[triangles[2][CORNER] as usize]);
    let d = i32x4::from_slice(simd, &frame.vertices[triangles[3][CORNER] as usize]);
    let (xy0, xy1) = (a.zip_low(c), b.zip_low(d));
    let (zf0, zf1) = (a.zip_high(c), b.zip_high(d));
    [xy0.zip_low(xy1), xy0.zip_high(xy1), zf0.zip_low(zf1), zf0.zip_high(zf1)]
}

/// Sorts the triangles of `piece` into `bins`.
#[inline(always)]
pub(super) fn sort_piece<S: Simd>(simd: S, frame: &Frame<'_>, piece: &Piece, bins: &mut Bins) {
    let hidden_by = if frame.clamp { flags::SIDES } else { flags::SIDES | flags::NEAR | flags::FAR };
    let (mut first_row, mut last_row) = ([0; LANES], [0; LANES]);
    let mut start = piece.triangles.start;
    for triangles in frame.scene.triangles()[piece.triangles.clone()].chunks(LANES) {
        // Lanes without a triangle repeat the last one and are masked.
        let used = mask32x16::from_bitmask(simd, (1 << triangles.len()) - 1);
        let mut lanes = [triangles[triangles.len() - 1]; LANES];
        lanes[..triangles.len()].copy_from_slice(triangles);
        let corners = Corners::gather(simd, frame, &lanes);
        let ([x0, x1, x2], [y0, y1, y2], [f0, f1, f2]) = (corners.x, corners.y, corners.flags);

        let seen = used & (f0 & f1 & f2 & hidden_by).simd_eq(0);
        let whole = ((f0 | f1 | f2) & flags::CLIP).simd_eq(0);
        let (x_min, x_max) = (x0.min(x1).min(x2), x0.max(x1).max(x2));
        let (y_min, y_max) = (y0.min(y1).min(y2), y0.max(y1).max(y2));
        let half = SUBPIXELS / 2;
        let [columns, rows] = &frame.window;
        let column0 = ((x_min + (half - 1)) >> SUBPIXEL_BITS).max(columns.start);
        let column1 = ((x_max - half) >> SUBPIXEL_BITS).min(columns.end - 1);
        let row0 = ((y_min + (half - 1)) >> SUBPIXEL_BITS).max(rows.start);
        let row1 = ((y_max - half) >> SUBPIXEL_BITS).min(rows.end - 1);
        let covers = column0.simd_le(column1) & row0.simd_le(row1);

        // No overflow: a guarded coordinate has 24 bits.
        let extent = (x_max - x_min).max(y_max - y_min);
        let small = extent.simd_lt(SMALL_PIXELS << SUBPIXEL_BITS);
        let tiny = extent.simd_lt(TINY_PIXELS << SUBPIXEL_BITS);
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
        let (tiny, small) = (tiny.to_bitmask(), small.to_bitmask());
        for lane in set_bits(whole_seen) {
            let id = (start + lane) as u32;
            if piece.cutout {
                bins.push_flat(frame, FlatTriangle::whole(frame, id));
                continue;
            }
            for band in &mut bins.bands[band_of(first_row[lane])..=band_of(last_row[lane])] {
                let list = match (tiny >> lane & 1, small >> lane & 1) {
                    (1, _) => &mut band.tiny,
                    (_, 1) => &mut band.small,
                    _ => &mut band.large,
                };
                list.push(id);
            }
        }
        for lane in set_bits(seen & !whole) {
            let id = start + lane;
            clip_triangle(frame.projection, frame.scene.corners(id), id as u32, |part| {
                bins.push_flat(frame, part);
            });
        }
        start += LANES;
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
