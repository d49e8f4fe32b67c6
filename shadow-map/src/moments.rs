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
//! What is kept of a window is its mean depth and its *central* moments, about that mean, and windows are joined about their
//! common mean (Pébay, *Formulas for robust, one-pass parallel computation of covariances and arbitrary-order statistical
//! moments*, 2008). Powers of depths themselves would cancel: of a window that spans a thousandth of the map's depths the
//! fourth moment has 10⁻¹² to tell from numbers near 1. So f32 will do, here and on a GPU, and the bound is as sharp near a contact
//! as anywhere: it is taken in units of the window's own spread.
//!
//! A sum of up to 65 terms of one sign is off by 65·2⁻²⁴ of itself, and a moment is made of two such sums: below 2⁻¹⁶. The matrix of
//! moments is made that much more positive, which moves V by about the root of it, 2⁻⁸.
//!
//! Limits: leaks light where more than two surfaces lie over each other in a window; the blur is as many texels wide
//! everywhere.

use fearless_simd::{Level, dispatch};
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;
use scene_core::{GBuffer, Report, VisibilityImage};

use crate::PreparedVariant;
use crate::cpu;
use crate::light_maps::{LightMaps, Receiver, ShadowMapView};
use crate::light_views::{LightView, NEAR_FRACTION, Unprojection};
use crate::params::ShadowMapParams;
use crate::texel_plane::TexelPlane;

/// What keeps the matrix of moments positive, as a share of it: derived in the module's text.
pub(crate) const MOMENT_BIAS: f32 = 1.0 / 65_536.0;

/// The spread that rounding alone gives to depths in [−1, 1]: 2⁻²¹, eight roundings. A receiver is compared two of them nearer to the
/// light than it is: of a window that holds one depth, its own, nothing is before it then.
pub(crate) const LEAST_SPREAD: f32 = 1.0 / 2_097_152.0;

/// The variant: blurred moments beside the maps.
#[derive(Debug)]
pub(crate) struct Moments<'a> {
    maps: LightMaps<'a>,
    moments: Vec<MomentMap>,
    window: f32,
    four: bool,
    light_bleeding: f32,
    level: Level,
}

/// Receivers that are answered side by side.
const LANES: usize = 16;

/// What some receivers read: the four windows around each of them, what each weighs, and the scaled depth that they are compared at.
struct Reads {
    windows: [[Window; LANES]; 4],
    weights: [[f32; LANES]; 4],
    depths: [f32; LANES],
}

impl Reads {
    const NONE: Self =
        Self { windows: [[Window::of(1.0); LANES]; 4], weights: [[0.25; LANES]; 4], depths: [-1.0; LANES] };

    /// The bound of each. Alike for all lanes and without a branch, so that it becomes vector code.
    #[inline(always)]
    fn shadows(&self, bound: impl Fn(&Window, f32) -> f32) -> [f32; LANES] {
        let mut shadows = [0.0; LANES];
        for (lane, shadow) in shadows.iter_mut().enumerate() {
            let parts = [0, 1, 2, 3].map(
                #[inline(always)]
                |part: usize| (self.weights[part][lane], self.windows[part][lane]),
            );
            *shadow = bound(&Window::joined_four(parts), self.depths[lane]);
        }
        shadows
    }
}

/// The moments of one view's texels that are looked up, with a border of one for lookups between texels.
#[derive(Clone, Debug)]
struct MomentMap {
    /// Texels a side of the whole map, and two.
    side: usize,
    /// Column and row, counted from the border's, of the first that is kept.
    first: [usize; 2],
    columns: usize,
    rows: usize,
    moments: Vec<Window>,
    depths: DepthScale,
}

/// What a view stores, as a distance from the light in [−1, 1], linear in space: from the near end of the view's depths to the far
/// one, so that rounding of a stored depth is a few 2⁻²⁴ of it whatever is stored.
#[derive(Clone, Copy, Debug)]
enum DepthScale {
    /// Reversed depth falls with the distance.
    Parallel,
    /// Reversed depth is the near distance over that to the point, and the near one is [`NEAR_FRACTION`] of the farthest.
    Central,
}

impl DepthScale {
    fn new(view: &LightView) -> Self {
        match view.unproject {
            Unprojection::Parallel { .. } => Self::Parallel,
            Unprojection::Central { .. } => Self::Central,
        }
    }

    /// In [−1, 1]; 1 for what is as far as any caster or farther, and where nothing is stored.
    #[inline]
    fn scaled(self, depth: f32) -> f32 {
        let scaled = match self {
            Self::Parallel => 1.0 - 2.0 * depth,
            Self::Central => 2.0 * NEAR_FRACTION / depth - 1.0,
        };
        if depth > 0.0 { scaled.clamp(-1.0, 1.0) } else { 1.0 }
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
            level: Level::new(),
        }
    }

    /// What `receiver` reads; `None` if no map holds it, so that nothing shadows it.
    #[inline(always)]
    fn read(&self, receiver: &Receiver) -> Option<([(f32, Window); 4], f32)> {
        let views = self.maps.maps.iter().zip(&self.moments);
        let (map, moments, ndc) = views
            .filter_map(|(map, moments)| Some((map, moments, map.view.project(receiver.point)?)))
            .next()?;
        let size = map.map.width as f32;
        let at = Vec2::new(ndc.x * 0.5 + 0.5, 0.5 - ndc.y * 0.5) * size - 0.5;
        // Between texels the window reaches half a texel farther.
        let reach = 0.5 * (self.window + 1.0);
        let plane = TexelPlane::new(&map.view, map.map.width, receiver);
        let nearest = plane.nearest([at.x - reach, at.y - reach], [at.x + reach, at.y + reach]);
        Some((moments.between_texels(at), moments.depths.scaled(nearest.min(f32::MAX))))
    }

    /// V by the share of shadow.
    #[inline(always)]
    fn stretched(&self, shadow: f32) -> f32 {
        let stretched = (1.0 - shadow - self.light_bleeding) / (1.0 - self.light_bleeding);
        // What is not a number comes of a receiver that is not finite.
        stretched.clamp(0.0, 1.0)
    }

    fn answer(&self, receiver: &Receiver) -> f32 {
        let Some((parts, depth)) = self.read(receiver) else { return 1.0 };
        let window = Window::joined_four(parts);
        self.stretched(if self.four { window.shadow_by_four(depth) } else { window.shadow_by_two(depth) })
    }

    /// V of a run of pixels, from `first` on.
    #[inline(always)]
    fn shade_run(&self, gbuffer: &GBuffer, first: usize, values: &mut [f32]) {
        for (run, values) in values.chunks_mut(LANES).enumerate() {
            let (mut reads, mut asked) = (Reads::NONE, [false; LANES]);
            for (lane, value) in values.iter_mut().enumerate() {
                *value = match cpu::receiver(&self.maps, gbuffer, first + run * LANES + lane) {
                    Err(known) => known,
                    Ok(receiver) => {
                        if let Some((parts, depth)) = self.read(&receiver) {
                            asked[lane] = true;
                            reads.depths[lane] = depth;
                            for (part, (weight, window)) in parts.into_iter().enumerate() {
                                (reads.weights[part][lane], reads.windows[part][lane]) = (weight, window);
                            }
                        }
                        1.0
                    }
                };
            }
            let shadows = if self.four {
                reads.shadows(
                    #[inline(always)]
                    |window, depth| window.shadow_by_four(depth),
                )
            } else {
                reads.shadows(
                    #[inline(always)]
                    |window, depth| window.shadow_by_two(depth),
                )
            };
            let found = values.iter_mut().zip(asked).zip(shadows).filter(|((_, asked), _)| *asked);
            found.for_each(|((value, _), shadow)| *value = self.stretched(shadow));
        }
    }
}

impl MomentMap {
    fn new(maps: &LightMaps<'_>, view: usize, window: usize) -> Self {
        let map = &maps.maps[view];
        let depths = DepthScale::new(&map.view);
        // An even window has half a texel at both ends.
        let half = window / 2;
        let weight =
            |step: usize| if window.is_multiple_of(2) && (step == 0 || step == 2 * half) { 0.5 } else { 1.0 };
        let border = half + 1;
        let first = map.window.clone().map(|side| side.start as usize);
        // Nothing is looked up in a face that nobody sees.
        let is_empty = map.window.iter().any(|side| side.is_empty());
        let [columns, rows] =
            map.window.clone().map(|side| if is_empty { 0 } else { (side.end - side.start) as usize + 2 });
        let [wide, high] = [columns, rows].map(|count| if is_empty { 0 } else { count + 2 * half });
        let at = |axis: usize, index: usize| (first[axis] + index) as i32 - border as i32;
        let mut scaled = vec![1.0f32; wide * high];
        scaled.par_chunks_mut(wide.max(1)).enumerate().for_each(|(row, line)| {
            for (column, value) in line.iter_mut().enumerate() {
                *value = depth_at(maps, view, depths, at(0, column), at(1, row));
            }
        });
        let share = 1.0 / window as f32;
        // Along rows, then along columns.
        let mut lines = vec![Window::default(); columns * high];
        lines.par_chunks_mut(columns.max(1)).zip(scaled.par_chunks(wide.max(1))).for_each(
            |(line, scaled)| {
                for (column, joined) in line.iter_mut().enumerate() {
                    let depth = |step: usize| Window::of(scaled[column + step]);
                    *joined = Window::joined((0..=2 * half).map(|step| (weight(step) * share, depth(step))));
                }
            },
        );
        let mut moments = vec![Window::default(); columns * rows];
        moments.par_chunks_mut(columns.max(1)).enumerate().for_each(|(row, line)| {
            for (column, joined) in line.iter_mut().enumerate() {
                let window = |step: usize| lines[(row + step) * columns + column];
                *joined = Window::joined((0..=2 * half).map(|step| (weight(step) * share, window(step))));
            }
        });
        Self { side: map.map.width as usize + 2, first, columns, rows, moments, depths }
    }

    /// The four windows around a place in texels, 0 at the centre of the first, and what they weigh there: linear between centres.
    #[inline(always)]
    fn between_texels(&self, at: Vec2) -> [(f32, Window); 4] {
        let at = (at + 1.0).clamp(Vec2::ZERO, Vec2::splat(self.side as f32 - 1.0));
        let first = at.floor().min(Vec2::splat(self.side as f32 - 2.0));
        let b = at - first;
        let a = 1.0 - b;
        // Who is not seen may ask for what is not kept.
        let column = (first.x as usize).wrapping_sub(self.first[0]);
        let row = (first.y as usize).wrapping_sub(self.first[1]);
        let window = |column: usize, row: usize| {
            let index = row.wrapping_mul(self.columns).wrapping_add(column);
            let is_kept = column < self.columns && row < self.rows;
            if is_kept { self.moments[index] } else { Window::of(1.0) }
        };
        let [right, below] = [column, row].map(|at| at.wrapping_add(1));
        [
            (a.x * a.y, window(column, row)),
            (b.x * a.y, window(right, row)),
            (a.x * b.y, window(column, below)),
            (b.x * b.y, window(right, below)),
        ]
    }
}

/// Depths in a window: their mean, and the means of the second to fourth power of what they are above it.
#[derive(Clone, Copy, Debug, Default)]
struct Window {
    mean: f32,
    second: f32,
    third: f32,
    fourth: f32,
}

impl Window {
    /// One depth.
    #[inline]
    const fn of(mean: f32) -> Self {
        Self { mean, second: 0.0, third: 0.0, fourth: 0.0 }
    }

    /// Windows together, by weights whose sum is 1.
    #[inline]
    fn joined(parts: impl Iterator<Item = (f32, Self)> + Clone) -> Self {
        let mean = parts.clone().map(|(weight, part)| weight * part.mean).sum::<f32>();
        let about_mean = parts.map(|(weight, part)| {
            let d = part.mean - mean;
            let fourth = part.fourth + d * (4.0 * part.third + d * (6.0 * part.second + d * d));
            let third = part.third + d * (3.0 * part.second + d * d);
            weight * Vec4::new(0.0, part.second + d * d, third, fourth)
        });
        let sums = about_mean.sum::<Vec4>();
        Self { mean, second: sums.y, third: sums.z, fourth: sums.w }
    }

    /// [`joined`](Self::joined) of four, in the same order.
    #[inline(always)]
    fn joined_four(parts: [(f32, Self); 4]) -> Self {
        let [a, b, c, d] = parts.map(
            #[inline(always)]
            |(weight, part)| weight * part.mean,
        );
        let mean = a + b + c + d;
        let mut sums = Self { mean, ..Self::default() };
        for (weight, part) in parts {
            let d = part.mean - mean;
            let square = d * d;
            sums.second += weight * (part.second + square);
            sums.third += weight * (part.third + d * (3.0 * part.second + square));
            sums.fourth += weight * (part.fourth + d * (4.0 * part.third + d * (6.0 * part.second + square)));
        }
        sums
    }

    /// The least shadow at `depth` of any distribution with this mean and spread: Chebyshev's inequality.
    #[inline(always)]
    fn shadow_by_two(&self, depth: f32) -> f32 {
        let above = (depth - 2.0 * LEAST_SPREAD - self.mean).max(0.0);
        above * above / (self.second + LEAST_SPREAD * LEAST_SPREAD + above * above)
    }

    /// The least shadow at `depth` of any distribution with these moments. It has three points, one of them `depth`; the
    /// others are the roots of the polynomial that the inverse of the matrix of moments gives.
    ///
    /// With x the depth, s and k the third and fourth moment in units of the spread the matrix is (1 0 1; 0 1 s; 1 s k), its
    /// last pivot d = k − 1 − s², and the polynomial times d has the coefficients that are taken here.
    #[inline(always)]
    fn shadow_by_four(&self, depth: f32) -> f32 {
        let variance = self.second + LEAST_SPREAD * LEAST_SPREAD;
        let spread = variance.sqrt();
        let x = (depth - 2.0 * LEAST_SPREAD - self.mean) / spread;
        let s = self.third / (variance * spread);
        let k = self.fourth / (variance * variance);
        let d = (k - 1.0 - s * s).max(0.0) + MOMENT_BIAS * (1.0 + s * s);
        let c3 = x * x - 1.0 - s * x;
        let c2 = x * d - s * c3;
        let c1 = d - c3;
        // Roots of c1 + c2·r + c3·r²; where c3 vanishes the first is at infinity, and its reciprocal is taken.
        let root = (c2 * c2 - 4.0 * c1 * c3).max(0.0).sqrt();
        let q = -0.5 * (c2 + root.copysign(c2));
        let (first, over_first, second) = (q / c3, c3 / q, c1 / q);
        // The weight of each point is the mean of Lagrange's polynomial that is 1 there and 0 at the others.
        let kept = |at: f32, weight: f32| if at < x && weight.is_finite() { weight } else { 0.0 };
        let of_first = kept(first, (x * second + 1.0) / ((first - x) * (first - second)));
        let of_second = kept(second, (x + over_first) / ((second - x) * (second * over_first - 1.0)));
        (of_first + of_second).clamp(0.0, 1.0)
    }
}

/// The scaled depth of a texel, beyond a cube face's border that of the face beside it, as this face's axis has it.
fn depth_at(maps: &LightMaps<'_>, view: usize, depths: DepthScale, column: i32, row: i32) -> f32 {
    let map = &maps.maps[view];
    let size = map.map.width as i32;
    if (0..size).contains(&column) && (0..size).contains(&row) {
        let (column, row) = (column as usize, row as usize);
        let is_held = map.holds(column, row);
        return if is_held { depths.scaled(map.map.depth[row * size as usize + column]) } else { 1.0 };
    }
    if maps.maps.len() < 2 {
        return 1.0;
    }
    let texel = 2.0 / size as f32;
    let ndc = Vec2::new((column as f32 + 0.5) * texel - 1.0, 1.0 - (row as f32 + 0.5) * texel);
    // Any place on the line from the light will do, and its direction is the most exact at the far end: near the light the place is
    // the light's but for its last digits.
    let beside = maps.occluder(map.view.unproject(ndc, NEAR_FRACTION));
    beside.map_or(1.0, |occluder| depths.scaled(map.view.depth_of(occluder.point)))
}

impl PreparedVariant for Moments<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        report.time("shade.lookup", |_| {
            let width = gbuffer.width.max(1) as usize;
            visibility.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
                dispatch!(self.level, _simd => self.shade_run(gbuffer, row * width, values));
            });
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

    fn window_of(points: &[(f32, f32)]) -> Window {
        Window::joined(points.iter().map(|&(z, weight)| (weight, Window::of(z))))
    }

    /// Two depths are what four moments can tell exactly; the bias moves V by the order of its square root. So it is however
    /// close they lie.
    #[test]
    fn two_depths_are_exact() {
        for (share, gap) in [(0.1, 1.3), (0.5, 1.3), (0.8, 1.3), (0.3, 1e-3), (0.7, 1e-3)] {
            let window = window_of(&[(0.5 - gap, share), (0.5, 1.0 - share)]);
            let (two, four) = (window.shadow_by_two(0.5), window.shadow_by_four(0.5));
            assert!((four - share).abs() < 8e-3, "{share}, {gap}: {four}");
            assert!((two - share).abs() < 4e-3, "{share}, {gap}: {two}");
            assert_eq!(window.shadow_by_two(0.5 - gap), 0.0);
            assert!(window.shadow_by_four(0.5 - gap) < 8e-3);
        }
    }

    /// The shadow that is found is never above the true share of nearer depths.
    #[test]
    fn shadow_is_a_lower_bound() {
        let points = [(-0.9, 0.2), (-0.2, 0.3), (0.1, 0.1), (0.8, 0.4)];
        let window = window_of(&points);
        for step in 0..=200u8 {
            let z = -1.0 + 0.01 * f32::from(step);
            let nearer: f32 = points.iter().filter(|point| point.0 < z).map(|point| point.1).sum();
            // Twice the square root of the bias: the step of a distribution may move by that.
            let (two, four) = (window.shadow_by_two(z), window.shadow_by_four(z));
            assert!(four <= nearer + 8e-3 && two <= nearer + 8e-3, "{z}: {two} {four} {nearer}");
            assert!((0.0..=1.0).contains(&four));
        }
    }

    /// Windows of windows are the window of all: the moments of 9 depths, in rows of 3.
    #[test]
    fn windows_join() {
        let depths: Vec<f32> = (0..9u8).map(|i| f32::from(i * i) * 0.01 - 0.3).collect();
        let third = 1.0 / 3.0;
        let row = |row: &[f32]| Window::joined(row.iter().map(|&z| (third, Window::of(z))));
        let rows: Vec<_> = depths.chunks(3).map(row).collect();
        let joined = Window::joined(rows.into_iter().map(|row| (third, row)));
        let mean = depths.iter().sum::<f32>() / 9.0;
        let central = |power: i32| depths.iter().map(|z| (z - mean).powi(power)).sum::<f32>() / 9.0;
        for (found, expected) in [
            (joined.mean, mean),
            (joined.second, central(2)),
            (joined.third, central(3)),
            (joined.fourth, central(4)),
        ] {
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
    }

    /// Of one depth nothing before it is in shadow, and everything behind it is.
    #[test]
    fn one_depth_is_a_step() {
        let window = window_of(&[(0.25, 1.0)]);
        for (z, expected) in [(0.2499, 0.0), (0.25, 0.0), (0.2501, 1.0)] {
            assert!((window.shadow_by_four(z) - expected).abs() < 1e-3, "{}", window.shadow_by_four(z));
            assert!((window.shadow_by_two(z) - expected).abs() < 1e-3);
        }
    }
}
