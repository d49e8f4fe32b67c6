//! Where in the data array the nodes around a depth are: two reads instead of a binary search through memory.
//!
//! The array of figure 6 keeps t and V side by side, so that a search in it takes a cache line at each step. The guide holds
//! t of every [`GROUP`]th node, side by side: how many of a function's are not behind a depth is a comparison of sixteen
//! at once, and so is the rest within the group that they lead to. It also holds the t at which each function starts, as an
//! image: what lies before the starts of all functions that it is read from is lit, and nothing else is read.
//!
//! It is made from index and nodes and is no part of a file.

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

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Guide {
    /// t of nodes 0, 8, 16 …, then [`AT_ONCE`] that belong to no function.
    every: Vec<f32>,
    /// t of each function's first node, infinite without nodes, in rows of n + 2·[`RIM`]; empty if they are too many.
    starts: Vec<f32>,
}

impl Guide {
    pub(crate) fn new(size: u32, index: &[u32], nodes: &Nodes) -> Self {
        let groups = nodes.len().div_ceil(GROUP);
        let mut every = vec![0.0; groups + AT_ONCE];
        every[..groups]
            .par_iter_mut()
            .with_min_len(4096)
            .enumerate()
            .for_each(|(group, t)| *t = nodes.get(GROUP * group).t);
        let side = Self::side(size);
        let mut starts = Vec::new();
        if side * side <= MOST_STARTS {
            starts.resize(side * side, f32::INFINITY);
            let (rim, size) = (RIM as usize, size as usize);
            let rows = starts.par_chunks_mut(side).skip(rim).take(size).zip(index.par_chunks(size.max(1)));
            rows.enumerate().for_each(|(row, (starts, begins))| {
                let end = |column: usize| index[row * size + column + 1];
                for (column, (start, &begin)) in starts[rim..].iter_mut().zip(begins).enumerate().take(size) {
                    if begin < end(column) {
                        *start = nodes.get(begin as usize).t;
                    }
                }
            });
        }
        Self { every, starts }
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

    /// The group that holds the last node that is not behind `t`, of a function whose nodes are `start` to `end` and are not
    /// none: if it has such a node.
    #[inline(always)]
    pub(crate) fn group(&self, [start, end]: [u32; 2], t: f32) -> usize {
        let mut entry = start.div_ceil(GROUP as u32) as usize;
        let last = ((end - 1) / GROUP as u32 + 1) as usize;
        while let Some(entries) = self.every.get(entry..).and_then(|rest| rest.first_chunk::<AT_ONCE>()) {
            let own = last.saturating_sub(entry) as u32;
            let mut count = 0;
            for (number, &of_node) in (0u32..).zip(entries) {
                count += u32::from((of_node <= t) & (number < own));
            }
            entry += count as usize;
            if (count as usize) < AT_ONCE {
                break;
            }
        }
        entry.saturating_sub(1)
    }
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
    let (low, high) =
        ((start as usize).saturating_sub(first) as u32, (end as usize).saturating_sub(first) as u32);
    let mut count = 0;
    if let Some(own) = nodes.get(first..).and_then(|rest| rest.first_chunk::<GROUP>()) {
        for (number, &own) in (0u32..).zip(own) {
            count += u32::from((node(own).t <= t) & (number >= low) & (number < high));
        }
    } else {
        // The last group of all may be short.
        for (number, &own) in (0u32..).zip(nodes.get(first..).unwrap_or_default()) {
            count += u32::from((node(own).t <= t) & (number >= low) & (number < high));
        }
    }
    first.saturating_sub(start as usize) + count as usize
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
