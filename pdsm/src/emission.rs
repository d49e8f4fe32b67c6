//! Events emitted from the map's texels: the events of [`crate::walk`], bit for bit, at a cost that follows the
//! events and not the texels that rays pass.
//!
//! A texel of depth s knows by itself which ray enters the shadow inside of it: the one that passes it at t = s. It
//! lies as many crossings back as have t ≤ s, so one pixel is found without walking. Between two neighbouring texels,
//! `before` and `after` along the rays' direction, the ray that crosses at `t_j` changes sides if exactly one of
//! `s_before` < `t_j` and `s_after` ≤ `t_j` holds. With A the number of crossings at or before `s_before` and B that of those
//! before `s_after` these are the crossings A ≤ j < B, exits, or B ≤ j < A, entries: an interval again found by
//! arithmetic. Where neighbours lie between the same crossings it is empty.

use std::ops::Range;

use fearless_simd::{Level, Simd, dispatch};

use crate::crossings::{AxisCrossings, Crossings};
use crate::events::{Event, EventStrips};
use crate::grid::{DepthGrid, PixelGrid};

/// Crossings passed at the depths of one bordered row, along one axis.
#[derive(Clone, Debug, Default)]
struct Passed {
    /// With t ≤ s.
    until: Vec<u32>,
    /// With t < s.
    before: Vec<u32>,
    /// Where something is seen; elsewhere all crossings are passed.
    seen: Range<usize>,
}

impl Passed {
    /// Of a row in which nothing is seen.
    fn clear(&mut self, axis: &AxisCrossings, width: usize) {
        for counts in [&mut self.until, &mut self.before] {
            counts.clear();
            counts.resize(width, axis.t.len() as u32);
        }
        self.seen = 0..0;
    }

    fn fill(&mut self, level: Level, axis: &AxisCrossings, depths: &[f32], seen: Range<usize>) {
        for counts in [&mut self.until, &mut self.before] {
            counts[self.seen.clone()].fill(axis.t.len() as u32);
        }
        let (until, before) = (&mut self.until[seen.clone()], &mut self.before[seen.clone()]);
        let depths = &depths[seen.clone()];
        dispatch!(level, simd => fill(simd, axis, depths, until, before));
        self.seen = seen;
    }
}

#[inline(always)]
fn fill<S: Simd>(_simd: S, axis: &AxisCrossings, depths: &[f32], until: &mut [u32], before: &mut [u32]) {
    let counts = until.iter_mut().zip(before);
    for (&depth, (until, before)) in depths.iter().zip(counts) {
        [*until, *before] = axis.passed_both(depth);
    }
}

/// A crossing as events need it.
#[derive(Clone, Copy, Debug)]
struct Move {
    /// From the texel that a ray leaves by this crossing to the one it is in at t = 0.
    back: [i32; 2],
    /// t of the crossing, of an entry and of an exit.
    events: [Event; 2],
}

/// A thread's buffers, kept from map to map.
#[derive(Clone, Debug)]
pub struct EmissionScratch {
    level: Level,
    x: Passed,
    y: [Passed; 2],
    moves: [Vec<Move>; 2],
}

impl Default for EmissionScratch {
    fn default() -> Self {
        Self { level: Level::new(), x: Passed::default(), y: Default::default(), moves: Default::default() }
    }
}

/// Where events go.
struct Output<'a> {
    grid: PixelGrid,
    events: &'a mut EventStrips,
}

impl Output<'_> {
    #[inline(always)]
    fn push(&mut self, column: i32, row: i32, event: Event) {
        if let (Some(column), Some(row)) = (self.grid.pixel(column), self.grid.pixel(row)) {
            self.events.push(column, row, event);
        }
    }
}

/// Adds the events that `map` makes in all pixels of a PDSM. With `skip` rows in which nothing is, beside another such
/// row, are not looked at: no event can come of them. Returns how many.
pub fn emit_events(
    map: &DepthGrid,
    grid: PixelGrid,
    crossings: &Crossings,
    skip: bool,
    scratch: &mut EmissionScratch,
    events: &mut EventStrips,
) -> u64 {
    let Crossings { x, y } = crossings;
    let size = map.size() as i32;
    let width = map.size() as usize + 2;
    let mut skipped = 0;
    let EmissionScratch { level, x: along_x, y: [above, here], moves } = scratch;
    let moved = |count: u32, axis: &AxisCrossings| axis.offset(count);
    for (side, moves) in moves.iter_mut().enumerate() {
        let axis = if side == 0 { x } else { y };
        moves.clear();
        moves.extend(axis.t.iter().zip(&axis.others).zip(0..).map(|((&t, &other), j)| Move {
            back: if side == 0 { [moved(j, x), moved(other, y)] } else { [moved(other, x), moved(j, y)] },
            events: [Event::new(t, false), Event::new(t, true)],
        }));
    }
    let mut output = Output { grid, events };
    above.clear(y, width);
    here.clear(y, width);
    along_x.clear(x, width);
    // All of a row where nothing is left out.
    let seen = |row: i32| if skip { map.seen(row) } else { 0..width };
    above.fill(*level, y, map.bordered_row(-1), seen(-1));
    for row in 0..=size {
        let (before, now) = (seen(row - 1), seen(row));
        if before.is_empty() && now.is_empty() {
            // `above` is that of an empty row, as this one's would be.
            skipped += 1;
            continue;
        }
        let depths = map.bordered_row(row);
        here.fill(*level, y, depths, now.clone());
        if row < size && !now.is_empty() {
            along_x.fill(*level, x, depths, now.clone());
            emit_tops(&depths[now.clone()], now.start, row, crossings, [along_x, here], &mut output);
            // Neighbours of what is seen, too.
            let left = now.start.saturating_sub(1)..now.end.min(width - 1);
            emit_borders_x(along_x, left, row, crossings, &moves[0], &mut output);
        }
        let either = match (before.is_empty(), now.is_empty()) {
            (true, _) => now,
            (_, true) => before,
            _ => before.start.min(now.start)..before.end.max(now.end),
        };
        emit_borders_y([above, here], either, row, crossings, &moves[1], &mut output);
        std::mem::swap(above, here);
    }
    skipped
}

/// Entries inside a texel, at its own depth. A depth that lies on a crossing is the border's affair.
#[inline(always)]
fn emit_tops(
    depths: &[f32],
    start: usize,
    row: i32,
    crossings: &Crossings,
    [x, y]: [&Passed; 2],
    output: &mut Output<'_>,
) {
    let seen = start..start + depths.len();
    let along_x = x.until[seen.clone()].iter().zip(&x.before[seen.clone()]);
    let along_y = y.until[seen.clone()].iter().zip(&y.before[seen]);
    let columns = start as i32 - 1..;
    for (((&depth, (&until_x, &before_x)), (&until_y, &before_y)), column) in
        depths.iter().zip(along_x).zip(along_y).zip(columns)
    {
        if depth < f32::INFINITY && until_x == before_x && until_y == before_y {
            let [dx, dy] = [crossings.x.offset(until_x), crossings.y.offset(until_y)];
            output.push(column - dx, row - dy, Event::new(depth, false));
        }
    }
}

/// Changes where rays pass from column to column, for these places as the left ones.
#[inline(always)]
fn emit_borders_x(
    passed: &Passed,
    left: Range<usize>,
    row: i32,
    crossings: &Crossings,
    moves: &[Move],
    output: &mut Output<'_>,
) {
    let right = left.start + 1..left.end + 1;
    let (from, to, first) = if crossings.x.sign > 0 {
        (left.clone(), right, left.start)
    } else {
        (right.clone(), left, right.start)
    };
    let pairs = passed.until[from].iter().zip(&passed.before[to]);
    for ((&a, &b), column) in pairs.zip(first as i32 - 1..) {
        emit_moves(a, b, column, row, moves, output);
    }
}

/// Changes where rays pass from row to row, between `row` − 1 and `row`, at these places.
#[inline(always)]
fn emit_borders_y(
    [above, here]: [&Passed; 2],
    places: Range<usize>,
    row: i32,
    crossings: &Crossings,
    moves: &[Move],
    output: &mut Output<'_>,
) {
    let (from, to, from_row) = if crossings.y.sign > 0 { (above, here, row - 1) } else { (here, above, row) };
    let first = places.start as i32 - 1;
    let pairs = from.until[places.clone()].iter().zip(&to.before[places]);
    for ((&a, &b), column) in pairs.zip(first..) {
        emit_moves(a, b, column, from_row, moves, output);
    }
}

/// The crossings from `a` up to `b` are exits, or from `b` up to `a` entries, of rays that leave this texel.
#[inline(always)]
fn emit_moves(a: u32, b: u32, column: i32, row: i32, moves: &[Move], output: &mut Output<'_>) {
    if a == b {
        return;
    }
    let is_exit = usize::from(a < b);
    for Move { back, events } in &moves[a.min(b) as usize..a.max(b) as usize] {
        output.push(column - back[0], row - back[1], events[is_exit]);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;
    use proptest::prelude::*;

    use super::*;
    use crate::sorting::SortedStrip;
    use crate::walk::walk_events;

    fn sorted(events: &EventStrips) -> Vec<Vec<Event>> {
        let mut strip = SortedStrip::default();
        let mut pixels = Vec::new();
        for index in 0..events.strip_count() {
            let count = (events.size() * events.strip_rows(index)) as usize;
            strip.sort(count, &events.strip(index).collect::<Vec<_>>());
            pixels.extend((0..count).map(|pixel| strip.pixel(pixel).collect::<Vec<_>>()));
        }
        pixels
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

        /// Depths from a coarse ladder meet crossings exactly, and each other; others fall between.
        #[test]
        fn emission_is_the_walk(
            depths in prop::collection::vec(
                prop_oneof![Just(0.0f32), (-6i32..4).prop_map(|i| i as f32 * 0.25), -1.5f32..1.0],
                144,
            ),
            step in prop_oneof![
                (-9.0f32..9.0, -9.0f32..9.0),
                (-4i32..5, -4i32..5).prop_map(|(x, y)| (x as f32, y as f32)),
            ],
            ratio in 1u32..4,
            first_empty in 0usize..12,
            empty in 0usize..6,
        ) {
            let (size, range) = (12, [-2.0, 1.0]);
            let mut map = DepthGrid::default();
            // Some rows are empty.
            let mut depths = depths;
            depths[12 * first_empty..12 * (first_empty + empty).min(12)].fill(0.0);
            map.fill(size, &depths, |depth| if depth == 0.0 { f32::INFINITY } else { depth });
            let grid = PixelGrid { size: size / ratio, ratio };
            let crossings = Crossings::new(Vec2::new(step.0, step.1), range);
            let mut walked = EventStrips::new(grid.size);
            walk_events(&map, grid, &crossings, &mut walked);
            for skip in [false, true] {
                let (mut emitted, mut scratch) = (EventStrips::new(grid.size), EmissionScratch::default());
                emit_events(&map, grid, &crossings, skip, &mut scratch, &mut emitted);
                prop_assert_eq!(sorted(&walked), sorted(&emitted));
            }
        }
    }
}
