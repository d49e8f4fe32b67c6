//! `moments`: filtered powers of the depth, from which a bound for the share of shadow is read (Peters and Klein: *Moment
//! Shadow Mapping*, I3D 2015). With two moments it is variance shadow mapping (Donnelly and Lauritzen 2006).
//!
//! The maps are blurred once, for all pixels; a lookup reads four texels however wide the blur is. Of all
//! distributions of depth with the moments that are read, the one with the least shadow is taken, so V is never below
//! what `pcf` would find with the same window. What it is above that is light bleeding: `light_bleeding` takes V up to
//! there for dark, and stretches the rest.
//!
//! # Bias
//! Of a lit plane one half of the window is nearer than the receiver in the middle. The receiver is compared at the
//! nearest depth that its own plane has in the window: nothing of the plane is nearer, and the bound says lit. What
//! that costs is contact: a caster nearer to its receiver than twice the plane's rise within half a window is lost.
//!
//! # Rounding
//! Sums are made in f64 and stored in f32, so the matrix of moments (entries within ±1) is off by at most
//! 3·2⁻²⁴ in norm. A share of α = 2⁻²⁰ of a distribution with moments (0, ½, 0, ½) adds α·0.19 to its
//! least eigenvalue, 0.19 being that distribution's own: 3·2⁻²⁴ < 0.19·2⁻²⁰, so it stays positive.
//!
//! Limits: leaks light where more than two surfaces lie over each other in a window; the blur is as many texels wide
//! everywhere.

use glam::{DVec4, Vec2, Vec3};
use rayon::prelude::*;
use scene_core::{GBuffer, Report, VisibilityImage};

use crate::PreparedVariant;
use crate::cpu;
use crate::light_maps::{LightMaps, Receiver, ShadowMapView};
use crate::light_views::Unprojection;
use crate::params::ShadowMapParams;
use crate::texel_plane::TexelPlane;

/// Share of the distribution that keeps the matrix of moments positive; derived in the module's text.
const MOMENT_BIAS: f64 = 1.0 / 1_048_576.0;

/// The variant: blurred moments beside the maps.
#[derive(Debug)]
pub(crate) struct Moments<'a> {
    maps: LightMaps<'a>,
    moments: Vec<MomentMap>,
    window: f32,
    four: bool,
    light_bleeding: f32,
}

/// The moments of one view, with a border of one texel for lookups between texels.
#[derive(Clone, Debug)]
struct MomentMap {
    side: usize,
    moments: Vec<[f32; 4]>,
    depths: DepthScale,
}

/// Maps what a view stores to a distance from the light in [−1, 1], linear in space.
#[derive(Clone, Copy, Debug)]
struct DepthScale {
    /// Of a central view, the near distance; 0 for parallel light.
    near: f32,
    middle: f32,
    scale: f32,
}

impl DepthScale {
    /// Spans the depths stored in `map`.
    fn new(map: &ShadowMapView) -> Self {
        let near = match map.view.unproject {
            Unprojection::Parallel { .. } => 0.0,
            Unprojection::Central { near, .. } => near,
        };
        let mut scale = Self { near, middle: 0.0, scale: 1.0 };
        let stored =
            map.map.depth.par_iter().filter(|&&depth| depth > 0.0).map(|&depth| scale.distance(depth));
        let (min, max) = stored
            .map(|distance| (distance, distance))
            .reduce(|| (f32::INFINITY, f32::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
        scale.middle = 0.5 * (min + max);
        scale.scale = 2.0 / (max - min).max(f32::MIN_POSITIVE);
        scale
    }

    /// Grows away from the light.
    #[inline]
    fn distance(&self, depth: f32) -> f32 {
        if self.near > 0.0 { self.near / depth } else { -depth }
    }

    /// In [−1, 1]; 1 for what is as far as the farthest caster or farther, and where nothing is stored.
    #[inline]
    fn scaled(&self, depth: f32) -> f32 {
        if depth > 0.0 { self.scaled_distance(self.distance(depth)) } else { 1.0 }
    }

    #[inline]
    fn scaled_distance(&self, distance: f32) -> f32 {
        // A lone depth spans nothing: its scale may be infinite, and 0·∞ is in the middle.
        let scaled = (distance - self.middle) * self.scale;
        if scaled.is_nan() { 0.0 } else { scaled.clamp(-1.0, 1.0) }
    }
}

impl<'a> Moments<'a> {
    pub(crate) fn new(maps: LightMaps<'a>, params: &ShadowMapParams, report: &mut Report) -> Self {
        let moments = report.time("prepare.moments", |_| {
            (0..maps.maps.len()).map(|view| MomentMap::new(&maps, view, params.filter as usize)).collect()
        });
        let moments: Vec<MomentMap> = moments;
        report.bytes += moments.iter().map(|map| size_of_val(map.moments.as_slice()) as u64).sum::<u64>();
        Self {
            maps,
            moments,
            window: params.filter as f32,
            four: params.moments == 4,
            light_bleeding: params.light_bleeding,
        }
    }

    fn answer(&self, receiver: &Receiver) -> f32 {
        let views = self.maps.maps.iter().zip(&self.moments);
        let found =
            views.filter_map(|(map, moments)| Some((map, moments, map.view.project(receiver.point)?))).next();
        let Some((map, moments, ndc)) = found else {
            return 1.0;
        };
        let size = map.map.width as f32;
        let at = Vec2::new(ndc.x * 0.5 + 0.5, 0.5 - ndc.y * 0.5) * size - 0.5;
        // Between texels the window reaches half a texel farther.
        let reach = 0.5 * (self.window + 1.0);
        let plane = TexelPlane::new(&map.view, map.map.width, receiver);
        let nearest = plane.nearest([at.x - reach, at.y - reach], [at.x + reach, at.y + reach]);
        let depth = f64::from(moments.depths.scaled(nearest.min(f32::MAX)));
        let b = moments.between_texels(at);
        let shadow = if self.four { shadow_of_four(b, depth) } else { shadow_of_two(b, depth) };
        let stretched = (1.0 - shadow as f32 - self.light_bleeding) / (1.0 - self.light_bleeding);
        // What is not a number comes of a receiver that is not finite.
        stretched.clamp(0.0, 1.0)
    }
}

impl MomentMap {
    fn new(maps: &LightMaps<'_>, view: usize, window: usize) -> Self {
        let map = &maps.maps[view];
        let depths = DepthScale::new(map);
        let size = map.map.width as usize;
        // An even window has half a texel at both ends.
        let half = window / 2;
        let weight =
            |step: usize| if window.is_multiple_of(2) && (step == 0 || step == 2 * half) { 0.5 } else { 1.0 };
        let (border, side) = (half + 1, size + 2);
        let wide = size + 2 * border;
        let at = |index: usize| index as i32 - border as i32;
        let mut scaled = vec![1.0f32; wide * wide];
        scaled.par_chunks_mut(wide).enumerate().for_each(|(row, line)| {
            for (column, value) in line.iter_mut().enumerate() {
                *value = depth_at(maps, view, &depths, at(column), at(row));
            }
        });
        let powers = |z: f32| {
            let z = f64::from(z);
            DVec4::new(z, z * z, z * z * z, z * z * z * z)
        };
        let share = 1.0 / window as f64;
        // Along rows, then along columns.
        let mut lines = vec![DVec4::ZERO; side * wide];
        lines.par_chunks_mut(side).zip(scaled.par_chunks(wide)).for_each(|(line, scaled)| {
            for (column, sum) in line.iter_mut().enumerate() {
                let window = scaled[column..].iter().take(2 * half + 1).enumerate();
                *sum = window.map(|(step, &z)| powers(z) * weight(step)).sum::<DVec4>() * share;
            }
        });
        let mut moments = vec![[0.0f32; 4]; side * side];
        moments.par_chunks_mut(side).enumerate().for_each(|(row, line)| {
            for (column, moment) in line.iter_mut().enumerate() {
                let window = (0..=2 * half).map(|step| lines[(row + step) * side + column] * weight(step));
                *moment = (window.sum::<DVec4>() * share).as_vec4().to_array();
            }
        });
        Self { side, moments, depths }
    }

    /// Moments at a place in texels, 0 at the centre of the first, linear between centres.
    #[inline]
    fn between_texels(&self, at: Vec2) -> DVec4 {
        let at = (at + 1.0).clamp(Vec2::ZERO, Vec2::splat(self.side as f32 - 1.0));
        let first = at.floor().min(Vec2::splat(self.side as f32 - 2.0));
        let fraction = (at - first).as_dvec2();
        let index = first.y as usize * self.side + first.x as usize;
        let moment = |index: usize| {
            let [a, b, c, d] = self.moments[index].map(f64::from);
            DVec4::new(a, b, c, d)
        };
        let upper = moment(index).lerp(moment(index + 1), fraction.x);
        let lower = moment(index + self.side).lerp(moment(index + self.side + 1), fraction.x);
        upper.lerp(lower, fraction.y)
    }
}

/// The scaled depth of a texel, beyond a cube face's border that of the face beside it, as this face's axis has it.
fn depth_at(maps: &LightMaps<'_>, view: usize, depths: &DepthScale, column: i32, row: i32) -> f32 {
    let map = &maps.maps[view];
    let size = map.map.width as i32;
    if (0..size).contains(&column) && (0..size).contains(&row) {
        return depths.scaled(map.map.depth[row as usize * size as usize + column as usize]);
    }
    if maps.maps.len() < 2 {
        return 1.0;
    }
    let texel = 2.0 / size as f32;
    let ndc = Vec2::new((column as f32 + 0.5) * texel - 1.0, 1.0 - (row as f32 + 0.5) * texel);
    // Any place on the line from the light will do: half of the way to where the nearest depth is 1.
    let beside = maps.occluder(map.view.unproject(ndc, 0.5));
    beside.map_or(1.0, |occluder| depths.scaled(map.view.depth_of(occluder.point)))
}

/// The least shadow at `depth` of any distribution with the first two moments of `b`: Chebyshev's inequality.
fn shadow_of_two(b: DVec4, depth: f64) -> f64 {
    let above = depth - b.x;
    let variance = (b.y - b.x * b.x).max(0.0) + 0.5 * MOMENT_BIAS;
    if above > 0.0 { above * above / (variance + above * above) } else { 0.0 }
}

/// The least shadow at `depth` of any distribution with the four moments `b`. It has three points, one of them `depth`;
/// the others are the roots of the polynomial that the inverse of the matrix of moments gives.
fn shadow_of_four(b: DVec4, depth: f64) -> f64 {
    let b = b.lerp(DVec4::new(0.0, 0.5, 0.0, 0.5), MOMENT_BIAS);
    let z = depth;
    // Cholesky: the matrix (1 b1 b2; b1 b2 b3; b2 b3 b4) = L·D·Lᵀ, times c = (1, z, z²).
    let d2 = b.y - b.x * b.x;
    let l32 = (b.z - b.x * b.y) / d2;
    let d3 = b.w - b.y * b.y - l32 * l32 * d2;
    let y2 = z - b.x;
    let y3 = z * z - b.y - l32 * y2;
    let c3 = y3 / d3;
    let c2 = y2 / d2 - l32 * c3;
    let c1 = 1.0 - b.x * c2 - b.y * c3;
    // Roots of c1 + c2·x + c3·x²; where c3 vanishes the second is at infinity and weighs nothing.
    let root = (c2 * c2 - 4.0 * c1 * c3).max(0.0).sqrt();
    let q = -0.5 * (c2 + root.copysign(c2));
    let (x1, x2) = (q / c3, c1 / q);
    // The weight of each point is the mean of Lagrange's polynomial that is 1 there and 0 at the others.
    let weight = |x: f64, other: f64| {
        let weight = (z * other - b.x * (z + other) + b.y) / ((x - z) * (x - other));
        if x < z && weight.is_finite() { weight } else { 0.0 }
    };
    (weight(x1, x2) + weight(x2, x1)).clamp(0.0, 1.0)
}

impl PreparedVariant for Moments<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        report.time("shade.lookup", |_| {
            cpu::shade_pixels(&self.maps, gbuffer, visibility, |receiver| self.answer(receiver));
        });
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32], report: &mut Report) {
        report.time("shade.lookup", |_| {
            cpu::filter_points(&self.maps, points, visibility, |receiver| self.answer(receiver));
        });
    }

    fn maps(&self) -> &[ShadowMapView] {
        &self.maps.maps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments_of(points: &[(f64, f64)]) -> DVec4 {
        points.iter().map(|&(z, w)| DVec4::new(z, z * z, z.powi(3), z.powi(4)) * w).sum()
    }

    /// Two depths are what four moments can tell exactly; the bias moves V by the order of its square root.
    #[test]
    fn two_depths_are_exact() {
        for share in [0.1, 0.5, 0.8] {
            let b = moments_of(&[(-0.6, share), (0.7, 1.0 - share)]);
            assert!((shadow_of_four(b, 0.7) - share).abs() < 2e-3, "{share}: {}", shadow_of_four(b, 0.7));
            assert!((shadow_of_two(b, 0.7) - share).abs() < 2e-3);
            assert_eq!(shadow_of_two(b, -0.6), 0.0);
            assert!(shadow_of_four(b, -0.6) < 2e-3);
        }
    }

    /// The shadow that is found is never above the true share of nearer depths.
    #[test]
    fn shadow_is_a_lower_bound() {
        let points = [(-0.9, 0.2), (-0.2, 0.3), (0.1, 0.1), (0.8, 0.4)];
        let b = moments_of(&points);
        for step in 0..=200 {
            let z = -1.0 + 0.01 * f64::from(step);
            let nearer: f64 = points.iter().filter(|point| point.0 < z).map(|point| point.1).sum();
            // Three times the square root of the bias: the step of a distribution may move by that.
            let (two, four) = (shadow_of_two(b, z), shadow_of_four(b, z));
            assert!(four <= nearer + 3e-3 && two <= nearer + 3e-3, "{z}: {two} {four} {nearer}");
            assert!((0.0..=1.0).contains(&four));
        }
    }
}
