//! The paper's way to find events (section 3.1, algorithm 1): every PDSM ray is walked through every texel of the map
//! that it crosses. O(k·m·n²); kept as what [`crate::emission`] is tested against.
//!
//! The rules of figure 4, written as one: at depth t inside a texel whose stored depth is s the ray is in shadow from
//! t ≥ s on. So an entry inside a texel has the map's depth (a), one at a texel's border the ray's (b), and an exit
//! always lies at a border (c).

use crate::crossings::Crossings;
use crate::events::{Event, EventStrips};
use crate::grid::{DepthGrid, PixelGrid};

/// Adds the events that `map` makes in all pixels of a PDSM, by the paper's walk.
pub fn walk_events(map: &DepthGrid, grid: PixelGrid, crossings: &Crossings, events: &mut EventStrips) {
    let cells: Vec<_> = crossings.cells().collect();
    for y in 0..grid.size {
        for x in 0..grid.size {
            let [column, row] = [grid.texel(x), grid.texel(y)];
            walk_ray(cells.iter().map(|&(t, [dx, dy])| (t, map.depth(column + dx, row + dy))), |event| {
                events.push(x, y, event);
            });
        }
    }
}

/// Calls `emit` for every event of a ray that passes texels of these depths, each from its own t on, ascending.
fn walk_ray(texels: impl Iterator<Item = (f32, f32)>, mut emit: impl FnMut(Event)) {
    let mut texels = texels.peekable();
    let mut previous = f32::INFINITY;
    while let Some((start, depth)) = texels.next() {
        // At the border: in shadow just before it, and from it on?
        let (was, is) = (previous < start, depth <= start);
        if was != is {
            emit(Event::new(start, was));
        }
        // Inside.
        let end = texels.peek().map_or(f32::INFINITY, |next| next.0);
        if start < depth && depth < end {
            emit(Event::new(depth, false));
        }
        previous = depth;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn events(texels: &[(f32, f32)]) -> Vec<(f32, bool)> {
        let mut events = Vec::new();
        walk_ray(texels.iter().copied(), |e| events.push((e.t(), e.is_exit())));
        events
    }

    #[test]
    fn the_rules_of_figure_4() {
        const START: f32 = f32::NEG_INFINITY;
        const NONE: f32 = f32::INFINITY;
        // (a) The surface lies inside the texel: the map's depth.
        assert_eq!(events(&[(START, 0.5)]), [(0.5, false)]);
        assert_eq!(events(&[(START, NONE), (0.25, 0.5), (0.75, 0.625)]), [(0.5, false)]);
        // (b) It lies before the ray comes in: the ray's depth.
        assert_eq!(events(&[(START, NONE), (0.25, 0.0)]), [(0.25, false)]);
        // (c) The ray leaves the shadow where it leaves the texel.
        assert_eq!(events(&[(START, 0.0), (0.25, NONE)]), [(0.0, false), (0.25, true)]);
        // A surface beyond the texel's part of the ray does nothing.
        assert_eq!(events(&[(START, 0.5), (0.25, NONE)]), []);
        // A surface exactly on a border is entered once.
        assert_eq!(events(&[(START, 0.25), (0.25, 0.25)]), [(0.25, false)]);
    }
}
