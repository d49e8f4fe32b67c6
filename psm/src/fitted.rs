//! The homography of a light's image that promises the least error: what the variant `auto` may take besides `uniform`.
//!
//! A map is a homography of the light's own image (see [`crate::warp`]), and its window takes away shift and scale. With places
//! (u, v) of the image, scaled so that the receivers fill [−1, 1]², what is left is
//!
//! ```text
//! w = 1 + a u + b v        x = u + p v        y = v + q u
//! ```
//!
//! of which the paper's maps, those of Wimmer et al. and the even one are members: b is the strength of the perspective along the view,
//! a across it, and p and q turn or slant the window as the ground does that is seen. The four numbers are searched for, on a
//! lattice: [`CHOICES`] at once, spread over all, then around the best of them, by halved steps. A GPU tries them side by side, and
//! since every number is a sum of powers of two both backends try the same ones.
//!
//! # What is least
//! The mean of [`expected_error`](crate::aliasing::expected_error) over samples near shadows. With G the metric of the surface in (u, v),
//! which does not depend on the homography, g = x' − (x/w)(a, b) and h = y' − (y/w)(a, b), the Jacobian of the place in the map
//! has the rows g/w and h/w and the determinant (1 − pq)/w³, so that the sides of a texel of window extents X, Y are
//!
//! ```text
//! X w²/(1 − pq) · |(h₂, −h₁)|_G        Y w²/(1 − pq) · |(−g₂, g₁)|_G
//! ```

use glam::{DVec2, DVec3, Vec2};
use rayon::prelude::*;

use crate::aliasing::surface_from_place;
use crate::caster_image::{DIRECTIONS, direction};
use crate::seen::Sample;
use crate::warp::{Warp, Window};

/// Shapes that are tried at once.
pub const CHOICES: usize = 64;

/// Samples that they are measured at, at most: the difference of two shapes varies less from sample to sample than either does.
pub const MOST_SAMPLES: usize = 128;

/// The first step around the best; each of the [`ROUNDS`] tries this step and half of it, the next one begins with the half.
pub(crate) const FIRST_STEP: f32 = 0.25;

/// Rounds after the first.
pub(crate) const ROUNDS: u32 = 4;

/// A round that gains less than this share stays where it was: rounding decides nothing.
pub(crate) const SAME: f32 = 1.0 / 1024.0;

/// The least w, as a share of the largest, over the receivers: more has no use that the samples could tell, and f32 holds places.
pub(crate) const LEAST_W: f32 = 1.0 / 64.0;

/// The strengths of the perspective along the view that are tried first.
const STRENGTHS: [f32; 4] = [0.0, 0.375, 0.625, 0.8125];

/// The slants that are tried first, of both sides.
const SLANTS: [f32; 4] = [-0.625, -0.1875, 0.1875, 0.625];

/// Pairs of the four numbers.
const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// a, b, p and q.
pub type Shape = [f32; 4];

/// Shape `index` of the first round.
fn first(index: usize) -> Shape {
    [0.0, STRENGTHS[index / 16], SLANTS[index / 4 % 4], SLANTS[index % 4]]
}

/// Shape `index` of a later round: one number or two of them changed by a step, the second half of them by half a step.
fn around(best: Shape, step: f32, index: usize) -> Shape {
    let step = if index < CHOICES / 2 { step } else { step * 0.5 };
    let signed = |bit: usize| if bit == 0 { step } else { -step };
    let mut shape = best;
    match index % (CHOICES / 2) {
        one @ 0..8 => shape[one / 2] += signed(one & 1),
        two => {
            let [i, j] = PAIRS[(two - 8) / 4];
            shape[i] += signed(two & 1);
            shape[j] += signed(two >> 1 & 1);
        }
    }
    shape
}

/// The warp of a shape.
fn warp(scaled: &Warp, [a, b, p, q]: Shape) -> Warp {
    let [a, b, p, q] = [a, b, p, q].map(f64::from);
    let Warp { x: u, y: v, w } = *scaled;
    Warp { x: u + v * p, y: v + u * q, w: w + u * a + v * b }
}

/// How often samples must be halved, so that about [`MOST_SAMPLES`] are left.
fn thinning(samples: usize) -> u32 {
    (0..3).find(|halvings| samples >> halvings <= MOST_SAMPLES).unwrap_or(3)
}

/// Whether the sample of a tile stays. By its place and not its rank, so that one sample that is there or not changes no other.
fn stays([column, row]: [u32; 2], thinning: u32) -> bool {
    match thinning {
        0 => true,
        1 => (column ^ row) & 1 == 0,
        2 => (column | row) & 1 == 0,
        _ => (column | row) & 1 == 0 && (column ^ row) & 2 == 0,
    }
}

/// What a shape is measured by.
struct Measure {
    /// Receivers that reach farthest in each direction, (u, v).
    extremes: [Vec2; DIRECTIONS],
    /// (u, v) of samples, in lanes.
    places: [Vec<f32>; 2],
    /// Of the surface, its metric: of du², of 2 du dv, of dv².
    metrics: [Vec<f32>; 3],
}

/// How far to its left a direction leans: of receivers along a straight border that is square to it the last is the farthest, and no rounding
/// decides.
pub(crate) const LEAN: f64 = 1.0 / 64.0;

/// Samples side by side.
const LANES: usize = 8;

/// After how many samples it is asked whether the others can still matter.
const ASKED_EACH: usize = 4 * LANES;

impl Measure {
    fn new(scaled: &Warp, receivers: &[DVec2], samples: &[Sample]) -> Self {
        let extreme = |index: usize| {
            let along = direction(index) + direction(index + DIRECTIONS / 4) * LEAN;
            let farther = |best: (f64, DVec2), place: &DVec2| {
                let reach = along.dot(*place);
                if reach > best.0 { (reach, *place) } else { best }
            };
            let first = (along.dot(receivers[0]), receivers[0]);
            receivers.iter().skip(1).fold(first, farther).1.as_vec2()
        };
        let mut measure = Self {
            extremes: std::array::from_fn(extreme),
            places: Default::default(),
            metrics: Default::default(),
        };
        let thinning = thinning(samples.len());
        for sample in samples.iter().filter(|sample| stays(sample.tile, thinning)).take(MOST_SAMPLES) {
            let (first, second) = sample.normal.any_orthonormal_pair();
            let surface = surface_from_place(scaled, sample.point, [first, second]);
            let (u, v) = (surface.x_axis, surface.y_axis);
            let metric = [u.length_squared(), u.dot(v), v.length_squared()].map(|m| m as f32);
            if metric.iter().all(|m| m.is_finite()) {
                measure.push(scaled.place(sample.point).as_vec2(), metric);
            }
        }
        // Lanes without a sample weigh nothing.
        while !measure.places[0].len().is_multiple_of(LANES) {
            measure.push(Vec2::ZERO, [0.0; 3]);
        }
        measure
    }

    fn push(&mut self, place: Vec2, metric: [f32; 3]) {
        self.places.iter_mut().zip(place.to_array()).for_each(|(lane, value)| lane.push(value));
        self.metrics.iter_mut().zip(metric).for_each(|(lane, value)| lane.push(value));
    }

    /// The sum over the samples, up to a factor that all shapes have; infinite for one that has no w above 0 or no extent.
    #[cfg(test)]
    fn of(&self, shape: Shape) -> f32 {
        self.of_less(shape, f32::INFINITY)
    }

    /// As `of`, but infinite as soon as it is known not to be less than `limit`: no sample weighs less than nothing, and
    /// rounded sums do not fall either.
    fn of_less(&self, [a, b, p, q]: Shape, limit: f32) -> f32 {
        let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        let (mut least, mut largest) = (f32::INFINITY, 0f32);
        for place in self.extremes {
            let w = 1.0 + a * place.x + b * place.y;
            (least, largest) = (least.min(w), largest.max(w));
            let place = Vec2::new(place.x + p * place.y, place.y + q * place.x) / w;
            (low, high) = (low.min(place), high.max(place));
        }
        let determinant = 1.0 - p * q;
        if !(least > largest * LEAST_W && determinant > LEAST_W) {
            return f32::INFINITY;
        }
        let extent = high - low;
        let [us, vs] = &self.places;
        let [uu, uv, vv] = &self.metrics;
        let mut sums = [0f32; LANES];
        for start in (0..us.len()).step_by(LANES) {
            if start % ASKED_EACH == 0 && sums.iter().sum::<f32>() > limit * determinant {
                return f32::INFINITY;
            }
            let lanes = |values: &[f32]| -> [f32; LANES] { std::array::from_fn(|i| values[start + i]) };
            let [u, v, uu, uv, vv] = [us, vs, uu, uv, vv].map(|values| lanes(values));
            for i in 0..LANES {
                let w = 1.0 + a * u[i] + b * v[i];
                let (x, y) = ((u[i] + p * v[i]) / w, (v[i] + q * u[i]) / w);
                let (gu, gv) = (1.0 - x * a, p - x * b);
                let (hu, hv) = (q - y * a, 1.0 - y * b);
                let length =
                    |u: f32, v: f32| (uu[i] * u * u + 2.0 * uv[i] * u * v + vv[i] * v * v).max(0.0).sqrt();
                sums[i] += w * w * (length(hv, -hu) * extent.x + length(-gv, gu) * extent.y);
            }
        }
        sums.iter().sum::<f32>() / determinant
    }
}

/// The homography of `image` that promises the least error at `near_shadows` with a window around `receivers`, `window` that of them
/// in the image itself. `None` without receivers.
pub fn least(image: &Warp, window: &Window, receivers: &[DVec3], near_shadows: &[Sample]) -> Option<Warp> {
    // Its window goes to [−1, 1]².
    let scaled = window.fitted(image);
    let places: Vec<DVec2> = receivers.iter().map(|p| scaled.place(*p)).collect();
    if places.is_empty() || near_shadows.is_empty() {
        return None;
    }
    let measure = Measure::new(&scaled, &places, near_shadows);
    let mut best = ([0.0; 4], measure.of_less([0.0; 4], f32::INFINITY));
    let mut step = FIRST_STEP;
    for round in 0..=ROUNDS {
        let (center, limit) = best;
        let shape = |index| if round == 0 { first(index) } else { around(center, step, index) };
        let indices = (0..CHOICES).into_par_iter().with_min_len(CHOICES / 4);
        let errors: Vec<f32> = indices.map(|index| measure.of_less(shape(index), limit)).collect();
        // Of equal ones the first.
        let least = (0..CHOICES).map(shape).zip(errors).reduce(|a, b| if b.1 < a.1 { b } else { a });
        best = least.filter(|least| least.1 < limit * (1.0 - SAME)).unwrap_or(best);
        if round > 0 {
            step *= 0.5;
        }
    }
    Some(warp(&scaled, best.0))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use scene_core::light::LightPoint;

    use super::*;
    use crate::aliasing::expected_error;
    use crate::light_image::LightImage;

    /// A band of ground, askew to the view along −z, under slanting light; and places of a grid on it.
    fn band() -> (Warp, Vec<DVec3>, Vec<Sample>) {
        let towards = Vec3::new(0.48, 0.8, 0.36);
        let image = LightImage::new(LightPoint::Towards(towards), towards.as_dvec3(), DVec3::NEG_Z);
        let on = |along: f64, across: f64| DVec3::new(along + across, 0.0, -2.0 * along - 2.0 + across);
        let corners = [on(0.0, 0.0), on(0.0, 1.0), on(9.0, 0.0), on(9.0, 1.0)];
        let cells = (0..100u32).map(|i| [i % 10, i / 10]);
        let samples = cells.map(|tile| {
            let [along, across] = tile.map(f64::from);
            // Near ones are many, as a camera sees them.
            Sample { point: on(along * along * 0.1, across * 0.1), normal: DVec3::Y, tile }
        });
        (image.warp, corners.to_vec(), samples.collect())
    }

    fn window(warp: &Warp, receivers: &[DVec3]) -> Window {
        receivers.iter().fold(Window::EMPTY, |window, &p| window.with(warp.place(p)))
    }

    fn error(warp: &Warp, receivers: &[DVec3], samples: &[Sample]) -> f64 {
        let window = window(warp, receivers);
        samples.iter().map(|s| expected_error(warp, &window, 1, s.point, s.normal)).sum()
    }

    #[test]
    fn the_measure_is_the_expected_error() {
        let (image, receivers, samples) = band();
        let scaled = window(&image, &receivers).fitted(&image);
        let places: Vec<_> = receivers.iter().map(|&p| scaled.place(p)).collect();
        let measure = Measure::new(&scaled, &places, &samples);
        let shapes = [[0.0; 4], [0.1, 0.5, 0.0, 0.0], [-0.2, 0.3, 0.5, -0.25], [0.0, -0.4, -0.75, 0.5]];
        for shape in shapes {
            let expected = error(&warp(&scaled, shape), &receivers, &samples);
            let found = f64::from(measure.of(shape)) * 0.5;
            assert!((found / expected - 1.0).abs() < 1e-4, "{shape:?}: {found}, not {expected}");
        }
        // No w above 0, no extent.
        assert_eq!(measure.of([0.0, 1.0, 0.0, 0.0]), f32::INFINITY);
        assert_eq!(measure.of([0.0, 0.0, 1.0, 1.0]), f32::INFINITY);
    }

    /// A slant for the band, strength for its depth.
    #[test]
    fn the_least_is_far_below_the_even_map() {
        let (image, receivers, samples) = band();
        let even = error(&image, &receivers, &samples);
        let found = least(&image, &window(&image, &receivers), &receivers, &samples).expect("samples");
        let fitted = error(&found, &receivers, &samples);
        assert!(fitted < 0.75 * even, "{fitted}, {even}");
        // No shape of a finer lattice around it is much better.
        let scaled = window(&image, &receivers).fitted(&image);
        let places: Vec<_> = receivers.iter().map(|&p| scaled.place(p)).collect();
        let measure = Measure::new(&scaled, &places, &samples);
        let steps = |n: i32, from: f32| (0..n).map(move |i| from + i as f32 * 0.125);
        let all = steps(8, -0.5).flat_map(|a| steps(8, 0.0).map(move |b| [a, b]));
        let all = all
            .flat_map(|[a, b]| steps(16, -1.0).flat_map(move |p| steps(16, -1.0).map(move |q| [a, b, p, q])));
        let least = all.map(|shape| measure.of(shape)).fold(f32::INFINITY, f32::min);
        assert!(fitted < f64::from(least) * 0.5 * 1.1, "{fitted}, {least}");
        assert!(super::least(&image, &window(&image, &receivers), &receivers, &[]).is_none());
    }

    #[test]
    fn thinning_leaves_what_is_asked_for() {
        for (samples, halvings) in [(0, 0), (128, 0), (129, 1), (256, 1), (512, 2), (1024, 3)] {
            assert_eq!(thinning(samples), halvings);
        }
        for halvings in 0..4 {
            let tiles = (0..32).flat_map(|y| (0..32).map(move |x| [x, y]));
            assert_eq!(tiles.filter(|&tile| stays(tile, halvings)).count(), 1024 >> halvings);
        }
    }
}
