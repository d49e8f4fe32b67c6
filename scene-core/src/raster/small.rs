//! Small triangles: a lane each, sixteen at once, pixel by pixel of their boxes.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16, i32x16};

use super::bins::{BAND_ROWS, Corners, set_bits};
use super::draw::Frame;
use super::pixels::{BLOCK, Face, Pixels};
use super::projection::{SUBPIXEL_BITS, SUBPIXELS};

/// An edge of each lane's triangle.
struct Edge<S: Simd> {
    /// Its function at the first pixel of the box, not negative inside; no rule for ties.
    at_first: i32x16<S>,
    /// What is added so that ties fall to the right side: 0 or −1.
    tie: i32x16<S>,
    step_x: i32x16<S>,
    step_y: i32x16<S>,
}

impl<S: Simd> Edge<S> {
    /// The edge from `a` to `b`, with the inside on its right as seen.
    #[inline(always)]
    fn new(a: [i32x16<S>; 2], b: [i32x16<S>; 2], first: [i32x16<S>; 2]) -> Self {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        // Top edges (level, inside below) and left edges (inside to the right) own their pixels.
        let owns = dy.simd_lt(0) | (dy.simd_eq(0) & dx.simd_gt(0));
        let zero = dx - dx;
        Self {
            at_first: dx * (first[1] - a[1]) - dy * (first[0] - a[0]),
            tie: owns.select(zero, zero - 1),
            step_x: -(dy << SUBPIXEL_BITS),
            step_y: dx << SUBPIXEL_BITS,
        }
    }
}

/// Draws small triangles into band number `band`.
#[inline(always)]
pub(super) fn fill<S: Simd>(
    simd: S,
    frame: &Frame<'_>,
    band: usize,
    triangles: &[u32],
    pixels: &mut impl Pixels,
) {
    for ids in triangles.chunks(BLOCK) {
        let mut corners = Corners::EMPTY;
        for (lane, &id) in ids.iter().enumerate() {
            corners.set(lane, frame, frame.scene.triangles()[id as usize]);
        }
        fill_lanes(simd, frame, band, ids, &corners, pixels);
    }
}

#[inline(always)]
fn fill_lanes<S: Simd>(
    simd: S,
    frame: &Frame<'_>,
    band: usize,
    ids: &[u32],
    corners: &Corners,
    pixels: &mut impl Pixels,
) {
    let lanes = |v: &[i32; BLOCK]| i32x16::from_slice(simd, v);
    let [x0, x1, x2] = corners.x.each_ref().map(lanes);
    let [y0, y1, y2] = corners.y.each_ref().map(lanes);
    let [z0, z1, z2] = corners.nearness.each_ref().map(|z| lanes(z).bitcast::<f32x16<S>>());

    // Second and third corner change places where the corners run counter-clockwise.
    let area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
    let front = area.simd_lt(0);
    let front_bits = front.to_bitmask();
    let (x1, x2) = (front.select(x2, x1), front.select(x1, x2));
    let (y1, y2) = (front.select(y2, y1), front.select(y1, y2));
    let (z1, z2) = (front.select(z2, z1), front.select(z1, z2));
    let area = area.abs();

    let half = SUBPIXELS / 2;
    let band_row = (band * BAND_ROWS) as i32;
    let column0 = ((x0.min(x1).min(x2) + (half - 1)) >> SUBPIXEL_BITS).max(0);
    let column1 = ((x0.max(x1).max(x2) - half) >> SUBPIXEL_BITS).min(frame.width - 1);
    let row0 = ((y0.min(y1).min(y2) + (half - 1)) >> SUBPIXEL_BITS).max(band_row);
    let last_row = frame.height.min(band_row + BAND_ROWS as i32) - 1;
    let row1 = ((y0.max(y1).max(y2) - half) >> SUBPIXEL_BITS).min(last_row);
    let (columns, rows) = (column1 - column0, row1 - row0);

    let first = [(column0 << SUBPIXEL_BITS) + half, (row0 << SUBPIXEL_BITS) + half];
    let edge0 = Edge::new([x1, y1], [x2, y2], first);
    let edge1 = Edge::new([x2, y2], [x0, y0], first);
    let edge2 = Edge::new([x0, y0], [x1, y1], first);

    let inverse_area = f32x16::splat(simd, 1.0) / area.to_float::<f32x16<S>>();
    let (slope1, slope2) = ((z1 - z0) * inverse_area, (z2 - z0) * inverse_area);
    let (z_min, z_max) = (z0.min(z1).min(z2), z0.max(z1).max(z2));
    let index = (row0 - band_row) * frame.width + column0;
    let mut first_index = [0; BLOCK];
    index.store_slice(&mut first_index);

    let (mut row_e0, mut row_e1, mut row_e2) = (edge0.at_first, edge1.at_first, edge2.at_first);
    let occupied = i32x16::from_fn(simd, |lane| if lane < ids.len() { 0 } else { -1 });
    let (max_columns, max_rows) = (columns.reduce_max(), rows.reduce_max());
    for row in 0..=max_rows {
        let in_rows = rows.simd_ge(row) & occupied.simd_eq(0);
        let (mut e0, mut e1, mut e2) = (row_e0, row_e1, row_e2);
        for column in 0..=max_columns {
            let inside = ((e0 + edge0.tie) | (e1 + edge1.tie) | (e2 + edge2.tie)).simd_ge(0)
                & columns.simd_ge(column)
                & in_rows;
            if inside.any_true() {
                let (w1, w2): (f32x16<S>, f32x16<S>) = (e1.to_float(), e2.to_float());
                let z = (z0 + (w1 * slope1 + w2 * slope2)).max(z_min).min(z_max).to_array();
                let offset = row * frame.width + column;
                for lane in set_bits(inside) {
                    let face = Face { id: ids[lane], front: front_bits >> lane & 1 == 1 };
                    pixels.sample((first_index[lane] + offset) as usize, z[lane], face);
                }
            }
            (e0, e1, e2) = (e0 + edge0.step_x, e1 + edge1.step_x, e2 + edge2.step_x);
        }
        (row_e0, row_e1, row_e2) = (row_e0 + edge0.step_y, row_e1 + edge1.step_y, row_e2 + edge2.step_y);
    }
}
