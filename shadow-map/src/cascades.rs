//! Cascades for a directional light: the depths that the camera sees, split into parts that each get a map.
//!
//! After Lauritzen, Salvi and Lefohn, "Sample distribution shadow maps" (I3D 2010): depths are split in equal ratios
//! between the nearest and the farthest *seen*, not between clip planes, and each part's map is fitted to its samples
//! as the light sees them. What nobody sees gets no texels.

use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;
use scene_core::geometry::Aabb;

/// Cascades at most.
pub const MAX_CASCADES: usize = 8;

/// A depth rounded to 2⁻¹² of itself: backends that raise to powers with other last digits split at the same place.
fn rounded(depth: f32) -> f32 {
    f32::from_bits((depth.to_bits() + 0x800) & 0xffff_f000)
}

/// Depths at which `near` to `far` splits into `count` parts of equal ratio: where each part ends, the last at `far`.
/// A range that is empty or does not begin above 0 has all of its ends at `far`.
pub fn splits(near: f32, far: f32, count: usize) -> Vec<f32> {
    let count = count.clamp(1, MAX_CASCADES);
    let ratio = f64::from(far) / f64::from(near);
    let inner = (1..count).map(|i| {
        let depth = f64::from(near) * ratio.powf(i as f64 / count as f64);
        if near > 0.0 && ratio.is_finite() { rounded(depth as f32) } else { far }
    });
    inner.chain([far]).collect()
}

/// The cascade of a depth: the first whose end it does not exceed, or the last.
#[inline]
pub fn cascade_of(splits: &[f32], depth: f32) -> usize {
    splits.iter().position(|&end| depth <= end).unwrap_or(splits.len().saturating_sub(1))
}

/// What the light sees of one cascade's samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Samples {
    /// Bounds in the light's axes.
    pub bounds: Aabb,
    /// How many there are.
    pub count: u32,
}

impl Samples {
    /// None.
    pub const NONE: Self = Self { bounds: Aabb::EMPTY, count: 0 };

    /// With one more, given in the light's axes.
    #[inline]
    pub fn with(self, sample: Vec3) -> Self {
        Self { bounds: self.bounds.with_point(sample), count: self.count + 1 }
    }

    /// Both.
    pub fn union(self, other: Self) -> Self {
        Self { bounds: self.bounds.union(other.bounds), count: self.count + other.count }
    }
}

/// The samples by cascade, in the light's axes, of `(depth, position)` pairs.
pub fn by_cascade(
    axes: Mat3,
    splits: &[f32],
    samples: impl IndexedParallelIterator<Item = Option<(f32, Vec3)>>,
) -> [Samples; MAX_CASCADES] {
    let light_from_world = axes.transpose();
    let empty = || [Samples::NONE; MAX_CASCADES];
    samples
        .fold(empty, |mut cascades, sample| {
            if let Some((depth, position)) = sample {
                let cascade = &mut cascades[cascade_of(splits, depth).min(MAX_CASCADES - 1)];
                *cascade = cascade.with(light_from_world * position);
            }
            cascades
        })
        .reduce(empty, |a, b| std::array::from_fn(|i| a[i].union(b[i])))
}

/// The window of a cascade's map: its samples' bounds across the light, cut to those of the casters (beyond them
/// nothing is in shadow), with a margin of `border` texels. `None` if the two do not meet.
///
/// The border keeps a sample on the rim, whose texel's centre may lie half a texel outside, within the map.
pub fn window(samples: &Samples, casters: Aabb, map_size: u32, border: f32) -> Option<(Vec2, Vec2)> {
    if samples.count == 0 || casters.is_empty() {
        return None;
    }
    let min = samples.bounds.min.max(casters.min).truncate();
    let max = samples.bounds.max.min(casters.max).truncate();
    let margin = (max - min) * (border / map_size.max(1) as f32);
    min.cmple(max).all().then(|| (min - margin, max + margin))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_have_equal_ratios_and_end_at_the_farthest() {
        let ends = splits(1.0, 16.0, 4);
        for (end, expected) in ends.iter().zip([2.0, 4.0, 8.0, 16.0]) {
            assert!((end - expected).abs() < 1e-5, "{ends:?}");
        }
        assert_eq!(ends[3], 16.0);
        assert_eq!(splits(0.0, 5.0, 3), [5.0; 3]);
        assert_eq!(splits(f32::INFINITY, f32::NEG_INFINITY, 2), [f32::NEG_INFINITY; 2]);
        assert_eq!(splits(3.0, 3.0, 2), [3.0; 2]);
        assert_eq!(splits(1.0, 2.0, 0).len(), 1);
    }

    #[test]
    fn every_depth_has_a_cascade() {
        let ends = splits(1.0, 16.0, 4);
        assert_eq!([0.5, 1.9, 2.1, 15.0, 16.0, 99.0].map(|d| cascade_of(&ends, d)), [0, 0, 1, 3, 3, 3]);
    }

    #[test]
    fn windows_hold_their_samples_and_no_more_than_the_casters() {
        let samples =
            [Some((1.0, Vec3::ZERO)), None, Some((1.5, Vec3::new(2.0, 1.0, 5.0))), Some((9.0, Vec3::X))];
        let found = by_cascade(Mat3::IDENTITY, &[2.0, 10.0], samples.into_par_iter());
        assert_eq!([found[0].count, found[1].count, found[2].count], [2, 1, 0]);
        let casters = Aabb { min: Vec3::splat(-1.0), max: Vec3::splat(1.5) };
        let (min, max) = window(&found[0], casters, 100, 1.0).expect("they meet");
        assert!(
            (min - Vec2::new(-0.015, -0.01)).length() < 1e-6
                && (max - Vec2::new(1.515, 1.01)).length() < 1e-6
        );
        assert_eq!(window(&found[2], casters, 100, 1.0), None);
        assert_eq!(window(&found[0], Aabb::EMPTY, 100, 1.0), None);
    }
}
