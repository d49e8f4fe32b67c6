//! Step 3, the distortion map: for every tile of the light's image the splats that reach it.
//!
//! The paper keeps one splat a pixel, and points under several layers of casters get the wrong one. Here a tile keeps all
//! of them; which counts is decided for each receiver by its depth. Splats may be a texel wide or the whole image: a grid
//! of tiles has coarser grids above it, four times as wide each, and a splat goes to the finest one in which it covers
//! few tiles. So memory is bounded by a number of entries an edge, whatever the light's size.
//!
//! # What is left out
//! A tile on which no receiver falls keeps nothing, nor one whose farthest receiver lies before the edge; and an edge's
//! splat is cut to the farthest receiver within its own reach. None of this changes an image.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use scene_core::light::LightHull;

use crate::light_image::{Bounds, LightImage};
use crate::splat::splat;

/// Texels a side of a tile of the finest grid, at least; and tiles a side of the map, at most.
const TILE: u32 = 8;
const MOST_TILES: u32 = 128;

/// Tiles a side that a splat may cover before it goes to the next grid.
const MOST: u32 = 6;

/// Each grid's tiles are this many times as wide as those of the one below, as a power of two.
const RATIO: u32 = 2;

/// How often a splat is cut to the receivers within its reach.
const CUTS: usize = 3;

/// A range of tiles of one grid, inclusive.
#[derive(Clone, Copy, Debug)]
struct Range {
    level: u32,
    first: [u32; 2],
    last: [u32; 2],
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
}

impl Grid {
    /// For maps of `size` texels; `lone` if receivers beside it belong to it.
    pub fn new(size: u32, lone: bool) -> Self {
        let margin = if lone { size } else { 0 };
        let tile = TILE.max(size.div_ceil(MOST_TILES));
        let tiles = (size + 2 * margin).div_ceil(tile).max(1);
        let levels = 1 + (32 - (tiles / MOST).leading_zeros()).div_ceil(RATIO);
        Self { size, margin, tile, tiles, levels }
    }

    /// Tiles of the finest grid.
    pub fn count(&self) -> usize {
        self.tiles as usize * self.tiles as usize
    }

    fn tiles_at(&self, level: u32) -> u32 {
        ((self.tiles - 1) >> (RATIO * level)) + 1
    }

    /// Where the tiles of a grid begin among all grids' tiles.
    fn first_of(&self, level: u32) -> usize {
        (0..level).map(|below| (self.tiles_at(below) as usize).pow(2)).sum()
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

    fn range(&self, bounds: Bounds) -> Range {
        let (mut first, mut last) =
            (bounds.min.to_array().map(|at| self.cell(at)), bounds.max.to_array().map(|at| self.cell(at)));
        let mut level = 0;
        while level + 1 < self.levels && (0..2).any(|axis| last[axis] - first[axis] >= MOST) {
            level += 1;
            (first, last) = (first.map(|at| at >> RATIO), last.map(|at| at >> RATIO));
        }
        Range { level, first, last }
    }

    /// Texels of the map.
    pub fn size(&self) -> u32 {
        self.size
    }
}

/// The farthest receiver of every tile of every grid.
#[derive(Debug)]
pub struct Farthest {
    grid: Grid,
    /// Order-preserving bits of distances, 0 for none.
    bits: Vec<AtomicU32>,
}

/// Bits of a float that order as the float does, none of them 0.
fn ordered(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits >> 31 == 1 { !bits | 1 } else { bits | 1 << 31 }
}

fn unordered(bits: u32) -> f32 {
    if bits == 0 {
        f32::NEG_INFINITY
    } else {
        f32::from_bits(if bits >> 31 == 1 { bits & !(1 << 31) } else { !bits })
    }
}

impl Farthest {
    /// No receivers yet.
    pub fn new(grid: Grid) -> Self {
        let all = grid.first_of(grid.levels);
        Self { grid, bits: (0..all).map(|_| AtomicU32::new(0)).collect() }
    }

    /// A receiver of a tile at a distance. The order of calls, and from which thread, does not matter.
    #[inline]
    pub fn add(&self, tile: u32, along: f32) {
        let bits = ordered(along);
        let held = &self.bits[tile as usize];
        if held.load(Ordering::Relaxed) < bits {
            held.fetch_max(bits, Ordering::Relaxed);
        }
    }

    /// Fills the coarser grids.
    pub fn finish(&self) {
        for level in 1..self.grid.levels {
            let (below, above) = (self.grid.tiles_at(level - 1), self.grid.tiles_at(level));
            let (from, to) = (self.grid.first_of(level - 1), self.grid.first_of(level));
            for row in 0..below {
                for column in 0..below {
                    let bits = self.bits[from + (row * below + column) as usize].load(Ordering::Relaxed);
                    let at = to + ((row >> RATIO) * above + (column >> RATIO)) as usize;
                    self.bits[at].fetch_max(bits, Ordering::Relaxed);
                }
            }
        }
    }

    /// With a margin for the rounding of distances, which are sums of four products: 2⁻¹⁸ is 64 half ulps.
    fn of(&self, tile: usize) -> f32 {
        let far = unordered(self.bits[tile].load(Ordering::Relaxed));
        far + far.abs() * (1.0 / 262_144.0)
    }

    /// The farthest of all.
    pub fn all(&self) -> f32 {
        (self.grid.first_of(self.grid.levels - 1)..self.bits.len())
            .map(|tile| self.of(tile))
            .fold(f32::NEG_INFINITY, f32::max)
    }

    fn within(&self, range: Range) -> f32 {
        let (first, side) = (self.grid.first_of(range.level), self.grid.tiles_at(range.level));
        let rows = range.first[1]..=range.last[1];
        rows.flat_map(|row| (range.first[0]..=range.last[0]).map(move |column| row * side + column))
            .map(|tile| self.of(first + tile as usize))
            .fold(f32::NEG_INFINITY, f32::max)
    }
}

/// The splats of one view.
#[derive(Debug)]
pub struct DistortionMap {
    grid: Grid,
    /// Splats of tile i, over all grids, are `splats[first[i]..first[i + 1]]`.
    first: Vec<u32>,
    splats: Vec<u32>,
    /// Edges that reach no receiver.
    pub left_out: u64,
}

impl DistortionMap {
    /// Splats `edges` over the receivers of `farthest`. Without `skip` every tile is taken to have receivers as far as the
    /// farthest of all. `reach` may say to which distance an edge's splat goes, whatever the receivers.
    pub fn new(
        image: &LightImage,
        edges: &(impl Fn(usize) -> [Vec3; 2] + Sync),
        reach: &(impl Fn(usize) -> Option<f32> + Sync),
        count: usize,
        hull: Option<&LightHull>,
        farthest: &Farthest,
        skip: bool,
    ) -> Self {
        let grid = farthest.grid;
        let far = farthest.all();
        let parts: Vec<(Vec<[u32; 2]>, u64)> = (0..count.div_ceil(1024))
            .into_par_iter()
            .map(|part| {
                let (mut entries, mut left_out) = (Vec::new(), 0);
                for edge in part * 1024..count.min((part + 1) * 1024) {
                    let before = entries.len();
                    splat_edge(image, edges(edge), hull, farthest, reach(edge).ok_or(far), skip, |tile| {
                        entries.push([tile, edge as u32]);
                    });
                    left_out += u64::from(entries.len() == before);
                }
                (entries, left_out)
            })
            .collect();
        // In order of edges within each tile, whatever the number of threads.
        let tiles = grid.first_of(grid.levels);
        let mut first = vec![0u32; tiles + 1];
        for [tile, _] in parts.iter().flat_map(|part| &part.0) {
            first[*tile as usize + 1] += 1;
        }
        let mut sum = 0;
        for count in &mut first {
            sum += *count;
            *count = sum;
        }
        let mut splats = vec![0; sum as usize];
        let mut cursor = first.clone();
        for [tile, edge] in parts.iter().flat_map(|part| &part.0) {
            let at = &mut cursor[*tile as usize];
            splats[*at as usize] = *edge;
            *at += 1;
        }
        Self { grid, first, splats, left_out: parts.iter().map(|part| part.1).sum() }
    }

    /// The splats that reach a tile of the finest grid: those of its own and of the tiles above it.
    pub fn of(&self, tile: u32) -> impl Iterator<Item = u32> + '_ {
        let (column, row) = (tile % self.grid.tiles, tile / self.grid.tiles);
        (0..self.grid.levels).flat_map(move |level| {
            let side = self.grid.tiles_at(level);
            let shift = RATIO * level;
            let at = self.grid.first_of(level) + ((row >> shift) * side + (column >> shift)) as usize;
            self.splats[self.first[at] as usize..self.first[at + 1] as usize].iter().copied()
        })
    }

    /// Whether no splat reaches a tile.
    pub fn is_clear(&self, tile: u32) -> bool {
        self.of(tile).next().is_none()
    }

    /// Entries of all grids.
    pub fn len(&self) -> usize {
        self.splats.len()
    }

    /// Whether there is no entry.
    pub fn is_empty(&self) -> bool {
        self.splats.is_empty()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.first[..]) + size_of_val(&self.splats[..])
    }
}

fn splat_edge(
    image: &LightImage,
    ends: [Vec3; 2],
    hull: Option<&LightHull>,
    farthest: &Farthest,
    far: Result<f32, f32>,
    skip: bool,
    mut entry: impl FnMut(u32),
) {
    let grid = &farthest.grid;
    let (Ok(mut reach) | Err(mut reach)) = far;
    let Some(bounds) = splat(image, ends, hull, reach) else { return };
    let mut range = grid.range(bounds);
    if skip && far.is_err() {
        for _ in 0..CUTS {
            let within = farthest.within(range);
            if within >= reach {
                break;
            }
            reach = within;
            let Some(bounds) = splat(image, ends, hull, reach) else { return };
            range = grid.range(bounds);
        }
    }
    let nearest = image.along(ends[0]).min(image.along(ends[1]));
    let (first, side) = (grid.first_of(range.level), grid.tiles_at(range.level));
    for row in range.first[1]..=range.last[1] {
        for column in range.first[0]..=range.last[0] {
            let tile = first + (row * side + column) as usize;
            if !skip || farthest.of(tile) > nearest {
                entry(tile as u32);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_order_as_their_bits() {
        let values = [f32::NEG_INFINITY, -2.0, -1e-30, 0.0, 1e-30, 0.5, 7.0, f32::INFINITY];
        for pair in values.windows(2) {
            assert!(ordered(pair[0]) < ordered(pair[1]) && ordered(pair[0]) > 0);
        }
        for value in values {
            let back = unordered(ordered(value));
            assert!((back - value).abs() <= 1e-37 || back == value, "{value} came back as {back}");
        }
        assert_eq!(unordered(0), f32::NEG_INFINITY);
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
