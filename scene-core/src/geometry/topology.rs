//! Edges of any triangle soup with their faces, and the silhouette a light sees.
//!
//! # The mathematics
//!
//! Write a face f as an oriented triangle and ∂f for its boundary: three directed edges. A light sees f from
//! its counter-clockwise side (s(f) = +1), from the other (−1) or edge-on (0); s(f)·f is the face *turned to
//! the light*. The shadow volume of the turned face is bounded by the face, its copy at infinity and the
//! quads that its boundary s(f)·∂f sweeps away from the light. The number of faces between the light and a
//! point is the number of these volumes around it, which is what crossing their oriented sides counts. So
//! the sides of the whole soup are the sweep of
//!
//! > Σ_f s(f)·∂f = Σ_e m(e)·e,  m(e) = Σ over faces f at e of sign(e, f)·s(f),
//!
//! where sign(e, f) is +1 if f runs along the edge's direction and −1 if against it. Edges of m(e) = 0 are
//! no silhouette and need no side; the others carry |m(e)| sides. Since ∂∂ = 0, the sum is a closed chain
//! for every soup and every s: at each vertex the multiplicities that enter and leave cancel, so that no
//! volume leaks. Nothing is asked of the mesh:
//!
//! | at the edge | m(e) |
//! | --- | --- |
//! | two faces of a consistent surface, both seen from the same side | 0 |
//! | …, one seen from each side: the classic silhouette | ±2 (a closed body is two layers) |
//! | boundary, one face | ±1 |
//! | two faces of opposite winding (flipped), same side seen | 0 on a flat piece, although s differs |
//! | duplicate faces | counted as often as they are there |
//!
//! The weights ±1 and ±2 are those of Bergeron ("A General Version of Crow's Shadow Volumes", 1986); the sum
//! over any number of faces is Kim, Kim and Turk's ("A Shadow-Volume Algorithm for Opaque and Transparent
//! Nonmanifold Casters", 2008).

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;
use thiserror::Error;

use super::{Object, Scene, weld};

/// Why no topology was built.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum TopologyError {
    /// A corner refers to a vertex that does not exist.
    #[error("triangle {triangle} refers to vertex {index}, but there are {vertices} vertices")]
    IndexOutOfRange {
        /// The triangle, counted from 0.
        triangle: usize,
        /// The index it holds.
        index: u32,
        /// Vertices there are.
        vertices: usize,
    },
    /// Corners are counted in 32 bits.
    #[error(
        "{count} triangles are too many for an edge topology: at most {} fit",
        EdgeTopology::MAX_TRIANGLES
    )]
    TooManyTriangles {
        /// Triangles there are.
        count: usize,
    },
}

/// A face at an edge and its direction there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Incidence(u32);

impl Incidence {
    #[inline]
    fn new(face: u32, along: bool) -> Self {
        Self(face << 1 | u32::from(along))
    }

    /// The face's index.
    #[inline]
    pub fn face(self) -> u32 {
        self.0 >> 1
    }

    /// +1 if the face runs along the edge's direction, −1 if against it.
    #[inline]
    pub fn sign(self) -> i32 {
        2 * (self.0 & 1) as i32 - 1
    }
}

/// An edge that bounds a shadow volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SilhouetteEdge {
    /// The edge, as an index of [`EdgeTopology::vertices`].
    pub edge: u32,
    /// m(e), never zero. Positive: the edge's own direction is that of the faces turned to the light, which
    /// then lie on its left as the light sees them.
    pub multiplicity: i32,
}

/// What a mesh's edges are like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EdgeStatistics {
    /// Undirected edges of the welded mesh.
    pub edges: usize,
    /// Edges of one face.
    pub boundary: usize,
    /// Edges of more than two faces.
    pub non_manifold: usize,
    /// Edges of two faces that run in the same direction.
    pub flipped: usize,
    /// Triangles left out because they repeat a welded vertex: their boundary cancels itself.
    pub degenerate: usize,
}

/// The undirected edges of a welded mesh, each directed from its lower to its upper vertex index, with its
/// faces in order of their index. Compressed rows: one array of edges, one of incidences.
#[derive(Clone, Debug, Default)]
pub struct EdgeTopology {
    vertices: Vec<[u32; 2]>,
    /// Incidences of edge e are `incident[first[e] as usize..first[e + 1] as usize]`.
    first: Vec<u32>,
    incident: Vec<Incidence>,
    degenerate: usize,
}

impl EdgeTopology {
    /// The largest number of triangles: their corners are counted in 32 bits.
    pub const MAX_TRIANGLES: usize = (u32::MAX / 3) as usize;

    /// The edges of `triangles`, welded by exact position. Faces keep their index; vertices are named by the
    /// first one at their position, so that `positions` can be read with them.
    ///
    /// Time is linear but for the sorting of each vertex's few edges: corners are bucketed by their edge's
    /// lower vertex in one counting pass, then each bucket is sorted.
    ///
    /// # Errors
    /// An index out of range, or more than [`Self::MAX_TRIANGLES`].
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<Self, TopologyError> {
        let vertices = positions.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&i| i as usize >= vertices) {
                return Err(TopologyError::IndexOutOfRange { triangle, index, vertices });
            }
        }
        Self::of_ranges(positions, triangles, std::slice::from_ref(&(0..triangles.len())))
    }

    /// The edges of those objects of a scene that `take` chooses, welded across objects. Faces are
    /// [`Scene::triangles`], vertices [`Scene::positions`].
    ///
    /// # Errors
    /// More than [`Self::MAX_TRIANGLES`].
    pub fn of_scene(scene: &Scene, take: impl Fn(&Object) -> bool) -> Result<Self, TopologyError> {
        let ranges: Vec<_> =
            scene.objects().iter().filter(|o| take(o)).map(|o| o.triangles.clone()).collect();
        Self::of_ranges(scene.positions(), scene.triangles(), &ranges)
    }

    /// Indices are in range.
    fn of_ranges(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        ranges: &[Range<usize>],
    ) -> Result<Self, TopologyError> {
        if triangles.len() > Self::MAX_TRIANGLES {
            return Err(TopologyError::TooManyTriangles { count: triangles.len() });
        }
        let representative = weld(positions).representative;
        let welded = |face: usize| triangles[face].map(|i| representative[i as usize]);
        let faces = || ranges.iter().cloned().flatten();

        let mut bucket_first = vec![0u32; positions.len() + 1];
        let mut degenerate = 0;
        for face in faces() {
            let [a, b, c] = welded(face);
            if is_degenerate([a, b, c]) {
                degenerate += 1;
            } else {
                for lower in [a.min(b), b.min(c), c.min(a)] {
                    bucket_first[lower as usize + 1] += 1;
                }
            }
        }
        let mut corners = 0;
        for first in &mut bucket_first {
            corners += *first;
            *first = corners;
        }

        // An entry is (upper vertex, incidence) in one integer, which sorts as the pair does. Placing moves
        // each bucket's cursor to its end, which is where the next bucket begins: undone by reading the
        // array shifted by one.
        let mut entries = vec![0u64; corners as usize];
        for face in faces() {
            let [a, b, c] = welded(face);
            if !is_degenerate([a, b, c]) {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    let incidence = Incidence::new(face as u32, from < to);
                    let cursor = &mut bucket_first[from.min(to) as usize];
                    entries[*cursor as usize] = u64::from(from.max(to)) << 32 | u64::from(incidence.0);
                    *cursor += 1;
                }
            }
        }
        drop(representative);
        let bucket_end = &bucket_first[..positions.len()];
        Ok(Self { degenerate, ..collect_edges(&mut entries, bucket_end) })
    }

    /// The edges of faces whose sides are given one by one, each by the vertices that the face runs along, from the first to
    /// the second, and the face: for surfaces that meet without ending at the same vertices, once their sides are cut to pieces.
    pub fn of_sides(mut sides: Vec<([u32; 2], u32)>) -> Self {
        let key = |&([from, to], face): &([u32; 2], u32)| {
            (from.min(to), from.max(to), Incidence::new(face, from < to).0)
        };
        sides.par_sort_unstable_by_key(key);
        let mut topology = Self::default();
        for (index, side) in sides.iter().enumerate() {
            let (lower, upper, incidence) = key(side);
            if topology.vertices.last() != Some(&[lower, upper]) {
                topology.vertices.push([lower, upper]);
                topology.first.push(index as u32);
            }
            topology.incident.push(Incidence(incidence));
        }
        topology.first.push(sides.len() as u32);
        topology
    }

    /// Undirected edges there are.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there is no edge.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Per edge its two vertices, lower index first, which is the edge's direction.
    pub fn vertices(&self) -> &[[u32; 2]] {
        &self.vertices
    }

    /// The faces of an edge.
    ///
    /// # Panics
    /// If there is no such edge.
    #[inline]
    pub fn faces(&self, edge: usize) -> &[Incidence] {
        &self.incident[self.first[edge] as usize..self.first[edge + 1] as usize]
    }

    /// The faces of a range of edges, edge by edge.
    ///
    /// # Panics
    /// If there are no such edges.
    #[inline]
    pub fn faces_of(&self, edges: Range<usize>) -> &[Incidence] {
        &self.incident[self.first[edges.start] as usize..self.first[edges.end] as usize]
    }

    /// m(e): what an edge's faces, turned to the light by `facing`, add up to.
    ///
    /// # Panics
    /// If there is no such edge, or `facing` is shorter than the largest face index.
    #[inline]
    pub fn multiplicity(&self, edge: usize, facing: &[i8]) -> i32 {
        self.faces(edge).iter().map(|f| f.sign() * i32::from(facing[f.face() as usize])).sum()
    }

    /// The edges whose multiplicity is not zero, in order. `facing` has one entry a face in {−1, 0, +1}:
    /// see [`facing`](super::facing()).
    ///
    /// # Panics
    /// If `facing` is shorter than the largest face index.
    pub fn silhouette<'a>(&'a self, facing: &'a [i8]) -> impl Iterator<Item = SilhouetteEdge> + 'a {
        (0..self.len()).filter_map(|edge| {
            let multiplicity = self.multiplicity(edge, facing);
            (multiplicity != 0).then_some(SilhouetteEdge { edge: edge as u32, multiplicity })
        })
    }

    /// Counts what the mesh is like.
    pub fn statistics(&self) -> EdgeStatistics {
        let mut s = EdgeStatistics { edges: self.len(), degenerate: self.degenerate, ..Default::default() };
        for edge in 0..self.len() {
            match self.faces(edge) {
                [_] => s.boundary += 1,
                [a, b] => s.flipped += usize::from(a.sign() == b.sign()),
                _ => s.non_manifold += 1,
            }
        }
        s
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.vertices[..]) + size_of_val(&self.first[..]) + size_of_val(&self.incident[..])
    }
}

#[inline]
fn is_degenerate([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

/// A run of buckets and their entries, cut so that tasks have about equal work.
struct Task<'a> {
    buckets: Range<usize>,
    first_entry: usize,
    entries: &'a mut [u64],
}

/// Sorts each bucket and gathers equal pairs into edges. Bucket v, the edges whose lower vertex is v, ends
/// where `bucket_end[v]` says and begins where the one before ends.
fn collect_edges(entries: &mut [u64], bucket_end: &[u32]) -> EdgeTopology {
    let corners = entries.len();
    let per_task = (corners / (4 * rayon::current_num_threads())).max(1 << 14);
    let mut tasks = Vec::new();
    let (mut rest, mut bucket, mut first_entry) = (entries, 0, 0);
    while !rest.is_empty() {
        let goal = (first_entry + per_task).min(corners);
        let next = bucket + bucket_end[bucket..].partition_point(|&end| (end as usize) < goal) + 1;
        let end = bucket_end[next - 1] as usize;
        let (mine, others) = rest.split_at_mut(end - first_entry);
        tasks.push(Task { buckets: bucket..next, first_entry, entries: mine });
        (rest, bucket, first_entry) = (others, next, end);
    }
    let parts: Vec<_> = tasks.into_par_iter().map(|task| task.run(bucket_end)).collect();

    let edges = parts.iter().map(|part| part.0.len()).sum();
    let mut topology = EdgeTopology {
        vertices: Vec::with_capacity(edges),
        first: Vec::with_capacity(edges + 1),
        incident: Vec::with_capacity(corners),
        degenerate: 0,
    };
    for (vertices, first, incident) in parts {
        topology.vertices.extend(vertices);
        topology.first.extend(first);
        topology.incident.extend(incident);
    }
    topology.first.push(corners as u32);
    topology
}

impl Task<'_> {
    fn run(self, bucket_end: &[u32]) -> (Vec<[u32; 2]>, Vec<u32>, Vec<Incidence>) {
        // A closed surface has two faces an edge.
        let guess = self.entries.len() / 2 + self.entries.len() / 16;
        let (mut vertices, mut first) = (Vec::with_capacity(guess), Vec::with_capacity(guess));
        let mut begin = 0;
        for lower in self.buckets {
            let end = bucket_end[lower] as usize - self.first_entry;
            let bucket = &mut self.entries[begin..end];
            bucket.sort_unstable();
            let mut last = None;
            for (i, entry) in bucket.iter().enumerate() {
                let upper = (entry >> 32) as u32;
                if last != Some(upper) {
                    last = Some(upper);
                    vertices.push([lower as u32, upper]);
                    first.push((self.first_entry + begin + i) as u32);
                }
            }
            begin = end;
        }
        let incident = self.entries.iter().map(|&entry| Incidence(entry as u32)).collect();
        (vertices, first, incident)
    }
}
