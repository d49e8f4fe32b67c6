//! Receivers by the tiles of the light's image that they fall into.

use std::sync::atomic::{AtomicU32, Ordering};

use gnomon_shadow_map::light_maps::Receiver;
use rayon::prelude::*;

use crate::distortion_map::Farthest;
use crate::grid::{Grid, RATIO};
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
    /// The tile of the grid that they are sorted by.
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

    /// The receivers that have a tile, sorted by tiles of the grid of `level`; in a tile in their own order.
    pub fn sorted(&self, level: u32) -> (Vec<u32>, Vec<TileReceivers>) {
        let (side, side_above) = (self.grid.tiles(), self.grid.tiles_at(level));
        let per_view = side_above * side_above;
        // Of each tile of the finest grid the one above it.
        let above: Vec<u32> = (0..self.farthest.len() as u32 * self.per_view)
            .map(|of| {
                let (view, tile) = (of / self.per_view, of % self.per_view);
                let [column, row] = [tile % side, tile / side].map(|at| at >> (RATIO * level));
                view * per_view + row * side_above + column
            })
            .collect();
        let tiles = self.farthest.len() * per_view as usize;
        let counts: Vec<AtomicU32> = (0..=tiles).map(|_| AtomicU32::new(0)).collect();
        let chosen = |of: u32| if of == NONE { NONE } else { above[of as usize] };
        self.of.par_iter().map(|&of| chosen(of)).filter(|&of| of != NONE).for_each(|of| {
            counts[of as usize + 1].fetch_add(1, Ordering::Relaxed);
        });
        let mut first: Vec<u32> = counts.into_iter().map(AtomicU32::into_inner).collect();
        let mut sum = 0;
        for count in &mut first {
            sum += *count;
            *count = sum;
        }
        let mut cursor = first.clone();
        let mut sorted = vec![0; sum as usize];
        for (index, &of) in self.of.iter().enumerate() {
            let of = chosen(of);
            if of != NONE {
                let at = &mut cursor[of as usize];
                sorted[*at as usize] = index as u32;
                *at += 1;
            }
        }
        let ranges = (0..tiles)
            .filter(|&tile| first[tile] < first[tile + 1])
            .map(|tile| TileReceivers {
                view: tile / per_view as usize,
                tile: tile as u32 % per_view,
                range: first[tile] as usize..first[tile + 1] as usize,
            })
            .collect();
        (sorted, ranges)
    }
}
