//! The GPU half on whatever adapter there is; `GNOMON_GPU=off` skips, a missing adapter fails.
#![cfg(feature = "gpu")]

mod errors;
mod headless;
mod passes;
mod shader_functions;
mod shaders;
