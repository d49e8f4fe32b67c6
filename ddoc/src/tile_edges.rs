//! The edges that a block's receivers are asked about, component by component.

use fearless_simd::{Simd, SimdBase, SimdMask, f32x16};
use glam::Vec3;
use gnomon_shadow_map::light_maps::Receiver;

use crate::lanes::{Lanes, load_three};
use crate::silhouettes::Edge;

/// Numbers an edge: a, b, the two planes, the two signs; the point seen past the edge.
const PARTS: usize = 19;

/// Edges of a block, component by component.
#[derive(Debug, Default)]
pub struct TileEdges {
    lanes: Lanes<PARTS>,
    has_far: bool,
}

impl TileEdges {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.lanes.clear();
        self.has_far = false;
    }

    /// Adds an edge.
    #[inline(always)]
    pub fn push(&mut self, edge: &Edge) {
        let [p, q] = edge.planes.map(|plane| plane.to_array());
        let (a, b, far, [first, second]) = (edge.a, edge.b, edge.far, edge.signs);
        self.has_far |= !far.is_nan();
        #[rustfmt::skip]
        self.lanes.push([
            a.x, a.y, a.z, b.x, b.y, b.z, p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3], first, second,
            far.x, far.y, far.z,
        ]);
    }

    /// Takes over those of `edges` that are named.
    #[inline(always)]
    pub fn gather(&mut self, edges: &[Edge], indices: impl Iterator<Item = u32>) {
        self.clear();
        indices.for_each(|index| self.push(&edges[index as usize]));
    }

    /// Keeps the edges that may count for some of the receivers: those that rise above its plane and, where it is `silhouettes`
    /// that count, are one as it sees them. Each is asked as [`Counter`](crate::coverage::Counter) asks: what is left out
    /// would have counted for nobody.
    #[inline(always)]
    pub(crate) fn keep_for<S: Simd>(
        &mut self,
        simd: S,
        receivers: &[(u32, Receiver)],
        origin: Vec3,
        silhouettes: bool,
    ) {
        let mut kept = 0;
        for vector in 0..self.lanes.vectors() {
            let valid = self.lanes.valid(vector);
            let mut counts = 0;
            for (_, receiver) in receivers {
                let point = receiver.point - origin;
                let from = self.from(simd, vector, 0, point);
                let to = self.from(simd, vector, 3, point);
                let a = dot(receiver.normal, from) - receiver.tolerance;
                let b = dot(receiver.normal, to) - receiver.tolerance;
                let mut bits = !(a.simd_le(0.0) & b.simd_le(0.0)).to_bitmask();
                if silhouettes {
                    bits &= !self.multiplicity(simd, vector, point).simd_eq(0.0).to_bitmask();
                }
                counts |= bits;
                if counts & valid == valid {
                    break;
                }
            }
            kept = self.lanes.keep(vector, counts & valid, kept);
        }
        self.lanes.resize(kept);
    }

    /// Corners of a vector of edges, whose x has the number `kind`, counted from a point.
    #[inline(always)]
    pub(crate) fn from<S: Simd>(&self, simd: S, vector: usize, kind: usize, point: Vec3) -> [f32x16<S>; 3] {
        let [x, y, z] = load_three(simd, self.lanes.vector(vector), kind);
        [x - point.x, y - point.y, z - point.z]
    }

    /// m(e) of a vector of edges as seen from a point.
    #[inline(always)]
    pub(crate) fn multiplicity<S: Simd>(&self, simd: S, vector: usize, point: Vec3) -> f32x16<S> {
        self.side(simd, vector, 6, 14, point) + self.side(simd, vector, 10, 15, point)
    }

    /// sign(e, f)·side(f, p) of the faces whose planes begin at `plane`, and whose signs are `sign`.
    #[inline(always)]
    fn side<S: Simd>(&self, simd: S, vector: usize, plane: usize, sign: usize, point: Vec3) -> f32x16<S> {
        let parts = self.lanes.vector(vector);
        let [x, y, z] = load_three(simd, parts, plane);
        let d = f32x16::load_array_ref(simd, &parts[plane + 3]);
        let at = x * point.x + y * point.y + z * point.z + d;
        let sign = f32x16::load_array_ref(simd, &parts[sign]);
        fearless_simd::Select::select(at.simd_ge(0.0), sign, -sign)
    }

    /// The ends of an edge.
    #[inline]
    pub(crate) fn ends(&self, index: usize) -> [Vec3; 2] {
        let at = |part: usize| self.lanes.at(index, part);
        [Vec3::new(at(0), at(1), at(2)), Vec3::new(at(3), at(4), at(5))]
    }

    /// Vectors that there are.
    #[inline(always)]
    pub(crate) fn vectors(&self) -> usize {
        self.lanes.vectors()
    }

    /// Lanes of a vector that are edges, a bit each.
    #[inline(always)]
    pub(crate) fn valid(&self, vector: usize) -> u64 {
        self.lanes.valid(vector)
    }

    /// Whether of some a point seen past them is known.
    #[inline(always)]
    pub(crate) fn has_far(&self) -> bool {
        self.has_far
    }

    /// Edges there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.lanes.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The product of an axis with a vector of vectors, summed as glam does.
#[inline(always)]
pub(crate) fn dot<S: Simd>(axis: Vec3, v: [f32x16<S>; 3]) -> f32x16<S> {
    v[0] * axis.x + v[1] * axis.y + v[2] * axis.z
}

/// a × b, summed as glam does.
#[inline(always)]
pub(crate) fn cross<S: Simd>(a: [f32x16<S>; 3], b: [f32x16<S>; 3]) -> [f32x16<S>; 3] {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}
