//! `pcf`: percentage-closer filtering (Reeves, Salesin, Cook: *Rendering Antialiased Shadows with Depth Maps*, 1987).
//!
//! Each texel around the receiver is asked whether it shadows, and the answers are averaged, not the depths. The grid
//! weighs every texel by the area that it shares with a square of `filter` texels around the receiver: as smooth as
//! N × N bilinear lookups, for (N + 1)² texels. The Poisson disk asks `taps` texels in a circle of `filter` texels
//! across, turned by a random angle in each pixel: the cost does not grow with the radius, noise takes its place.
//!
//! Limits: the blur is as wide at the contact as far from it and as many texels wide whatever the light's size.

use std::cell::Cell;

use glam::{Vec2, Vec3};
use scene_core::{GBuffer, Report, VisibilityImage};

use crate::PreparedVariant;
use crate::cpu;
use crate::filter_maps::FilterMaps;
use crate::grid_cells::known_of_grid;
use crate::light_maps::{LightMaps, Receiver, ShadowMapView};
use crate::params::{Kernel, ShadowMapParams};
use crate::patches::{Form, Outcome, patches_of};
use crate::pixel_hash::pixel_numbers;
use crate::poisson_disk::poisson_disk;
use crate::shade_patches::{Known, PatchLookup, TilePixels, shade_patches};
use crate::taps::{Stored, Taps};
use crate::texel_outcomes::{TexelOutcomes, bits_of, patches_pay};

/// The variant: maps and a filter.
#[derive(Debug)]
pub(crate) struct Pcf<'a> {
    maps: FilterMaps<'a>,
    filter: Filter,
}

impl<'a> Pcf<'a> {
    pub(crate) fn new(maps: LightMaps<'a>, params: &ShadowMapParams, report: &mut Report) -> Self {
        Self { maps: FilterMaps::new(maps, params.skip, report), filter: Filter::new(params) }
    }
}

impl PatchLookup for Pcf<'_> {
    const FORM: Form = Form::Filter;

    fn reach(&self) -> [f64; 2] {
        self.filter.reads()
    }

    fn constant(&self, outcome: Outcome) -> Option<f32> {
        Filter::constant(outcome)
    }

    fn known(&self, outcomes: &TexelOutcomes, pixels: &TilePixels<'_>, values: &mut [f32; 64]) -> Known {
        self.filter.known(&self.maps, outcomes, pixels, values)
    }

    fn answer(&self, outcomes: Option<&TexelOutcomes>, receiver: &Receiver, lit: &mut u64) -> f32 {
        self.filter.answer(&self.maps, receiver, outcomes, lit, |taps, stored| taps.blocks(stored))
    }
}

impl PreparedVariant for Pcf<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        Filter::shade(&self.maps, gbuffer, visibility, self, report);
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32], report: &mut Report) {
        report.time("shade.filter", |_| {
            cpu::filter_points(&self.maps.maps, points, visibility, |receiver| {
                self.answer(None, receiver, &mut 0)
            });
        });
    }

    fn maps(&self) -> &[ShadowMapView] {
        &self.maps.maps.maps
    }
}

/// Which texels are asked and what they weigh.
#[derive(Clone, Debug)]
pub(crate) enum Filter {
    /// A square of this many texels a side.
    Grid(i32),
    /// Offsets in texels.
    Disk { offsets: Vec<Vec2>, radius: f32, seed: u32 },
}

impl Filter {
    pub(crate) fn new(params: &ShadowMapParams) -> Self {
        match params.kernel {
            Kernel::Grid => Self::Grid(params.filter as i32),
            Kernel::PoissonDisk => {
                let radius = params.filter as f32 * 0.5;
                let offsets =
                    poisson_disk(params.taps, params.seed).into_iter().map(|p| p * radius).collect();
                Self::Disk { offsets, radius, seed: params.seed }
            }
        }
    }

    /// `shade.filter`: V of every pixel by `lookup`.
    pub(crate) fn shade<L: PatchLookup>(
        maps: &FilterMaps<'_>,
        gbuffer: &GBuffer,
        visibility: &mut VisibilityImage,
        lookup: &L,
        report: &mut Report,
    ) {
        let lit = report.time("shade.filter", |_| {
            if !maps.skip || !patches_pay(&maps.maps, gbuffer, lookup.reach()) {
                let one = |receiver: &Receiver, lit: &mut u64| lookup.answer(None, receiver, lit);
                return cpu::filter_pixels(&maps.maps, gbuffer, visibility, one);
            }
            let patches = patches_of(&maps.maps.scene, gbuffer);
            shade_patches(&maps.maps, gbuffer, &patches, &mut visibility.values, lookup).iter().sum()
        });
        report.skip("filters", lit);
    }

    /// Texels that are read before and after the receiver's place.
    pub(crate) fn reads(&self) -> [f64; 2] {
        match self {
            Self::Grid(side) => [f64::from(*side) * 0.5, f64::from(*side) * 0.5 + 1.0],
            Self::Disk { radius, .. } => [f64::from(*radius) + 1.0; 2],
        }
    }

    /// V where all texels are alike. What blocks everywhere is a sum of weights, which rounding may keep from all.
    pub(crate) fn constant(outcome: Outcome) -> Option<f32> {
        (outcome == Outcome::Clear).then_some(1.0)
    }

    /// V of `receiver`: one less the share of taps that `blocks` says shadow it, where that is not known from `outcomes`
    /// already. Counts in `lit` what needed no tap.
    #[inline]
    pub(crate) fn answer(
        &self,
        maps: &FilterMaps<'_>,
        receiver: &Receiver,
        outcomes: Option<&TexelOutcomes>,
        lit: &mut u64,
        blocks: impl Fn(&Taps<'_>, &Stored) -> bool,
    ) -> f32 {
        let Some(taps) = Taps::new(maps, receiver) else {
            return 1.0;
        };
        if maps.skip && outcomes.is_none() {
            let (first, last) = self.reach(taps.texel);
            if taps.is_clear(first, last) {
                *lit += 1;
                return 1.0;
            }
        }
        let ask = |column, row| taps.risen(column, row).is_some_and(|stored| blocks(&taps, &stored));
        match self {
            Self::Grid(side) => match outcomes {
                Some(outcomes) if *side < 64 => grid_of_bits(*side, taps.texel, |column, row| {
                    let run = outcomes.run(column, row, (side + 1) as u32);
                    let [blocked, open] =
                        run.map_or([0, u64::MAX >> (63 - side)], |row| [row.blocks, row.open()]);
                    bits_of(open)
                        .filter(|&bit| ask(column + bit as i32, row))
                        .fold(blocked, |blocked, bit| blocked | 1 << bit)
                }),
                _ => grid(*side, taps.texel, ask),
            },
            Self::Disk { .. } => self.disk(receiver.pixel, taps.texel, |column, row| {
                match outcomes.map_or(Outcome::Unknown, |outcomes| outcomes.at(column, row)) {
                    Outcome::Blocks => true,
                    Outcome::Clear => false,
                    _ => ask(column, row),
                }
            }),
        }
    }

    /// V of the pixels for which each texel in reach is known.
    pub(crate) fn known(
        &self,
        maps: &FilterMaps<'_>,
        outcomes: &TexelOutcomes,
        pixels: &TilePixels<'_>,
        values: &mut [f32; 64],
    ) -> Known {
        if let Self::Grid(side) = self {
            return known_of_grid(*side, maps, outcomes, pixels, values);
        }
        let map = &maps.maps.maps[outcomes.view];
        let mut known = Known::default();
        for bit in bits_of(pixels.mask) {
            let Some(ndc) = map.view.project_beyond(pixels.position(bit)) else { continue };
            let is_known = Cell::new(true);
            values[bit] = self.disk(pixels.at(bit), map.texel_at(ndc), |column, row| {
                let outcome = outcomes.at(column, row);
                is_known.set(is_known.get() && matches!(outcome, Outcome::Clear | Outcome::Blocks));
                outcome == Outcome::Blocks
            });
            known.answered |= u64::from(is_known.get()) << bit;
        }
        known
    }

    /// V by some texels of a circle; none of a grid's.
    #[inline]
    fn disk(&self, pixel: [u32; 2], texel: Vec2, is_blocked: impl Fn(i32, i32) -> bool) -> f32 {
        let Self::Disk { offsets, seed, .. } = self else { return 1.0 };
        let [turn, _] = pixel_numbers(pixel, *seed);
        let rotation = Vec2::from_angle(turn * std::f32::consts::TAU);
        let dark = offsets.iter().filter(|offset| {
            let at = (texel + rotation.rotate(**offset)).floor();
            is_blocked(at.x as i32, at.y as i32)
        });
        1.0 - dark.count() as f32 / offsets.len() as f32
    }

    /// The first and last texel that may be asked.
    #[inline]
    fn reach(&self, texel: Vec2) -> ([i32; 2], [i32; 2]) {
        match self {
            Self::Grid(side) => {
                let first = first_of_grid(*side, texel);
                (first, first.map(|at| at + side))
            }
            Self::Disk { radius, .. } => {
                // A rotated offset may be longer than the radius by rounding: a texel more on each side.
                let at = |corner: Vec2| corner.floor().to_array().map(|at| at as i32);
                (at(texel - radius - 1.0), at(texel + radius + 1.0))
            }
        }
    }
}

/// The first column and row of a grid of `side` + 1 texels around a place.
#[inline]
pub(crate) fn first_of_grid(side: i32, texel: Vec2) -> [i32; 2] {
    (texel - side as f32 * 0.5).floor().to_array().map(|at| at as i32)
}

/// The weight of a row or column of a grid, the first and the last by the share of it in the square.
#[inline]
pub(crate) fn weight(side: i32, step: i32, fraction: f32) -> f32 {
    match step {
        0 => 1.0 - fraction,
        step if step == side => fraction,
        _ => 1.0,
    }
}

/// V by all texels of a square.
#[inline]
fn grid(side: i32, texel: Vec2, is_blocked: impl Fn(i32, i32) -> bool) -> f32 {
    let first = first_of_grid(side, texel);
    let fraction = texel - side as f32 * 0.5 - Vec2::new(first[0] as f32, first[1] as f32);
    let mut dark = 0.0;
    for row in 0..=side {
        let mut line = 0.0;
        for column in 0..=side {
            if is_blocked(first[0] + column, first[1] + row) {
                line += weight(side, column, fraction.x);
            }
        }
        dark += line * weight(side, row, fraction.y);
    }
    // The weights add up to side² but for rounding.
    (1.0 - dark / (side * side) as f32).clamp(0.0, 1.0)
}

/// [`grid`] with a bit for each texel of a row that blocks, from the column and in the row that `blocked` is given: the same
/// sums in the same order. Of 63 texels a side at most.
#[inline]
fn grid_of_bits(side: i32, texel: Vec2, blocked: impl Fn(i32, i32) -> u64) -> f32 {
    let first = first_of_grid(side, texel);
    let fraction = texel - side as f32 * 0.5 - Vec2::new(first[0] as f32, first[1] as f32);
    let mut dark = 0.0;
    for row in 0..=side {
        let blocked = bits_of(blocked(first[0], first[1] + row));
        let line = blocked.fold(0.0, |line, step| line + weight(side, step as i32, fraction.x));
        dark += line * weight(side, row, fraction.y);
    }
    (1.0 - dark / (side * side) as f32).clamp(0.0, 1.0)
}
