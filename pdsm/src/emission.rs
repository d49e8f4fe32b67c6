//! Events emitted from the map's texels: the events of [`crate::walk`], bit for bit, at a cost that follows the
//! events and not the texels that rays pass.
//!
//! A texel of depth s knows by itself which ray enters the shadow inside of it: the one that passes it at t = s. It
//! lies as many crossings back as have t ≤ s, so one pixel is found without walking. Between two neighbouring texels,
//! `before` and `after` along the rays' direction, the ray that crosses at `t_j` changes sides if exactly one of
//! `s_before` < `t_j` and `s_after` ≤ `t_j` holds. With A the number of crossings at or before `s_before` and B that of those
//! before `s_after` these are the crossings A ≤ j < B, exits, or B ≤ j < A, entries: an interval again found by
//! arithmetic. Where neighbours lie between the same crossings it is empty.

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
}

impl Passed {
    fn fill(&mut self, axis: &AxisCrossings, depths: &[f32]) {
        self.until.clear();
        self.before.clear();
        for &depth in depths {
            let until = axis.passed(depth);
            let is_on = until > 0 && axis.t[until as usize - 1] == depth;
            self.until.push(until);
            self.before.push(until - u32::from(is_on));
        }
    }
}

/// A thread's buffers, kept from map to map.
#[derive(Clone, Debug, Default)]
pub struct EmissionScratch {
    x: Passed,
    y: [Passed; 2],
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
    let mut skipped = 0;
    let EmissionScratch { x: along_x, y: [above, here] } = scratch;
    above.fill(y, map.bordered_row(-1));
    for row in 0..=size {
        if skip && map.is_row_empty(row - 1) && map.is_row_empty(row) {
            // `above` is that of an empty row, as this one's would be.
            skipped += 1;
            continue;
        }
        let depths = map.bordered_row(row);
        here.fill(y, depths);
        if row < size {
            along_x.fill(x, depths);
            emit_tops(depths, row, grid, crossings, [along_x, here], events);
            emit_borders_x(along_x, row, grid, crossings, events);
        }
        emit_borders_y([above, here], row, grid, crossings, events);
        std::mem::swap(above, here);
    }
    skipped
}

#[inline]
fn push(grid: PixelGrid, texel: [i32; 2], event: Event, events: &mut EventStrips) {
    if let (Some(column), Some(row)) = (grid.pixel(texel[0]), grid.pixel(texel[1])) {
        events.push(column, row, event);
    }
}

/// Entries inside a texel, at its own depth. A depth that lies on a crossing is the border's affair.
fn emit_tops(
    depths: &[f32],
    row: i32,
    grid: PixelGrid,
    crossings: &Crossings,
    [x, y]: [&Passed; 2],
    events: &mut EventStrips,
) {
    for (index, &depth) in depths.iter().enumerate() {
        let (passed_x, passed_y) = (x.until[index], y.until[index]);
        let is_inside = depth < f32::INFINITY && passed_x == x.before[index] && passed_y == y.before[index];
        if is_inside {
            let ray = [index as i32 - 1 - crossings.x.offset(passed_x), row - crossings.y.offset(passed_y)];
            push(grid, ray, Event::new(depth, false), events);
        }
    }
}

/// Changes where rays pass from column to column.
fn emit_borders_x(
    passed: &Passed,
    row: i32,
    grid: PixelGrid,
    crossings: &Crossings,
    events: &mut EventStrips,
) {
    let Crossings { x, y } = crossings;
    for left in 0..passed.until.len() - 1 {
        let (from, to) = if x.sign > 0 { (left, left + 1) } else { (left + 1, left) };
        let (a, b) = (passed.until[from], passed.before[to]);
        for j in a.min(b)..a.max(b) {
            let ray = [from as i32 - 1 - x.offset(j), row - y.offset(x.others[j as usize])];
            push(grid, ray, Event::new(x.t[j as usize], a < b), events);
        }
    }
}

/// Changes where rays pass from row to row: between `row` − 1 and `row`.
fn emit_borders_y(
    [above, here]: [&Passed; 2],
    row: i32,
    grid: PixelGrid,
    crossings: &Crossings,
    events: &mut EventStrips,
) {
    let Crossings { x, y } = crossings;
    let (from, to, from_row) = if y.sign > 0 { (above, here, row - 1) } else { (here, above, row) };
    for index in 0..from.until.len() {
        let (a, b) = (from.until[index], to.before[index]);
        for j in a.min(b)..a.max(b) {
            let ray = [index as i32 - 1 - x.offset(y.others[j as usize]), from_row - y.offset(j)];
            push(grid, ray, Event::new(y.t[j as usize], a < b), events);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;
    use proptest::prelude::*;

    use super::*;
    use crate::events::SortedStrip;
    use crate::walk::walk_events;

    fn sorted(events: &EventStrips) -> Vec<Vec<Event>> {
        let mut strip = SortedStrip::default();
        let mut pixels = Vec::new();
        for index in 0..events.strip_count() {
            let count = (events.size() * events.strip_rows(index)) as usize;
            strip.sort(count, &[events.strip(index)]);
            pixels.extend((0..count).map(|pixel| strip.pixel(pixel).to_vec()));
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
