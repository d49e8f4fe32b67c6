//! Where techniques run: which backend is asked for, and the GPU if it is.
//!
//! `auto` takes the GPU if it is one. A GPU in software is a program on the CPU that does not know what the CPU paths
//! know, and slower than they are; it runs only where `gpu` is asked for. What fails on the GPU under `auto`, for want
//! of memory or because the device is lost, is run on the CPU instead, and said.

use scene_core::ShadowTechnique;
use scene_core::technique::Capability;

use crate::args::Backend;
use crate::error::CliError;

#[cfg(feature = "gpu")]
pub(crate) use scene_core::gpu::Gpu;

/// No GPU can be opened by this build.
#[cfg(not(feature = "gpu"))]
#[derive(Debug)]
pub(crate) enum Gpu {}

/// One side of the two that a technique may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Cpu,
    Gpu,
}

impl Side {
    /// Its name in reports.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        }
    }
}

/// The GPU, if one of `backends` may use it.
///
/// # Errors
/// If one of them requires a GPU and there is none.
pub(crate) fn open(backends: &[Backend]) -> Result<Option<Gpu>, CliError> {
    if backends.contains(&Backend::Gpu) {
        return require().map(Some);
    }
    if !backends.contains(&Backend::Auto) {
        return Ok(None);
    }
    Ok(prefer())
}

#[cfg(feature = "gpu")]
fn require() -> Result<Gpu, CliError> {
    Gpu::open().map_err(CliError::Gpu)
}

#[cfg(feature = "gpu")]
fn prefer() -> Option<Gpu> {
    Gpu::open().ok().filter(|gpu| !gpu.is_software())
}

#[cfg(not(feature = "gpu"))]
fn require() -> Result<Gpu, CliError> {
    Err(CliError::NoGpuInBuild)
}

#[cfg(not(feature = "gpu"))]
fn prefer() -> Option<Gpu> {
    None
}

/// Where `technique` runs under `backend`; `None` if that requires a GPU path that it does not have.
pub(crate) fn side(technique: &dyn ShadowTechnique, backend: Backend, has_gpu: bool) -> Option<Side> {
    let has_path = technique.describe().support(Capability::Gpu).is_supported();
    match backend {
        Backend::Cpu => Some(Side::Cpu),
        Backend::Gpu => has_path.then_some(Side::Gpu),
        Backend::Auto if has_path && has_gpu => Some(Side::Gpu),
        Backend::Auto => Some(Side::Cpu),
    }
}

/// The different sides that `backends` come down to, each with the first backend that asks for it; `None` stands for a
/// GPU path that is required and not there.
pub(crate) fn sides(
    technique: &dyn ShadowTechnique,
    backends: &[Backend],
    has_gpu: bool,
) -> Vec<(Backend, Option<Side>)> {
    let mut sides: Vec<(Backend, Option<Side>)> = Vec::new();
    for &backend in backends {
        let side = side(technique, backend, has_gpu);
        if !sides.iter().any(|(_, known)| *known == side) {
            sides.push((backend, side));
        }
    }
    sides
}
