//! An Owen-scrambled (0, 2)-sequence in base 2.
//!
//! The first two dimensions of Sobol's sequence, each scrambled by a hash that flips every bit depending on the
//! bits above it: Owen's scrambling, by Burley, *Practical Hash-based Owen Scrambling* (JCGT 9(4), 2020). The
//! hash has the paper's factors, but the seed enters after each of them and not only at the start.

use glam::Vec2;

use super::SampleKey;
use super::key::unit;

/// Point `index` of the sequence of `key`, in [0, 1)².
///
/// Of any 2ᵐ points that start at a multiple of 2ᵐ (m ≤ 24), every dyadic box of area 2⁻ᵐ holds exactly one.
/// Over keys each point is uniform, so means over the light are unbiased.
#[inline]
pub fn sobol(index: u32, key: SampleKey) -> Vec2 {
    let seeds = key.bits(u32::MAX);
    sobol_of_seeds(index, [(seeds >> 32) as u32, seeds as u32])
}

/// Point `index` of the sequence that is scrambled by these seeds, one a dimension: what shaders have, where a
/// [`SampleKey`]'s 64 bits are not at hand.
#[inline]
pub fn sobol_of_seeds(index: u32, seeds: [u32; 2]) -> Vec2 {
    // In reversed bit order the first dimension, the bit reversal of the index, is the index itself.
    let x = owen_scramble_reversed(index, seeds[0]).reverse_bits();
    let y = owen_scramble_reversed(second_dimension_reversed(index), seeds[1]).reverse_bits();
    Vec2::new(unit(x), unit(y))
}

/// Sobol's second dimension, bit-reversed: bit j is the sum of C(i, j)·(bit i of the index) modulo 2, Pascal's
/// triangle. By Lucas' theorem that matrix is a fivefold Kronecker product of one of 2 × 2, so five steps do.
#[inline]
fn second_dimension_reversed(index: u32) -> u32 {
    let step = |bits: u32, shift: u32, kept: u32| bits ^ (bits >> shift & kept);
    let bits = step(index, 1, 0x5555_5555);
    let bits = step(bits, 2, 0x3333_3333);
    let bits = step(bits, 4, 0x0f0f_0f0f);
    let bits = step(bits, 8, 0x00ff_00ff);
    step(bits, 16, 0x0000_ffff)
}

/// Owen's scrambling of a bit-reversed number. In reversed order "each bit is flipped by those above it" reads
/// "by those below it", which is what additions, multiplications by odd numbers and xors with even multiples
/// do: none of them lets a bit reach downwards.
#[inline]
fn owen_scramble_reversed(mut bits: u32, seed: u32) -> u32 {
    bits = bits.wrapping_add(seed);
    for factor in [0x6c50_b47c_u32, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        bits ^= bits.wrapping_mul(factor);
        bits = bits.wrapping_mul(seed >> 15 | 1).wrapping_add(seed.rotate_left(7));
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(count: u32, pixel: u64) -> Vec<Vec2> {
        (0..count).map(|i| sobol(i, SampleKey::new(5, pixel))).collect()
    }

    /// The exact star discrepancy: the largest difference between the share of points in a box from the origin
    /// and its area. The supremum is reached at boxes through the points' coordinates, closed or open.
    fn star_discrepancy(points: &[Vec2]) -> f64 {
        let n = points.len();
        let mut by_x: Vec<_> = points.iter().map(|p| p.as_dvec2()).collect();
        by_x.sort_by(|a, b| a.x.total_cmp(&b.x));
        let mut edges: Vec<f64> = by_x.iter().map(|p| p.y).chain([1.0]).collect();
        edges.sort_by(f64::total_cmp);
        let mut worst: f64 = 0.0;
        for &y in &edges {
            let (mut open, mut closed) = (0, 0);
            for point in &by_x {
                // Open: strictly left of this point; closed: it and all on its left.
                worst = worst.max(point.x * y - f64::from(open) / n as f64);
                open += i32::from(point.y < y);
                closed += i32::from(point.y <= y);
                worst = worst.max(f64::from(closed) / n as f64 - point.x * y);
            }
            worst = worst.max(y - f64::from(open) / n as f64);
        }
        worst
    }

    #[test]
    fn every_elementary_box_holds_one_point() {
        for m in 0..=10 {
            for pixel in 0..8 {
                for block in 0..3 {
                    let n = 1u32 << m;
                    let points: Vec<_> =
                        (block * n..(block + 1) * n).map(|i| sobol(i, SampleKey::new(5, pixel))).collect();
                    for split in 0..=m {
                        let (columns, rows) = (1u32 << split, 1u32 << (m - split));
                        let mut seen = vec![false; n as usize];
                        for p in &points {
                            let cell = (p.y * rows as f32) as u32 * columns + (p.x * columns as f32) as u32;
                            assert!(!std::mem::replace(&mut seen[cell as usize], true), "{m} {split}");
                        }
                    }
                }
            }
        }
    }

    /// Niederreiter's bound for a (0, m, 2)-net in base 2: N·D* ≤ m/2 + 3/2.
    #[test]
    fn star_discrepancy_is_that_of_a_net() {
        for m in [4, 6, 8, 10] {
            for pixel in 0..4 {
                let n = 1 << m;
                let d = star_discrepancy(&points(n, pixel));
                assert!(d * f64::from(n) <= 0.5 * f64::from(m) + 1.5, "m = {m}: {d}");
            }
        }
    }

    /// The yardstick can fail: random points of the same number break the bound.
    #[test]
    fn random_points_are_not_a_net() {
        let random: Vec<_> = (0..1024).map(|i| SampleKey::new(1, 1).square(i)).collect();
        assert!(star_discrepancy(&random) * 1024.0 > 6.5);
        assert_eq!(star_discrepancy(&[Vec2::ZERO]), 1.0);
        assert_eq!(star_discrepancy(&[Vec2::new(0.5, 0.5)]), 0.75);
    }

    /// Over keys, the first point is uniform: chi-square in 16 × 16 cells; 330.5 is exceeded by 255 degrees of
    /// freedom with a chance of 10⁻³.
    #[test]
    fn scrambling_is_uniform_over_keys() {
        for index in [0, 1, 5] {
            let n = 100_000;
            let mut counts = [0f64; 256];
            for pixel in 0..n {
                let p = sobol(index, SampleKey::new(3, pixel)) * 16.0;
                counts[p.y as usize * 16 + p.x as usize] += 1.0;
            }
            let expected = n as f64 / 256.0;
            let chi2: f64 = counts.iter().map(|c| (c - expected).powi(2) / expected).sum();
            assert!(chi2 < 330.5, "point {index}: {chi2}");
        }
    }
}
