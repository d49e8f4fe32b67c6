//! Samples of the light on its plane, in an order that edges can be counted in.

use glam::{DVec2, Vec3};
use scene_core::Light;
use scene_core::light::LightPoint;
use scene_core::light::sampling::{LightView, SampleKey, low_discrepancy};

use crate::area_light::Outline;

/// Samples that are looked at together.
pub const LANES: usize = 16;

/// Patterns of a light: one for each pixel of a tile of 8 × 8.
pub const PATTERNS: usize = 64;

/// Points of the square [−1, 1]² or the unit disk, in groups that rise by v: a scrambled (0, 2)-sequence
/// ([`low_discrepancy`]). Of 256 points of a square each 256th of its width and of its height holds one, so that a straight
/// edge along a side of the light is right to 1/256.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// First coordinates. The last group is filled up with its last sample.
    pub u: Vec<[f32; LANES]>,
    /// Second coordinates.
    pub v: Vec<[f32; LANES]>,
    /// The least and the greatest second coordinate of each group.
    pub span: Vec<[f32; 2]>,
    /// Samples there are.
    pub count: usize,
}

impl Samples {
    /// `count` samples of pattern `index`.
    pub fn new(is_round: bool, count: u32, seed: u64, index: usize) -> Self {
        let light = if is_round {
            Light::Disk { center: Vec3::ZERO, normal: Vec3::Z, radius: 1.0 }
        } else {
            Light::Rect { center: Vec3::ZERO, half_u: Vec3::X, half_v: Vec3::Y }
        };
        let mut points = vec![LightPoint::At(Vec3::ZERO); count.max(1) as usize];
        low_discrepancy(
            &LightView::new(&light, Vec3::NEG_Z),
            SampleKey::new(seed, index as u64),
            &mut points,
        );
        let mut points: Vec<[f32; 2]> = points
            .into_iter()
            .map(|point| match point {
                LightPoint::At(p) | LightPoint::Towards(p) => [p.x, p.y],
            })
            .collect();
        points.sort_by(|a, b| a[1].total_cmp(&b[1]));
        let mut samples = Self { count: points.len(), ..Self::default() };
        for group in points.chunks(LANES) {
            let at = |lane: usize| group[lane.min(group.len() - 1)];
            samples.u.push(std::array::from_fn(|lane| at(lane)[0]));
            samples.v.push(std::array::from_fn(|lane| at(lane)[1]));
        }
        samples.find_spans();
        samples
    }

    /// The sample's place on the plane.
    #[inline]
    pub fn at(&self, sample: usize) -> DVec2 {
        let (group, lane) = (sample / LANES, sample % LANES);
        DVec2::new(f64::from(self.u[group][lane]), f64::from(self.v[group][lane]))
    }

    /// Moves the samples of a disk along their radii so that equal shares of the disk become equal shares of the solid angle
    /// of a cap; others are copied as they are.
    ///
    /// With s² uniform, a direction at the angle t from the middle has 1 − cos t = s²·h, h = 1 − cos θ at the rim, and
    /// lies at tan t / tan θ on the plane: at √(h(2 − l)) / ((1 − l) tan θ) times s, l = s²·h.
    #[inline(always)]
    pub fn placed(&self, outline: Outline, into: &mut Self) {
        into.u.clone_from(&self.u);
        into.v.clone_from(&self.v);
        into.count = self.count;
        if let Outline::Cap(tan) = outline {
            let secant = tan.hypot(1.0);
            let h = tan * tan / (secant * (1.0 + secant));
            let (h, factor) = (h as f32, (h.sqrt() / tan) as f32);
            for (u, v) in into.u.iter_mut().zip(&mut into.v) {
                for lane in 0..LANES {
                    let l = h * (u[lane] * u[lane] + v[lane] * v[lane]);
                    let stretch = factor * (2.0 - l).sqrt() / (1.0 - l);
                    u[lane] *= stretch;
                    v[lane] *= stretch;
                }
            }
            into.find_spans();
        } else {
            into.span.clone_from(&self.span);
        }
    }

    #[inline(always)]
    fn find_spans(&mut self) {
        self.span.clear();
        self.span.extend(self.v.iter().map(|v| {
            v.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], &v| [low.min(v), high.max(v)])
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_fill_the_light_and_rise() {
        for (is_round, count) in [(false, 256), (false, 7), (true, 64), (true, 1)] {
            let samples = Samples::new(is_round, count, 3, 5);
            assert_eq!(samples.count, count as usize);
            let points: Vec<_> = (0..samples.count).map(|i| samples.at(i)).collect();
            assert!(points.is_sorted_by(|a, b| a.y <= b.y));
            let inside = |p: &DVec2| if is_round { p.length() < 1.0 } else { p.abs().max_element() < 1.0 };
            assert!(points.iter().all(inside));
            if count > 50 {
                let mean = points.iter().sum::<DVec2>() / points.len() as f64;
                assert!(mean.length() < 0.05, "{mean}");
            }
        }
        assert_ne!(Samples::new(false, 16, 3, 5).u, Samples::new(false, 16, 3, 6).u);
    }

    /// The share of samples within half the rim's angle is that of the solid angle.
    #[test]
    fn caps_are_filled_by_solid_angle() {
        let disk = Samples::new(true, 4096, 0, 0);
        let mut cap = Samples::default();
        for angle in [0.1_f64, 0.8, 1.3] {
            disk.placed(Outline::Cap(angle.tan()), &mut cap);
            let limit = (angle / 2.0).tan() / angle.tan();
            let within = (0..cap.count).filter(|&i| cap.at(i).length() < limit).count();
            let expected = (1.0 - (angle / 2.0).cos()) / (1.0 - angle.cos());
            assert!((within as f64 / 4096.0 - expected).abs() < 0.01, "{angle}: {within} {expected}");
            assert!((0..cap.count).all(|i| cap.at(i).length() < 1.0 + 1e-6));
        }
    }
}
