//! One triangle in sixteen views.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16, i32x16, mask32x16};
use glam::Vec2;

use super::{LANES, MapCasters, Target, Vertex, spans};

const STEP_BITS: u32 = 8;
const STEPS: i32 = 1 << STEP_BITS;
const HALF: i32 = STEPS / 2;

/// A triangle whose box is at most so many texels long in every view is tested texel by texel; larger ones are drawn by
/// rows, view by view. At most 64, so that edge functions fit i32.
const SMALL_TEXELS: i32 = 32;

/// Adding it moves a number's whole part into the lowest bits of the mantissa, rounded to even.
const SHIFT: f32 = 12_582_912.0;

/// An edge of each lane's triangle, the inside on its right as seen.
struct Edge<S: Simd> {
    /// The edge's function at the first texel of the box, ties included: not negative where the texel is owned.
    at_first: i32x16<S>,
    tie: i32x16<S>,
    step_x: i32x16<S>,
    step_y: i32x16<S>,
}

impl<S: Simd> Edge<S> {
    #[inline(always)]
    fn new(simd: S, a: [i32x16<S>; 2], b: [i32x16<S>; 2], first: [i32x16<S>; 2]) -> Self {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        // Top edges (level, inside below) and left edges (inside to the right) own their texels.
        let owns = dy.simd_lt(0) | (dy.simd_eq(0) & dx.simd_gt(0));
        let tie = owns.select(i32x16::splat(simd, 0), i32x16::splat(simd, -1));
        Self {
            at_first: dx * (first[1] - a[1]) - dy * (first[0] - a[0]) + tie,
            tie,
            step_x: -(dy << STEP_BITS),
            step_y: dx << STEP_BITS,
        }
    }
}

/// Steps of up to sixteen samples, in 1/256 texel.
struct Moves<S: Simd> {
    x: f32x16<S>,
    y: f32x16<S>,
}

impl<S: Simd> Moves<S> {
    /// Where a vertex is snapped to in each view.
    #[inline(always)]
    fn place(&self, vertex: &Vertex) -> [i32x16<S>; 2] {
        [place(self.x, vertex, 0), place(self.y, vertex, 1)]
    }
}

/// A vertex along one axis, moved by a step for each view. No closure: it would be compiled apart, without the vector unit.
#[inline(always)]
fn place<S: Simd>(step: f32x16<S>, vertex: &Vertex, axis: usize) -> i32x16<S> {
    let bits: i32x16<S> = (step * vertex.t + vertex.rest[axis] + SHIFT).bitcast();
    bits + (vertex.whole[axis] - SHIFT.to_bits() as i32)
}

#[inline(always)]
pub(super) fn draw<S: Simd>(
    simd: S,
    casters: &MapCasters,
    steps: &[Vec2],
    target: Target,
    maps: &mut [&mut [f32]],
) {
    // Lanes without a sample repeat the last one and are masked.
    let step = |lane: usize| steps[lane.min(steps.len() - 1)] * STEPS as f32;
    let moves = Moves {
        x: f32x16::from_fn(simd, |lane| step(lane).x),
        y: f32x16::from_fn(simd, |lane| step(lane).y),
    };
    let used = mask32x16::from_bitmask(simd, (1 << steps.len()) - 1);
    let Target { size, start, stride } = target;
    let mut index = [0; LANES];
    for triangle in &casters.triangles {
        let vertices = triangle.map(|vertex| casters.vertices[vertex as usize]);
        let [[x0, y0], [x1, y1], [x2, y2]] =
            [moves.place(&vertices[0]), moves.place(&vertices[1]), moves.place(&vertices[2])];
        let (x_min, x_max) = (x0.min(x1).min(x2), x0.max(x1).max(x2));
        let (y_min, y_max) = (y0.min(y1).min(y2), y0.max(y1).max(y2));
        let column0 = ((x_min + (HALF - 1)) >> STEP_BITS).max(0);
        let columns = ((x_max - HALF) >> STEP_BITS).min(size - 1) - column0;
        let row0 = ((y_min + (HALF - 1)) >> STEP_BITS).max(0);
        let rows = ((y_max - HALF) >> STEP_BITS).min(size - 1) - row0;
        let covers = used & (columns | rows).simd_ge(0);
        if !covers.any_true() {
            continue;
        }
        let extent = (x_max - x_min).max(y_max - y_min);
        let t = vertices.map(|vertex| vertex.t);
        if extent.simd_ge(SMALL_TEXELS << STEP_BITS).any_true() {
            let x = [x0.to_array(), x1.to_array(), x2.to_array()];
            let y = [y0.to_array(), y1.to_array(), y2.to_array()];
            for (lane, map) in maps.iter_mut().enumerate().take(steps.len()) {
                let corners = [0, 1, 2].map(|corner| [x[corner][lane], y[corner][lane]]);
                spans::draw(corners, t, target, map);
            }
            continue;
        }

        // Second and third corner change places where the corners run counter-clockwise.
        let area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
        let turned = area.simd_lt(0);
        let (x1, x2) = (turned.select(x2, x1), turned.select(x1, x2));
        let (y1, y2) = (turned.select(y2, y1), turned.select(y1, y2));
        let [t0, t1, t2] = t.map(|t| f32x16::splat(simd, t));
        let (t1, t2) = (turned.select(t2, t1), turned.select(t1, t2));
        let first = [(column0 << STEP_BITS) + HALF, (row0 << STEP_BITS) + HALF];
        let edge0 = Edge::new(simd, [x1, y1], [x2, y2], first);
        let edge1 = Edge::new(simd, [x2, y2], [x0, y0], first);
        let edge2 = Edge::new(simd, [x0, y0], [x1, y1], first);
        let inverse_area = f32x16::splat(simd, 1.0) / area.abs().to_float::<f32x16<S>>();
        let (slope1, slope2) = ((t1 - t0) * inverse_area, (t2 - t0) * inverse_area);
        // Ties are no part of a weight: what they add is taken off here.
        let ties = edge1.tie.to_float::<f32x16<S>>() * slope1 + edge2.tie.to_float::<f32x16<S>>() * slope2;
        let base = t0 - ties;
        let (low, high) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));

        (row0 * stride + column0 + start).store_slice(&mut index);
        let idle = covers.select(i32x16::splat(simd, 0), i32x16::splat(simd, -1));
        let (last_column, last_row) = ((columns & !idle).reduce_max(), (rows & !idle).reduce_max());
        let (mut row_e0, mut row_e1, mut row_e2) = (edge0.at_first, edge1.at_first, edge2.at_first);
        for row in 0..=last_row {
            let in_rows = (rows - row) | idle;
            let (mut e0, mut e1, mut e2) = (row_e0, row_e1, row_e2);
            for column in 0..=last_column {
                // No sign bit anywhere.
                let inside = (e0 | e1 | e2 | in_rows | (columns - column)).simd_ge(0);
                let mut bits = inside.to_bitmask();
                if bits != 0 {
                    let (w1, w2): (f32x16<S>, f32x16<S>) = (e1.to_float(), e2.to_float());
                    let t = (base + (w1 * slope1 + w2 * slope2)).max(low).min(high).to_array();
                    let offset = row * stride + column;
                    while bits != 0 {
                        let lane = bits.trailing_zeros() as usize;
                        bits &= bits - 1;
                        let texel = &mut maps[lane][(index[lane] + offset) as usize];
                        *texel = if t[lane] < *texel { t[lane] } else { *texel };
                    }
                }
                (e0, e1, e2) = (e0 + edge0.step_x, e1 + edge1.step_x, e2 + edge2.step_x);
            }
            (row_e0, row_e1, row_e2) = (row_e0 + edge0.step_y, row_e1 + edge1.step_y, row_e2 + edge2.step_y);
        }
    }
}
