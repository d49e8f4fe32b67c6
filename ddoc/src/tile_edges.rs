//! The edges that a tile's receivers are asked about, component by component, and the choice of those that reach into a beam.

use fearless_simd::Simd;
use glam::Vec3;

use crate::beam::Beam;
use crate::silhouettes::Edge;

/// Lanes that the compiler is given to fill.
pub(crate) const LANES: usize = 16;

/// Edges of a tile, component by component.
#[derive(Debug, Default)]
pub struct TileEdges {
    /// a, b, the two planes, the two signs; the point seen past the edge.
    parts: [Vec<f32>; 19],
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

    /// Takes over those of `edges` that `indices` name, or of them those that [`Beam`] lets through, and fills the last lanes.
    #[inline(always)]
    pub fn gather<S: Simd>(
        &mut self,
        _simd: S,
        edges: &[Edge],
        mut indices: impl Iterator<Item = u32>,
        beam: Option<&Beam>,
    ) {
        self.clear();
        let (mut chunk, mut ends) = ([0u32; LANES], [[0.0f32; LANES]; 6]);
        loop {
            let mut count = 0;
            while count < LANES
                && let Some(index) = indices.next()
            {
                let Edge { a, b, .. } = edges[index as usize];
                for (part, value) in ends.iter_mut().zip([a.x, a.y, a.z, b.x, b.y, b.z]) {
                    part[count] = value;
                }
                chunk[count] = index;
                count += 1;
            }
            let outside = beam.map_or([false; LANES], |beam| beam.outside(&ends));
            for (&index, _) in chunk[..count].iter().zip(&outside).filter(|(_, outside)| !**outside) {
                self.push(&edges[index as usize]);
            }
            if count < LANES {
                break;
            }
        }
        self.pad();
    }

    /// Takes over those of `other` that `beam` lets through, and fills the last lanes.
    #[inline(always)]
    pub fn take_within<S: Simd>(&mut self, _simd: S, other: &Self, beam: &Beam) {
        self.clear();
        self.has_far = other.has_far;
        // Without points seen past edges nothing asks for theirs.
        let told = if other.has_far { 19 } else { 16 };
        let padded = other.parts[0].len();
        // A vector is written whole wherever those before it ended.
        self.parts.iter_mut().for_each(|part| part.resize(padded + LANES, 0.0));
        for first in (0..padded).step_by(LANES) {
            let mut ends = [[0.0; LANES]; 6];
            for (to, from) in ends.iter_mut().zip(&other.parts) {
                to.copy_from_slice(&from[first..first + LANES]);
            }
            let outside = beam.outside(&ends);
            let (mut kept, mut count) = ([0u8; LANES], 0);
            for (lane, &outside) in (0u8..).zip(&outside).take(other.count - first.min(other.count)) {
                kept[count] = lane;
                count += usize::from(!outside);
            }
            if count == 0 {
                continue;
            }
            for (to, from) in self.parts.iter_mut().zip(&other.parts).take(told) {
                let mut vector = [0.0; LANES];
                vector.copy_from_slice(&from[first..first + LANES]);
                let to = &mut to[self.count..self.count + LANES];
                for (to, &lane) in to.iter_mut().zip(&kept) {
                    *to = vector[usize::from(lane) % LANES];
                }
            }
            self.count += count;
        }
        let count = self.count;
        self.parts.iter_mut().for_each(|part| part.truncate(count));
        self.pad();
    }

    /// The ends of an edge.
    #[inline]
    pub(crate) fn ends(&self, index: usize) -> [Vec3; 2] {
        let at = |part: usize| self.parts[part][index];
        [Vec3::new(at(0), at(1), at(2)), Vec3::new(at(3), at(4), at(5))]
    }

    /// A vector of the numbers of one kind, from edge `first` on.
    #[inline(always)]
    pub(crate) fn part(&self, kind: usize, first: usize) -> &[f32] {
        &self.parts[kind][first..first + LANES]
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
