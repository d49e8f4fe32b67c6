//! Receivers by the tiles of the light's image that they fall into.

use std::sync::atomic::{AtomicU32, Ordering};

use gnomon_shadow_map::light_maps::Receiver;
use rayon::prelude::*;

use crate::distortion_map::Farthest;
use crate::grid::Grid;
use crate::light_image::LightImage;

/// Of what needs no tile.
const NONE: u32 = u32::MAX;

/// Receivers a task.
const CHUNK: usize = 1 << 12;

/// Receivers, each in one tile of one view.
#[derive(Debug)]
pub struct Tiles {
    /// View and tile of each receiver: tiles of the first view, then those of the next; `NONE` where V is known.
    of: Vec<u32>,
    /// The farthest receivers, a view each.
    pub farthest: Vec<Farthest>,
    per_view: u32,
    grid: Grid,
}

/// Receivers of one tile.
#[derive(Clone, Debug)]
pub struct TileReceivers {
    /// The view.
    pub view: usize,
    /// The grid that the tile is of.
    pub level: u32,
    /// The tile.
    pub tile: u32,
    /// Indices of receivers, where they begin and end among all that are sorted.
    pub range: std::ops::Range<usize>,
}

impl Tiles {
    /// `shade.receivers`: asks `site` for every receiver, keeps its V in `values` where it is known, and finds tiles for the
    /// others.
    pub fn new(
        images: &[LightImage],
        lone: bool,
        values: &mut [f32],
        site: &(impl Fn(usize) -> Result<Receiver, f32> + Sync),
    ) -> Self {
        let size = images.first().map_or(1, |image| image.size);
        let grid = Grid::new(size, lone);
        let per_view = grid.count() as u32;
        let farthest: Vec<_> = images.iter().map(|_| Farthest::new(grid)).collect();
        let mut of = vec![NONE; values.len()];
        let chunks = values.par_chunks_mut(CHUNK).zip(of.par_chunks_mut(CHUNK)).enumerate();
        chunks.for_each(|(chunk, (values, of))| {
            for (index, (value, of)) in values.iter_mut().zip(of).enumerate() {
                let receiver = match site(chunk * CHUNK + index) {
                    Ok(receiver) => receiver,
                    Err(known) => {
                        *value = known;
                        continue;
                    }
                };
                let view = if lone {
                    Some(0)
                } else {
                    images.iter().position(|image| image.view.project(receiver.point).is_some())
                };
                let Some(view) = view.filter(|&view| view < images.len()) else {
                    // No view holds it: no caster is there.
                    *value = 1.0;
                    continue;
                };
                let image = &images[view];
                let tile = grid.tile(image.place(receiver.point));
                farthest[view].add(tile, image.along(receiver.point));
                *of = view as u32 * per_view + tile;
            }
        });
        farthest.iter().for_each(Farthest::finish);
        Self { of, farthest, per_view, grid }
    }

    /// The receivers that have a tile, sorted by tiles of the grid of `level`, within one by its finest tiles, and in those in their
    /// own order. `is_cut` says of a view's tile, how many receivers it holds and how many of the finest, whether these are tiles of their
    /// own.
    pub fn sorted(
        &self,
        level: u32,
        is_cut: impl Fn(usize, u32, usize, usize) -> bool,
    ) -> (Vec<u32>, Vec<TileReceivers>) {
        let (views, tiles) = (self.farthest.len(), self.grid.tiles_at(level) * self.grid.tiles_at(level));
        let (order, starts) = self.grid.finest_by(level);
        // Of each of the finest tiles its place in this order.
        let mut places = vec![0; order.len()];
        order.iter().zip(0..).for_each(|(&tile, place)| places[tile as usize] = place);
        let place = |of: u32| of / self.per_view * self.per_view + places[(of % self.per_view) as usize];
        let counts: Vec<AtomicU32> =
            (0..=views * self.per_view as usize).map(|_| AtomicU32::new(0)).collect();
        self.of.par_iter().filter(|&&of| of != NONE).for_each(|&of| {
            counts[place(of) as usize + 1].fetch_add(1, Ordering::Relaxed);
        });
        let mut first: Vec<u32> = counts.into_iter().map(AtomicU32::into_inner).collect();
        let mut sum = 0;
        for count in &mut first {
            sum += *count;
            *count = sum;
        }
        let range = |from: u32, to: u32| first[from as usize] as usize..first[to as usize] as usize;
        let mut ranges = Vec::new();
        for view in 0..views {
            let base = view as u32 * self.per_view;
            for tile in 0..tiles {
                let [from, to] = [0, 1].map(|end| starts[(tile + end) as usize]);
                let held = range(base + from, base + to);
                if !held.is_empty() && is_cut(view, tile, held.len(), (to - from) as usize) {
                    let finest = (from..to).map(|at| TileReceivers {
                        view,
                        level: 0,
                        tile: order[at as usize],
                        range: range(base + at, base + at + 1),
                    });
                    ranges.extend(finest.filter(|tile| !tile.range.is_empty()));
                } else if !held.is_empty() {
                    ranges.push(TileReceivers { view, level, tile, range: held });
                }
            }
        }
        let mut sorted = vec![0; sum as usize];
        for (&of, index) in self.of.iter().zip(0..) {
            if of != NONE {
                let at = &mut first[place(of) as usize];
                sorted[*at as usize] = index;
                *at += 1;
            }
        }
        (sorted, ranges)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::RATIO;

    /// Every receiver is in one range, of a tile that holds its own; full tiles are told apart, others are not.
    #[test]
    fn full_tiles_are_told_apart() {
        let grid = Grid::new(64, true);
        let (side, per_view) = (grid.tiles(), grid.count() as u32);
        // A receiver on each of the finest tiles, and twenty more on each of the last row's.
        let last_row = per_view - side..per_view;
        let of: Vec<u32> =
            (0..per_view).chain((0..20).flat_map(|_| last_row.clone())).chain([NONE]).collect();
        let tiles = Tiles { of, farthest: vec![Farthest::new(grid)], per_view, grid };
        let (sorted, ranges) = tiles.sorted(1, |_, _, receivers, finest| receivers > 3 * finest);
        let mut found = sorted.clone();
        found.sort_unstable();
        assert!(found.into_iter().eq(0..tiles.of.len() as u32 - 1));
        let mut next = 0;
        for TileReceivers { view, level, tile, range } in ranges {
            assert_eq!((view, range.start), (0, next));
            next = range.end;
            let side_of_level = grid.tiles_at(level);
            let shift = RATIO * level;
            for &receiver in &sorted[range] {
                let at = tiles.of[receiver as usize];
                let (column, row) = (at % side, at / side);
                assert_eq!((row >> shift) * side_of_level + (column >> shift), tile);
                let is_full = row >> RATIO == (side - 1) >> RATIO;
                assert_eq!(level, u32::from(!is_full));
            }
        }
        assert_eq!(next, sorted.len());
    }
}
