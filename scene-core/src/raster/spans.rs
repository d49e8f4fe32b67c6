//! Larger triangles: row by row, between ends that an exact integer DDA yields.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, mask32x8};

use super::bins::{BAND_ROWS, covered};
use super::clip::FlatTriangle;
use super::cutout::Cutout;
use super::depth::Cull;
use super::draw::Frame;
use super::pixels::{BLOCK, Face, Pixels};
use super::projection::{SUBPIXEL_BITS, SUBPIXELS};

/// On which side of an edge its triangle lies.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    /// The edge bounds rows on their left.
    Left,
    /// On their right.
    Right,
    /// The edge is level.
    Level,
}

/// An edge walked down row by row. With E(x) = c − dy·x the edge function in whole pixels, a row is covered
/// where E ≥ 0: from ⌈−c/|dy|⌉ on a left edge, to ⌊c/dy⌋ on a right one. Quotient and remainder of c by |dy| are
/// carried from row to row, so that nothing is ever rounded.
struct EdgeWalk {
    side: Side,
    /// ⌊c/|dy|⌋, or c itself on a level edge.
    quotient: i64,
    remainder: i64,
    quotient_step: i64,
    remainder_step: i64,
    divisor: i64,
}

impl EdgeWalk {
    /// The edge from `a` to `b` with the inside on its right as seen, at the centre of pixel (0, `row`).
    #[inline(always)]
    fn new(a: [i64; 2], b: [i64; 2], row: i64) -> Self {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let (side, divisor) = match dy {
            0 => (Side::Level, 1),
            ..0 => (Side::Left, -dy),
            _ => (Side::Right, dy),
        };
        let half = i64::from(SUBPIXELS / 2);
        // Top and left edges own the pixels on them, the others do not.
        let tie = i64::from(!(dy < 0 || (dy == 0 && dx > 0)));
        let value = edge_function(a, b, half, (row << SUBPIXEL_BITS) + half) - tie;
        // Stepping a pixel adds a multiple of 256: the bits below decide nothing.
        let c = value >> SUBPIXEL_BITS;
        Self {
            side,
            quotient: c.div_euclid(divisor),
            remainder: c.rem_euclid(divisor),
            quotient_step: dx.div_euclid(divisor),
            remainder_step: dx.rem_euclid(divisor),
            divisor,
        }
    }

    /// Narrows a row's first and last pixel.
    #[inline(always)]
    fn narrow(&self, first: &mut i64, last: &mut i64) {
        match self.side {
            Side::Left => *first = (*first).max(-self.quotient),
            Side::Right => *last = (*last).min(self.quotient),
            Side::Level if self.quotient < 0 => *last = -1,
            Side::Level => {}
        }
    }

    /// To the next row.
    #[inline(always)]
    fn step(&mut self) {
        self.quotient += self.quotient_step;
        self.remainder += self.remainder_step;
        let carry = i64::from(self.remainder >= self.divisor);
        self.quotient += carry;
        self.remainder -= carry * self.divisor;
    }
}

/// Twice the area of (a, b, point): positive on the right of the edge as seen (y runs down).
#[inline(always)]
fn edge_function(a: [i64; 2], b: [i64; 2], x: i64, y: i64) -> i64 {
    (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
}

/// How depths out of range are treated and which pixels a mask keeps.
pub(super) struct Tests<'a> {
    /// Reject or clamp depths beyond near and far; `None` if the triangle has none.
    pub(super) range: Option<[f32; 2]>,
    /// Clamp instead of reject.
    pub(super) clamp: bool,
    /// The cut-out mask, if there is one.
    pub(super) cutout: Option<Cutout<'a>>,
}

impl Tests<'_> {
    /// Every covered pixel is drawn.
    pub(super) const NONE: Self = Self { range: None, clamp: false, cutout: None };
}

/// Draws a triangle into band number `band`.
#[inline(always)]
pub(super) fn fill<S: Simd>(
    simd: S,
    frame: &Frame<'_>,
    band: usize,
    triangle: &FlatTriangle,
    tests: &Tests<'_>,
    pixels: &mut impl Pixels,
) {
    let corner = |i: usize| [i64::from(triangle.x[i]), i64::from(triangle.y[i])];
    let (a, mut b, mut c) = (corner(0), corner(1), corner(2));
    let [mut z0, mut z1, mut z2] = triangle.nearness;
    let mut area = edge_function(a, b, c[0], c[1]);
    let front = area < 0;
    if area == 0 || (frame.cull == Cull::Back && !front) || (frame.cull == Cull::Front && front) {
        return;
    }
    if front {
        (b, c, z1, z2, area) = (c, b, z2, z1, -area);
    }
    let [y_min, y_max] = [a[1].min(b[1]).min(c[1]), a[1].max(b[1]).max(c[1])];
    let band_row = (band * BAND_ROWS) as i32;
    let rows = covered(y_min as i32, y_max as i32, frame.height.min(band_row + BAND_ROWS as i32));
    let rows = rows.start.max(band_row)..rows.end;
    let columns = covered(a[0].min(b[0]).min(c[0]) as i32, a[0].max(b[0]).max(c[0]) as i32, frame.width);
    if rows.is_empty() || columns.is_empty() {
        return;
    }

    let top = i64::from(rows.start);
    let mut edges = [EdgeWalk::new(b, c, top), EdgeWalk::new(c, a, top), EdgeWalk::new(a, b, top)];
    let (z_min, z_max) = (z0.min(z1).min(z2), z0.max(z1).max(z2));
    (z1, z2) = (z1 - z0, z2 - z0);
    let inverse_area = 1.0 / area as f64;
    // Change of nearness from a pixel to the next in its row.
    let slope =
        -((a[1] - c[1]) as f64 * z1 + (b[1] - a[1]) as f64 * z2) * (inverse_area * f64::from(SUBPIXELS));
    z0 = z0.clamp(f64::from(-f32::MAX), f64::from(f32::MAX));
    let fill = SpanFill {
        ramp: f32x8::from_fn(simd, |lane| lane as f32)
            * (slope.clamp(f64::from(-f32::MAX), f64::from(f32::MAX)) as f32),
        slope,
        limits: [z_min as f32, z_max as f32],
        tests,
        face: Face { id: triangle.id, front },
    };
    let half = i64::from(SUBPIXELS / 2);
    for row in rows {
        let (mut first, mut last) = (i64::from(columns.start), i64::from(columns.end) - 1);
        for edge in &mut edges {
            edge.narrow(&mut first, &mut last);
            edge.step();
        }
        if first > last {
            continue;
        }
        let (x, y) = ((first << SUBPIXEL_BITS) + half, (i64::from(row) << SUBPIXEL_BITS) + half);
        let (w1, w2) = (edge_function(c, a, x, y) as f64, edge_function(a, b, x, y) as f64);
        let nearness = z0 + (w1 * z1 + w2 * z2) * inverse_area;
        let index = (row - band_row) as usize * frame.width as usize + first as usize;
        let length = (last - first + 1) as usize;
        if let Some(cutout) = &fill.tests.cutout {
            fill.cut_out(cutout, [first as i32, row], index, length, nearness, pixels);
        } else {
            fill.solid(simd, index, length, nearness, pixels);
        }
    }
}

/// What the rows of a triangle have in common.
struct SpanFill<'a, S: Simd> {
    /// Change of nearness from the first pixel of a block to each.
    ramp: f32x8<S>,
    slope: f64,
    limits: [f32; 2],
    tests: &'a Tests<'a>,
    face: Face,
}

impl<S: Simd> SpanFill<'_, S> {
    /// A row without a mask. The nearness of each block starts anew in f64.
    #[inline(always)]
    fn solid(&self, simd: S, index: usize, length: usize, nearness: f64, pixels: &mut impl Pixels) {
        for start in (0..length).step_by(BLOCK) {
            let base = (nearness + start as f64 * self.slope) as f32;
            let mut z = (self.ramp + base).max(self.limits[0]).min(self.limits[1]);
            let lanes = (length - start).min(BLOCK);
            let mut mask = mask32x8::from_bitmask(simd, (1 << lanes) - 1);
            if let Some([far, near]) = self.tests.range {
                if self.tests.clamp {
                    z = z.max(far).min(near);
                } else {
                    mask &= z.simd_ge(far) & z.simd_le(near);
                }
            }
            pixels.block(simd, index + start, z, mask, self.face);
        }
    }

    /// A row of an object with a mask, pixel by pixel.
    #[inline(always)]
    fn cut_out(
        &self,
        cutout: &Cutout<'_>,
        [x, y]: [i32; 2],
        index: usize,
        length: usize,
        nearness: f64,
        pixels: &mut impl Pixels,
    ) {
        for i in 0..length {
            let z = (nearness + i as f64 * self.slope) as f32;
            let mut z = z.max(self.limits[0]).min(self.limits[1]);
            if let Some([far, near]) = self.tests.range {
                if self.tests.clamp {
                    z = z.clamp(far, near);
                } else if !(z >= far && z <= near) {
                    continue;
                }
            }
            if cutout.is_solid(x + i as i32, y) {
                pixels.sample(index + i, z, self.face);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The walk against the edge function itself, pixel by pixel.
    #[test]
    fn walked_ends_are_those_of_the_edge_function() {
        let mut state = 1_u64;
        let mut random = |range: i64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as i64).rem_euclid(2 * range) - range
        };
        for round in 0..2000 {
            let range = if round % 2 == 0 { 3000 } else { 8_000_000 };
            let (a, b) = ([random(range), random(range)], [random(range), random(range)]);
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let owns = dy < 0 || (dy == 0 && dx > 0);
            let mut walk = EdgeWalk::new(a, b, 3);
            for row in 3..9 {
                let (mut first, mut last) = (0, 15);
                walk.narrow(&mut first, &mut last);
                for x in 0..16 {
                    let value = edge_function(a, b, (x << 8) + 128, (row << 8) + 128);
                    let inside = value > 0 || (value == 0 && owns);
                    assert_eq!((first..=last).contains(&x), inside, "{a:?} {b:?} at {x}, {row}");
                }
                walk.step();
            }
        }
    }
}
