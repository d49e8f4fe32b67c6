//! Triangle meshes and the flattened scene that every technique reads.

mod aabb;
mod alpha;
mod deal;
mod facing;
mod mesh;
mod repair;
mod scene;
mod sides;
mod surfaces;
mod topology;
mod triangulate;
mod uncut;
mod weld;

pub use aabb::Aabb;
pub use alpha::{AlphaMask, Wrap};
pub use facing::{facing, facing_of};
pub use mesh::{MeshError, TriangleMesh};
pub use repair::{Repairs, drop_unused_vertices, remove_faulty_faces};
pub use scene::{Object, ObjectFlags, Scene, SceneError};
pub use surfaces::{NO_TRIANGLE, SurfaceTriangle, Surfaces};
pub use topology::{EdgeStatistics, EdgeTopology, Incidence, SilhouetteEdge, TopologyError};
pub use triangulate::{MAX_CROSSING, PolygonFault, Repair, triangulate};
pub use weld::{Weld, weld};
