//! V of a batch, from the nearest function of each or interpolated between four.

use super::places::Places;
use super::{BATCH, Lanes};
use crate::functions::Functions;
use crate::guide::{GROUP, Guide, RIM, evaluate_in, fetch};
use crate::nodes::{Node, Nodes};

/// V of those places that are read, interpolated between four functions, 1 of the others; how many lie before the start of
/// all their functions, if `skip` lets these be left out.
#[inline(always)]
pub(super) fn interpolate(functions: &Functions, places: &Places, skip: bool, found: &mut Lanes<f32>) -> u64 {
    let (mut reads, weights) = Reads::around(functions, places);
    let lit = reads.evaluate(functions, places, skip);
    if reads.count > 0 {
        for ((k, found), &[a, b, c, d]) in found.iter_mut().enumerate().zip(&reads.values) {
            let [x, y] = [weights[0][k], weights[1][k]];
            let (top, bottom) = (a + (b - a) * x, c + (d - c) * x);
            *found = top + (bottom - top) * y;
        }
    }
    lit
}

/// The same of the nearest function.
#[inline(always)]
pub(super) fn nearest(functions: &Functions, places: &Places, skip: bool, found: &mut Lanes<f32>) -> u64 {
    let mut reads = Reads::at(functions, places);
    let lit = reads.evaluate(functions, places, skip);
    for (found, &[value]) in found.iter_mut().zip(&reads.values) {
        *found = value;
    }
    lit
}

/// `N` functions for each of a batch, one or a square of four, and which of them are read.
struct Reads<const N: usize> {
    /// Column and row of the first pixel, from beside the PDSM to beside it.
    columns: Lanes<i32>,
    rows: Lanes<i32>,
    /// Depths that are asked for.
    depths: [Lanes<f32>; N],
    /// V there.
    values: [[f32; N]; BATCH],
    /// Functions that are read, in order, numbered N·receiver + function; what is behind `count` of them is not.
    chosen: [[u8; N]; BATCH],
    count: usize,
}

impl Reads<4> {
    /// The square of four pixels that a place lies in, and how far it lies from the first of them.
    #[inline(always)]
    fn around(functions: &Functions, places: &Places) -> (Self, [Lanes<f32>; 2]) {
        let mut reads = Self::new();
        let (mut right, mut down) = ([0.0; BATCH], [0.0; BATCH]);
        for k in 0..BATCH {
            let [x, y] = [places.pixel[0][k], places.pixel[1][k]];
            let is_read = places.is_read[k] & places.is_near(k);
            let (column, row) = (x.floor(), y.floor());
            let (to_x, to_y) = (x - column, y - row);
            let [dx, dy] = [places.slope[0][k], places.slope[1][k]];
            let first = places.t[k] - (dx * to_x + dy * to_y);
            right[k] = if is_read { to_x } else { 0.0 };
            down[k] = if is_read { to_y } else { 0.0 };
            reads.depths[0][k] = first;
            reads.depths[1][k] = first + dx;
            reads.depths[2][k] = first + dy;
            reads.depths[3][k] = first + dx + dy;
            reads.columns[k] = beside(column, is_read, functions);
            reads.rows[k] = beside(row, is_read, functions);
        }
        (reads, [right, down])
    }
}

impl Reads<1> {
    /// The pixel that is nearest to a place.
    #[inline(always)]
    fn at(functions: &Functions, places: &Places) -> Self {
        let mut reads = Self::new();
        for k in 0..BATCH {
            let [x, y] = [places.pixel[0][k], places.pixel[1][k]];
            let is_read = places.is_read[k] & places.is_near(k);
            let (column, row) = (x.round(), y.round());
            let [dx, dy] = [places.slope[0][k], places.slope[1][k]];
            reads.depths[0][k] = places.t[k] + (dx * (column - x) + dy * (row - y));
            reads.columns[k] = beside(column, is_read, functions);
            reads.rows[k] = beside(row, is_read, functions);
        }
        reads
    }
}

/// A column or row as a number no farther than beside the PDSM: far beside it, where it is not read.
#[inline(always)]
fn beside(place: f32, is_read: bool, functions: &Functions) -> i32 {
    let (low, high) = (-(RIM as f32), functions.size() as f32);
    whole(if is_read { place.max(low).min(high) } else { low })
}

/// 1.5 · 2²³: floats from 2²³ to 2²⁴ are whole numbers, and count up with their bits.
const WHOLE: f32 = 12_582_912.0;

/// A whole number of less than 2²² as an integer. A conversion that saturates is not done side by side.
#[inline(always)]
fn whole(number: f32) -> i32 {
    (number + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits()) as i32
}

impl<const N: usize> Reads<N> {
    /// Columns and rows of functions from the first.
    const COLUMNS: usize = if N == 1 { 1 } else { 2 };
    const ROWS: usize = N / Self::COLUMNS;

    #[inline(always)]
    fn new() -> Self {
        Self {
            columns: [0; BATCH],
            rows: [0; BATCH],
            depths: [[0.0; BATCH]; N],
            values: [[1.0; N]; BATCH],
            chosen: [[0; N]; BATCH],
            count: 0,
        }
    }

    /// Finds V of all functions that are read; how many places lie before the start of all of theirs, if `skip` lets these
    /// be left out.
    #[inline(always)]
    fn evaluate(&mut self, functions: &Functions, places: &Places, skip: bool) -> u64 {
        let starts = if skip { functions.guide().starts() } else { None };
        let lit = match starts {
            Some(starts) => self.choose(starts, Guide::side(functions.size()), places),
            None => self.choose_all(places),
        };
        if self.count > 0 {
            match functions.nodes() {
                Nodes::Full(nodes) => self.read(functions, nodes, |node| node),
                Nodes::Packed(nodes, steps) => self.read(functions, nodes, |node| steps.unpack(node)),
            }
        }
        lit
    }

    /// Chooses the functions that start before their depth; how many places that leaves none of.
    #[inline(always)]
    fn choose(&mut self, starts: &[f32], side: usize, places: &Places) -> u64 {
        let mut of_each = [[f32::INFINITY; BATCH]; N];
        for (k, (&row, &column)) in self.rows.iter().zip(&self.columns).enumerate() {
            let place = (row + RIM) as usize * side + (column + RIM) as usize;
            for row in 0..Self::ROWS {
                let first = place + row * side;
                let Some(own) = starts.get(first..first + Self::COLUMNS) else { continue };
                for (column, &start) in own.iter().enumerate() {
                    of_each[row * Self::COLUMNS + column][k] = start;
                }
            }
        }
        let (mut begun, mut lit) = ([0u8; BATCH], 0u32);
        for (i, (starts, depths)) in of_each.iter().zip(&self.depths).enumerate() {
            for ((begun, start), depth) in begun.iter_mut().zip(starts).zip(depths) {
                *begun |= u8::from(start <= depth) << i;
            }
        }
        for (&begun, &is_read) in begun.iter().zip(&places.is_read) {
            lit += u32::from((begun == 0) & is_read);
        }
        let chosen = self.chosen.as_flattened_mut();
        for (k, &begun) in begun.iter().enumerate() {
            if begun != 0 {
                for i in 0..N {
                    chosen[self.count] = (N * k + i) as u8;
                    self.count += usize::from(begun >> i & 1);
                }
            }
        }
        u64::from(lit)
    }

    /// Chooses all functions of what is read.
    #[inline(always)]
    fn choose_all(&mut self, places: &Places) -> u64 {
        let chosen = self.chosen.as_flattened_mut();
        for k in (0..BATCH).filter(|&k| places.is_read[k]) {
            for i in 0..N {
                chosen[self.count] = (N * k + i) as u8;
                self.count += 1;
            }
        }
        0
    }

    /// Finds V of those that are chosen: see [`Nodes::evaluate`].
    #[inline(always)]
    fn read<T: Copy>(&mut self, functions: &Functions, nodes: &[T], node: impl Fn(T) -> Node + Copy) {
        // A function as its receiver and its number among that one's.
        let chosen = self.chosen.as_flattened().iter().take(self.count);
        let chosen = chosen.map(|&number| (usize::from(number) / N, usize::from(number) % N));
        let (mut ranges, mut groups) = ([[[0u32; 2]; N]; BATCH], [[0u32; N]; BATCH]);
        let (ranges, groups) = (ranges.as_flattened_mut(), groups.as_flattened_mut());
        for ((k, i), range) in chosen.clone().zip(&mut *ranges) {
            *range = functions.range(self.columns[k] + (i % 2) as i32, self.rows[k] + (i / 2) as i32);
        }
        for &range in ranges.iter().take(self.count) {
            functions.guide().fetch(range);
        }
        for (((k, i), &range), group) in chosen.clone().zip(&*ranges).zip(&mut *groups) {
            if range[0] < range[1] {
                *group = functions.guide().group(range, self.depths[i][k]) as u32;
            }
        }
        for &group in groups.iter().take(self.count) {
            fetch(nodes, GROUP * group as usize, GROUP);
        }
        for (((k, i), &range), &group) in chosen.zip(&*ranges).zip(&*groups) {
            if range[0] < range[1] {
                self.values[k][i] = evaluate_in(nodes, group as usize, range, self.depths[i][k], node);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;
    use proptest::prelude::*;

    use super::*;

    /// V of a request from its nearest function.
    fn nearest_apart(functions: &Functions, (pixel, t, slope): (Vec2, f32, Vec2)) -> f32 {
        if pixel.is_nan() || pixel.abs().max_element() >= 1e6 {
            return 1.0;
        }
        let at = pixel.round();
        functions.visibility(at.x as i32, at.y as i32, t + slope.dot(at - pixel))
    }

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
                    nearest(&functions, &Places::at(&requests), skip, &mut found);
                    for (&request, found) in requests.iter().zip(found) {
                        prop_assert_eq!(found.to_bits(), nearest_apart(&functions, request).to_bits());
                    }
                }
            }
        }
    }
}
