//! Edges or faces that may lie between a block of receivers and the light, chosen sixteen at a time.
//!
//! Blocks are cut again and again, and each part chooses from what the whole has: so only corners are held, component by
//! component, and the number of what they belong to.

use fearless_simd::{Simd, SimdBase, SimdMask, f32x16};

use crate::beam::Beam;

/// Lanes of a vector.
pub(crate) const LANES: usize = 16;

/// Moves the lanes that `bits` name, of the vector at `first`, down to where `kept` are already, and says how many are kept then.
#[inline(always)]
pub(crate) fn keep_lanes(parts: &mut [Vec<f32>], first: usize, mut bits: u64, mut kept: usize) -> usize {
    while bits != 0 {
        let lane = first + bits.trailing_zeros() as usize;
        bits &= bits - 1;
        parts.iter_mut().for_each(|part| part[kept] = part[lane]);
        kept += 1;
    }
    kept
}

/// Things of N/3 corners each.
#[derive(Debug)]
pub(crate) struct Chosen<const N: usize> {
    /// Which, and how many; what comes after them fills the last vector.
    indices: Vec<u32>,
    count: usize,
    /// x, y and z of the corners, from the origin of edges.
    parts: [Vec<f32>; N],
}

impl<const N: usize> Default for Chosen<N> {
    fn default() -> Self {
        Self { indices: Vec::new(), count: 0, parts: std::array::from_fn(|_| Vec::new()) }
    }
}

impl<const N: usize> Chosen<N> {
    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Which they are.
    pub(crate) fn indices(&self) -> &[u32] {
        &self.indices[..self.count]
    }

    /// Makes room for so many, and a vector more: one is written whole wherever those before it ended.
    fn resize(&mut self, count: usize) {
        let padded = count + 2 * LANES;
        if self.indices.len() < padded {
            self.indices.resize(padded, 0);
            self.parts.iter_mut().for_each(|part| part.resize(padded, 0.0));
        }
    }

    /// Takes over the lanes of a vector that `bits` name.
    #[inline(always)]
    fn take(&mut self, mut bits: u64, indices: &[u32; LANES], parts: &[[f32; LANES]; N]) {
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize % LANES;
            bits &= bits - 1;
            let at = self.count;
            self.indices[at] = indices[lane];
            for (to, from) in self.parts.iter_mut().zip(parts) {
                to[at] = from[lane];
            }
            self.count += 1;
        }
    }

    /// Takes those of `things` that [`Beam`] lets through; all without one. `corners` gives a thing's.
    #[inline(always)]
    pub(crate) fn gather<S: Simd>(
        &mut self,
        simd: S,
        mut things: impl Iterator<Item = u32>,
        corners: impl Fn(u32) -> [f32; N],
        beam: Option<&Beam>,
    ) {
        self.count = 0;
        let (mut indices, mut parts) = ([0u32; LANES], [[0.0f32; LANES]; N]);
        loop {
            let mut count = 0;
            while count < LANES
                && let Some(index) = things.next()
            {
                for (part, value) in parts.iter_mut().zip(corners(index)) {
                    part[count] = value;
                }
                indices[count] = index;
                count += 1;
            }
            self.resize(self.count + count);
            self.take(inside(simd, beam, &parts) & ((1 << count) - 1), &indices, &parts);
            if count < LANES {
                break;
            }
        }
    }

    /// Takes those of `other` that `beam` lets through; all without one.
    #[inline(always)]
    pub(crate) fn take_within<S: Simd>(&mut self, simd: S, other: &Self, beam: Option<&Beam>) {
        self.count = 0;
        self.resize(other.count);
        let (mut indices, mut parts) = ([0u32; LANES], [[0.0f32; LANES]; N]);
        for first in (0..other.count).step_by(LANES) {
            indices.copy_from_slice(&other.indices[first..first + LANES]);
            for (to, from) in parts.iter_mut().zip(&other.parts) {
                to.copy_from_slice(&from[first..first + LANES]);
            }
            let valid = (1 << (other.count - first).min(LANES)) - 1;
            self.take(inside(simd, beam, &parts) & valid, &indices, &parts);
        }
    }
}

/// Lanes that do not lie outside, a bit each.
#[inline(always)]
fn inside<S: Simd, const N: usize>(simd: S, beam: Option<&Beam>, parts: &[[f32; LANES]; N]) -> u64 {
    let Some(beam) = beam else { return u64::MAX };
    let mut outside = 0;
    for plane in &beam.planes {
        let mut beyond = u64::MAX;
        for corner in parts.chunks_exact(3) {
            let (x, y) = (f32x16::load_array_ref(simd, &corner[0]), f32x16::load_array_ref(simd, &corner[1]));
            let z = f32x16::load_array_ref(simd, &corner[2]);
            let height = x * plane.x + y * plane.y + z * plane.z + plane.w;
            beyond &= height.simd_gt(0.0).to_bitmask();
        }
        outside |= beyond;
    }
    !outside
}
