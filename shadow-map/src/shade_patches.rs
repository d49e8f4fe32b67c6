//! V of an image whose pixels are asked by patches: see [`patches`](crate::patches).
//!
//! A patch is as small as a tile, and a texel of a map often far larger: then tiles that see one triangle ask about the same texels.
//! So patches of some tiles in a row are asked as one first, and each alone only about what that leaves open.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;
use scene_core::GBuffer;

use crate::cpu::receiver;
use crate::light_maps::{LightMaps, Receiver};
use crate::patches::{Form, Outcome, Patch, PatchRow, Questions, TILE};
use crate::texel_outcomes::{Reads, TexelOutcomes, bits_of};

/// Tiles of a row that are asked as one first.
const GROUP: usize = 8;

/// Surfaces of a group that are told apart; patches of more are asked alone.
const MOST_SURFACES: usize = 8;

/// A lookup that texels can be asked for.
pub trait PatchLookup: Sync {
    /// Which questions are asked.
    const FORM: Form;

    /// Texels that a lookup reads before and after the receiver's place.
    fn reach(&self) -> [f64; 2];

    /// The object in a texel of a view, asked by [`Form::Ids`].
    fn object_of(&self, _view: usize, _index: usize) -> u32 {
        GBuffer::NOTHING
    }

    /// V where all texels are alike, if that is one V.
    fn constant(&self, outcome: Outcome) -> Option<f32>;

    /// Writes V, by their bits, of those `pixels` for which the table says enough.
    fn known(&self, outcomes: &TexelOutcomes, pixels: &TilePixels<'_>, values: &mut [f32; 64]) -> Known;

    /// V of any pixel. Counts what took no filter.
    fn answer(&self, outcomes: Option<&TexelOutcomes>, receiver: &Receiver, lit: &mut u64) -> f32;
}

/// Some pixels of a tile.
#[derive(Clone, Copy, Debug)]
pub struct TilePixels<'g> {
    /// What they see.
    pub gbuffer: &'g GBuffer,
    /// A bit for each, rows of [`TILE`].
    pub mask: u64,
    column: usize,
    row: usize,
}

impl TilePixels<'_> {
    /// The index of the pixel at a bit.
    #[inline]
    pub fn pixel(&self, bit: usize) -> usize {
        (self.row + bit / TILE) * self.gbuffer.width as usize + self.column + bit % TILE
    }

    /// Its column and row.
    #[inline]
    pub fn at(&self, bit: usize) -> [u32; 2] {
        [(self.column + bit % TILE) as u32, (self.row + bit / TILE) as u32]
    }

    /// Its position.
    #[inline]
    pub fn position(&self, bit: usize) -> Vec3 {
        self.gbuffer.position[self.pixel(bit)]
    }
}

/// Pixels of a tile, by their bits, that were answered by a table.
#[derive(Clone, Copy, Debug, Default)]
pub struct Known {
    /// Those with a V.
    pub answered: u64,
    /// Those of them that a stored plane had to be asked for.
    pub asked: u64,
}

/// Patches of a group of tiles that are of one triangle, as one.
#[derive(Debug, Default)]
struct Surfaces {
    patches: Vec<(Patch, usize)>,
    tables: Vec<TexelOutcomes>,
    filled: [bool; MOST_SURFACES],
}

impl Surfaces {
    /// Joins the patches, and fills a table for each surface that several are of, if it is not larger than theirs.
    fn find<L: PatchLookup>(&mut self, maps: &LightMaps<'_>, lookup: &L, patches: &[Patch]) {
        self.patches.clear();
        for patch in patches {
            match self.patches.iter().rposition(|(surface, _)| surface.is_of_surface(patch)) {
                Some(index) => {
                    let (surface, count) = &mut self.patches[index];
                    (*surface, *count) = (surface.joined(patch), *count + 1);
                }
                None if self.patches.len() < MOST_SURFACES => self.patches.push((*patch, 1)),
                None => {}
            }
        }
        self.tables.resize_with(MOST_SURFACES, TexelOutcomes::default);
        let reach = lookup.reach();
        let least = (reach[0] + reach[1] + 1.0).powi(2) as usize;
        for (index, (patch, count)) in self.patches.iter().enumerate() {
            let table = &mut self.tables[index];
            let reads = Reads { form: L::FORM, reach, most: count * least, within: None };
            let object_of = |view, index| lookup.object_of(view, index);
            self.filled[index] = *count > 1
                && Questions::new(patch, &maps.light, maps.tolerance)
                    .is_some_and(|mut questions| table.fill(maps, patch, &mut questions, reads, object_of));
        }
    }

    /// The table of the surface that `patch` is of.
    fn table_of(&self, patch: &Patch) -> Option<&TexelOutcomes> {
        let index = self.patches.iter().position(|(surface, _)| surface.is_of_surface(patch))?;
        self.filled[index].then(|| &self.tables[index])
    }
}

/// V of every pixel that sees a surface, NaN elsewhere, with the pixels of each patch asked together.
/// Returns how many took no filter though they were asked alone, and how many were known from tables.
pub fn shade_patches<L: PatchLookup>(
    maps: &LightMaps<'_>,
    gbuffer: &GBuffer,
    patches: &[PatchRow],
    values: &mut [f32],
    lookup: &L,
) -> [u64; 2] {
    let width = gbuffer.width.max(1) as usize;
    let tiles = width.div_ceil(TILE);
    let shade_row = |(tile_row, values): (usize, &mut [f32])| {
        let mut row = RowOfTiles {
            maps,
            gbuffer,
            lookup,
            values,
            row: tile_row * TILE,
            surfaces: Surfaces::default(),
            outcomes: TexelOutcomes::default(),
            counts: [0; 2],
        };
        for first in (0..tiles).step_by(GROUP) {
            row.shade(&patches[tile_row], first..(first + GROUP).min(tiles));
        }
        row.counts
    };
    let rows = values.par_chunks_mut(width * TILE).enumerate().map(shade_row);
    rows.reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
}

/// One row of tiles.
struct RowOfTiles<'r, L> {
    maps: &'r LightMaps<'r>,
    gbuffer: &'r GBuffer,
    lookup: &'r L,
    /// Of the row's pixels.
    values: &'r mut [f32],
    /// Its first row of pixels.
    row: usize,
    surfaces: Surfaces,
    outcomes: TexelOutcomes,
    counts: [u64; 2],
}

impl<L: PatchLookup> RowOfTiles<'_, L> {
    fn shade(&mut self, patches: &PatchRow, tiles: Range<usize>) {
        let width = self.gbuffer.width.max(1) as usize;
        let rows = self.values.len() / width;
        self.surfaces.find(self.maps, self.lookup, patches.of_tiles(tiles.clone()));
        for tile in tiles {
            let x = tile * TILE;
            let columns = TILE.min(width - x);
            let line = u64::MAX >> (64 - columns);
            let whole: u64 = (0..rows).fold(0, |bits, row| bits | line << (row * TILE));
            let mut rest = whole;
            for patch in patches.of(tile) {
                if self.shade_patch(patch, x, whole) {
                    rest &= !patch.mask;
                }
            }
            for bit in bits_of(rest) {
                self.ask(x, bit, false);
            }
        }
    }

    /// False where the patch's pixels have to be asked alone.
    fn shade_patch(&mut self, patch: &Patch, x: usize, whole: u64) -> bool {
        let lookup = self.lookup;
        let constant = |table: &TexelOutcomes| table.all().and_then(|outcome| lookup.constant(outcome));
        let table = self.surfaces.table_of(patch);
        if let Some(v) = table.and_then(constant) {
            self.fill(patch, x, whole, v);
            return true;
        }
        let Some(mut questions) = Questions::new(patch, &self.maps.light, self.maps.tolerance) else {
            return false;
        };
        let reach = lookup.reach();
        let most = patch.mask.count_ones() as usize * (reach[0] + reach[1] + 1.0).powi(2) as usize;
        let reads = Reads { form: L::FORM, reach, most, within: table };
        let object_of = |view, index| lookup.object_of(view, index);
        if !self.outcomes.fill(self.maps, patch, &mut questions, reads, object_of) {
            return false;
        }
        if let Some(v) = constant(&self.outcomes) {
            self.fill(patch, x, whole, v);
            return true;
        }
        let mut values = [0.0; 64];
        let pixels = TilePixels { gbuffer: self.gbuffer, mask: patch.mask, column: x, row: self.row };
        let known = lookup.known(&self.outcomes, &pixels, &mut values);
        let width = self.gbuffer.width.max(1) as usize;
        for bit in bits_of(known.answered) {
            self.values[bit / TILE * width + x + bit % TILE] = values[bit];
        }
        self.counts[1] += u64::from((known.answered & !known.asked).count_ones());
        for bit in bits_of(patch.mask & !known.answered) {
            self.ask(x, bit, true);
        }
        true
    }

    /// One V for all of the patch, in a tile with the pixels `whole`.
    fn fill(&mut self, patch: &Patch, x: usize, whole: u64, v: f32) {
        let width = self.gbuffer.width.max(1) as usize;
        self.counts[1] += u64::from(patch.mask.count_ones());
        if patch.mask == whole {
            let columns = TILE.min(width - x);
            self.values.chunks_mut(width).for_each(|line| line[x..x + columns].fill(v));
        } else {
            bits_of(patch.mask).for_each(|bit| self.values[bit / TILE * width + x + bit % TILE] = v);
        }
    }

    /// One pixel, by what the table says of its patch or without.
    fn ask(&mut self, x: usize, bit: usize, by_table: bool) {
        let width = self.gbuffer.width.max(1) as usize;
        let pixel = (self.row + bit / TILE) * width + x + bit % TILE;
        let outcomes = by_table.then_some(&self.outcomes);
        self.values[bit / TILE * width + x + bit % TILE] = match receiver(self.maps, self.gbuffer, pixel) {
            Ok(receiver) => self.lookup.answer(outcomes, &receiver, &mut self.counts[0]),
            Err(known) => known,
        };
    }
}
