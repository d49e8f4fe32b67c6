//! Points that fill the unit disk without coming close to each other.

use glam::Vec2;
use scene_core::light::sampling::SampleKey;

/// Candidates a point. Twice as many raise the least distance by a few percent and cost twice the time.
const CANDIDATES: u32 = 32;

/// `count` points of the unit disk, each the farthest from those before it of a few random candidates: Mitchell's best
/// candidate (*Spectrally Optimal Sampling for Distribution Ray Tracing*, 1991), which tends to a Poisson disk. Any
/// prefix is well spread too. O(`count`²).
pub fn poisson_disk(count: u32, seed: u32) -> Vec<Vec2> {
    let key = SampleKey::new(u64::from(seed), 0);
    let mut points: Vec<Vec2> = Vec::with_capacity(count as usize);
    for index in 0..count {
        let candidate = |number: u32| {
            let square = key.square(index * CANDIDATES + number);
            Vec2::from_angle(square.x * std::f32::consts::TAU) * square.y.sqrt()
        };
        let gap = |point: &Vec2| {
            points.iter().map(|other| other.distance_squared(*point)).fold(f32::INFINITY, f32::min)
        };
        let best = (0..CANDIDATES).map(candidate).max_by(|a, b| gap(a).total_cmp(&gap(b)));
        points.extend(best);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    /// n disks of radius r that do not overlap fill at most the disk of radius 1 + r: r is below 1/(√n − 1). Random
    /// points come far closer than a third of the distance that a square grid of n points has.
    #[test]
    fn points_keep_their_distance() {
        for count in [2u32, 16, 64, 256] {
            let points = poisson_disk(count, 3);
            assert_eq!(points.len(), count as usize);
            let grid = (std::f32::consts::PI / count as f32).sqrt();
            for (i, a) in points.iter().enumerate() {
                assert!(a.length() <= 1.0);
                assert!(points[..i].iter().all(|b| a.distance(*b) > grid / 3.0), "{count}: point {i}");
            }
        }
    }
}
