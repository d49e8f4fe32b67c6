//! The points of pass 4's kernel, and what each weighs.

use glam::Vec2;
use scene_core::Light;
use scene_core::light::sampling::SampleKey;

use crate::params::{ContactHardeningParams, Scaling, Variant};

/// Candidates a point: twice as many raise the least distance by a few percent.
const CANDIDATES: u32 = 32;

/// A kernel in the light's half axes: the unit disk or the square [−1, 1]² is the light.
#[derive(Clone, Debug)]
pub struct Kernel {
    /// Where the points are.
    pub points: Vec<Vec2>,
    /// What they weigh; 1 in all.
    pub weights: Vec<f32>,
    /// How far from the middle they reach, in half axes.
    pub reach: f32,
    /// Whether a pixel shifts the points (within a square) instead of turning them.
    pub is_square: bool,
}

impl ContactHardeningParams {
    /// The kernel that these settings blur with under a light.
    pub fn kernel_for(&self, light: &Light) -> Kernel {
        match self.scaling {
            Scaling::Physical => {
                let is_round = !matches!(light, Light::Rect { .. });
                Kernel::of_light(self.variant, is_round, self.taps, self.seed)
            }
            Scaling::Paper => Kernel::gaussian(self.taps, self.seed),
        }
    }

    /// The kernel of twice as many points with `physical` scaling.
    pub fn fine_kernel_for(&self, light: &Light) -> Kernel {
        let times = if self.scaling == Scaling::Physical { 2 } else { 1 };
        Self { taps: self.taps * times, ..*self }.kernel_for(light)
    }
}

impl Kernel {
    /// The kernel of `variant` for a light that is round or a rect.
    ///
    /// `pcf` is the light itself. A Gaussian has the light's variance a half axis: ¼ of a disk, ⅓ of a square. It ends
    /// at three σ (the paper's 3-sigma rule).
    pub fn of_light(variant: Variant, is_round: bool, taps: u32, seed: u32) -> Self {
        match (variant, is_round) {
            (Variant::Pcf, true) => Self::even(disk_points(taps), false),
            (Variant::Pcf, false) => Self::even(square_points(taps), true),
            (Variant::Gaussian | Variant::MultiPass, _) => {
                let sigma = if is_round { 0.5f32 } else { (1.0f32 / 3.0).sqrt() };
                let mut kernel = Self::gaussian(taps, seed);
                kernel.points.iter_mut().for_each(|point| *point *= 3.0 * sigma);
                kernel.reach = 3.0 * sigma;
                kernel
            }
        }
    }

    /// Poisson points of the unit disk, weighed by a Gaussian of σ = ⅓.
    pub fn gaussian(taps: u32, seed: u32) -> Self {
        let points = poisson_points(taps, seed);
        let weight = |point: &Vec2| (-4.5 * point.length_squared()).exp();
        let sum: f32 = points.iter().map(weight).sum();
        let weights = points.iter().map(|point| weight(point) / sum).collect();
        Self { points, weights, reach: 1.0, is_square: false }
    }

    fn even(points: Vec<Vec2>, is_square: bool) -> Self {
        let weights = vec![1.0 / points.len() as f32; points.len()];
        Self { points, weights, reach: 1.0, is_square }
    }

    /// Points and weights as one pixel sees them; `numbers`, in [0, 1), are its own.
    #[inline]
    pub fn turned(&self, numbers: [f32; 2]) -> impl Iterator<Item = (Vec2, f32)> + '_ {
        let rotation = Vec2::from_angle(numbers[0] * std::f32::consts::TAU);
        let shift = Vec2::from(numbers) * 2.0;
        self.points.iter().zip(&self.weights).map(move |(&point, &weight)| {
            if self.is_square {
                // Shifted within [−1, 1)², what leaves comes in on the other side.
                let at = point + shift;
                (at - Vec2::new(wrap(at.x), wrap(at.y)), weight)
            } else {
                (rotation.rotate(point), weight)
            }
        })
    }
}

/// 1/φ of the golden section φ: of all numbers its multiples, modulo 1, are spread most evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A lattice of [−1, 1]²: columns in equal steps, rows by the golden section. It may be shifted by whatever is asked for, what leaves
/// coming in on the other side.
///
/// An edge parts the light's points, and what V is wrong by is what the numbers on its sides are off. Over edges of all directions and
/// places, 64 points and the square that is 0.0134 (root of the mean square) and of a (0, 2)-sequence 0.0161; over strips 0.0167 and
/// 0.0209.
fn square_points(taps: u32) -> Vec<Vec2> {
    let row = |index: u32| (f64::from(index) * GOLDEN).fract() as f32;
    let point = |index: u32| Vec2::new((index as f32 + 0.5) / taps as f32, row(index));
    (0..taps).map(|index| point(index) * 2.0 - 1.0).collect()
}

/// The seeds of a sunflower (Vogel 1979): equal areas within equal radii, turned on by the golden angle. It may be turned by any angle.
/// Of the disk the numbers above are 0.0125 and, by the concentric map of a (0, 2)-sequence, 0.0149; of strips 0.0165 and 0.0206.
fn disk_points(taps: u32) -> Vec<Vec2> {
    let golden_angle = std::f64::consts::TAU * (1.0 - GOLDEN);
    let turn = |index: u32| (f64::from(index) * golden_angle) as f32;
    let radius = |index: u32| ((index as f32 + 0.5) / taps as f32).sqrt();
    (0..taps).map(|index| Vec2::from_angle(turn(index)) * radius(index)).collect()
}

/// 2 if beyond 1.
fn wrap(at: f32) -> f32 {
    if at >= 1.0 { 2.0 } else { 0.0 }
}

/// Points of the unit disk far from each other, the first at the origin: each next one is the farthest from those before
/// it of a few random candidates (Mitchell 1991), so any prefix is well spread. They come in opposite pairs: an odd number
/// of them has its mean at the origin, and a blur by it moves no shadow aside.
pub fn poisson_points(count: u32, seed: u32) -> Vec<Vec2> {
    let key = SampleKey::new(u64::from(seed), 1);
    let mut points = vec![Vec2::ZERO];
    for index in 1..count {
        if index % 2 == 0 {
            points.push(-points[points.len() - 1]);
            continue;
        }
        let candidate = |number: u32| {
            let square = key.square(index * CANDIDATES + number);
            Vec2::from_angle(square.x * std::f32::consts::TAU) * square.y.sqrt()
        };
        // The border counts as a neighbour half a gap away, or points would crowd on it; so does the opposite point.
        let gap = |point: &Vec2| {
            let length = point.length();
            let own = (2.0 * (1.0 - length)).min(2.0 * length);
            points.iter().map(|other| other.distance(*point)).fold(own, f32::min)
        };
        let best = (0..CANDIDATES).map(candidate).max_by(|a, b| gap(a).total_cmp(&gap(b)));
        points.extend(best);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_weigh_one_and_stay_within_their_reach() {
        for variant in Variant::ALL {
            for is_round in [true, false] {
                let kernel = Kernel::of_light(variant, is_round, 20, 3);
                assert!((kernel.weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                for (point, _) in kernel.turned([0.3, 0.8]) {
                    let length = if kernel.is_square { point.abs().max_element() } else { point.length() };
                    assert!(length <= kernel.reach * 1.00001, "{variant:?}: {point}");
                }
            }
        }
    }

    /// Root of the mean square of what edges of all directions and places are wrong by, over `kernel` as `pixels` pixels see it.
    fn error_of_edges(kernel: &Kernel, pixels: u32) -> f64 {
        let (mut sum, mut count) = (0.0, 0u32);
        for pixel in 0..pixels {
            let numbers = gnomon_shadow_map::pixel_hash::pixel_numbers([pixel, 1], 0);
            let across = Vec2::from_angle(2.4 * pixel as f32 + 0.3);
            let extent = if kernel.is_square { across.abs().element_sum() } else { 1.0 };
            for place in 0..16 {
                let edge = ((place as f32 + 0.5) / 8.0 - 1.0) * extent;
                let dark = kernel.turned(numbers).filter(|(at, _)| at.dot(across) < edge);
                let dark: f32 = dark.map(|(_, weight)| weight).sum();
                let exact = if kernel.is_square {
                    // Of the sum of two numbers that are spread evenly within ± their share of the direction.
                    let Vec2 { x, y } = across.abs();
                    let square = |at: f32| at.max(0.0).powi(2);
                    (square(edge + x + y) - square(edge + x - y) - square(edge - x + y)
                        + square(edge - x - y))
                        / (8.0 * x * y)
                } else {
                    1.0 - (edge.acos() - edge * (1.0 - edge * edge).sqrt()) / std::f32::consts::PI
                };
                sum += f64::from(dark - exact).powi(2);
                count += 1;
            }
        }
        (sum / f64::from(count)).sqrt()
    }

    /// Points that are moved at random, each within a cell of its own, are wrong by the root of n^(−3/2)/6.
    #[test]
    fn points_of_the_light_tell_edges_better_than_random_ones_in_cells_do() {
        for (is_round, taps) in [(true, 16), (true, 64), (false, 16), (false, 33), (false, 64)] {
            let kernel = Kernel::of_light(Variant::Pcf, is_round, taps, 0);
            let error = error_of_edges(&kernel, 500);
            let in_cells = (f64::from(taps).powf(-1.5) / 6.0).sqrt();
            assert!(error < 0.8 * in_cells, "{is_round}, {taps}: {error}, {in_cells}");
        }
    }

    #[test]
    fn the_first_point_is_the_origin_and_prefixes_agree() {
        let points = poisson_points(64, 5);
        assert_eq!(points[0], Vec2::ZERO);
        assert_eq!(points[..7], poisson_points(7, 5));
        let nearest = (0..64)
            .flat_map(|i| points[..i].iter().map(|b| b.distance(points[i])).collect::<Vec<_>>())
            .fold(f32::INFINITY, f32::min);
        assert!(points[..63].iter().sum::<Vec2>().length() < 1e-5);
        // A square grid of 64 points in the disk has gaps of 0.22.
        assert!(nearest > 0.22 / 3.0, "{nearest}");
    }
}
