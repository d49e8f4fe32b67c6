//! The scene: every instance flattened to world space, in one vertex and one triangle array.

use std::ops::Range;
use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use thiserror::Error;

use super::{Aabb, AlphaMask, MeshError, TriangleMesh};

/// What an object takes part in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectFlags {
    /// Throws shadows.
    pub casts: bool,
    /// Shows shadows. An object that does not receive is always lit.
    pub receives: bool,
    /// May move between frames: baked data must not contain it as a caster.
    pub dynamic: bool,
    /// May be drawn as points by techniques that can: for what is finer than they resolve, such as leaves far off.
    pub points: bool,
    /// Named as a flat surface that shadows fall on. Where a scene has such objects, techniques that look for flat receivers
    /// take these alone.
    pub planar: bool,
}

impl Default for ObjectFlags {
    fn default() -> Self {
        Self { casts: true, receives: true, dynamic: false, points: false, planar: false }
    }
}

/// One instance of a mesh in the scene, or the part of it that a mask does not cut, or that it does. Its id is its place in [`Scene::objects`].
#[derive(Clone, Debug)]
pub struct Object {
    /// A name for messages and reports.
    pub name: String,
    /// Its triangles in [`Scene::triangles`].
    pub triangles: Range<usize>,
    /// Its vertices in [`Scene::positions`], which it may share with the object before or after it.
    pub vertices: Range<usize>,
    /// World-space bounds of its vertices, or of its triangles where a mesh became two objects ([`Scene::add`]).
    pub bounds: Aabb,
    /// What it takes part in.
    pub flags: ObjectFlags,
    /// Cut-out mask, by the vertices' [`Scene::uvs`].
    pub alpha: Option<Arc<AlphaMask>>,
}

/// Why an object could not be added.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SceneError {
    /// The mesh is broken.
    #[error("object '{object}': {source}")]
    Mesh {
        /// The object's name.
        object: String,
        /// The fault.
        source: MeshError,
    },
    /// Indices are 32 bits wide.
    #[error("object '{object}' would be the scene's {count}th {what}: at most {} fit", u32::MAX)]
    TooLarge {
        /// The object's name.
        object: String,
        /// Vertices or triangles there would be.
        count: usize,
        /// "vertex" or "triangle".
        what: &'static str,
    },
}

/// All geometry of a scene in world space, flattened: what techniques and ray tracer read.
///
/// Objects are contiguous ranges of triangles in the order they were added, so a triangle's
/// object is found by binary search.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    uvs: Vec<Vec2>,
    objects: Vec<Object>,
    bounds: Option<Aabb>,
}

impl Scene {
    /// A scene without objects.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds `mesh` placed by `world_from_mesh` and returns the new object's id.
    ///
    /// A mesh with a mask that leaves some of its triangles whole ([`AlphaMask::leaves_whole`]) becomes two objects of its name,
    /// over the same vertices: those triangles, without a mask, and then the others. The first one's id is returned.
    ///
    /// # Errors
    /// A broken mesh (by element), a position that leaves the range of f32 under the transformation, or more
    /// vertices or triangles than 32-bit indices reach. The scene is unchanged then.
    pub fn add(
        &mut self,
        mesh: &TriangleMesh,
        world_from_mesh: Affine3A,
        flags: ObjectFlags,
    ) -> Result<u32, SceneError> {
        let fault = |source| SceneError::Mesh { object: mesh.name.clone(), source };
        mesh.validate().map_err(fault)?;
        let first_vertex = self.positions.len();
        let first_triangle = self.triangles.len();
        for (count, what) in [
            (first_vertex + mesh.positions.len(), "vertex"),
            (first_triangle + mesh.triangles.len(), "triangle"),
        ] {
            if count >= u32::MAX as usize {
                return Err(SceneError::TooLarge { object: mesh.name.clone(), count, what });
            }
        }
        self.positions.extend(mesh.positions.iter().map(|&p| world_from_mesh.transform_point3(p)));
        if let Some(vertex) = self.positions[first_vertex..].iter().position(|p| !p.is_finite()) {
            let position = self.positions[first_vertex + vertex];
            self.positions.truncate(first_vertex);
            return Err(fault(MeshError::NotFinite { vertex, position }));
        }
        let mask = mesh.alpha.as_ref().filter(|mask| !mask.is_opaque());
        let mut cut = Vec::new();
        for corners in &mesh.triangles {
            let is_whole = mask.is_none_or(|mask| mask.leaves_whole(corners.map(|i| mesh.uvs[i as usize])));
            let side = if is_whole { &mut self.triangles } else { &mut cut };
            side.push(corners.map(|i| i + first_vertex as u32));
        }
        let first_cut = self.triangles.len();
        self.triangles.append(&mut cut);
        // Texture coordinates exist for all vertices or, as in most scenes, for none.
        if !mesh.uvs.is_empty() && mesh.alpha.is_some() {
            self.uvs.resize(first_vertex, Vec2::ZERO);
            self.uvs.extend_from_slice(&mesh.uvs);
        } else if !self.uvs.is_empty() {
            self.uvs.resize(self.positions.len(), Vec2::ZERO);
        }
        let bounds = Aabb::from_points(self.positions[first_vertex..].iter().copied());
        self.bounds = Some(self.bounds().union(bounds));
        let id = self.objects.len() as u32;
        let (whole, cut) = (first_triangle..first_cut, first_cut..self.triangles.len());
        let mut push = |triangles: Range<usize>, alpha: Option<&Arc<AlphaMask>>, bounds: Aabb| {
            let vertices = first_vertex..self.positions.len();
            let (name, alpha) = (mesh.name.clone(), alpha.cloned());
            self.objects.push(Object { name, triangles, vertices, bounds, flags, alpha });
        };
        if cut.is_empty() {
            push(whole, None, bounds);
        } else if whole.is_empty() {
            push(cut, mask, bounds);
        } else {
            let own = |range: &Range<usize>| {
                let corners = self.triangles[range.clone()].iter().flatten();
                Aabb::from_points(corners.map(|&vertex| self.positions[vertex as usize]))
            };
            let bounds = [own(&whole), own(&cut)];
            push(whole, None, bounds[0]);
            push(cut, mask, bounds[1]);
        }
        Ok(id)
    }

    /// The same with all coordinates less `origin`, each rounded once. Coordinates that overflow become infinite.
    #[must_use]
    pub fn counted_from(&self, origin: Vec3) -> Self {
        let mut moved = self.clone();
        moved.positions.iter_mut().for_each(|position| *position -= origin);
        // Rounding keeps order: the bounds of what moved are what moved of the bounds.
        let bounds = moved.objects.iter_mut().map(|object| &mut object.bounds).chain(&mut moved.bounds);
        for bounds in bounds.filter(|bounds| !bounds.is_empty()) {
            (bounds.min, bounds.max) = (bounds.min - origin, bounds.max - origin);
        }
        moved
    }

    /// Marks the objects of a name as flat receivers ([`ObjectFlags::planar`]); how many there are.
    pub fn mark_planar(&mut self, name: &str) -> usize {
        let named = self.objects.iter_mut().filter(|object| object.name == name);
        named.map(|object| object.flags.planar = true).count()
    }

    /// Vertex positions in world space.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Vertex indices, three a triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Texture coordinates, one a vertex; empty if no object has a mask.
    pub fn uvs(&self) -> &[Vec2] {
        &self.uvs
    }

    /// The objects; an object's id is its index.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// World-space bounds of all vertices; [`Aabb::EMPTY`] for none.
    pub fn bounds(&self) -> Aabb {
        self.bounds.unwrap_or(Aabb::EMPTY)
    }

    /// The corners of a triangle in world space.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[inline]
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|i| self.positions[i as usize])
    }

    /// The id of the object a triangle belongs to: a binary search over the objects.
    #[inline]
    pub fn object_of(&self, triangle: usize) -> u32 {
        self.objects.partition_point(|o| o.triangles.end <= triangle) as u32
    }

    /// Triangles of objects that cast shadows.
    pub fn caster_count(&self) -> usize {
        self.objects.iter().filter(|o| o.flags.casts).map(|o| o.triangles.len()).sum()
    }

    /// Whether any object has a cut-out mask.
    pub fn has_alpha(&self) -> bool {
        self.objects.iter().any(|o| o.alpha.is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> TriangleMesh {
        TriangleMesh::new("t", vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])
    }

    #[test]
    fn instances_are_flattened_to_world_space() {
        let mut scene = Scene::new();
        scene.add(&triangle(), Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        let id = scene.add(&triangle(), Affine3A::from_translation(Vec3::Z), ObjectFlags::default()).unwrap();
        assert_eq!(id, 1);
        assert_eq!(scene.corners(1), [Vec3::Z, Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 1.0)]);
        assert_eq!((scene.object_of(0), scene.object_of(1)), (0, 1));
        assert_eq!(scene.bounds(), Aabb { min: Vec3::ZERO, max: Vec3::ONE });
    }

    #[test]
    fn empty_objects_do_not_confuse_the_search() {
        let mut scene = Scene::new();
        let empty = TriangleMesh::default();
        for mesh in [&empty, &triangle(), &empty, &triangle()] {
            scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        }
        assert_eq!((scene.object_of(0), scene.object_of(1)), (1, 3));
    }

    #[test]
    fn a_refused_object_leaves_the_scene_unchanged() {
        let mut scene = Scene::new();
        let huge = Affine3A::from_scale(Vec3::splat(f32::MAX));
        let mut mesh = triangle();
        mesh.positions[1] *= 2.0;
        assert!(scene.add(&mesh, huge, ObjectFlags::default()).is_err());
        assert!(scene.positions().is_empty() && scene.objects().is_empty());
    }

    /// Of three triangles the mask cuts the second, the others are an object without it: whichever one asks for, the same corners
    /// and texture coordinates.
    #[test]
    fn what_a_mask_does_not_cut_is_an_object_without_it() {
        let at = |x: f32| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|corner| corner + Vec3::X * x);
        let mut mesh = TriangleMesh::new("leaf", [at(0.0), at(2.0), at(4.0)].concat(), vec![]);
        mesh.triangles = (0..3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        mesh.uvs = [0.25, 0.75, 0.25].into_iter().flat_map(|u| [Vec2::new(u, 0.5); 3]).collect();
        let mask = AlphaMask::from_solid(2, 1, vec![true, false], Default::default()).map(Arc::new);
        mesh.alpha.clone_from(&mask);
        let mut scene = Scene::new();
        scene.add(&triangle(), Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        let up = Affine3A::from_translation(Vec3::Z);
        assert_eq!(scene.add(&mesh, up, ObjectFlags::default()), Ok(1));
        assert_eq!(scene.add(&triangle(), up, ObjectFlags::default()), Ok(3));
        let [_, whole, cut, _] = scene.objects() else { panic!("{:?}", scene.objects()) };
        assert_eq!((whole.triangles.clone(), cut.triangles.clone()), (1..3, 3..4));
        assert_eq!((&whole.name, &whole.vertices), (&cut.name, &cut.vertices));
        assert_eq!((whole.alpha.is_none(), &cut.alpha), (true, &mask));
        assert_eq!([1, 2, 3].map(|triangle| scene.corners(triangle)[0].x), [0.0, 4.0, 2.0]);
        assert_eq!([1, 2, 3].map(|triangle| scene.object_of(triangle)), [1, 1, 2]);
        assert_eq!([whole, cut].map(|o| [o.bounds.min.x, o.bounds.max.x]), [[0.0, 5.0], [2.0, 3.0]]);
        assert_eq!(scene.uvs()[scene.triangles()[3][0] as usize], Vec2::new(0.75, 0.5));

        // One object where all of it is cut, or nothing is; an empty mesh is one, too.
        let add = |uv: Vec2, triangles: usize| {
            let mut scene = Scene::new();
            let mut mesh = mesh.clone();
            mesh.uvs.fill(uv);
            mesh.triangles.truncate(triangles);
            scene.add(&mesh, up, ObjectFlags::default()).unwrap();
            scene
                .objects()
                .iter()
                .map(|object| (object.triangles.clone(), object.alpha.is_some()))
                .collect::<Vec<_>>()
        };
        assert_eq!(add(Vec2::new(0.75, 0.5), 3), [(0..3, true)]);
        assert_eq!(add(Vec2::new(0.25, 0.5), 3), [(0..3, false)]);
        assert_eq!(add(Vec2::new(0.75, 0.5), 0), [(0..0, false)]);
    }

    #[test]
    fn uvs_are_kept_only_for_masks_and_stay_aligned() {
        let mut masked = triangle();
        masked.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::Y];
        masked.alpha = AlphaMask::from_alpha(1, 1, &[0], 0.5, Default::default()).map(Arc::new);
        let mut scene = Scene::new();
        for mesh in [&triangle(), &masked, &triangle()] {
            scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        }
        assert_eq!(scene.uvs().len(), scene.positions().len());
        assert_eq!(scene.uvs()[4], Vec2::X);
    }
}
