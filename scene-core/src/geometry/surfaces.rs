//! What lies across each edge of a triangle soup's casters, and how large the pieces of surface are that they make up.
//!
//! For walks over a surface from a triangle that is known to one that is asked for, on the CPU and, in the same layout, on a GPU.

use std::sync::atomic::{AtomicU32, Ordering};

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::sides::Sides;
use super::{Aabb, Scene, TopologyError};

/// No triangle lies across an edge.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// A triangle's place in its surface. 16 bytes, as `vec4<u32>` has them.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SurfaceTriangle {
    /// The triangle across the edge from corner i to corner i + 1; [`NO_TRIANGLE`] at a boundary, and where more than two meet.
    pub across: [u32; 3],
    /// Diagonal of the box around the whole connected piece of surface, scene units. 0 for a triangle that is in none: one that
    /// does not cast, has no area, or whose surface is cut out by a mask and so ends elsewhere than its triangles.
    pub extent: f32,
}

/// The connected surfaces of a scene's solid casters, by [`Scene::triangles`].
#[derive(Clone, Debug, Default)]
pub struct Surfaces {
    triangles: Vec<SurfaceTriangle>,
}

impl Surfaces {
    /// Welded by exact position, across objects.
    ///
    /// # Errors
    /// More triangles than can be numbered.
    pub fn new(scene: &Scene) -> Result<Self, TopologyError> {
        let sides =
            Sides::of_scene(scene, |o| o.flags.casts && o.alpha.is_none(), |face, side, _| 3 * face + side)?;
        let none = |_| [NO_TRIANGLE, NO_TRIANGLE, NO_TRIANGLE, 0].map(AtomicU32::new);
        let triangles: Vec<_> = (0..scene.triangles().len()).into_par_iter().map(none).collect();
        let of = |name: u64| (&triangles[name as u32 as usize / 3], name as u32 as usize % 3);
        sides.by_bucket(|rows| {
            for (_, edge) in rows.edges() {
                for &name in edge {
                    // In a surface, if only of one triangle.
                    of(name).0[3].store(f32::INFINITY.to_bits(), Ordering::Relaxed);
                }
                if let [a, b] = *edge {
                    for (name, other) in [(a, b), (b, a)] {
                        let (triangle, side) = of(name);
                        triangle[side].store(other as u32 / 3, Ordering::Relaxed);
                    }
                }
            }
        });
        drop(sides);
        let known = |[a, b, c, extent]: [AtomicU32; 4]| SurfaceTriangle {
            across: [a, b, c].map(AtomicU32::into_inner),
            extent: f32::from_bits(extent.into_inner()),
        };
        let mut surfaces = Self { triangles: triangles.into_iter().map(known).collect() };
        surfaces.measure(scene);
        Ok(surfaces)
    }

    /// Replaces infinite extents by those of the pieces.
    fn measure(&mut self, scene: &Scene) {
        let mut piece = Vec::new();
        for seed in 0..self.triangles.len() {
            if self.triangles[seed].extent != f32::INFINITY {
                continue;
            }
            piece.clear();
            piece.push(seed as u32);
            // Until the piece is whole.
            self.triangles[seed].extent = f32::MIN_POSITIVE;
            let mut bounds = Aabb::EMPTY;
            let mut next = 0;
            while let Some(&triangle) = piece.get(next) {
                next += 1;
                bounds = scene.corners(triangle as usize).into_iter().fold(bounds, Aabb::with_point);
                for across in self.triangles[triangle as usize].across {
                    if across != NO_TRIANGLE && self.triangles[across as usize].extent == f32::INFINITY {
                        self.triangles[across as usize].extent = f32::MIN_POSITIVE;
                        piece.push(across);
                    }
                }
            }
            let extent = bounds.diagonal().max(f32::MIN_POSITIVE);
            piece.iter().for_each(|&triangle| self.triangles[triangle as usize].extent = extent);
        }
    }

    /// A triangle's place in its surface.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[inline]
    pub fn of(&self, triangle: usize) -> &SurfaceTriangle {
        &self.triangles[triangle]
    }

    /// All, for a buffer.
    pub fn triangles(&self) -> &[SurfaceTriangle] {
        &self.triangles
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        size_of_val(&self.triangles[..]) as u64
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{Affine3A, Vec2, Vec3};

    use super::*;
    use crate::TriangleMesh;
    use crate::geometry::{AlphaMask, ObjectFlags};

    const NONE: SurfaceTriangle = SurfaceTriangle { across: [NO_TRIANGLE; 3], extent: 0.0 };

    /// Four points around the middle of a square, at `height`, and its four triangles, which share no vertex index.
    fn fan(height: f32) -> TriangleMesh {
        let around = [Vec3::X, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Z].map(|corner| corner + Vec3::Y * height);
        let positions = (0..4).flat_map(|i| [Vec3::Y * height, around[i], around[(i + 1) % 4]]).collect();
        TriangleMesh::new("fan", positions, (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    }

    fn scene_of(meshes: &[TriangleMesh], flags: ObjectFlags) -> Scene {
        let mut scene = Scene::new();
        for mesh in meshes {
            scene.add(mesh, Affine3A::IDENTITY, flags).unwrap();
        }
        scene
    }

    #[test]
    fn neighbours_lie_across_their_edges_and_pieces_are_measured_whole() {
        let scene = scene_of(&[fan(0.0), fan(3.0)], ObjectFlags::default());
        let surfaces = Surfaces::new(&scene).unwrap();
        for triangle in 0..8 {
            let SurfaceTriangle { across, extent } = *surfaces.of(triangle);
            let (fan, i) = (triangle as u32 / 4 * 4, triangle as u32 % 4);
            // From the middle to this triangle's first corner, outside, and back.
            assert_eq!(across, [fan + (i + 3) % 4, NO_TRIANGLE, fan + (i + 1) % 4]);
            assert!((extent - 8.0f32.sqrt()).abs() < 1e-6, "{extent}");
        }
        assert_eq!(surfaces.bytes(), 8 * 16);
    }

    #[test]
    fn where_more_than_two_meet_none_is_across() {
        let [a, b, c, d, e] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_Y];
        let mesh = TriangleMesh::new("three", vec![a, b, c, d, e], vec![[0, 1, 2], [0, 1, 3], [1, 0, 4]]);
        let surfaces = Surfaces::new(&scene_of(&[mesh], ObjectFlags::default())).unwrap();
        assert!(surfaces.triangles().iter().all(|t| t.across == [NO_TRIANGLE; 3] && t.extent > 1.0));
    }

    #[test]
    fn what_does_not_cast_or_is_cut_out_is_in_no_surface() {
        let flags = ObjectFlags { casts: false, ..Default::default() };
        let mut masked = fan(0.0);
        masked.uvs = vec![Vec2::ZERO; masked.positions.len()];
        masked.alpha = AlphaMask::from_alpha(1, 1, &[0], 0.5, Default::default()).map(Arc::new);
        for scene in [scene_of(&[fan(0.0)], flags), scene_of(&[masked], ObjectFlags::default())] {
            let surfaces = Surfaces::new(&scene).unwrap();
            assert!(surfaces.triangles().iter().all(|&triangle| triangle == NONE));
        }
        let point = TriangleMesh::new("point", vec![Vec3::ONE; 3], vec![[0, 1, 2]]);
        let surfaces = Surfaces::new(&scene_of(&[point], ObjectFlags::default())).unwrap();
        assert_eq!(surfaces.of(0), &NONE);
    }
}
