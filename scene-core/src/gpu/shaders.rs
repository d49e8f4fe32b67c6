//! The shaders of this crate, linked to plain WGSL by its build script.
//!
//! The sources are `shaders/*.wesl`. Those without entry points are the shared modules, which technique crates
//! import as `scene_core::camera::…`.

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
