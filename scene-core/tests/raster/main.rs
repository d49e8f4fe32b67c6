//! The rasteriser against what it promises: watertight coverage, equality with ray casting, and the same result
//! whatever the threads.

mod caster;
mod meshes;

mod coverage;
mod depth;
mod extremes;
mod gbuffer;
