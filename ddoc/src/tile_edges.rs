//! The edges that a block's receivers are asked about, component by component.

use fearless_simd::{Simd, SimdBase, SimdMask, f32x16};
use glam::Vec3;
use gnomon_shadow_map::light_maps::Receiver;

use crate::chosen::{LANES, keep_lanes};
use crate::silhouettes::Edge;

/// Numbers an edge: a, b, the two planes, the two signs; the point seen past the edge.
const PARTS: usize = 19;

/// Edges of a block, component by component.
#[derive(Debug, Default)]
pub struct TileEdges {
    parts: [Vec<f32>; PARTS],
    count: usize,
    has_far: bool,
}

impl TileEdges {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.parts.iter_mut().for_each(Vec::clear);
        (self.count, self.has_far) = (0, false);
    }

    /// Adds an edge.
    #[inline(always)]
    pub fn push(&mut self, edge: &Edge) {
        let [p, q] = edge.planes.map(|plane| plane.to_array());
        let (a, b, far, [first, second]) = (edge.a, edge.b, edge.far, edge.signs);
        #[rustfmt::skip]
        let values = [
            a.x, a.y, a.z, b.x, b.y, b.z, p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3], first, second,
            far.x, far.y, far.z,
        ];
        self.has_far |= !far.is_nan();
        for (part, value) in self.parts.iter_mut().zip(values) {
            part.push(value);
        }
        self.count += 1;
    }

    /// Fills the last lanes with edges that never count.
    pub fn pad(&mut self) {
        let padded = self.count.next_multiple_of(LANES);
        self.parts.iter_mut().for_each(|part| part.resize(padded, 0.0));
    }

    /// Takes over those of `edges` that are named, and fills the last lanes.
    pub fn gather(&mut self, edges: &[Edge], indices: impl Iterator<Item = u32>) {
        self.clear();
        indices.for_each(|index| self.push(&edges[index as usize]));
        self.pad();
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
        for first in (0..self.count).step_by(LANES) {
            let valid = (1u64 << (self.count - first).min(LANES)) - 1;
            let mut counts = 0;
            for (_, receiver) in receivers {
                let point = receiver.point - origin;
                let from = self.from(simd, first, 0, point);
                let to = self.from(simd, first, 3, point);
                let a = dot(receiver.normal, from) - receiver.tolerance;
                let b = dot(receiver.normal, to) - receiver.tolerance;
                let mut bits = !(a.simd_le(0.0) & b.simd_le(0.0)).to_bitmask();
                if silhouettes {
                    bits &= !self.multiplicity(simd, first, point).simd_eq(0.0).to_bitmask();
                }
                counts |= bits;
                if counts & valid == valid {
                    break;
                }
            }
            kept = keep_lanes(&mut self.parts, first, counts & valid, kept);
        }
        self.count = kept;
        self.parts.iter_mut().for_each(|part| part.truncate(kept));
        self.pad();
    }

    /// Corners of a vector of edges, whose x has the number `kind`, counted from a point.
    #[inline(always)]
    pub(crate) fn from<S: Simd>(&self, simd: S, first: usize, kind: usize, point: Vec3) -> [f32x16<S>; 3] {
        let (x, y) = (self.part(simd, kind, first), self.part(simd, kind + 1, first));
        [x - point.x, y - point.y, self.part(simd, kind + 2, first) - point.z]
    }

    /// m(e) of a vector of edges as seen from a point.
    #[inline(always)]
    pub(crate) fn multiplicity<S: Simd>(&self, simd: S, first: usize, point: Vec3) -> f32x16<S> {
        self.side(simd, first, 6, 14, point) + self.side(simd, first, 10, 15, point)
    }

    /// sign(e, f)·side(f, p) of the faces whose planes begin at `plane`, and whose signs are `sign`.
    #[inline(always)]
    fn side<S: Simd>(&self, simd: S, first: usize, plane: usize, sign: usize, point: Vec3) -> f32x16<S> {
        let (x, y) = (self.part(simd, plane, first), self.part(simd, plane + 1, first));
        let (z, d) = (self.part(simd, plane + 2, first), self.part(simd, plane + 3, first));
        let at = x * point.x + y * point.y + z * point.z + d;
        let sign = self.part(simd, sign, first);
        fearless_simd::Select::select(at.simd_ge(0.0), sign, -sign)
    }

    /// The ends of an edge.
    #[inline]
    pub(crate) fn ends(&self, index: usize) -> [Vec3; 2] {
        let at = |part: usize| self.parts[part][index];
        [Vec3::new(at(0), at(1), at(2)), Vec3::new(at(3), at(4), at(5))]
    }

    /// A vector of the numbers of one kind, from edge `first` on.
    #[inline(always)]
    fn part<S: Simd>(&self, simd: S, kind: usize, first: usize) -> f32x16<S> {
        f32x16::from_slice(simd, &self.parts[kind][first..first + LANES])
    }

    /// Whether of some a point seen past them is known.
    #[inline(always)]
    pub(crate) fn has_far(&self) -> bool {
        self.has_far
    }

    /// Edges there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
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
