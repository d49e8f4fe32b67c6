//! `SplitMix64` (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014): numbers that look random from
//! numbers that count, and hashes from what is alike.

/// What the generator's state grows by: 2⁶⁴ over the golden ratio, odd, so that its multiples fill the ring of 64-bit numbers evenly.
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finaliser: each bit of the input changes each bit of the output with probability one half. It leaves 0 as it is.
#[inline]
pub fn mix(mut word: u64) -> u64 {
    word = (word ^ word >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ word >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ word >> 31
}

/// The number after the state `word`, 0 included: a hash of it.
#[inline]
pub fn hash(word: u64) -> u64 {
    mix(word.wrapping_add(GOLDEN))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first numbers of the generator from the state 0, as its authors' program gives them.
    #[test]
    fn numbers_are_the_generators() {
        let first = [0, GOLDEN, GOLDEN.wrapping_mul(2)].map(hash);
        assert_eq!(first, [0xe220_a839_7b1d_cdaf, 0x6e78_9e6a_a1b9_65f4, 0x06c4_5d18_8009_454f]);
    }
}
