//! The points of pass 4's kernel, and what each weighs.

use glam::Vec2;
use scene_core::Light;
use scene_core::light::sampling::{SampleKey, sobol};

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
}

impl Kernel {
    /// The kernel of `variant` for a light that is round or a rect.
    ///
    /// `pcf` is the light itself. A Gaussian has the light's variance a half axis: ¼ of a disk, ⅓ of a square. It ends
    /// at three σ (the paper's 3-sigma rule).
    pub fn of_light(variant: Variant, is_round: bool, taps: u32, seed: u32) -> Self {
        match (variant, is_round) {
            (Variant::Pcf, true) => Self::even(disk_points(taps, seed), false),
            (Variant::Pcf, false) => {
                Self::even(square_points(taps, seed).map(|point| point * 2.0 - 1.0).collect(), true)
            }
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

/// The (0, 2)-sequence of the unit square.
fn square_points(taps: u32, seed: u32) -> impl Iterator<Item = Vec2> {
    let key = SampleKey::new(u64::from(seed), 0);
    (0..taps).map(move |index| sobol(index, key))
}

/// The (0, 2)-sequence brought to the unit disk, equal areas to equal areas.
fn disk_points(taps: u32, seed: u32) -> Vec<Vec2> {
    square_points(taps, seed)
        .map(|square| {
            let p = square * 2.0 - 1.0;
            // Shirley and Chiu's concentric map: the larger coordinate is the radius.
            let (radius, other) = if p.x.abs() > p.y.abs() { (p.x, p.y) } else { (p.y, p.x) };
            let angle = if radius == 0.0 { 0.0 } else { other / radius * std::f32::consts::FRAC_PI_4 };
            let (along, across) = (radius * angle.cos(), radius * angle.sin());
            if p.x.abs() > p.y.abs() { Vec2::new(along, across) } else { Vec2::new(across, along) }
        })
        .collect()
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
