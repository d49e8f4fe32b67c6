//! The indexed triangle mesh, as loaders and generators hand it over.

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use thiserror::Error;

use super::{Aabb, AlphaMask};

/// Why a mesh was refused. Elements are counted from 0.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeshError {
    /// A corner refers to a vertex that does not exist.
    #[error("triangle {triangle} refers to vertex {index}, but there are {vertices} vertices (0 … {})", vertices.saturating_sub(1))]
    IndexOutOfRange {
        /// The triangle.
        triangle: usize,
        /// The index it holds.
        index: u32,
        /// Vertices there are.
        vertices: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} is not finite: ({}, {}, {})", position.x, position.y, position.z)]
    NotFinite {
        /// The vertex.
        vertex: usize,
        /// Its position.
        position: Vec3,
    },
    /// There are texture coordinates, but not one a vertex.
    #[error("there are {uvs} texture coordinates for {vertices} vertices: give one a vertex, or none")]
    UvCount {
        /// Texture coordinates there are.
        uvs: usize,
        /// Vertices there are.
        vertices: usize,
    },
    /// A mask without texture coordinates has no meaning.
    #[error("an alpha mask needs texture coordinates, and there are none")]
    MaskWithoutUvs,
}

/// An indexed triangle mesh in f32. Both sides of a triangle cast and receive; winding matters to nobody but
/// to the sign of its area.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// A name for messages and reports; may be empty.
    pub name: String,
    /// Vertex positions, in the mesh's own space.
    pub positions: Vec<Vec3>,
    /// Three vertex indices a triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates, one a vertex, or none at all. (0, 0) is the first texel of the first row.
    pub uvs: Vec<Vec2>,
    /// Cut-out mask; needs `uvs`.
    pub alpha: Option<Arc<AlphaMask>>,
}

impl TriangleMesh {
    /// A mesh without texture coordinates or mask.
    pub fn new(name: impl Into<String>, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        Self { name: name.into(), positions, triangles, uvs: Vec::new(), alpha: None }
    }

    /// Checks what every algorithm relies on: indices in range, finite positions, matching `uvs`.
    ///
    /// # Errors
    /// The first fault found, by element.
    pub fn validate(&self) -> Result<(), MeshError> {
        let vertices = self.positions.len();
        if let Some(vertex) = self.positions.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NotFinite { vertex, position: self.positions[vertex] });
        }
        for (triangle, corners) in self.triangles.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&i| i as usize >= vertices) {
                return Err(MeshError::IndexOutOfRange { triangle, index, vertices });
            }
        }
        if !self.uvs.is_empty() && self.uvs.len() != vertices {
            return Err(MeshError::UvCount { uvs: self.uvs.len(), vertices });
        }
        if self.alpha.is_some() && self.uvs.is_empty() && !self.triangles.is_empty() {
            return Err(MeshError::MaskWithoutUvs);
        }
        Ok(())
    }

    /// The smallest box around all vertices, used or not.
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(self.positions.iter().copied())
    }

    /// This mesh with every position mapped by `world_from_mesh`.
    #[must_use]
    pub fn transformed(mut self, world_from_mesh: Affine3A) -> Self {
        for position in &mut self.positions {
            *position = world_from_mesh.transform_point3(*position);
        }
        self
    }

    /// Appends another mesh's vertices and triangles. Texture coordinates are kept only if both have them
    /// (an empty mesh takes over the other's).
    pub fn append(&mut self, other: &Self) {
        let base = self.positions.len() as u32;
        let keep_uvs = (base == 0 || !self.uvs.is_empty()) && !other.uvs.is_empty();
        self.positions.extend_from_slice(&other.positions);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
        if keep_uvs {
            self.uvs.extend_from_slice(&other.uvs);
        } else {
            self.uvs.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> TriangleMesh {
        TriangleMesh::new("t", vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])
    }

    #[test]
    fn faults_are_named_by_element() {
        assert_eq!(triangle().validate(), Ok(()));
        let mut mesh = triangle();
        mesh.triangles.push([0, 1, 3]);
        assert_eq!(mesh.validate(), Err(MeshError::IndexOutOfRange { triangle: 1, index: 3, vertices: 3 }));
        let mut mesh = triangle();
        mesh.positions[2].y = f32::INFINITY;
        assert!(matches!(mesh.validate(), Err(MeshError::NotFinite { vertex: 2, .. })));
        let mut mesh = triangle();
        mesh.uvs = vec![Vec2::ZERO];
        assert_eq!(mesh.validate(), Err(MeshError::UvCount { uvs: 1, vertices: 3 }));
    }

    #[test]
    fn append_shifts_indices() {
        let mut mesh = triangle();
        mesh.append(&triangle());
        assert_eq!(mesh.triangles, [[0, 1, 2], [3, 4, 5]]);
        assert_eq!(mesh.validate(), Ok(()));
    }
}
