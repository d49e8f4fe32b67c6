//! Triangle meshes and the flattened scene that every technique reads.

mod aabb;
mod alpha;
mod mesh;
mod scene;

pub use aabb::Aabb;
pub use alpha::{AlphaMask, Wrap};
pub use mesh::{MeshError, TriangleMesh};
pub use scene::{Object, ObjectFlags, Scene, SceneError};
