//! Edges or faces that may lie between a block of receivers and the light, chosen sixteen at a time.
//!
//! Blocks are cut again and again, and each part chooses from what the whole has: so only corners are held, component by
//! component, and the number of what they belong to.

use fearless_simd::{Simd, SimdBase, SimdMask, f32x16};
use glam::Vec3;

use crate::beam::Beam;
use crate::lanes::{LANES, Lanes, Named};

/// Things of N/3 corners each.
#[derive(Debug)]
pub(crate) struct Chosen<const N: usize> {
    /// Which; what comes after them fills the last vector.
    indices: Vec<u32>,
    /// x, y and z of the corners.
    corners: Lanes<N>,
}

impl<const N: usize> Default for Chosen<N> {
    fn default() -> Self {
        Self { indices: Vec::new(), corners: Lanes::default() }
    }
}

impl<const N: usize> Chosen<N> {
    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.corners.len()
    }

    /// Which they are.
    pub(crate) fn indices(&self) -> &[u32] {
        &self.indices[..self.len()]
    }

    /// Their corners.
    pub(crate) fn corners(&self) -> &Lanes<N> {
        &self.corners
    }

    /// Takes over the lanes of a vector that `bits` name.
    #[inline(always)]
    fn take(&mut self, bits: u64, indices: &[u32; LANES], parts: &[[f32; LANES]; N]) {
        let first = self.corners.len();
        self.corners.resize(first + bits.count_ones() as usize);
        // Vectors are copied whole: there is always room for one more.
        if self.indices.len() < first + 2 * LANES {
            self.indices.resize(first + 2 * LANES, 0);
        }
        for (at, lane) in (first..).zip(Named(bits)) {
            self.indices[at] = indices[lane];
            let (to, to_lane) = (self.corners.vector_mut(at / LANES), at % LANES);
            for (to, from) in to.iter_mut().zip(parts) {
                to[to_lane] = from[lane];
            }
        }
    }

    /// Takes those of `things` that [`Beam`] lets through; all without one. `corners` gives a thing's, and `origin` is where the
    /// beam's planes count from, in the coordinates of the corners.
    #[inline(always)]
    pub(crate) fn gather<S: Simd>(
        &mut self,
        simd: S,
        things: &[u32],
        corners: impl Fn(u32) -> [f32; N],
        beam: Option<&Beam>,
        origin: Vec3,
    ) {
        self.corners.clear();
        let (mut indices, mut parts) = ([0u32; LANES], [[0.0f32; LANES]; N]);
        for things in things.chunks(LANES) {
            for (lane, &index) in things.iter().enumerate() {
                for (part, value) in parts.iter_mut().zip(corners(index)) {
                    part[lane] = value;
                }
                indices[lane] = index;
            }
            self.take(inside(simd, beam, &parts, origin) & ((1 << things.len()) - 1), &indices, &parts);
        }
    }

    /// Takes those of `other` that `beam` lets through; all without one.
    #[inline(always)]
    pub(crate) fn take_within<S: Simd>(&mut self, simd: S, other: &Self, beam: Option<&Beam>, origin: Vec3) {
        self.corners.clear();
        let mut indices = [0u32; LANES];
        for vector in 0..other.corners.vectors() {
            let first = vector * LANES;
            indices.copy_from_slice(&other.indices[first..first + LANES]);
            let parts = other.corners.vector(vector);
            self.take(inside(simd, beam, parts, origin) & other.corners.valid(vector), &indices, parts);
        }
    }
}

/// Lanes that do not lie outside, a bit each.
#[inline(always)]
fn inside<S: Simd, const N: usize>(
    simd: S,
    beam: Option<&Beam>,
    parts: &[[f32; LANES]; N],
    origin: Vec3,
) -> u64 {
    let Some(beam) = beam else { return u64::MAX };
    let mut beyond = [u64::MAX; 5];
    for corner in parts.chunks_exact(3) {
        let x = f32x16::load_array_ref(simd, &corner[0]) - origin.x;
        let y = f32x16::load_array_ref(simd, &corner[1]) - origin.y;
        let z = f32x16::load_array_ref(simd, &corner[2]) - origin.z;
        for (beyond, plane) in beyond.iter_mut().zip(&beam.planes) {
            let height = x * plane.x + y * plane.y + z * plane.z + plane.w;
            *beyond &= height.simd_gt(0.0).to_bitmask();
        }
    }
    !beyond.into_iter().fold(0, |outside, beyond| outside | beyond)
}
