//! What lives as long as the scene does.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use scene_core::bvh::Bvh;
use scene_core::geometry::{EdgeTopology, Object};
use scene_core::relevance::{CasterChunks, CasterRegion, relevant_casters};
use scene_core::{Camera, Light, Report, Scene};

use crate::bodies::Bodies;
use crate::error::WedgeError;

/// Edges and bounds of a scene's casters. Independent of light and camera.
#[derive(Clone, Debug)]
pub struct Casters<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Edges of everything that casts without a mask, welded across objects.
    pub topology: Arc<EdgeTopology>,
    /// Bounds of runs of triangles.
    pub chunks: Arc<CasterChunks>,
    /// The tree of everything that casts.
    pub tree: Arc<Bvh>,
    bodies: Arc<OnceLock<Bodies>>,
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
        let (topology, chunks) = (Arc::new(topology?), Arc::new(CasterChunks::new(scene)));
        Ok(Self { scene, topology, chunks, tree, bodies: Arc::default() })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let bodies = self.bodies.get().map_or(0, Bodies::bytes);
        self.topology.bytes() + self.chunks.bytes() + self.tree.bytes() + bodies
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

    /// What counts as a layer, for the variants that add layers up; made when first asked for.
    pub fn bodies(&self) -> &Bodies {
        self.bodies.get_or_init(|| Bodies::new(self))
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
