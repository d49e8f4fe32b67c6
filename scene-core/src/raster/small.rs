//! Small triangles: set up sixteen at once, a lane each. The tiniest are then tested together, pixel by pixel of
//! their boxes; the others one by one, eight pixels of a row at once.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, f32x16, i32x8, i32x16};

use super::bins::{BAND_ROWS, Corners, LANES, set_bits};
use super::draw::Frame;
use super::pixels::{BLOCK, Face, Pixels};
use super::projection::{SUBPIXEL_BITS, SUBPIXELS};

/// Edges of each lane's triangle, the inside on their right as seen.
struct Edge<S: Simd> {
    /// The edge's function at the first pixel of the box, ties included: not negative where the pixel is owned.
    at_first: i32x16<S>,
    /// What ties add to the function: 0 or −1.
    tie: i32x16<S>,
    step_x: i32x16<S>,
    step_y: i32x16<S>,
}

impl<S: Simd> Edge<S> {
    /// The edges from `a` to `b`.
    #[inline(always)]
    fn new(a: [i32x16<S>; 2], b: [i32x16<S>; 2], first: [i32x16<S>; 2]) -> Self {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        // Top edges (level, inside below) and left edges (inside to the right) own their pixels.
        let owns = dy.simd_lt(0) | (dy.simd_eq(0) & dx.simd_gt(0));
        let tie = owns.select(i32x16::splat(dx.token(), 0), i32x16::splat(dx.token(), -1));
        Self {
            at_first: dx * (first[1] - a[1]) - dy * (first[0] - a[0]) + tie,
            tie,
            step_x: -(dy << SUBPIXEL_BITS),
            step_y: dx << SUBPIXEL_BITS,
        }
    }
}

/// Sixteen triangles ready to be filled.
struct Lanes<S: Simd> {
    edges: [Edge<S>; 3],
    /// Nearness is `base` + E1·`slopes[0]` + E2·`slopes[1]`, kept within `limits`.
    base: f32x16<S>,
    slopes: [f32x16<S>; 2],
    limits: [f32x16<S>; 2],
    /// Last column and row of the box within the band, counted from its first; −1 where there is none.
    columns: i32x16<S>,
    rows: i32x16<S>,
    /// The box's first pixel in the band.
    index: i32x16<S>,
    /// A bit for each front face.
    fronts: u64,
}

impl<S: Simd> Lanes<S> {
    /// At least one and at most sixteen triangles; lanes without one repeat the last.
    #[inline(always)]
    fn new(simd: S, frame: &Frame<'_>, band: usize, ids: &[u32]) -> Self {
        let triangles = frame.scene.triangles();
        let mut lanes = [triangles[ids[ids.len() - 1] as usize]; LANES];
        for (lane, &id) in lanes.iter_mut().zip(ids) {
            *lane = triangles[id as usize];
        }
        let corners = Corners::gather(simd, frame, &lanes);
        let ([x0, x1, x2], [y0, y1, y2]) = (corners.x, corners.y);
        let [z0, z1, z2] = corners.nearness;
        let (z0, z1, z2): (f32x16<S>, f32x16<S>, f32x16<S>) = (z0.bitcast(), z1.bitcast(), z2.bitcast());

        // Second and third corner change places where the corners run counter-clockwise.
        let area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
        let front = area.simd_lt(0);
        let (x1, x2) = (front.select(x2, x1), front.select(x1, x2));
        let (y1, y2) = (front.select(y2, y1), front.select(y1, y2));
        let (z1, z2) = (front.select(z2, z1), front.select(z1, z2));

        let half = SUBPIXELS / 2;
        let band_row = (band * BAND_ROWS) as i32;
        let column0 = ((x0.min(x1).min(x2) + (half - 1)) >> SUBPIXEL_BITS).max(0);
        let column1 = ((x0.max(x1).max(x2) - half) >> SUBPIXEL_BITS).min(frame.width - 1);
        let row0 = ((y0.min(y1).min(y2) + (half - 1)) >> SUBPIXEL_BITS).max(band_row);
        let last_row = frame.height.min(band_row + BAND_ROWS as i32) - 1;
        let row1 = ((y0.max(y1).max(y2) - half) >> SUBPIXEL_BITS).min(last_row);

        let first = [(column0 << SUBPIXEL_BITS) + half, (row0 << SUBPIXEL_BITS) + half];
        let edges = [
            Edge::new([x1, y1], [x2, y2], first),
            Edge::new([x2, y2], [x0, y0], first),
            Edge::new([x0, y0], [x1, y1], first),
        ];
        let inverse_area = f32x16::splat(simd, 1.0) / area.abs().to_float::<f32x16<S>>();
        let slopes = [(z1 - z0) * inverse_area, (z2 - z0) * inverse_area];
        // Ties are no part of a weight: what they add is taken off here.
        let ties = edges[1].tie.to_float::<f32x16<S>>() * slopes[0]
            + edges[2].tie.to_float::<f32x16<S>>() * slopes[1];
        Self {
            edges,
            base: z0 - ties,
            slopes,
            limits: [z0.min(z1).min(z2), z0.max(z1).max(z2)],
            columns: column1 - column0,
            rows: row1 - row0,
            index: (row0 - band_row) * frame.width + column0,
            fronts: front.to_bitmask(),
        }
    }
}

/// Draws triangles, each of at most [`TINY_PIXELS`](super::bins::TINY_PIXELS), into band number `band`.
#[inline(always)]
pub(super) fn fill_tiny<S: Simd>(
    simd: S,
    frame: &Frame<'_>,
    band: usize,
    triangles: &[u32],
    pixels: &mut impl Pixels,
) {
    for ids in triangles.chunks(LANES) {
        let lanes = Lanes::new(simd, frame, band, ids);
        let mut index = [0; LANES];
        lanes.index.store_slice(&mut index);
        let [edge0, edge1, edge2] = &lanes.edges;
        let (mut row0, mut row1, mut row2) = (edge0.at_first, edge1.at_first, edge2.at_first);
        let idle = i32x16::from_fn(simd, |lane| if lane < ids.len() { 0 } else { -1 });
        let (last_column, last_row) = (lanes.columns.reduce_max(), lanes.rows.reduce_max());
        for row in 0..=last_row {
            let in_rows = (lanes.rows - row) | idle;
            let (mut e0, mut e1, mut e2) = (row0, row1, row2);
            for column in 0..=last_column {
                // No sign bit anywhere.
                let inside = (e0 | e1 | e2 | in_rows | (lanes.columns - column)).simd_ge(0);
                if inside.any_true() {
                    let (w1, w2): (f32x16<S>, f32x16<S>) = (e1.to_float(), e2.to_float());
                    let z = lanes.base + (w1 * lanes.slopes[0] + w2 * lanes.slopes[1]);
                    let z = z.max(lanes.limits[0]).min(lanes.limits[1]).to_array();
                    let offset = row * frame.width + column;
                    for lane in set_bits(inside) {
                        let face = Face { id: ids[lane], front: lanes.fronts >> lane & 1 == 1 };
                        pixels.sample((index[lane] + offset) as usize, z[lane], face);
                    }
                }
                (e0, e1, e2) = (e0 + edge0.step_x, e1 + edge1.step_x, e2 + edge2.step_x);
            }
            (row0, row1, row2) = (row0 + edge0.step_y, row1 + edge1.step_y, row2 + edge2.step_y);
        }
    }
}

/// Draws triangles, each of at most [`SMALL_PIXELS`](super::bins::SMALL_PIXELS), into band number `band`.
#[inline(always)]
pub(super) fn fill_small<S: Simd>(
    simd: S,
    frame: &Frame<'_>,
    band: usize,
    triangles: &[u32],
    pixels: &mut impl Pixels,
) {
    let ramp = i32x8::from_fn(simd, |lane| lane as i32);
    for ids in triangles.chunks(LANES) {
        let lanes = Lanes::new(simd, frame, band, ids);
        let [edge0, edge1, edge2] = &lanes.edges;
        let at_first = [edge0.at_first.to_array(), edge1.at_first.to_array(), edge2.at_first.to_array()];
        let step_x = [edge0.step_x.to_array(), edge1.step_x.to_array(), edge2.step_x.to_array()];
        let step_y = [edge0.step_y.to_array(), edge1.step_y.to_array(), edge2.step_y.to_array()];
        let (base, slopes) =
            (lanes.base.to_array(), [lanes.slopes[0].to_array(), lanes.slopes[1].to_array()]);
        let limits = [lanes.limits[0].to_array(), lanes.limits[1].to_array()];
        let (columns, rows) = (lanes.columns.to_array(), lanes.rows.to_array());
        let index = lanes.index.to_array();
        for (lane, &id) in ids.iter().enumerate() {
            let face = Face { id, front: lanes.fronts >> lane & 1 == 1 };
            let mut e0 = ramp * step_x[0][lane] + at_first[0][lane];
            let mut e1 = ramp * step_x[1][lane] + at_first[1][lane];
            let mut e2 = ramp * step_x[2][lane] + at_first[2][lane];
            let (down0, down1, down2) = (step_y[0][lane], step_y[1][lane], step_y[2][lane]);
            let (base, slope1, slope2) = (base[lane], slopes[0][lane], slopes[1][lane]);
            let (z_min, z_max) = (limits[0][lane], limits[1][lane]);
            for start in (0..=columns[lane]).step_by(BLOCK) {
                let (mut row0, mut row1, mut row2) = (e0, e1, e2);
                // Negative beyond the last column.
                let in_columns = i32x8::splat(simd, columns[lane] - start) - ramp;
                let mut index = (index[lane] + start) as usize;
                for _ in 0..=rows[lane] {
                    let mask = (row0 | row1 | row2 | in_columns).simd_ge(0);
                    let (w1, w2): (f32x8<S>, f32x8<S>) = (row1.to_float(), row2.to_float());
                    let z = ((w1 * slope1 + w2 * slope2) + base).max(z_min).min(z_max);
                    pixels.block(simd, index, z, mask, face);
                    (row0, row1, row2) = (row0 + down0, row1 + down1, row2 + down2);
                    index += frame.width as usize;
                }
                let block = BLOCK as i32;
                (e0, e1, e2) = (
                    e0 + step_x[0][lane] * block,
                    e1 + step_x[1][lane] * block,
                    e2 + step_x[2][lane] * block,
                );
            }
        }
    }
}
