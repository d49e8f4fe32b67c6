//! Tiles of the light's image, and lists of what lies over each.
//!
//! What is sorted may be a texel wide or as wide as the image: a grid of tiles has coarser grids above it, four times as
//! wide each, and everything goes to the finest one in which it covers few tiles. So memory is bounded by a number of
//! entries a thing, whatever the light's size and the map's.

use glam::Vec2;
use rayon::prelude::*;

use crate::light_image::Bounds;

/// Things a task.
const CHUNK: usize = 1024;

/// Texels a side of a tile of the finest grid, at least; and tiles a side of the map, at most.
const TILE: u32 = 8;
const MOST_TILES: u32 = 128;

/// Tiles a side that a splat may cover before it goes to the next grid; and a face.
const MOST: u32 = 6;
const MOST_FACE: u32 = 4;

/// Where faces are few they may cover more, up to so many tiles a side and so many entries of all faces together.
const MOST_OF_FEW: u32 = 16;
const ENTRIES: usize = 1 << 22;

/// Grids at most: a map has at most 2¹⁴ texels a side.
const MOST_LEVELS: usize = 8;

/// Each grid's tiles are this many times as wide as those of the one below, as a power of two.
pub(crate) const RATIO: u32 = 2;

/// A range of tiles of one grid, inclusive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Range {
    pub(crate) level: u32,
    pub(crate) first: [u32; 2],
    pub(crate) last: [u32; 2],
}

impl Range {
    /// How many tiles of the finest grid it lies over, those beside the border counted, too.
    pub(crate) fn finest_tiles(&self) -> u32 {
        let [columns, rows] = [0, 1].map(|axis| self.last[axis] - self.first[axis] + 1);
        (columns * rows) << (2 * RATIO * self.level)
    }
}

/// The grids' geometry: receivers beside the map count, too, as far as its own width; those beyond go to the border tiles.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Texels of the map.
    size: u32,
    /// Texels beside the map on each side.
    margin: u32,
    /// Texels a side of a tile of the finest grid.
    tile: u32,
    /// Tiles a side of the finest grid.
    tiles: u32,
    /// Grids.
    levels: u32,
    /// Tiles a side that something may cover before it goes to the next grid.
    most: u32,
    /// Where the tiles of each grid begin among all grids' tiles, and where the last one's end.
    starts: [u32; MOST_LEVELS + 1],
}

impl Grid {
    /// Of splats in maps of `size` texels; `lone` if receivers beside it belong to it.
    pub fn new(size: u32, lone: bool) -> Self {
        let margin = if lone { size } else { 0 };
        let tile = TILE.max(size.div_ceil(MOST_TILES));
        let tiles = (size + 2 * margin).div_ceil(tile).max(1);
        Self {
            size,
            margin,
            tile,
            tiles,
            levels: levels(tiles, MOST),
            most: MOST,
            starts: [0; MOST_LEVELS + 1],
        }
        .started()
    }

    /// Of so many faces in maps of `size` texels: the finest tiles are texels.
    pub fn of_texels(size: u32, faces: usize) -> Self {
        let each = u32::try_from((ENTRIES / faces.max(1)).isqrt()).unwrap_or(MOST_OF_FEW);
        let most = each.clamp(MOST_FACE, MOST_OF_FEW);
        let levels = levels(size, most);
        Self { size, margin: 0, tile: 1, tiles: size, levels, most, starts: [0; MOST_LEVELS + 1] }.started()
    }

    /// `side` tiles a side, and none above.
    pub fn alone(side: u32) -> Self {
        let most = side;
        Self { size: side, margin: 0, tile: 1, tiles: side, levels: 1, most, starts: [0; MOST_LEVELS + 1] }
            .started()
    }

    fn started(mut self) -> Self {
        for level in 0..self.levels {
            let tiles = self.tiles_at(level) * self.tiles_at(level);
            self.starts[level as usize + 1] = self.starts[level as usize] + tiles;
        }
        self
    }

    /// Tiles of the finest grid.
    pub fn count(&self) -> usize {
        self.tiles as usize * self.tiles as usize
    }

    /// Tiles of all grids.
    pub fn count_all(&self) -> usize {
        self.first_of(self.levels)
    }

    /// Grids, each coarser than the one before.
    pub fn levels(&self) -> u32 {
        self.levels
    }

    pub(crate) fn tiles_at(&self, level: u32) -> u32 {
        ((self.tiles - 1) >> (RATIO * level)) + 1
    }

    /// The tiles of the finest grid, those within one tile of the grid of `level` after the other; and where each of these begins
    /// among them, and the last one ends.
    pub(crate) fn finest_by(&self, level: u32) -> (Vec<u32>, Vec<u32>) {
        let (side, width) = (self.tiles_at(level), 1 << (RATIO * level));
        let within = |at: u32| at * width..((at + 1) * width).min(self.tiles);
        let (mut order, mut starts) = (Vec::with_capacity(self.count()), vec![0]);
        for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
            for row in within(row) {
                order.extend(within(column).map(|column| row * self.tiles + column));
            }
            starts.push(order.len() as u32);
        }
        (order, starts)
    }

    /// Where the tiles of a grid begin among all grids' tiles.
    pub(crate) fn first_of(&self, level: u32) -> usize {
        self.starts[level as usize] as usize
    }

    fn cell(&self, at: f32) -> u32 {
        // NaN and what lies left of the grid saturate at 0.
        (((at + self.margin as f32) / self.tile as f32) as u32).min(self.tiles - 1)
    }

    /// The tile that a place of the image falls into; the first for a place there is none of.
    #[inline]
    pub fn tile(&self, place: Option<Vec2>) -> u32 {
        let place = place.unwrap_or(Vec2::NEG_INFINITY);
        self.cell(place.y) * self.tiles + self.cell(place.x)
    }

    pub(crate) fn range(&self, bounds: Bounds) -> Range {
        let (mut first, mut last) =
            (bounds.min.to_array().map(|at| self.cell(at)), bounds.max.to_array().map(|at| self.cell(at)));
        let mut level = 0;
        while level + 1 < self.levels && (0..2).any(|axis| last[axis] - first[axis] >= self.most) {
            level += 1;
            (first, last) = (first.map(|at| at >> RATIO), last.map(|at| at >> RATIO));
        }
        Range { level, first, last }
    }

    /// Calls `enter` with every tile that bounds go to.
    pub fn each_tile(&self, bounds: Bounds, enter: &mut dyn FnMut(u32)) {
        self.each_tile_that(bounds, |_| true, enter);
    }

    /// Of those the ones that `takes` chooses by their bounds, in texels; tiles at the border reach beyond it without end.
    pub fn each_tile_that(&self, bounds: Bounds, takes: impl Fn(Bounds) -> bool, enter: &mut dyn FnMut(u32)) {
        let range = self.range(bounds);
        let (first, side) = (self.first_of(range.level) as u32, self.tiles_at(range.level));
        for row in range.first[1]..=range.last[1] {
            for column in range.first[0]..=range.last[0] {
                let width = (self.tile << (RATIO * range.level)) as f32;
                let from = |at: u32| {
                    if at == 0 { f32::NEG_INFINITY } else { at as f32 * width - self.margin as f32 }
                };
                let to = |at: u32| if at + 1 == side { f32::INFINITY } else { from(at + 1) };
                let tile =
                    Bounds { min: Vec2::new(from(column), from(row)), max: Vec2::new(to(column), to(row)) };
                if takes(tile) {
                    enter(first + row * side + column);
                }
            }
        }
    }

    /// Columns and rows of texels that a tile of the grid of `level` lies over: the first ones and those past the last, beside
    /// the map, too.
    pub fn texels_within(&self, level: u32, tile: u32) -> [std::ops::Range<i64>; 2] {
        let side = self.tiles_at(level);
        let width = i64::from(self.tile) << (RATIO * level);
        [tile % side, tile / side].map(|at| {
            let first = i64::from(at) * width - i64::from(self.margin);
            first..first + width
        })
    }

    /// Tiles a side of the finest grid.
    pub fn tiles(&self) -> u32 {
        self.tiles
    }

    /// Texels a side of such a tile.
    pub fn texels(&self) -> u32 {
        self.tile
    }

    /// Texels beside the map that tiles lie over, on each side.
    pub fn margin(&self) -> u32 {
        self.margin
    }

    /// Texels of the map.
    pub fn size(&self) -> u32 {
        self.size
    }
}

/// Grids enough for a coarsest one of `most` tiles a side.
fn levels(tiles: u32, most: u32) -> u32 {
    1 + (32 - (tiles / most).leading_zeros()).div_ceil(RATIO)
}

/// What lies over each tile of each grid.
#[derive(Clone, Debug)]
pub struct TileLists {
    grid: Grid,
    /// What lies over tile i, over all grids, is `all[first[i]..first[i + 1]]`.
    first: Vec<u32>,
    all: Vec<u32>,
    /// Of what was to be sorted in, how much lies over no tile.
    pub left_out: u64,
}

impl TileLists {
    /// Sorts `count` things: `enter` calls its second argument with every tile that one of them lies over.
    pub fn new(grid: Grid, count: usize, enter: impl Fn(usize, &mut dyn FnMut(u32)) + Sync) -> Self {
        let parts: Vec<(Vec<[u32; 2]>, u64)> = (0..count.div_ceil(CHUNK))
            .into_par_iter()
            .map(|part| {
                let (mut entries, mut left_out) = (Vec::new(), 0);
                for thing in part * CHUNK..count.min((part + 1) * CHUNK) {
                    let before = entries.len();
                    enter(thing, &mut |tile| entries.push([tile, thing as u32]));
                    left_out += u64::from(entries.len() == before);
                }
                (entries, left_out)
            })
            .collect();
        // In order of the things within each tile, whatever the number of threads.
        let mut first = vec![0u32; grid.count_all() + 1];
        for [tile, _] in parts.iter().flat_map(|part| &part.0) {
            first[*tile as usize + 1] += 1;
        }
        let mut sum = 0;
        for count in &mut first {
            sum += *count;
            *count = sum;
        }
        let mut all = vec![0; sum as usize];
        let mut cursor = first.clone();
        for [tile, thing] in parts.iter().flat_map(|part| &part.0) {
            let at = &mut cursor[*tile as usize];
            all[*at as usize] = *thing;
            *at += 1;
        }
        Self { grid, first, all, left_out: parts.iter().map(|part| part.1).sum() }
    }

    /// What lies over a tile of the finest grid: what its own list holds and those of the tiles above it.
    #[inline]
    pub fn of(&self, tile: u32) -> impl Iterator<Item = u32> + '_ {
        let (column, row) = (tile % self.grid.tiles, tile / self.grid.tiles);
        (0..self.grid.levels).flat_map(move |level| {
            let side = self.grid.tiles_at(level);
            let shift = RATIO * level;
            let at = self.grid.first_of(level) + ((row >> shift) * side + (column >> shift)) as usize;
            self.all[self.first[at] as usize..self.first[at + 1] as usize].iter().copied()
        })
    }

    /// How much lies over all of a tile of the grid of `level` alike: what that grid and those above list for it.
    pub fn over_all_of(&self, level: u32, tile: u32) -> usize {
        let side = self.grid.tiles_at(level);
        let (column, row) = (tile % side, tile / side);
        let held = (level..self.grid.levels).map(|above| {
            let shift = RATIO * (above - level);
            let at = (row >> shift) * self.grid.tiles_at(above) + (column >> shift);
            let at = self.grid.first_of(above) + at as usize;
            (self.first[at + 1] - self.first[at]) as usize
        });
        held.sum()
    }

    /// What lies over any part of a tile of the grid of `level`; some of it more than once.
    pub fn of_all_within(&self, level: u32, tile: u32) -> impl Iterator<Item = u32> + '_ {
        let side = self.grid.tiles_at(level);
        let (column, row) = (tile % side, tile / side);
        (0..self.grid.levels).flat_map(move |at_level| {
            let side = self.grid.tiles_at(at_level);
            // Tiles of finer grids within it, or the one of a coarser grid that holds it.
            let range = |at: u32| match level.checked_sub(at_level) {
                Some(finer) => (at << (RATIO * finer))..((at + 1) << (RATIO * finer)).min(side),
                None => {
                    let held = at >> (RATIO * (at_level - level));
                    held..held + 1
                }
            };
            let columns = range(column);
            range(row).flat_map(move |row| {
                let first = self.grid.first_of(at_level) + (row * side) as usize;
                let lists = first + columns.start as usize..first + columns.end as usize;
                self.all[self.first[lists.start] as usize..self.first[lists.end] as usize].iter().copied()
            })
        })
    }

    /// How much lies over the fullest tile of the finest grid, what the tiles above it hold included.
    pub fn longest(&self) -> u32 {
        let held = |tile: usize| self.first[tile + 1] - self.first[tile];
        let mut above: Vec<u32> = vec![0];
        for level in (0..self.grid.levels).rev() {
            let (side, start) = (self.grid.tiles_at(level), self.grid.first_of(level));
            let side_above = if level + 1 < self.grid.levels { self.grid.tiles_at(level + 1) } else { 1 };
            let shift = if level + 1 < self.grid.levels { RATIO } else { u32::BITS - 1 };
            let sum = |tile: u32| {
                let (column, row) = (tile % side, tile / side);
                let over = above[((row >> shift) * side_above + (column >> shift)) as usize];
                over + held(start + tile as usize)
            };
            above = (0..side * side).map(sum).collect();
        }
        above.into_iter().max().unwrap_or(0)
    }

    /// Whether nothing lies over a tile.
    pub fn is_clear(&self, tile: u32) -> bool {
        let (column, row) = (tile % self.grid.tiles, tile / self.grid.tiles);
        (0..self.grid.levels).all(|level| {
            let shift = RATIO * level;
            let at = (row >> shift) * self.grid.tiles_at(level) + (column >> shift);
            let at = self.grid.first_of(level) + at as usize;
            self.first[at] == self.first[at + 1]
        })
    }

    /// Each entry replaced.
    #[must_use]
    pub fn map(mut self, by: impl Fn(u32) -> u32) -> Self {
        self.all.iter_mut().for_each(|entry| *entry = by(*entry));
        self
    }

    /// The grids.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Where each tile's list begins in [`all`](Self::all), the finest grid's tiles first, and where the last one ends.
    pub fn first(&self) -> &[u32] {
        &self.first
    }

    /// Entries of all tiles.
    pub fn all(&self) -> &[u32] {
        &self.all
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.first[..]) + size_of_val(&self.all[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fullest_tile_counts_what_lies_above_it() {
        let grid = Grid::of_texels(64, 1 << 20);
        let squares = [(0.0, 0.5), (0.0, 60.0), (0.2, 0.7), (50.0, 50.5)];
        let lists = TileLists::new(grid, squares.len(), |index, enter| {
            let (min, max) = squares[index];
            grid.each_tile(Bounds { min: Vec2::splat(min), max: Vec2::splat(max) }, enter);
        });
        assert_eq!(lists.longest(), 3);
        let longest = (0..64 * 64).map(|tile| lists.of(tile).count()).max();
        assert_eq!(longest, Some(3));
    }

    #[test]
    fn a_coarse_tile_has_what_its_fine_ones_have() {
        let grid = Grid::of_texels(64, 1 << 20);
        let lists = TileLists::new(grid, 200, |index, enter| {
            let at = |prime: usize| (index * prime % 64) as f32;
            let min = Vec2::new(at(7), at(23));
            grid.each_tile(Bounds { min, max: min + at(11) * 0.5 }, enter);
        });
        for level in 0..grid.levels() {
            for tile in 0..grid.tiles_at(level) * grid.tiles_at(level) {
                let (side, shift) = (grid.tiles_at(level), RATIO * level);
                let fine = (0..64 * 64).filter(|fine| {
                    (fine % 64) >> shift == tile % side && (fine / 64) >> shift == tile / side
                });
                let alike = Some(lists.over_all_of(level, tile));
                let least = fine.clone().map(|fine| lists.of(fine).count()).min();
                assert!(alike <= least && (level > 0 || alike == least), "{tile} of {level}");
                let mut expected: Vec<u32> = fine.flat_map(|fine| lists.of(fine)).collect();
                let mut found: Vec<u32> = lists.of_all_within(level, tile).collect();
                for all in [&mut expected, &mut found] {
                    all.sort_unstable();
                    all.dedup();
                }
                assert_eq!(found, expected, "{tile} of {level}");
            }
        }
    }

    #[test]
    fn a_range_holds_its_bounds_at_every_level() {
        let grid = Grid::new(1024, true);
        for (min, max) in [(0.0, 3.0), (-2000.0, 5000.0), (100.0, 180.0), (700.5, 1500.0)] {
            let bounds = Bounds { min: Vec2::splat(min), max: Vec2::splat(max) };
            let range = grid.range(bounds);
            assert!(range.last[0] - range.first[0] < MOST || range.level + 1 == grid.levels);
            for at in [min, (min + max) * 0.5, max] {
                let cell = grid.cell(at) >> (RATIO * range.level);
                assert!((range.first[0]..=range.last[0]).contains(&cell), "{at} in {range:?}");
            }
        }
        assert_eq!(grid.tile(None), 0);
    }
}
