//! `pcf`: percentage-closer filtering (Reeves, Salesin, Cook: *Rendering Antialiased Shadows with Depth Maps*, 1987).
//!
//! Each texel around the receiver is asked whether it shadows, and the answers are averaged, not the depths. The grid
//! weighs every texel by the area that it shares with a square of `filter` texels around the receiver: as smooth as
//! N × N bilinear lookups, for (N + 1)² texels. The Poisson disk asks `taps` texels in a circle of `filter` texels
//! across, turned by a random angle in each pixel: the cost does not grow with the radius, noise takes its place.
//!
//! Limits: the blur is as wide at the contact as far from it and as many texels wide whatever the light's size.

use glam::Vec2;
use scene_core::{GBuffer, Report, VisibilityImage};

use crate::PreparedVariant;
use crate::cpu;
use crate::filter_maps::FilterMaps;
use crate::light_maps::{LightMaps, Receiver, ShadowMapView};
use crate::params::{Kernel, ShadowMapParams};
use crate::pixel_hash::pixel_numbers;
use crate::poisson_disk::poisson_disk;
use crate::taps::{Stored, Taps};

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

    fn answer(&self, receiver: &Receiver, lit: &mut u64) -> f32 {
        self.filter.answer(&self.maps, receiver, lit, |taps, stored| taps.blocks(stored))
    }
}

impl PreparedVariant for Pcf<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        let lit = report.time("shade.filter", |_| {
            cpu::filter_pixels(&self.maps.maps, gbuffer, visibility, |receiver, lit| {
                self.answer(receiver, lit)
            })
        });
        report.skip("filters", lit);
    }

    fn visibility_at(&self, points: &[glam::Vec3], visibility: &mut [f32], report: &mut Report) {
        report.time("shade.filter", |_| {
            cpu::filter_points(&self.maps.maps, points, visibility, |receiver| self.answer(receiver, &mut 0));
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

    /// V of `receiver`: one less the share of taps that `blocks` says shadow it. Counts in `lit` what needed no tap.
    #[inline]
    pub(crate) fn answer(
        &self,
        maps: &FilterMaps<'_>,
        receiver: &Receiver,
        lit: &mut u64,
        blocks: impl Fn(&Taps<'_>, &Stored) -> bool,
    ) -> f32 {
        let Some(taps) = Taps::new(maps, receiver) else {
            return 1.0;
        };
        let (first, last) = self.reach(&taps);
        if maps.skip && taps.is_clear(first, last) {
            *lit += 1;
            return 1.0;
        }
        let is_blocked = |column, row| taps.risen(column, row).is_some_and(|stored| blocks(&taps, &stored));
        match self {
            Self::Grid(side) => {
                let fraction = taps.texel - *side as f32 * 0.5 - Vec2::new(first[0] as f32, first[1] as f32);
                let weight = |step: i32, fraction: f32| match step {
                    0 => 1.0 - fraction,
                    step if step == *side => fraction,
                    _ => 1.0,
                };
                let mut dark = 0.0;
                for row in 0..=*side {
                    let mut line = 0.0;
                    for column in 0..=*side {
                        if is_blocked(first[0] + column, first[1] + row) {
                            line += weight(column, fraction.x);
                        }
                    }
                    dark += line * weight(row, fraction.y);
                }
                // The weights add up to side² but for rounding.
                (1.0 - dark / (side * side) as f32).clamp(0.0, 1.0)
            }
            Self::Disk { offsets, seed, .. } => {
                let [turn, _] = pixel_numbers(receiver.pixel, *seed);
                let rotation = Vec2::from_angle(turn * std::f32::consts::TAU);
                let dark = offsets.iter().filter(|offset| {
                    let at = (taps.texel + rotation.rotate(**offset)).floor();
                    is_blocked(at.x as i32, at.y as i32)
                });
                1.0 - dark.count() as f32 / offsets.len() as f32
            }
        }
    }

    /// The first and last texel that may be asked.
    #[inline]
    fn reach(&self, taps: &Taps<'_>) -> ([i32; 2], [i32; 2]) {
        match self {
            Self::Grid(side) => {
                let first = (taps.texel - *side as f32 * 0.5).floor().to_array().map(|at| at as i32);
                (first, first.map(|at| at + side))
            }
            Self::Disk { radius, .. } => {
                // A rotated offset may be longer than the radius by rounding: a texel more on each side.
                let at = |corner: Vec2| corner.floor().to_array().map(|at| at as i32);
                (at(taps.texel - radius - 1.0), at(taps.texel + radius + 1.0))
            }
        }
    }
}
