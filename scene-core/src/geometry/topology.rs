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

use super::sides::{Rows, Sides};
use super::{Object, Scene};

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
    /// # Errors
    /// An index out of range, or more than [`Self::MAX_TRIANGLES`].
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<Self, TopologyError> {
        let vertices = positions.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&i| i as usize >= vertices) {
                return Err(TopologyError::IndexOutOfRange { triangle, index, vertices });
            }
        }
        let all = 0..triangles.len();
        Sides::of_ranges(positions, triangles, std::slice::from_ref(&all), name_incidence).map(Self::of)
    }

    /// The edges of those objects of a scene that `take` chooses, welded across objects. Faces are
    /// [`Scene::triangles`], vertices [`Scene::positions`].
    ///
    /// # Errors
    /// More than [`Self::MAX_TRIANGLES`].
    pub fn of_scene(scene: &Scene, take: impl Fn(&Object) -> bool) -> Result<Self, TopologyError> {
        Sides::of_scene(scene, take, name_incidence).map(Self::of)
    }

    fn of(sides: Sides) -> Self {
        let parts = sides.by_bucket(EdgePart::new);
        let degenerate = sides.degenerate;
        drop(sides);
        Self { degenerate, ..EdgePart::join(parts) }
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

/// What [`EdgeTopology`] keeps of a face's side.
#[inline]
fn name_incidence(face: u32, _side: u32, along: bool) -> u32 {
    Incidence::new(face, along).0
}

/// The edges of one bucket.
struct EdgePart {
    vertices: Vec<[u32; 2]>,
    /// Where the faces of each begin, in this part.
    first: Vec<u32>,
    incident: Vec<Incidence>,
}

impl EdgePart {
    fn new(rows: &Rows) -> Self {
        // A closed surface has two faces an edge.
        let guess = rows.entries().len() / 2 + rows.entries().len() / 16;
        let (mut vertices, mut first) = (Vec::with_capacity(guess), Vec::with_capacity(guess));
        let mut sides = 0;
        for (edge, names) in rows.edges() {
            vertices.push(edge);
            first.push(sides);
            sides += names.len() as u32;
        }
        let incident = rows.entries().iter().map(|&entry| Incidence(entry as u32)).collect();
        Self { vertices, first, incident }
    }

    fn join(parts: Vec<Self>) -> EdgeTopology {
        let edges = parts.iter().map(|part| part.vertices.len()).sum();
        let sides = parts.iter().map(|part| part.incident.len()).sum();
        let mut topology = EdgeTopology {
            vertices: Vec::with_capacity(edges),
            first: Vec::with_capacity(edges + 1),
            incident: Vec::with_capacity(sides),
            degenerate: 0,
        };
        for Self { vertices, first, incident } in parts {
            let before = topology.incident.len() as u32;
            topology.vertices.extend(vertices);
            topology.first.extend(first.into_iter().map(|first| before + first));
            topology.incident.extend(incident);
        }
        topology.first.push(sides as u32);
        topology
    }
}
