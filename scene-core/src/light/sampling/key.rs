//! Counter-based random numbers: a sample's numbers depend on its key and index alone, not on who drew before.

use glam::Vec2;

use crate::splitmix::{GOLDEN, hash, mix};

/// What the random numbers of one pixel are drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleKey(u64);

/// The largest f32 below 1.
pub(super) const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

impl SampleKey {
    /// The key of a pixel (or of any other thing that is counted) under a seed.
    #[inline]
    pub fn new(seed: u64, pixel: u64) -> Self {
        Self(mix(hash(seed) ^ pixel.wrapping_mul(GOLDEN)))
    }

    /// 64 random bits, the same for the same index.
    #[inline]
    pub fn bits(self, index: u32) -> u64 {
        mix(self.0.wrapping_add((u64::from(index) + 1).wrapping_mul(GOLDEN)))
    }

    /// A random point of [0, 1)², the same for the same index.
    #[inline]
    pub fn square(self, index: u32) -> Vec2 {
        let bits = self.bits(index);
        Vec2::new(unit((bits >> 32) as u32), unit(bits as u32))
    }
}

/// The upper 24 bits of `bits` as a number in [0, 1): as many as an f32 holds, so nothing rounds up to 1.
#[inline]
pub(super) fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_depend_on_seed_pixel_and_index() {
        let base = SampleKey::new(1, 2).bits(3);
        assert_eq!(base, SampleKey::new(1, 2).bits(3));
        assert_ne!(base, SampleKey::new(2, 2).bits(3));
        assert_ne!(base, SampleKey::new(1, 3).bits(3));
        assert_ne!(base, SampleKey::new(1, 2).bits(4));
    }

    /// Neighbouring pixels' numbers are uncorrelated: of n products of centred uniform numbers the mean is 0
    /// with standard deviation 1/(12√n); five of them is a chance of 6·10⁻⁷ a pair.
    #[test]
    fn neighbours_are_uncorrelated() {
        let n = 100_000;
        let centred = |pixel: u64, index| SampleKey::new(9, pixel).square(index).as_dvec2() - 0.5;
        for (pixel, index) in [(1, 0), (512, 0), (0, 1)] {
            let products = (0..n).map(|p| centred(p, 0) * centred(p + pixel, index));
            let mean = products.fold(glam::DVec2::ZERO, |a, b| a + b) / n as f64;
            assert!(mean.abs().max_element() < 5.0 / (12.0 * (n as f64).sqrt()), "{pixel} {index}: {mean}");
        }
        let axes = (0..n).map(|p| centred(p, 0)).map(|c| c.x * c.y).sum::<f64>() / n as f64;
        assert!(axes.abs() < 5.0 / (12.0 * (n as f64).sqrt()));
    }

    #[test]
    fn the_unit_interval_is_half_open() {
        assert_eq!(unit(0), 0.0);
        assert_eq!(unit(u32::MAX), BELOW_ONE);
    }
}
