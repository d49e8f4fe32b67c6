//! V of a batch, interpolated between four functions each.

use super::places::Places;
use super::{BATCH, Lanes};
use crate::functions::Functions;
use crate::guide::{Guide, RIM, evaluate_in};
use crate::nodes::Nodes;

/// Functions that a batch is read from: four for each receiver, numbered 4·receiver + function.
const FUNCTIONS: usize = 4 * BATCH;

/// V of those places that are read, 1 of the others; how many lie before the start of all their functions, if `skip` lets
/// these be left out.
#[inline(always)]
pub(super) fn interpolate(functions: &Functions, places: &Places, skip: bool, found: &mut Lanes<f32>) -> u64 {
    let mut four = Four::new(functions, places);
    let starts = if skip { functions.guide().starts() } else { None };
    let lit = match starts {
        Some(starts) => four.choose(starts, Guide::side(functions.size()), places),
        None => four.choose_all(places),
    };
    if four.count > 0 {
        match functions.nodes() {
            Nodes::Full(nodes) => four.read(functions, nodes, |node| node),
            Nodes::Packed(nodes, steps) => four.read(functions, nodes, |node| steps.unpack(node)),
        }
        four.weigh(found);
    }
    lit
}

/// Four functions for each of a batch, and which of them are read.
struct Four {
    /// How far a place lies from its first pixel.
    weights: [Lanes<f32>; 2],
    /// Column and row of the first pixel, from beside the PDSM to beside it.
    columns: Lanes<i32>,
    rows: Lanes<i32>,
    /// Depths that are asked for.
    depths: [Lanes<f32>; 4],
    /// V there.
    values: [f32; FUNCTIONS],
    /// Functions that are read, in order; what is behind `count` of them is not.
    chosen: [u8; FUNCTIONS],
    count: usize,
}

impl Four {
    #[inline(always)]
    fn new(functions: &Functions, places: &Places) -> Self {
        let mut four = Self {
            weights: [[0.0; BATCH]; 2],
            columns: [0; BATCH],
            rows: [0; BATCH],
            depths: [[0.0; BATCH]; 4],
            values: [1.0; FUNCTIONS],
            chosen: [0; FUNCTIONS],
            count: 0,
        };
        let beside = functions.size() as i32;
        for k in 0..BATCH {
            let [x, y] = [places.pixel[0][k], places.pixel[1][k]];
            let is_read = places.is_read[k] & places.is_near(k);
            let (column, row) = (x.floor(), y.floor());
            let (to_x, to_y) = (x - column, y - row);
            let [dx, dy] = [places.slope[0][k], places.slope[1][k]];
            let first = places.t[k] - (dx * to_x + dy * to_y);
            four.weights[0][k] = if is_read { to_x } else { 0.0 };
            four.weights[1][k] = if is_read { to_y } else { 0.0 };
            four.depths[0][k] = first;
            four.depths[1][k] = first + dx;
            four.depths[2][k] = first + dy;
            four.depths[3][k] = first + dx + dy;
            // Clamped as floats, which saturate to no other side.
            let clamped = |value: f32| {
                if is_read { value.max(-(RIM as f32)).min(beside as f32) } else { -(RIM as f32) }
            };
            four.columns[k] = clamped(column) as i32;
            four.rows[k] = clamped(row) as i32;
        }
        four
    }

    /// Chooses the functions that start before their depth; how many places that leaves none of.
    #[inline(always)]
    fn choose(&mut self, starts: &[f32], side: usize, places: &Places) -> u64 {
        let mut of_four = [[f32::INFINITY; BATCH]; 4];
        for (k, (&row, &column)) in self.rows.iter().zip(&self.columns).enumerate() {
            let place = (row + RIM) as usize * side + (column + RIM) as usize;
            if let Some(&[a, b]) = starts.get(place..).and_then(|rest| rest.first_chunk()) {
                (of_four[0][k], of_four[1][k]) = (a, b);
            }
            if let Some(&[c, d]) = starts.get(place + side..).and_then(|rest| rest.first_chunk()) {
                (of_four[2][k], of_four[3][k]) = (c, d);
            }
        }
        let (mut begun, mut lit) = ([0u8; BATCH], 0u32);
        for k in 0..BATCH {
            let has_begun = |i: usize| u8::from(of_four[i][k] <= self.depths[i][k]) << i;
            begun[k] = has_begun(0) | has_begun(1) | has_begun(2) | has_begun(3);
            lit += u32::from((begun[k] == 0) & places.is_read[k]);
        }
        for (k, &begun) in (0u8..).zip(&begun) {
            if begun != 0 {
                for i in 0..4 {
                    self.chosen[self.count] = 4 * k + i;
                    self.count += usize::from(begun >> i & 1);
                }
            }
        }
        u64::from(lit)
    }

    /// Chooses all functions of what is read.
    #[inline(always)]
    fn choose_all(&mut self, places: &Places) -> u64 {
        for k in (0..BATCH).filter(|&k| places.is_read[k]) {
            for i in 0..4 {
                self.chosen[self.count] = (4 * k + i) as u8;
                self.count += 1;
            }
        }
        0
    }

    /// Finds V of those that are chosen: see [`Nodes::evaluate`].
    #[inline(always)]
    fn read<N: Copy>(
        &mut self,
        functions: &Functions,
        nodes: &[N],
        node: impl Fn(N) -> crate::nodes::Node + Copy,
    ) {
        let chosen = &self.chosen[..self.count];
        let mut ranges = [[0u32; 2]; FUNCTIONS];
        for (&number, range) in chosen.iter().zip(&mut ranges) {
            let (k, i) = (usize::from(number / 4), i32::from(number % 4));
            *range = functions.range(self.columns[k] + i % 2, self.rows[k] + i / 2);
        }
        let mut groups = [0u32; FUNCTIONS];
        for ((&number, &range), group) in chosen.iter().zip(&ranges).zip(&mut groups) {
            if range[0] < range[1] {
                *group = functions
                    .guide()
                    .group(range, self.depths[usize::from(number % 4)][usize::from(number / 4)])
                    as u32;
            }
        }
        for ((&number, &range), &group) in chosen.iter().zip(&ranges).zip(&groups) {
            if range[0] < range[1] {
                let t = self.depths[usize::from(number % 4)][usize::from(number / 4)];
                self.values[usize::from(number)] = evaluate_in(nodes, group as usize, range, t, node);
            }
        }
    }

    /// V of each place from that of its functions.
    #[inline(always)]
    fn weigh(&self, found: &mut Lanes<f32>) {
        for ((k, found), &[a, b, c, d]) in found.iter_mut().enumerate().zip(self.values.as_chunks::<4>().0) {
            let [x, y] = [self.weights[0][k], self.weights[1][k]];
            let (top, bottom) = (a + (b - a) * x, c + (d - c) * x);
            *found = top + (bottom - top) * y;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;
    use proptest::prelude::*;

    use super::*;
    use crate::nodes::Node;

    /// V of a request, one function after the other.
    fn apart(functions: &Functions, (pixel, t, slope): (Vec2, f32, Vec2)) -> f32 {
        if pixel.is_nan() || pixel.abs().max_element() >= 1e6 {
            return 1.0;
        }
        let low = pixel.floor();
        let weight = pixel - low;
        let first = t - slope.dot(weight);
        let at = |x: i32, y: i32, t| functions.visibility(low.x as i32 + x, low.y as i32 + y, t);
        let (a, b) = (at(0, 0, first), at(1, 0, first + slope.x));
        let (c, d) = (at(0, 1, first + slope.y), at(1, 1, first + slope.x + slope.y));
        let (top, bottom) = (a + (b - a) * weight.x, c + (d - c) * weight.x);
        top + (bottom - top) * weight.y
    }

    fn depth() -> impl Strategy<Value = f32> {
        prop_oneof![
            4 => (-10i32..10).prop_map(|t| t as f32),
            4 => -10.0f32..10.0,
            1 => Just(f32::NAN),
            1 => Just(f32::INFINITY),
        ]
    }

    proptest! {
        /// Side by side is one after the other, bit for bit: before, between, at and behind nodes, beside the PDSM, in functions
        /// without nodes, and for what is no number.
        #[test]
        fn side_by_side_is_one_after_the_other(
            functions in prop::collection::vec(prop::collection::vec((-8i32..8, -0.1f32..1.1), 0..400), 9),
            requests in prop::collection::vec((-2.0f32..4.0, -2.0f32..4.0, depth(), -1.0f32..1.0, -1.0f32..1.0), 0..=BATCH),
            far in prop_oneof![Just(f32::NAN), Just(f32::INFINITY), Just(-1e7f32)],
        ) {
            let (mut nodes, mut index) = (Vec::new(), vec![0]);
            for mut function in functions {
                function.sort_by_key(|node| node.0);
                nodes.extend(function.iter().map(|&(t, visibility)| Node { t: t as f32, visibility }));
                index.push(nodes.len() as u32);
            }
            let mut requests: Vec<_> = requests
                .iter()
                .map(|&(x, y, t, dx, dy)| (Vec2::new(x, y), t, Vec2::new(dx, dy)))
                .collect();
            if let Some(request) = requests.last_mut() {
                request.0.x = far;
            }
            for nodes in [Nodes::packed(&nodes), Nodes::Full(nodes)] {
                let functions = Functions::from_parts(3, index.clone(), nodes, Default::default()).expect("ascending nodes");
                for skip in [true, false] {
                    let mut found = [1.0; BATCH];
                    interpolate(&functions, &Places::at(&requests), skip, &mut found);
                    for (&request, found) in requests.iter().zip(found) {
                        prop_assert_eq!(found.to_bits(), apart(&functions, request).to_bits());
                    }
                }
            }
        }
    }
}
