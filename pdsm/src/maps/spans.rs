//! Large triangles, row by row: where a row enters and leaves each edge is a division of whole numbers.

use super::Target;

const STEPS: i64 = 256;

/// Draws one triangle, its corners in 1/256 texel, with these t at its corners.
#[inline(always)]
pub(super) fn draw(corners: [[i32; 2]; 3], t: [f32; 3], target: Target, map: &mut [f32]) {
    let [a, mut b, mut c] = corners.map(|corner| corner.map(i64::from));
    let [ta, mut tb, mut tc] = t;
    let mut area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    if area == 0 {
        return;
    }
    if area < 0 {
        (b, c, tb, tc, area) = (c, b, tc, tb, -area);
    }
    let edges = [Edge::new(b, c), Edge::new(c, a), Edge::new(a, b)];
    let covered = |low: i64, high: i64| {
        let first = (low + STEPS / 2 - 1).div_euclid(STEPS).max(0);
        (first, (high - STEPS / 2).div_euclid(STEPS).min(i64::from(target.size) - 1))
    };
    let (first_column, last_column) = covered(a[0].min(b[0]).min(c[0]), a[0].max(b[0]).max(c[0]));
    let (first_row, last_row) = covered(a[1].min(b[1]).min(c[1]), a[1].max(b[1]).max(c[1]));
    let (low, high) = (ta.min(tb).min(tc), ta.max(tb).max(tc));
    let per_area = 1.0 / area as f64;
    let (slope_b, slope_c) = (f64::from(tb - ta) * per_area, f64::from(tc - ta) * per_area);
    // Weights change by that much a column.
    let per_column = edges[1].step_x as f64 * slope_b + edges[2].step_x as f64 * slope_c;
    for row in first_row..=last_row {
        let y = row * STEPS + STEPS / 2;
        let (mut first, mut last) = (first_column, last_column);
        for edge in &edges {
            edge.narrow(y, &mut first, &mut last);
        }
        if first > last {
            continue;
        }
        let at_zero = |edge: &Edge| (edge.at_column_zero(y) - edge.tie) as f64;
        let at_start = f64::from(ta) + at_zero(&edges[1]) * slope_b + at_zero(&edges[2]) * slope_c;
        let place = i64::from(target.start) + row * i64::from(target.stride) + first;
        let length = (last - first + 1) as usize;
        for (texel, column) in map[place as usize..][..length].iter_mut().zip(first as i32..) {
            let t = ((at_start + f64::from(column) * per_column) as f32).max(low).min(high);
            *texel = if t < *texel { t } else { *texel };
        }
    }
}

/// An edge, the inside on its right as seen.
struct Edge {
    from: [i64; 2],
    dx: i64,
    dy: i64,
    /// What ties add: 0 or −1.
    tie: i64,
    step_x: i64,
}

impl Edge {
    #[inline(always)]
    fn new(from: [i64; 2], to: [i64; 2]) -> Self {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let owns = dy < 0 || (dy == 0 && dx > 0);
        Self { from, dx, dy, tie: if owns { 0 } else { -1 }, step_x: -dy * STEPS }
    }

    /// The edge's function at the first column's centre, ties included: not negative where the texel is owned.
    #[inline(always)]
    fn at_column_zero(&self, y: i64) -> i64 {
        self.dx * (y - self.from[1]) - self.dy * (STEPS / 2 - self.from[0]) + self.tie
    }

    #[inline(always)]
    fn narrow(&self, y: i64, first: &mut i64, last: &mut i64) {
        let value = self.at_column_zero(y);
        match self.step_x {
            0 if value < 0 => *last = *first - 1,
            0 => {}
            step if step > 0 => *first = (*first).max(-value.div_euclid(step)),
            step => *last = (*last).min(value.div_euclid(-step)),
        }
    }
}
