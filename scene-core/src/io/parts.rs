//! What a mesh file gives, and how it becomes a scene.

use std::path::Path;

use glam::Affine3A;

use super::{LoadError, LoadOptions, Progress, file, framing, gltf, obj};
use crate::geometry::{ObjectFlags, Repairs, SceneError};
use crate::{Camera, Light, Scene, SceneSetup, TriangleMesh};

/// The contents of a mesh file, not yet placed in a scene.
#[derive(Debug, Default)]
pub(super) struct MeshFile {
    /// Meshes in their own space.
    pub(super) meshes: Vec<TriangleMesh>,
    /// Index of a mesh, and its place in the file's space. A mesh may occur often.
    pub(super) instances: Vec<(usize, Affine3A)>,
    /// The first camera of the file, in the file's space.
    pub(super) camera: Option<Camera>,
    /// The file's lights, in the file's space.
    pub(super) lights: Vec<Light>,
    /// Faces that were removed.
    pub(super) repairs: Repairs,
    /// What else the user should know.
    pub(super) notes: Vec<String>,
}

impl MeshFile {
    /// Reads an `.obj`, `.gltf` or `.glb` file.
    pub(super) fn load(path: &Path, options: &LoadOptions<'_>) -> Result<Self, LoadError> {
        let mut loaded = match file::extension(path).as_str() {
            "obj" => obj::load(path, &options.limits)?,
            "gltf" | "glb" => gltf::load(path, &options.limits)?,
            _ => {
                let message = "a mesh must be a .obj, .gltf or .glb file".to_owned();
                return Err(LoadError::File { path: path.to_owned(), message });
            }
        };
        if loaded.instances.iter().all(|&(mesh, _)| loaded.meshes[mesh].triangles.is_empty()) {
            let message = if loaded.repairs == Repairs::default() {
                "there are no faces in it".to_owned()
            } else {
                "no face in it has an area".to_owned()
            };
            return Err(LoadError::File { path: path.to_owned(), message });
        }
        if let Some(note) = loaded.repairs.note() {
            loaded.notes.push(note);
        }
        for note in &mut loaded.notes {
            *note = format!("{}: {note}", file::name(path));
        }
        Ok(loaded)
    }

    /// Adds every instance, placed by `world_from_file`, to `scene`. `path` is for messages.
    pub(super) fn add_to(
        &self,
        scene: &mut Scene,
        world_from_file: Affine3A,
        flags: ObjectFlags,
        path: &Path,
        options: &LoadOptions<'_>,
    ) -> Result<(), LoadError> {
        let instanced: u64 =
            self.instances.iter().map(|&(mesh, _)| self.meshes[mesh].triangles.len() as u64).sum();
        let count = scene.triangles().len() as u64 + instanced;
        let limit = options.limits.triangles;
        if count > limit {
            let what = "triangles, instances counted";
            return Err(LoadError::TooLarge { path: path.to_owned(), what, count, limit });
        }
        for &(mesh, file_from_mesh) in &self.instances {
            let mesh = &self.meshes[mesh];
            if mesh.triangles.is_empty() {
                continue;
            }
            scene.add(mesh, world_from_file * file_from_mesh, flags).map_err(|fault| match fault {
                SceneError::Mesh { object, source } => LoadError::Element {
                    path: path.to_owned(),
                    element: format!("object '{object}' in its place"),
                    message: source.to_string(),
                },
                other => LoadError::File { path: path.to_owned(), message: other.to_string() },
            })?;
        }
        Ok(())
    }
}

/// A mesh file alone: what it lacks of camera, light and ground is made up.
pub(super) fn load_bare_mesh(path: &Path, options: &LoadOptions<'_>) -> Result<SceneSetup, LoadError> {
    if let Some(progress) = options.progress {
        progress(Progress { path, done: 0, total: 1 });
    }
    let loaded = MeshFile::load(path, options)?;
    let mut scene = Scene::new();
    loaded.add_to(&mut scene, Affine3A::IDENTITY, ObjectFlags::default(), path, options)?;
    let mut setup = SceneSetup {
        name: file::stem(path),
        scene,
        camera: framing::UNFRAMED,
        lights: loaded.lights,
        notes: loaded.notes,
    };
    framing::complete(&mut setup, loaded.camera, options.up)
        .map_err(|fault| LoadError::File { path: path.to_owned(), message: fault.to_string() })?;
    Ok(setup)
}
