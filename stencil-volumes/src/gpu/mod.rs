//! The GPU path: the CPU's hierarchical counting in compute passes, recorded into the caller's encoder.
//!
//! | pass | what it does | twin |
//! | --- | --- | --- |
//! | `prepare.facing` | facing, once a triangle; faces between eye and light; faces before the near plane | `volumes::facing_in` |
//! | `prepare.silhouette` | edges whose faces do not cancel, by signed multiplicity | [`silhouette`](crate::silhouette) |
//! | `prepare.runs` | boxes around runs of 64 of these | [`runs`](crate::runs) |
//! | `shade.ask` | which pixels hang on the casters | `cpu::Receivers::ask` |
//! | `shade.blocks` | edges against blocks of 64 × 64 pixels | `cpu::block` |
//! | `shade.tiles` | the rest against tiles of 8 × 8 pixels, and what is left against pixels | `cpu::tile` |
//! | `shade.rays` | one exact ray for each pixel that is still open | [`Bvh`](scene_core::bvh::Bvh) |
//! | `shade.write` | V | |
//!
//! `planar` draws the casters once for each flat receiver ([`planar`]).
//!
//! # Why no stencil
//! The classic way draws every side with a two-sided stencil that is counted up and down. Three things speak against it here.
//! Its 8 bits wrap at 256 nested volumes, and a count that wraps to 0 is light in the deepest shadow; here a count is an
//! `i32` in a register, and a scene would need 2³¹ faces in a row. It tests the depths that hardware interpolates along a
//! quad stretched to infinity, whose digits say little about a pixel within 1e-3 of an outline; here every sign that decides
//! is computed with a bound on its rounding, and where it is not certain, one exact ray decides. And it fills: each side is
//! drawn over all pixels that it covers, a hundred times over in a forest. The tiles ask most sides once for 4,096 pixels.
//!
//! # Why no indirect arguments
//! Nothing that the CPU records hangs on what the GPU finds. Edges are counted in a buffer, and the passes behind loop up to that
//! count: a workgroup is a block or a tile of the image, of which there are as many as there are pixels for. Only `shade.rays` has work
//! whose amount is unknown, and runs a fixed number of threads over the list. Arguments written by the GPU would spare the idle
//! ones among at most 1,024 workgroups, whose one read is a count of nought, and would add a pass that writes them and the one by
//! which wgpu checks every indirect dispatch. No call less would be recorded.
//!
//! # What is skipped
//! All that [`Skips`](crate::Skips) lists. Faces outside the region that can shadow what is seen, or of casters in another's shadow,
//! are turned by nobody, so they have no edges; the region's planes and the shadowed casters come from the objects' boxes, the only
//! thing beside recording that a frame asks of the CPU. Blocks ask runs of edges before their edges, pixels that the light cannot
//! reach are not counted, and no caps ever are. What is left out is counted in a buffer, a few atomic additions a workgroup; a frame
//! never reads it: [`GpuShadowTechnique::counted`](scene_core::gpu::GpuShadowTechnique::counted) does, for who wants a report.
//!
//! # Why the eye's count is all that z-fail needs
//! The count at a point is the count at the eye plus the crossings on the way from there. The first is one number a frame:
//! the faces between the eye and the light. So `z-fail` and `auto` come down to the same, `z-pass` with that number, and
//! no caps are counted. What the near plane may have cut off is found with it: pixels behind such a face are left to rays.
//!
//! # Exactness
//! V differs from one exact shadow ray a pixel only where the position, kept as a distance in f32, is rounded to the other
//! side of an outline. Facing and the eye's side of each edge are decided to 41 bits (`scene_core::predicates`).

pub mod layout;
pub mod planar;
pub mod shaders;
pub mod tables;
pub mod volumes;

use scene_core::gpu::{GpuGBuffer, GpuShadowQuery, Recorder};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Report};

use crate::{Variant, VolumeParams};
use planar::PlanarOnGpu;
use volumes::VolumesOnGpu;

/// The technique on one device.
#[derive(Debug)]
pub enum StencilVolumesOnGpu {
    /// Shadow volumes.
    Volumes(Box<VolumesOnGpu>),
    /// Planar shadows.
    Planar(Box<PlanarOnGpu>),
}

impl StencilVolumesOnGpu {
    /// Makes the pipelines. `visibility` is the format of the texture that V is written to.
    pub fn new(device: &wgpu::Device, params: VolumeParams, visibility: wgpu::TextureFormat) -> Self {
        match params.variant {
            Variant::Volumes => Self::Volumes(Box::new(VolumesOnGpu::new(device, params, visibility))),
            Variant::Planar => Self::Planar(Box::new(PlanarOnGpu::new(device, visibility))),
        }
    }

    /// Records what depends on light and camera. The first call for a scene builds its edges and its tree on the CPU; later
    /// ones only record.
    ///
    /// # Errors
    /// [`TechniqueError::Unsupported`] without the geometry in memory; more than the device binds.
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        let geometry = query.scene.geometry.ok_or_else(|| TechniqueError::Unsupported {
            technique: VolumeParams::TECHNIQUE,
            input: "a scene without its geometry in memory".to_owned(),
            why: "edges are found from it, once a scene".to_owned(),
        })?;
        match self {
            Self::Volumes(volumes) => volumes.prepare(recorder, query, geometry),
            Self::Planar(planar) => planar.prepare(recorder, query, geometry),
        }
    }

    /// Records the passes that write V of every pixel, 1 where nothing is seen. `camera` must be the one prepared for.
    ///
    /// # Errors
    /// [`TechniqueError::NotPrepared`]; a G-buffer of another size than the camera's.
    pub fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        match self {
            Self::Volumes(volumes) => volumes.shade(recorder, camera, gbuffer, visibility),
            Self::Planar(planar) => planar.shade(recorder, camera, gbuffer, visibility),
        }
    }
}
