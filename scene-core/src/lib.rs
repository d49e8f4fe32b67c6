//! The scene core of Gnomon: everything that shadow techniques share.
//!
//! Data flows one way: a [`Scene`] is loaded ([`io`]) or generated ([`scenes`]), a technique
//! *prepares* what depends on scene and light, *shades* a [`GBuffer`], and the resulting
//! [`VisibilityImage`] is held against ground truth ([`mod@reference`]) by [`metrics`].
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`geometry`] | meshes, the flattened scene, welding, edge topology, alpha masks |
//! | [`light`] | light kinds and their sampling |
//! | [`camera`] | the pinhole camera and its matrices |
//! | [`io`] | scene files, OBJ, glTF, images, `.npy` |
//! | [`scenes`] | built-in procedural scenes |
//! | [`raster`] | the CPU rasteriser: depth from any projection, G-buffer |
//! | [`bvh`] | closest hit and packets of shadow rays |
//! | [`mod@reference`] | ray-traced ground truth and which pixels may be compared |
//! | [`relevance`] | what light and camera make irrelevant |
//! | [`metrics`] | errors of a visibility image |
//! | [`origin`] | coordinates counted from the scene, where it lies far from zero |
//! | [`technique`] | the [`ShadowTechnique`] trait, settings, reports, what every technique's tests check |
//! | [`splitmix`] | numbers that look random, and hashes |
//! | `gpu` | its GPU half, with the feature of that name |
//!
//! # Conventions
//!
//! World space is right-handed. Lengths are in the scene's own unit, angles are radians unless a name ends
//! in `_deg`. Visibility `V` is the fraction of the light seen from a point, in [0, 1]; 1 is lit. Matrices are
//! named `target_from_source` and act on column vectors. Depth is reversed: 1 at the near plane, 0 at the
//! far plane or at infinity.

pub mod bvh;
pub mod camera;
pub mod gbuffer;
pub mod geometry;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod io;
pub mod light;
pub mod metrics;
pub mod origin;
pub mod raster;
pub mod reference;
pub mod relevance;
pub mod report;
pub mod scenes;
pub mod setup;
pub mod splitmix;
pub mod technique;
pub mod visibility;

pub use camera::Camera;
pub use gbuffer::GBuffer;
pub use geometry::{Scene, TriangleMesh};
pub use light::Light;
pub use origin::Origin;
pub use report::Report;
pub use setup::SceneSetup;
pub use technique::{PreparedShadow, ShadowTechnique};
pub use visibility::VisibilityImage;
