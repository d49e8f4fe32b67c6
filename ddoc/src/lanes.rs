//! Things of so many numbers each, sixteen at a time: of every sixteen things the first number of each, then the second, and so
//! on, so that what is asked of them together lies together.

use fearless_simd::{Simd, SimdBase, f32x16};
use glam::Vec3;

use crate::vectors::Vec3x16;

/// Lanes of a vector.
pub(crate) const LANES: usize = 16;

/// The lanes that bits name, one after the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Named(pub(crate) u64);

impl Iterator for Named {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lane = self.0.trailing_zeros() as usize % LANES;
        self.0 &= self.0 - 1;
        Some(lane)
    }
}

/// Things of N numbers each. Lanes after the last thing hold anything: [`valid`](Self::valid) tells them apart.
#[derive(Debug)]
pub(crate) struct Lanes<const N: usize> {
    vectors: Vec<[[f32; LANES]; N]>,
    count: usize,
}

impl<const N: usize> Default for Lanes<N> {
    fn default() -> Self {
        Self { vectors: Vec::new(), count: 0 }
    }
}

impl<const N: usize> Lanes<N> {
    /// How many there are.
    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Forgets all.
    pub(crate) fn clear(&mut self) {
        self.count = 0;
    }

    /// Makes them so many, whatever they are.
    pub(crate) fn resize(&mut self, count: usize) {
        let vectors = count.div_ceil(LANES);
        if self.vectors.len() < vectors {
            self.vectors.resize(vectors, [[0.0; LANES]; N]);
        }
        self.count = count;
    }

    /// Adds one.
    #[inline(always)]
    pub(crate) fn push(&mut self, values: [f32; N]) {
        let (vector, lane) = (self.count / LANES, self.count % LANES);
        self.resize(self.count + 1);
        for (part, value) in self.vectors[vector].iter_mut().zip(values) {
            part[lane] = value;
        }
    }

    /// The vectors, the last one not full.
    #[inline(always)]
    pub(crate) fn vectors(&self) -> usize {
        self.count.div_ceil(LANES)
    }

    /// Which lanes of a vector hold something, a bit each.
    #[inline(always)]
    pub(crate) fn valid(&self, vector: usize) -> u64 {
        (1 << (self.count - vector * LANES).min(LANES)) - 1
    }

    /// The numbers of a vector.
    #[inline(always)]
    pub(crate) fn vector(&self, vector: usize) -> &[[f32; LANES]; N] {
        &self.vectors[vector]
    }

    /// The same, to be written.
    #[inline(always)]
    pub(crate) fn vector_mut(&mut self, vector: usize) -> &mut [[f32; LANES]; N] {
        &mut self.vectors[vector]
    }

    /// The things of a vector.
    #[inline(always)]
    pub(crate) fn sixteen<S: Simd>(&self, simd: S, vector: usize) -> Sixteen<'_, S, N> {
        Sixteen { simd, parts: &self.vectors[vector] }
    }

    /// One thing.
    #[inline(always)]
    pub(crate) fn one<S: Simd>(&self, simd: S, thing: usize) -> One<'_, S, N> {
        One { simd, parts: &self.vectors[thing / LANES], lane: thing % LANES }
    }

    /// A number of one thing.
    #[inline(always)]
    pub(crate) fn at(&self, thing: usize, part: usize) -> f32 {
        self.vectors[thing / LANES][part][thing % LANES]
    }

    /// Three numbers of one thing from `part` on.
    #[inline(always)]
    pub(crate) fn three(&self, thing: usize, part: usize) -> Vec3 {
        Vec3::new(self.at(thing, part), self.at(thing, part + 1), self.at(thing, part + 2))
    }

    /// Moves the lanes that `bits` name, of a vector, down to where `kept` things are already, and says how many are kept then.
    #[inline(always)]
    pub(crate) fn keep(&mut self, vector: usize, bits: u64, mut kept: usize) -> usize {
        if kept == vector * LANES && bits == self.valid(vector) {
            return kept + bits.count_ones() as usize;
        }
        for lane in Named(bits) {
            let (to, to_lane) = (kept / LANES, kept % LANES);
            for part in 0..N {
                self.vectors[to][part][to_lane] = self.vectors[vector][part][lane];
            }
            kept += 1;
        }
        kept
    }
}

/// Where the numbers of a vector come from. What is made of them is the same code for [`Sixteen`] things and for [`One`].
pub(crate) trait Source<S: Simd>: Copy {
    /// One number.
    fn number(self, part: usize) -> f32x16<S>;

    /// Three from `part` on.
    #[inline(always)]
    fn three(self, part: usize) -> Vec3x16<S> {
        [self.number(part), self.number(part + 1), self.number(part + 2)]
    }
}

/// Sixteen things, a lane each.
#[derive(Clone, Copy)]
pub(crate) struct Sixteen<'a, S, const N: usize> {
    simd: S,
    parts: &'a [[f32; LANES]; N],
}

impl<S: Simd, const N: usize> Source<S> for Sixteen<'_, S, N> {
    #[inline(always)]
    fn number(self, part: usize) -> f32x16<S> {
        f32x16::load_array_ref(self.simd, &self.parts[part])
    }
}

/// One thing in all lanes.
#[derive(Clone, Copy)]
pub(crate) struct One<'a, S, const N: usize> {
    simd: S,
    parts: &'a [[f32; LANES]; N],
    lane: usize,
}

impl<S: Simd, const N: usize> Source<S> for One<'_, S, N> {
    #[inline(always)]
    fn number(self, part: usize) -> f32x16<S> {
        f32x16::splat(self.simd, self.parts[part][self.lane % LANES])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_moves_down_in_order() {
        let mut lanes = Lanes::<2>::default();
        (0..40).for_each(|i| lanes.push([i as f32, -(i as f32)]));
        assert_eq!((lanes.len(), lanes.vectors(), lanes.valid(2)), (40, 3, 0xff));
        let mut kept = 0;
        for vector in 0..3 {
            // All of the first vector, every third lane of the others.
            let bits = if vector == 0 { 0xffff } else { 0x9249 & lanes.valid(vector) };
            kept = lanes.keep(vector, bits, kept);
        }
        lanes.resize(kept);
        let found: Vec<_> = (0..lanes.len()).map(|thing| [lanes.at(thing, 0), lanes.at(thing, 1)]).collect();
        let expected = (0..16).chain([16, 19, 22, 25, 28, 31, 32, 35, 38]).map(|i| [i as f32, -(i as f32)]);
        assert!(found.into_iter().eq(expected));
    }
}
