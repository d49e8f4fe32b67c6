//! Where in the data array the nodes around a depth are: two reads instead of a binary search through memory.
//!
//! The array of figure 6 keeps t and V side by side, so that a search in it takes a cache line at each step. The guide holds
//! t of every [`GROUP`]th node, side by side: how many of a function's are not behind a depth is a comparison of sixteen
//! at once, and so is the rest within the group that they lead to. It also holds the t at which each function starts, as an
//! image: what lies before the starts of all functions that it is read from is lit, and nothing else is read.
//!
//! It is made from index and nodes and is no part of a file.

use std::hint::black_box;

use rayon::prelude::*;

use crate::nodes::{Node, Nodes};

/// Nodes a group: as many as fill a cache line.
pub(crate) const GROUP: usize = 8;

/// Entries that are compared at once.
const AT_ONCE: usize = 16;

/// Pixels beside the PDSM, on each side, that have a start: whatever a square of four pixels reads that touches it.
pub(crate) const RIM: i32 = 2;

/// Most pixels whose functions' starts are kept, 16 MiB: the last cache holds no more, and without it they take as long
/// to read as what they save.
const MOST_STARTS: usize = 1 << 22;

/// Rows of functions a task, where a guide is made of all of them at once.
const ROWS: u32 = 16;

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Guide {
    /// t of nodes 0, 8, 16 …, then [`AT_ONCE`] that belong to no function.
    every: Vec<f32>,
    /// t of each function's first node, infinite without nodes, in rows of n + 2·[`RIM`]; empty if they are too many.
    starts: Vec<f32>,
}

/// What a guide holds of some rows of functions.
pub(crate) struct Part<'a> {
    every: &'a mut [f32],
    /// Whole rows, with their rims; none where starts are not kept.
    starts: &'a mut [f32],
    /// Where nodes of these functions start, and their end.
    index: &'a [u32],
    size: u32,
}

impl Part<'_> {
    /// `node` yields the nodes of these functions, counted from the first of them.
    pub(crate) fn fill(self, node: impl Fn(usize) -> Node) {
        let size = self.size as usize;
        let Some(&first) = self.index.first() else { return };
        let own = first.div_ceil(GROUP as u32) as usize;
        for (group, t) in (own..).zip(self.every) {
            *t = node(GROUP * group - first as usize).t;
        }
        let rows = self.index.windows(size + 1).step_by(size.max(1));
        for (starts, index) in self.starts.chunks_mut(Guide::side(self.size)).zip(rows) {
            for (start, range) in starts[RIM as usize..].iter_mut().zip(index.windows(2)) {
                if range[0] < range[1] {
                    *start = node((range[0] - first) as usize).t;
                }
            }
        }
    }
}

impl Guide {
    pub(crate) fn new(size: u32, index: &[u32], nodes: &Nodes) -> Self {
        let mut guide = Self::with_room(size, nodes.len());
        guide.parts(size, ROWS, index).into_par_iter().for_each(|part| {
            let first = part.index[0] as usize;
            part.fill(|node| nodes.get(first + node));
        });
        guide
    }

    /// With nothing in it yet.
    pub(crate) fn with_room(size: u32, nodes: usize) -> Self {
        let side = Self::side(size);
        let starts = if side * side <= MOST_STARTS { vec![f32::INFINITY; side * side] } else { Vec::new() };
        Self { every: vec![0.0; nodes.div_ceil(GROUP) + AT_ONCE], starts }
    }

    /// What there is to fill, `rows` rows of functions each.
    pub(crate) fn parts<'a>(&'a mut self, size: u32, rows: u32, index: &'a [u32]) -> Vec<Part<'a>> {
        let side = Self::side(size);
        let mut every = self.every.as_mut_slice();
        let mut starts = self.starts.get_mut(RIM as usize * side..).unwrap_or_default();
        let part = |first: u32| {
            let rows = rows.max(1).min(size - first) as usize;
            let place = first as usize * size as usize;
            let index = &index[place..=place + rows * size as usize];
            let groups = |node: u32| node.div_ceil(GROUP as u32) as usize;
            let here = groups(index[index.len() - 1]) - groups(index[0]);
            let (own, rest) = std::mem::take(&mut every).split_at_mut(here);
            every = rest;
            let wide = (rows * side).min(starts.len());
            let (own_starts, rest) = std::mem::take(&mut starts).split_at_mut(wide);
            starts = rest;
            Part { every: own, starts: own_starts, index, size }
        };
        (0..size).step_by(rows.max(1) as usize).map(part).collect()
    }

    /// Pixels a row of the starts.
    #[inline(always)]
    pub(crate) fn side(size: u32) -> usize {
        size as usize + 2 * RIM as usize
    }

    /// The starts, if they are kept.
    #[inline(always)]
    pub(crate) fn starts(&self) -> Option<&[f32]> {
        (!self.starts.is_empty()).then_some(self.starts.as_slice())
    }

    pub(crate) fn bytes(&self) -> u64 {
        (size_of_val(self.every.as_slice()) + size_of_val(self.starts.as_slice())) as u64
    }

    /// See [`fetch`]: what [`group`](Self::group) reads first.
    #[inline(always)]
    pub(crate) fn fetch(&self, [start, _]: [u32; 2]) {
        fetch(&self.every, start.div_ceil(GROUP as u32) as usize, AT_ONCE);
    }

    /// The group that holds the last node that is not behind `t`, of a function whose nodes are `start` to `end` and are not
    /// none: if it has such a node.
    #[inline(always)]
    pub(crate) fn group(&self, [start, end]: [u32; 2], t: f32) -> usize {
        let mut entry = start.div_ceil(GROUP as u32) as usize;
        let last = ((end - 1) / GROUP as u32 + 1) as usize;
        while let Some(entries) = self.every.get(entry..).and_then(|rest| rest.first_chunk::<AT_ONCE>()) {
            let mut passed = 0;
            for (number, &of_node) in entries.iter().enumerate() {
                passed |= u32::from(of_node <= t) << number;
            }
            let own = passed & first_bits(last.saturating_sub(entry));
            let count = own.count_ones() as usize;
            entry += count;
            if count < AT_ONCE {
                break;
            }
        }
        entry.saturating_sub(1)
    }
}

/// Reads the ends of a cache line's `count` values for a later loop, as they may lie in two. A loop of nothing else waits for as many
/// reads at once as memory answers; one that goes on with what it reads fills the processor's window with a few rounds, and waits
/// for those alone.
#[inline(always)]
pub(crate) fn fetch<T: Copy>(values: &[T], first: usize, count: usize) {
    for place in [first, first + count - 1] {
        if let Some(&value) = values.get(place) {
            black_box(value);
        }
    }
}

/// As many bits from the lowest on. Comparisons are kept as bits and those of other functions masked away all at once: asked one
/// by one whether they belong here, they do not become vector instructions.
#[inline(always)]
fn first_bits(count: usize) -> u32 {
    !u32::MAX.checked_shl(count.min(32) as u32).unwrap_or(0)
}

/// How many nodes of the function `start` to `end` lie in group `group` or before it and are not behind `t`, if all of those before it are not.
#[inline(always)]
fn until<N: Copy>(
    nodes: &[N],
    group: usize,
    [start, end]: [u32; 2],
    t: f32,
    node: impl Fn(N) -> Node,
) -> usize {
    let first = GROUP * group;
    let mut passed = 0;
    if let Some(own) = nodes.get(first..).and_then(|rest| rest.first_chunk::<GROUP>()) {
        for (number, &own) in own.iter().enumerate() {
            passed |= u32::from(node(own).t <= t) << number;
        }
    } else {
        // The last group of all may be short.
        for (number, &own) in nodes.get(first..).unwrap_or_default().iter().enumerate() {
            passed |= u32::from(node(own).t <= t) << number;
        }
    }
    let [before, until] = [start, end].map(|end| first_bits((end as usize).saturating_sub(first)));
    first.saturating_sub(start as usize) + (passed & until & !before).count_ones() as usize
}

/// V at `t` of the function whose nodes are `range`, which are not none, if `group` is [`Guide::group`] of it.
#[inline(always)]
pub(crate) fn evaluate_in<N: Copy>(
    nodes: &[N],
    group: usize,
    range: [u32; 2],
    t: f32,
    node: impl Fn(N) -> Node + Copy,
) -> f32 {
    let [start, end] = range.map(|place| place as usize);
    let Some(before) = until(nodes, group, range, t, node).checked_sub(1) else { return 1.0 };
    let place = start + before;
    let a = node(nodes[place]);
    // Behind the last node, and without a branch that would be guessed wrong.
    let b = node(nodes[(place + 1).min(end - 1)]);
    let share = if place + 1 < end { (t - a.t) / (b.t - a.t) } else { 0.0 };
    (a.visibility + (b.visibility - a.visibility) * share).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// However many rows its parts have, it holds t of every eighth node and of each function's first.
        #[test]
        fn parts_are_the_whole(counts in prop::collection::vec(0u32..40, 25), rows in 1u32..7) {
            let mut index = vec![0];
            index.extend(counts.iter().scan(0, |sum, count| { *sum += count; Some(*sum) }));
            let nodes: Vec<_> = (0..index[25]).map(|t| Node { t: t as f32, visibility: 1.0 }).collect();
            let mut guide = Guide::with_room(5, nodes.len());
            for part in guide.parts(5, rows, &index) {
                let first = part.index[0] as usize;
                part.fill(|node| nodes[first + node]);
            }
            for (group, nodes) in nodes.chunks(GROUP).enumerate() {
                prop_assert_eq!(guide.every[group], nodes[0].t);
            }
            for (place, &start) in guide.starts.iter().enumerate() {
                let (x, y) = ((place % 9) as i32 - RIM, (place / 9) as i32 - RIM);
                let is_inside = (0..5).contains(&x) && (0..5).contains(&y);
                let pixel = if is_inside { (5 * y + x) as usize } else { 0 };
                let has_nodes = is_inside && counts[pixel] > 0;
                prop_assert_eq!(start, if has_nodes { index[pixel] as f32 } else { f32::INFINITY });
            }
            prop_assert_eq!(guide, Guide::new(5, &index, &Nodes::Full(nodes)));
        }
    }
}
