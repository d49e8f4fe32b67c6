//! A square filter for the pixels of a patch that are looked up in the same texels, all at once.
//!
//! Where a texel is larger than a pixel most pixels of a patch have their squares begin in the same one: what blocks is the same for
//! all of them, and only the weights at the rim differ. So rows are read once, and the sums, which are those of
//! [`pcf`](crate::pcf) in the same order, are made for all of those pixels side by side.

use glam::{Vec2, Vec3};

use crate::filter_maps::FilterMaps;
use crate::light_maps::Receiver;
use crate::patches::Outcome;
use crate::pcf::{first_of_grid, weight};
use crate::receiver_plane::view_tolerance;
use crate::shade_patches::{Known, TilePixels};
use crate::taps::own_texel;
use crate::texel_outcomes::{Row, TexelOutcomes, bits_of};
use crate::texel_plane::TexelPlane;

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
            (any, asked) = (any | row.blocks | row.if_before, asked | row.if_before);
        }
        if any == 0 {
            self.bits[..self.count].iter().for_each(|&bit| values[bit] = 1.0);
            return Some(false);
        }
        let (mut dark, mut line) = ([0.0f32; 64], [0.0f32; 64]);
        let (mut summed, mut planes) = (None, None);
        for step in 0..=side {
            let row = row(step)?;
            if row.if_before != 0 {
                summed = None;
                let planes = planes.get_or_insert_with(|| self.planes(maps, outcomes.view, pixels));
                let at = |column: i32| [first[0] + column, first[1] + step];
                let is_before = |column, lane: usize| {
                    planes[lane].is_before(maps, outcomes.view, at(column), pixels.position(self.bits[lane]))
                };
                self.line_of_some(side, row, &mut line, is_before);
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

    /// [`line`](Self::line) where some texels block some pixels: those that `is_before` says of a column and a place in the cell.
    #[cold]
    fn line_of_some(
        &self,
        side: i32,
        row: Row,
        line: &mut [f32; 64],
        is_before: impl Fn(i32, usize) -> bool,
    ) {
        line[..self.count].fill(0.0);
        for column in bits_of(row.blocks | row.if_before) {
            let is_sure = row.blocks >> column & 1 == 1;
            let sums = line[..self.count].iter_mut().zip(&self.columns);
            for (lane, (line, &fraction)) in sums.enumerate() {
                if is_sure || is_before(column as i32, lane) {
                    *line += weight(side, column as i32, fraction);
                }
            }
        }
    }

    /// The planes of the pixels.
    #[cold]
    fn planes(&self, maps: &FilterMaps<'_>, view: usize, pixels: &TilePixels<'_>) -> Vec<PixelPlane> {
        let map = &maps.maps.maps[view];
        let of = |&bit: &usize| {
            let (gbuffer, pixel) = (pixels.gbuffer, pixels.pixel(bit));
            let receiver = Receiver {
                point: gbuffer.position[pixel],
                normal: gbuffer.normal[pixel],
                object: gbuffer.object[pixel],
                tolerance: maps.maps.tolerance + view_tolerance(gbuffer.depth[pixel]),
                pixel: pixels.at(bit),
            };
            let plane = TexelPlane::new(&map.view, map.map.width, &receiver);
            PixelPlane { plane, tolerance: receiver.tolerance }
        };
        self.bits[..self.count].iter().map(of).collect()
    }
}

/// The first two questions of one pixel: as [`Taps`](crate::taps::Taps) asks them.
struct PixelPlane {
    plane: TexelPlane,
    tolerance: f32,
}

impl PixelPlane {
    /// Whether what is stored in the texel `[column, row]`, where there is something, is before the pixel at `point`.
    #[inline]
    fn is_before(&self, maps: &FilterMaps<'_>, view: usize, [column, row]: [i32; 2], point: Vec3) -> bool {
        let map = &maps.maps.maps[view].map;
        let index = row as usize * map.width as usize + column as usize;
        self.plane.rise(column as f32, row as f32, map.depth[index]) > 0.0
            && maps.is_behind_texel(view, index, point, self.tolerance)
    }
}
