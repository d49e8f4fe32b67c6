//! Random numbers of a pixel, alike on CPU and GPU.

/// Hash of three words to three (Jarzynski and Olano: *Hash Functions for GPU Rendering*, JCGT 9(3), 2020): the twin
/// of `hash` in `sampling.wesl`. Keys should differ in their lower 24 bits; use the upper bits of the result first.
#[inline]
pub fn hash(key: [u32; 3]) -> [u32; 3] {
    let [mut x, mut y, mut z] = key.map(|word| word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    [x, y, z] = [x, y, z].map(|word| word ^ word >> 16);
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    [x, y, z]
}

/// Two numbers in [0, 1) that a pixel (column, row) draws under a seed.
#[inline]
pub fn pixel_numbers(pixel: [u32; 2], seed: u32) -> [f32; 2] {
    let [x, y, _] = hash([pixel[0], pixel[1], seed]);
    [x, y].map(|bits| (bits >> 8) as f32 * (1.0 / 16_777_216.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_differ_by_pixel_and_seed_and_fill_the_interval() {
        assert_ne!(pixel_numbers([1, 2], 0), pixel_numbers([2, 1], 0));
        assert_ne!(pixel_numbers([1, 2], 0), pixel_numbers([1, 2], 1));
        let n = 64 * 64;
        let sum: f32 = (0..n).map(|i| pixel_numbers([i % 64, i / 64], 7)[0]).sum();
        // Of n uniform numbers the mean is ½ with standard deviation 1/√(12·n) = 0.0045: five of them.
        assert!((sum / n as f32 - 0.5).abs() < 0.0226);
    }
}
