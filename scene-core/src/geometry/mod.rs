//! Triangle meshes and the flattened scene that every technique reads.

mod aabb;
mod alpha;
mod mesh;
mod repair;
mod scene;
mod triangulate;

pub use aabb::Aabb;
pub use alpha::{AlphaMask, Wrap};
pub use mesh::{MeshError, TriangleMesh};
pub use repair::{Repairs, drop_unused_vertices, remove_faulty_faces};
pub use scene::{Object, ObjectFlags, Scene, SceneError};
pub use triangulate::{MAX_CROSSING, PolygonFault, Repair, triangulate};
