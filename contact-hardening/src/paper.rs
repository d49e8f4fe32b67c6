//! `paper` scaling: passes 3 and 4 as section 3.2 has them, in pixels, whatever the light.
//!
//! `D = distance^D_p · D_m` is the kernel's width of `pcf` and `gaussian`, and the number of passes of `multi-pass`. Only
//! shadowed pixels have a D: lit ones next to an edge are blurred if pass 3 dilates it to them.

use glam::Vec2;
use rayon::prelude::*;
use scene_core::{GBuffer, Light};

use crate::distance_map::{DistanceMap, to_light};
use crate::kernel::Kernel;
use crate::params::{ContactHardeningParams, GaussianKernel, Variant};
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
                    let size = self.params.pass_size(pass);
                    skipped += self.pass(map, |_| size);
                    map.distance.iter_mut().for_each(|distance| *distance = (*distance - 1.0).max(0.0));
                }
                skipped
            }
        }
    }

    /// One pass over all pixels with D > 0; `size` is the kernel's width in pixels for a D.
    fn pass(&self, map: &mut DistanceMap, size: impl Fn(f32) -> f32 + Sync) -> u64 {
        let pyramid = self.params.skip.then(|| ShadowPyramid::new(map));
        let source = &*map;
        // Odd widths have a middle: radius 0, 1, 2, …
        let radius = |distance: f32| (size(distance) * 0.5).floor() as usize;
        let is_separable =
            self.params.variant != Variant::Pcf && self.params.kernel == GaussianKernel::Separable;
        let most = (self.params.kernel_size / 2) as usize;
        let rows = is_separable.then(|| {
            let row = |pixel: usize| self.row(source, pixel, radius(source.distance[pixel]));
            (0..source.shadow.len()).into_par_iter().map(row).collect::<Vec<_>>()
        });
        let answer = |pixel: usize| {
            let (shadow, distance) = (source.shadow[pixel], source.distance[pixel]);
            if distance <= 0.0 || shadow.is_nan() {
                return (shadow, 0);
            }
            let radius = radius(distance);
            // Rows are as wide as their own pixels ask for.
            let across = if is_separable { most } else { radius };
            let reach = reach(source, pixel, across, radius);
            if let Some(pyramid) = &pyramid {
                let extremes = pyramid.of(reach);
                if extremes.least == 1.0 || extremes.greatest == 0.0 {
                    return (shadow, 1);
                }
            }
            let blurred = match &rows {
                Some(rows) => self.column(source, rows, pixel, radius),
                None if self.params.variant == Variant::Pcf => self.box_filter(source, pixel, reach),
                None => self.gaussian(source, pixel, radius),
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

    /// The Gaussian along a row; S itself where there is none.
    fn row(&self, map: &DistanceMap, pixel: usize, radius: usize) -> f32 {
        let PixelRect { first, last } = reach(map, pixel, radius, 0);
        let start = pixel - pixel % map.width;
        self.line(
            map,
            &map.shadow,
            pixel,
            radius,
            (first[0]..=last[0]).map(|x| (start + x, x)),
            pixel % map.width,
        )
    }

    /// The Gaussian of blurred rows along a column.
    fn column(&self, map: &DistanceMap, rows: &[f32], pixel: usize, radius: usize) -> f32 {
        let PixelRect { first, last } = reach(map, pixel, 0, radius);
        let x = pixel % map.width;
        let places = (first[1]..=last[1]).map(|y| (y * map.width + x, y));
        self.line(map, rows, pixel, radius, places, pixel / map.width)
    }

    /// The 3-sigma Gaussian of `values` over pixels at places, around `own`.
    fn line(
        &self,
        map: &DistanceMap,
        values: &[f32],
        pixel: usize,
        radius: usize,
        places: impl Iterator<Item = (usize, usize)>,
        own: usize,
    ) -> f32 {
        let (mut dark, mut all) = (0.0, 0.0);
        for (other, place) in places.filter(|&(other, _)| self.counts(map, pixel, other)) {
            let share = place.abs_diff(own) as f32 / radius.max(1) as f32;
            let weight = (-4.5 * share * share).exp();
            dark += weight * values[other];
            all += weight;
        }
        if all > 0.0 { dark / all } else { values[pixel] }
    }

    /// Whether `other` has an S that counts for `pixel`: with `geometry`, if the height of each over the other's plane is
    /// below sin 45° of their distance.
    ///
    /// Over an edge where a surface bends by β, pixels a and b away from it are √(a² + b² + 2ab·cos β) apart and a·sin β,
    /// b·sin β high; the larger height is the least share of the distance where a = b, sin(β/2). This is the largest
    /// limit under which nothing counts across a right angle or a sharper edge, so all that bends less is one surface.
    #[inline]
    fn counts(&self, map: &DistanceMap, pixel: usize, other: usize) -> bool {
        if map.shadow[other].is_nan() {
            return false;
        }
        if !self.params.geometry || pixel == other {
            return true;
        }
        let apart = self.gbuffer.position[other] - self.gbuffer.position[pixel];
        let limit = std::f32::consts::FRAC_1_SQRT_2 * apart.length();
        [pixel, other].iter().all(|&at| self.gbuffer.normal[at].dot(apart).abs() < limit)
    }
}

/// The pixels within `across` columns and `down` rows, cut at the border.
fn reach(map: &DistanceMap, pixel: usize, across: usize, down: usize) -> PixelRect {
    let (x, y) = (pixel % map.width, pixel / map.width);
    PixelRect {
        first: [x.saturating_sub(across), y.saturating_sub(down)],
        last: [(x + across).min(map.width - 1), (y + down).min(map.height - 1)],
    }
}
