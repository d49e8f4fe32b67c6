//! What lives as long as the scene does.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use scene_core::bvh::Bvh;
use scene_core::geometry::{EdgeTopology, Object};
use scene_core::relevance::{CasterChunks, CasterRegion, relevant_casters};
use scene_core::{Camera, Light, Report, Scene};

use crate::error::WedgeError;

/// Edges and bounds of a scene's casters. Independent of light and camera.
#[derive(Clone, Debug)]
pub struct Casters<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Edges of everything that casts without a mask, welded across objects.
    pub topology: EdgeTopology,
    /// Bounds of runs of triangles.
    pub chunks: CasterChunks,
    /// The tree of everything that casts.
    pub tree: Arc<Bvh>,
}

/// Whether an object's outline is that of its triangles.
pub(crate) fn has_edges(object: &Object) -> bool {
    object.flags.casts && object.alpha.is_none()
}

impl<'a> Casters<'a> {
    /// The casters of `scene`.
    ///
    /// # Errors
    /// More triangles than can be numbered.
    pub fn new(scene: &'a Scene) -> Result<Self, WedgeError> {
        let (topology, tree) =
            rayon::join(|| EdgeTopology::of_scene(scene, has_edges), || Arc::new(Bvh::casters(scene)));
        Ok(Self { scene, topology: topology?, chunks: CasterChunks::new(scene), tree })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.topology.bytes() + self.chunks.bytes() + self.tree.bytes()
    }

    /// A casting object with a mask.
    pub fn masked(&self) -> Option<&Object> {
        self.scene.objects().iter().find(|object| object.flags.casts && object.alpha.is_some())
    }

    /// The casting triangles that may shadow what `camera` sees, or all of them, as ranges of
    /// [`Scene::triangles`]; books what is left out.
    pub fn relevant(
        &self,
        light: &Light,
        camera: &Camera,
        skip: bool,
        report: &mut Report,
    ) -> Vec<Range<usize>> {
        if !skip {
            return std::iter::once(0..self.scene.triangles().len()).collect();
        }
        let region = CasterRegion::of(self.scene, camera, light);
        let kept = relevant_casters(self.scene, &region, &self.chunks, |_| true);
        kept.book(report);
        kept.ranges
    }

    /// Which triangles belong to a part without a border: connected by edges, as many faces along each as against it. A ray
    /// through such a part meets as many of its faces from the front as from the back.
    pub fn closed_faces(&self) -> Vec<bool> {
        let mut parts = Parts { parent: (0..self.scene.triangles().len() as u32).collect() };
        for edge in 0..self.topology.len() {
            for pair in self.topology.faces(edge).windows(2) {
                parts.join(pair[0].face(), pair[1].face());
            }
        }
        let mut is_open = vec![false; parts.parent.len()];
        for edge in 0..self.topology.len() {
            let faces = self.topology.faces(edge);
            if faces.iter().map(|face| face.sign()).sum::<i32>() != 0 {
                is_open[parts.root(faces[0].face()) as usize] = true;
            }
        }
        (0..parts.parent.len() as u32).map(|face| !is_open[parts.root(face) as usize]).collect()
    }

    /// Runs `of` on every triangle of objects that have edges, in parallel; others stay as `default` has them.
    pub(crate) fn for_faces<T: Copy + Send + Sync>(
        &self,
        default: T,
        of: impl Fn(usize) -> T + Sync,
    ) -> Vec<T> {
        /// Triangles a task.
        const CHUNK: usize = 1 << 13;
        let mut values = vec![default; self.scene.triangles().len()];
        for object in self.scene.objects().iter().filter(|object| has_edges(object)) {
            let first = object.triangles.start;
            values[object.triangles.clone()].par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, values)| {
                for (offset, value) in values.iter_mut().enumerate() {
                    *value = of(first + chunk * CHUNK + offset);
                }
            });
        }
        values
    }
}

/// Disjoint sets of faces.
struct Parts {
    parent: Vec<u32>,
}

impl Parts {
    fn root(&mut self, mut face: u32) -> u32 {
        while self.parent[face as usize] != face {
            let above = self.parent[self.parent[face as usize] as usize];
            self.parent[face as usize] = above;
            face = above;
        }
        face
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, Vec3};
    use scene_core::TriangleMesh;
    use scene_core::geometry::ObjectFlags;

    use super::*;

    #[test]
    fn closed_bodies_are_told_from_sheets() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let body = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let mut scene = Scene::new();
        for triangles in [body.clone(), body[..3].to_vec(), vec![[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3]]]
        {
            let mesh = TriangleMesh::new("part", positions.clone(), triangles);
            let apart = Affine3A::from_translation(Vec3::X * (2 * scene.objects().len()) as f32);
            scene.add(&mesh, apart, ObjectFlags::default()).unwrap();
        }
        let closed = Casters::new(&scene).unwrap().closed_faces();
        assert_eq!(closed[..4], [true; 4]);
        assert_eq!(closed[4..7], [false; 3]);
        assert_eq!(closed[7..], [false; 4], "one face is flipped");
    }
}
