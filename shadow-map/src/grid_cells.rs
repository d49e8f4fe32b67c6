//! A square filter for the pixels of a patch that are looked up in the same texels, all at once.
//!
//! Where a texel is larger than a pixel most pixels of a patch have their squares begin in the same one: what blocks is the same for
//! all of them, and only the weights at the rim differ. So rows are read once, and the sums, which are those of
//! [`pcf`](crate::pcf) in the same order, are made for all of those pixels side by side.

use glam::Vec2;

use crate::filter_maps::FilterMaps;
use crate::patches::Outcome;
use crate::pcf::{first_of_grid, weight};
use crate::receiver_plane::view_tolerance;
use crate::shade_patches::{Known, TilePixels};
use crate::taps::own_texel;
use crate::texel_outcomes::{Row, TexelOutcomes, bits_of};

/// Pixels whose squares begin in one texel, side by side.
struct Cell {
    /// How many.
    count: usize,
    /// Their bits in the tile.
    bits: [usize; 64],
    /// How far into its first texel each square begins, columns and rows.
    columns: [f32; 64],
    rows: [f32; 64],
}

/// V of those `pixels` for which `outcomes`, and planes that it asks for, say what each texel in a square of `side` texels is.
pub(crate) fn known_of_grid(
    side: i32,
    maps: &FilterMaps<'_>,
    outcomes: &TexelOutcomes,
    pixels: &TilePixels<'_>,
    values: &mut [f32; 64],
) -> Known {
    let map = &maps.maps.maps[outcomes.view];
    let by_own = outcomes.asks_own();
    let (mut places, mut fractions) = ([[[0; 2]; 2]; 64], [Vec2::ZERO; 64]);
    let mut left: u64 = 0;
    for bit in bits_of(pixels.mask) {
        let Some(ndc) = map.view.project_beyond(pixels.position(bit)) else { continue };
        let texel = map.texel_at(ndc);
        let first = first_of_grid(side, texel);
        fractions[bit] = texel - side as f32 * 0.5 - Vec2::new(first[0] as f32, first[1] as f32);
        places[bit] = [first, if by_own { own_texel(texel, map.map.width) } else { first }];
        left |= 1 << bit;
    }
    let mut known = Known::default();
    while left != 0 {
        let place = places[left.trailing_zeros() as usize];
        let mut cell = Cell { count: 0, bits: [0; 64], columns: [0.0; 64], rows: [0.0; 64] };
        let mut mask = 0;
        for bit in bits_of(left) {
            if places[bit] == place {
                mask |= 1 << bit;
                cell.bits[cell.count] = bit;
                (cell.columns[cell.count], cell.rows[cell.count]) = fractions[bit].into();
                cell.count += 1;
            }
        }
        left &= !mask;
        let own = if by_own { outcomes.at(place[1][0], place[1][1]) } else { Outcome::Unknown };
        let [first, _] = place;
        if let Some(asked) = cell.sum(side, maps, outcomes, (first, own), pixels, values) {
            known.answered |= mask;
            known.asked |= if asked { mask } else { 0 };
        }
    }
    known
}

impl Cell {
    /// V of all of them, and whether planes were asked; `None` where more has to be.
    fn sum(
        &self,
        side: i32,
        maps: &FilterMaps<'_>,
        outcomes: &TexelOutcomes,
        (first, own): ([i32; 2], Outcome),
        pixels: &TilePixels<'_>,
        values: &mut [f32; 64],
    ) -> Option<bool> {
        let row = |step: i32| Some(outcomes.run(first[0], first[1] + step, (side + 1) as u32)?.told(own));
        let (mut any, mut asked) = (0, 0);
        for step in 0..=side {
            let row = row(step)?;
            if row.unknown != 0 {
                return None;
            }
            (any, asked) = (any | row.blocks | row.if_behind, asked | row.if_behind);
        }
        if any == 0 {
            self.bits[..self.count].iter().for_each(|&bit| values[bit] = 1.0);
            return Some(false);
        }
        let (mut dark, mut line, mut summed) = ([0.0f32; 64], [0.0f32; 64], None);
        for step in 0..=side {
            let row = row(step)?;
            if row.if_behind != 0 {
                summed = None;
                self.line_of_some(side, row, &mut line, |column, bit| {
                    let (view, pixel) = (outcomes.view, pixels.pixel(bit));
                    let [column, row] = [first[0] + column, first[1] + step].map(|at| at as usize);
                    let tolerance = maps.maps.tolerance + view_tolerance(pixels.gbuffer.depth[pixel]);
                    let index = row * maps.maps.maps[view].map.width as usize + column;
                    maps.is_behind_texel(view, index, pixels.position(bit), tolerance)
                });
            } else if summed != Some(row.blocks) {
                summed = Some(row.blocks);
                self.line(side, row.blocks, &mut line);
            }
            let sums = dark[..self.count].iter_mut().zip(&line).zip(&self.rows);
            sums.for_each(|((dark, line), &fraction)| *dark += line * weight(side, step, fraction));
        }
        let area = (side * side) as f32;
        for (&bit, dark) in self.bits[..self.count].iter().zip(dark) {
            values[bit] = (1.0 - dark / area).clamp(0.0, 1.0);
        }
        Some(asked != 0)
    }

    /// The weights in one row, of those texels that block.
    #[inline]
    fn line(&self, side: i32, blocks: u64, line: &mut [f32; 64]) {
        line[..self.count].fill(0.0);
        for column in bits_of(blocks) {
            let sums = line[..self.count].iter_mut().zip(&self.columns);
            sums.for_each(|(line, &fraction)| *line += weight(side, column as i32, fraction));
        }
    }

    /// [`line`](Self::line) where some texels block some pixels: those that `blocks` says of a column and a pixel's bit.
    #[cold]
    fn line_of_some(&self, side: i32, row: Row, line: &mut [f32; 64], blocks: impl Fn(i32, usize) -> bool) {
        line[..self.count].fill(0.0);
        for column in bits_of(row.blocks | row.if_behind) {
            let is_sure = row.blocks >> column & 1 == 1;
            let pixels = self.bits[..self.count].iter().zip(&self.columns);
            for (line, (&bit, &fraction)) in line.iter_mut().zip(pixels) {
                if is_sure || blocks(column as i32, bit) {
                    *line += weight(side, column as i32, fraction);
                }
            }
        }
    }
}
