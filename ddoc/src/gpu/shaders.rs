//! The shaders of this crate, linked to plain WGSL by its build script. The sources are `shaders/*.wesl`.

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
