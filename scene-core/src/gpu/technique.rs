//! The interface of a technique on the GPU: prepare, then shade, both recorded into the caller's encoder.

use super::{Gpu, GpuGBuffer, GpuScene, Recorder};
use crate::technique::TechniqueError;
use crate::{Camera, Light, Report};

/// [`ShadowQuery`](crate::technique::ShadowQuery) on the GPU.
#[derive(Clone, Copy, Debug)]
pub struct GpuShadowQuery<'a> {
    /// Geometry.
    pub scene: GpuScene<'a>,
    /// The light whose visibility is asked for.
    pub light: &'a Light,
    /// The camera that the G-buffer is seen by.
    pub camera: &'a Camera,
}

/// A technique on one device: its pipelines and the textures it keeps between frames. Made by
/// [`ShadowTechnique::gpu`](crate::ShadowTechnique::gpu).
///
/// One value serves one light at a time: what [`prepare`](Self::prepare) recorded is what the next
/// [`shade`](Self::shade) reads. Reports hold bytes and skips; times come from the recorder's timer, after the
/// frame.
pub trait GpuShadowTechnique: Send {
    /// Records what depends on scene and light (and, for view-dependent techniques, on the camera).
    ///
    /// # Errors
    /// [`TechniqueError::Unsupported`] for inputs that the technique excludes.
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError>;

    /// Records the pass that writes V of every pixel to `visibility` (usage `RENDER_ATTACHMENT`, of the format that
    /// [`ShadowTechnique::gpu`](crate::ShadowTechnique::gpu) was given). Where nothing is seen V is 1.
    ///
    /// # Errors
    /// If nothing was prepared.
    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError>;

    /// What the last frame left out and counted on the device, where nobody but the device knows it. Waits for the device: for
    /// measurements, not for a frame.
    ///
    /// # Errors
    /// What went wrong on the device.
    fn counted(&mut self, _gpu: &Gpu) -> Result<Report, TechniqueError> {
        Ok(Report::default())
    }

    /// Whether the preparation still holds when only the camera moves.
    fn survives_camera(&self) -> bool;
}
