//! `paper` scaling: passes 3 and 4 as section 3.2 has them, in pixels, whatever the light.
//!
//! `D = distance^D_p · D_m` is the kernel's width of `pcf` and `gaussian`, and the number of passes of `multi-pass`. Only
//! shadowed pixels have a D: lit ones next to an edge are blurred if pass 3 dilates it to them.

use glam::Vec2;
use rayon::prelude::*;
use scene_core::{GBuffer, Light};

use crate::distance_map::{DistanceMap, to_light};
use crate::kernel::Kernel;
use crate::params::{ContactHardeningParams, Variant};
use crate::shadow_pyramid::{PixelRect, ShadowPyramid};

/// What the passes read.
#[derive(Clone, Copy, Debug)]
pub struct Paper<'a> {
    /// Settings.
    pub params: &'a ContactHardeningParams,
    /// Surfaces.
    pub gbuffer: &'a GBuffer,
    /// Gaussian points of the unit disk.
    pub kernel: &'a Kernel,
}

impl Paper<'_> {
    /// Pass 2's D from distances: makes shares of the way to scene units first.
    pub fn scale(&self, light: &Light, map: &mut DistanceMap) {
        let center = light.center();
        map.distance.par_iter_mut().zip(&self.gbuffer.position).for_each(|(distance, &position)| {
            if *distance > 0.0 {
                let length = *distance * to_light(center, position).length();
                let scaled = length.powf(self.params.distance_power) * self.params.distance_multiplier;
                *distance = if scaled.is_finite() { scaled } else { 0.0 };
            }
        });
    }

    /// Pass 3: a Gaussian over D, rows, then columns. Pixels without S keep D = 0.
    pub fn dilate(&self, map: &mut DistanceMap) {
        let radius = (self.params.dilate / 2) as usize;
        if radius == 0 {
            return;
        }
        // 3-sigma rule: σ is a third of the radius.
        let weight = |i: usize| (-4.5 * (i as f32 / radius as f32).powi(2)).exp();
        let sum: f32 = weight(0) + 2.0 * (1..=radius).map(weight).sum::<f32>();
        let weights: Vec<f32> = (0..=radius).map(|i| weight(i) / sum).collect();
        let (width, height) = (map.width, map.height);
        let filter = |source: &[f32], length: usize, stride: usize| -> Vec<f32> {
            let at = |pixel: usize| {
                let place = pixel / stride % length;
                let side = |i: usize, w: f32| {
                    let before = if place >= i { source[pixel - i * stride] } else { 0.0 };
                    let after = if place + i < length { source[pixel + i * stride] } else { 0.0 };
                    w * (before + after)
                };
                let sides: f32 = weights.iter().enumerate().skip(1).map(|(i, &w)| side(i, w)).sum();
                weights[0] * source[pixel] + sides
            };
            (0..source.len()).into_par_iter().map(at).collect()
        };
        let rows = filter(&map.distance, width, 1);
        let mut dilated = filter(&rows, height, width);
        for (distance, shadow) in dilated.iter_mut().zip(&map.shadow) {
            if shadow.is_nan() {
                *distance = 0.0;
            }
        }
        map.distance = dilated;
    }

    /// Pass 4: blurs S of `map` in place and returns how many blurs were left out.
    pub fn blur(&self, map: &mut DistanceMap) -> u64 {
        match self.params.variant {
            Variant::Pcf | Variant::Gaussian => {
                let most = self.params.kernel_size as f32;
                self.pass(map, |distance| distance.min(most))
            }
            Variant::MultiPass => {
                let mut skipped = 0;
                for pass in 0..self.params.passes {
                    if map.distance.iter().all(|&distance| distance <= 0.0) {
                        break;
                    }
                    let size = self.pass_size(pass);
                    skipped += self.pass(map, |_| size);
                    map.distance.iter_mut().for_each(|distance| *distance = (*distance - 1.0).max(0.0));
                }
                skipped
            }
        }
    }

    /// The kernel's width in a pass of `multi-pass`.
    fn pass_size(&self, pass: u32) -> f32 {
        let (most, passes) = (self.params.kernel_size as f32, self.params.passes);
        let first = most.min(3.0);
        if self.params.widening && passes > 1 {
            first + (most - first) * pass as f32 / (passes - 1) as f32
        } else {
            most
        }
    }

    /// One pass over all pixels with D > 0; `size` is the kernel's width in pixels for a D.
    fn pass(&self, map: &mut DistanceMap, size: impl Fn(f32) -> f32 + Sync) -> u64 {
        let pyramid = self.params.skip.then(|| ShadowPyramid::new(map));
        let source = &*map;
        let answer = |pixel: usize| {
            let (shadow, distance) = (source.shadow[pixel], source.distance[pixel]);
            if distance <= 0.0 || shadow.is_nan() {
                return (shadow, 0);
            }
            // Odd widths have a middle: radius 0, 1, 2, …
            let radius = (size(distance) * 0.5).floor() as usize;
            let reach = reach(source, pixel, radius);
            if let Some(pyramid) = &pyramid {
                let extremes = pyramid.of(reach);
                if extremes.least == 1.0 || extremes.greatest == 0.0 {
                    return (shadow, 1);
                }
            }
            let blurred = if self.params.variant == Variant::Pcf {
                self.box_filter(source, pixel, reach)
            } else {
                self.gaussian(source, pixel, radius)
            };
            (blurred, 0)
        };
        let answers: Vec<(f32, u64)> = (0..source.shadow.len()).into_par_iter().map(answer).collect();
        let mut skipped = 0;
        for (shadow, (value, count)) in map.shadow.iter_mut().zip(answers) {
            *shadow = value;
            skipped += count;
        }
        skipped
    }

    fn box_filter(&self, map: &DistanceMap, pixel: usize, reach: PixelRect) -> f32 {
        let (mut dark, mut all) = (0.0, 0.0);
        for row in reach.first[1]..=reach.last[1] {
            for other in row * map.width + reach.first[0]..=row * map.width + reach.last[0] {
                if self.counts(map, pixel, other) {
                    dark += map.shadow[other];
                    all += 1.0;
                }
            }
        }
        if all > 0.0 { dark / all } else { map.shadow[pixel] }
    }

    fn gaussian(&self, map: &DistanceMap, pixel: usize, radius: usize) -> f32 {
        let (x, y) = (pixel % map.width, pixel / map.width);
        let size = Vec2::new(map.width as f32, map.height as f32);
        let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let (mut dark, mut all) = (0.0, 0.0);
        for (point, weight) in self.kernel.points.iter().zip(&self.kernel.weights) {
            let at = center + *point * radius as f32;
            if at.cmplt(Vec2::ZERO).any() || at.cmpge(size).any() {
                continue;
            }
            let other = at.y as usize * map.width + at.x as usize;
            if self.counts(map, pixel, other) {
                dark += weight * map.shadow[other];
                all += weight;
            }
        }
        if all > 0.0 { dark / all } else { map.shadow[pixel] }
    }

    /// Whether `other` has an S that counts for `pixel`: with `geometry`, if each lies within 30° of the other's
    /// plane, as on any surface that bends by less than that under the kernel.
    #[inline]
    fn counts(&self, map: &DistanceMap, pixel: usize, other: usize) -> bool {
        if map.shadow[other].is_nan() {
            return false;
        }
        if !self.params.geometry || pixel == other {
            return true;
        }
        let apart = self.gbuffer.position[other] - self.gbuffer.position[pixel];
        let limit = 0.5 * apart.length();
        [pixel, other].iter().all(|&at| self.gbuffer.normal[at].dot(apart).abs() <= limit)
    }
}

/// The pixels within `radius` columns and rows, cut at the border.
fn reach(map: &DistanceMap, pixel: usize, radius: usize) -> PixelRect {
    let (x, y) = (pixel % map.width, pixel / map.width);
    PixelRect {
        first: [x.saturating_sub(radius), y.saturating_sub(radius)],
        last: [(x + radius).min(map.width - 1), (y + radius).min(map.height - 1)],
    }
}
