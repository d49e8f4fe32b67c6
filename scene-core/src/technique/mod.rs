//! The interface of every shadow technique: prepare, then shade.
//!
//! [`ShadowTechnique`] is object-safe so that the command line, tests and benchmarks can hold any of them.
//! The algorithms themselves live on concrete types in the technique crates and can be called without it.

mod capability;
pub mod conformance;
mod factory;
mod settings;

use glam::Vec3;
use thiserror::Error;

pub use capability::{Capability, Description, Support};
pub use factory::{TechniqueFactory, TechniqueFromParams};
pub use settings::{Params, Preset, Setting, SettingKind, SettingsError};

use crate::{Camera, GBuffer, Light, Report, Scene, VisibilityImage};

/// Why a technique could not do its work.
#[derive(Debug, Error)]
pub enum TechniqueError {
    /// The technique cannot answer for this input at all; see [`ShadowTechnique::describe`].
    #[error("{technique} does not take {input}: {why}")]
    Unsupported {
        /// The technique's name.
        technique: &'static str,
        /// What it was given.
        input: String,
        /// The limit.
        why: String,
    },
    /// Settings contradict each other or the input.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The output buffer does not have the input's size.
    #[error("the output holds {got} values, but the input has {expected}")]
    OutputSize {
        /// Values expected.
        expected: usize,
        /// Values given.
        got: usize,
    },
    /// Shading was asked for before anything was prepared.
    #[error("{technique} has nothing prepared to shade with")]
    NotPrepared {
        /// The technique's name.
        technique: &'static str,
    },
    /// The device.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] crate::gpu::GpuError),
    /// Anything that only one technique knows.
    #[error(transparent)]
    Other(#[from] Box<dyn std::error::Error + Send + Sync>),
}

impl TechniqueError {
    /// Refuses an output of `got` values for an input of `expected`.
    ///
    /// # Errors
    /// [`TechniqueError::OutputSize`] if the two differ.
    pub fn check_output(expected: usize, got: usize) -> Result<(), Self> {
        if got == expected { Ok(()) } else { Err(Self::OutputSize { expected, got }) }
    }
}

/// What a technique prepares for: one light in one scene, seen by one camera.
#[derive(Clone, Copy, Debug)]
pub struct ShadowQuery<'a> {
    /// Geometry.
    pub scene: &'a Scene,
    /// The light whose visibility is asked for.
    pub light: &'a Light,
    /// The camera. Techniques whose preparation does not depend on it say so by
    /// [`PreparedShadow::survives_camera`].
    pub camera: &'a Camera,
}

/// A shadow algorithm with its settings.
pub trait ShadowTechnique: Send + Sync {
    /// The name on the command line, the crate's without its prefix.
    fn name(&self) -> &'static str;

    /// What it takes: exact, approximate or unsupported, per input.
    fn describe(&self) -> Description;

    /// All settings as they stand, by name.
    fn settings(&self) -> serde_json::Value;

    /// Does what depends on scene and light, and, for view-dependent techniques, on the camera.
    ///
    /// # Errors
    /// [`TechniqueError::Unsupported`] for inputs that [`describe`](Self::describe) excludes.
    fn prepare<'a>(
        &self,
        query: &ShadowQuery<'a>,
    ) -> Result<(Box<dyn PreparedShadow + 'a>, Report), TechniqueError>;

    /// The technique on a device of the caller's: makes its pipelines, records nothing yet. `visibility` is the
    /// format of the texture that it will write: `R32Float`, `R8Unorm` or any other that takes one float.
    ///
    /// # Errors
    /// [`TechniqueError::Unsupported`] if there is no GPU path for these settings.
    #[cfg(feature = "gpu")]
    fn gpu(
        &self,
        device: &wgpu::Device,
        visibility: wgpu::TextureFormat,
    ) -> Result<Box<dyn crate::gpu::GpuShadowTechnique>, TechniqueError> {
        let _ = (device, visibility);
        Err(TechniqueError::Unsupported {
            technique: self.name(),
            input: "backend = gpu".to_owned(),
            why: "this technique has a CPU path only".to_owned(),
        })
    }
}

/// The outcome of [`ShadowTechnique::prepare`]: answers for any number of G-buffers and points.
pub trait PreparedShadow: Send + Sync {
    /// Fills `visibility` for every pixel that sees a surface; NaN elsewhere.
    ///
    /// # Errors
    /// If the two images differ in size.
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Result<Report, TechniqueError>;

    /// V at free points of space, world coordinates, one value a point; NaN for a point that is not finite.
    ///
    /// # Errors
    /// [`TechniqueError::Unsupported`] by default, or if the slices differ in length.
    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Result<Report, TechniqueError>;

    /// Whether the preparation still holds when only the camera moves.
    fn survives_camera(&self) -> bool;
}
