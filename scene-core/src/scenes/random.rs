//! A small seeded generator, so that scenes are the same everywhere and for ever.

use glam::Vec2;

/// `SplitMix64` (Steele, Lea, Flood 2014): a counter and a mixer, good enough to place leaves.
#[derive(Clone, Debug)]
pub(super) struct Random(u64);

impl Random {
    /// A sequence of its own for each pair: scene parts draw from different streams, so that adding to one
    /// does not change another.
    pub(super) fn new(seed: u32, stream: u32) -> Self {
        let mut random = Self(u64::from(seed) << 32 | u64::from(stream));
        random.next();
        random
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    /// Uniform in [0, 1).
    pub(super) fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 * (1.0 / (1u32 << 24) as f32)
    }

    /// Uniform in [low, high).
    pub(super) fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform in [−1, 1) × [−1, 1).
    pub(super) fn square(&mut self) -> Vec2 {
        Vec2::new(self.range(-1.0, 1.0), self.range(-1.0, 1.0))
    }

    /// An angle in [0, 2π).
    pub(super) fn angle(&mut self) -> f32 {
        self.range(0.0, std::f32::consts::TAU)
    }

    /// Uniform in 0 … `count` − 1; `count` must not be zero.
    pub(super) fn index(&mut self, count: usize) -> usize {
        ((self.unit() * count as f32) as usize).min(count - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_and_repeat() {
        let draw = |seed, stream| {
            let mut random = Random::new(seed, stream);
            [random.unit(), random.unit()]
        };
        assert_eq!(draw(1, 0), draw(1, 0));
        assert_ne!(draw(1, 0), draw(2, 0));
        assert_ne!(draw(1, 0), draw(1, 1));
    }

    #[test]
    fn ranges_are_kept_and_filled() {
        let mut random = Random::new(7, 7);
        let mut hits = [0; 10];
        for _ in 0..10_000 {
            let x = random.range(2.0, 4.0);
            assert!((2.0..4.0).contains(&x));
            hits[random.index(10)] += 1;
        }
        // 1,000 each with a standard deviation of 30.
        assert!(hits.iter().all(|&n| (850..1150).contains(&n)), "{hits:?}");
    }
}
