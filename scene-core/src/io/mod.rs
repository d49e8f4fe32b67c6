//! Loading scenes, writing images.
//!
//! [`load_setup`] takes any of these and returns a scene with a camera and lights:
//!
//! | file | what is read |
//! | --- | --- |
//! | `.toml`, `.json` | a scene file: meshes with their places, camera, lights ([`scene_file`]) |
//! | `.obj` | polygons, groups, `map_d` masks of its `.mtl` ([`obj`]) |
//! | `.gltf`, `.glb` | the default scene's nodes, cameras, lights and `MASK` materials ([`gltf`]) |
//!
//! What is missing is made up by a stated rule ([`framing`]) and said in [`SceneSetup::notes`], as is every
//! repair. Broken input is a [`LoadError`] that names file and place; it is never a panic, and the memory
//! taken is bounded by the size of the files and by [`Limits`].
//!
//! [`mod@write`] holds the writers of PNG, EXR, `.npy` and JSON.

mod error;
mod file;
pub mod framing;
pub mod gltf;
pub mod obj;
mod parts;
pub mod scene_file;
mod texture;
pub mod write;

use std::path::Path;

pub use error::LoadError;
pub use framing::UpAxis;

use crate::SceneSetup;

/// What a load may take at most. The defaults fit a machine of 16 GiB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of one file, 4 GiB by default.
    pub file_bytes: u64,
    /// Triangles of the flattened scene, instances counted, 128 Mi by default: about 3 GiB of geometry.
    pub triangles: u64,
    /// Texels of one texture, 64 Mi by default.
    pub texels: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { file_bytes: 4 << 30, triangles: 128 << 20, texels: 64 << 20 }
    }
}

/// How far a load has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress<'a> {
    /// The file that is about to be read.
    pub path: &'a Path,
    /// Mesh files read so far.
    pub done: usize,
    /// Mesh files to read.
    pub total: usize,
}

/// What a load can be told.
#[derive(Clone, Copy, Default)]
pub struct LoadOptions<'a> {
    /// What it may take.
    pub limits: Limits,
    /// Which way is up in a mesh without camera; a scene file's `camera.up` comes first.
    pub up: UpAxis,
    /// Called before each mesh file is read.
    pub progress: Option<&'a (dyn Fn(Progress<'_>) + Sync)>,
}

impl std::fmt::Debug for LoadOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LoadOptions")
            .field("limits", &self.limits)
            .field("up", &self.up)
            .field("progress", &self.progress.is_some())
            .finish()
    }
}

/// Loads a scene file or a mesh file, told apart by the name's ending, with default [`LoadOptions`].
///
/// # Errors
/// [`LoadError`], with file and place.
pub fn load_setup(path: &Path) -> Result<SceneSetup, LoadError> {
    load_setup_with(path, &LoadOptions::default())
}

/// [`load_setup`] with limits, up axis and progress.
///
/// # Errors
/// [`LoadError`], with file and place.
pub fn load_setup_with(path: &Path, options: &LoadOptions<'_>) -> Result<SceneSetup, LoadError> {
    match file::extension(path).as_str() {
        "toml" | "json" => scene_file::load(path, options),
        "obj" | "gltf" | "glb" => parts::load_bare_mesh(path, options),
        extension => Err(LoadError::Extension { path: path.to_owned(), extension: extension.to_owned() }),
    }
}
