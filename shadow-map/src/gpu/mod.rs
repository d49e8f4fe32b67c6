//! The GPU path: the stages of [`cpu`](crate::cpu) under the same names, recorded into the caller's encoder.
//!
//! | stage | what is recorded |
//! | --- | --- |
//! | `prepare.views` | nothing: the CPU's own code |
//! | `prepare.maps` | the casters, the nearest triangle a texel, into a layer a view |
//! | `prepare.filter` | the stored triangles' depths in a buffer, and the nearest of every rectangle of them |
//! | `shade.lookup` | the questions of [`receiver_plane`](crate::receiver_plane), of one texel, for `hard` and those that draw while shading; the bound of `moments` |
//! | `shade.filter` | those of [`taps`](crate::taps), for `pcf`, `object-id` and `pcss` |
//! | `prepare.moments` | the windows of `moments`, along rows and then along columns |
//! | `shade.cascades` | where depths are split, and the projections of `cascaded` |
//! | `shade.maps` | the maps of `cascaded`, and of `multi-view` one after the other, each looked up at once |
//! | `shade.receivers`, `shade.casters`, `shade.large` | the irregular z-buffer of `alias-free` |
//!
//! With `view_dependent` a map holds the objects that surfaces seen by the query's camera are looked up in, and a face of a
//! cube that nobody looks at draws nothing. Both are chosen in `prepare.views` by the CPU's bounds of what is seen, so nothing
//! is read back. What filters leave out is not counted.
//!
//! V differs from the CPU's only where the hardware's rasteriser gives a texel on a caster's outline to the other side
//! of it, or rounding decides: a receiver or tap on the border of two texels, a stored point that rises above a plane by
//! no more than the tolerance.

mod alias_free;
mod cascaded;
pub mod filter_maps;
pub mod layout;
pub mod light_maps;
mod lookup;
mod moments;
mod multi_view;
pub mod shaders;

use std::fmt::Debug;

use scene_core::gpu::{DepthLayers, GpuError, GpuGBuffer, GpuShadowQuery, Recorder};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Report};

use crate::{ShadowMapParams, Variant};
use alias_free::AliasFree;
use cascaded::Cascaded;
use lookup::Lookup;
use moments::Moments;
use multi_view::MultiView;

/// The technique on one device: pipelines, and the maps of the light prepared last.
#[derive(Debug)]
pub struct ShadowMapOnGpu {
    variant: Box<dyn VariantOnGpu>,
    is_for_one_camera: bool,
}

/// A variant on one device. Each is a type in the file named after it; this is all that is asked of it.
trait VariantOnGpu: Debug + Send {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError>;

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError>;

    fn layers(&self) -> &DepthLayers;

    fn depths(&self) -> Option<(&wgpu::Buffer, u32)> {
        None
    }
}

fn not_prepared() -> TechniqueError {
    TechniqueError::NotPrepared { technique: ShadowMapParams::TECHNIQUE }
}

impl ShadowMapOnGpu {
    /// Makes the pipelines. `visibility` is the format of the texture that V is written to.
    ///
    /// # Errors
    /// A `map_size` that the device has no texture of.
    pub fn new(
        device: &wgpu::Device,
        params: ShadowMapParams,
        visibility: wgpu::TextureFormat,
    ) -> Result<Self, TechniqueError> {
        GpuError::within(
            "texels a side of a map",
            params.map_size,
            device.limits().max_texture_dimension_2d,
        )?;
        Ok(Self {
            is_for_one_camera: params.view_dependent,
            variant: match params.variant {
                Variant::AliasFree => Box::new(AliasFree::new(device, visibility)),
                Variant::Cascaded => Box::new(Cascaded::new(device, params, visibility)),
                Variant::MultiView => Box::new(MultiView::new(device, params, visibility)),
                Variant::Moments => Box::new(Moments::new(device, params, visibility)),
                _ => Box::new(Lookup::new(device, params, visibility)),
            },
        })
    }

    /// Records what depends on the query's light: the drawing of its maps. They hold for any camera, with `view_dependent` for
    /// the query's alone.
    ///
    /// Without [`GpuScene::geometry`](scene_core::gpu::GpuScene::geometry) the views are fitted to the bounds of
    /// objects, which takes more texels than the vertices would.
    ///
    /// # Errors
    /// More maps or texels than the device has, or depths of filters larger than it binds in one piece.
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        self.variant.prepare(recorder, query)
    }

    /// Whether what was prepared holds for any camera.
    pub fn survives_camera(&self) -> bool {
        !self.is_for_one_camera
    }

    /// Records the passes that write V of every pixel, 1 where nothing is seen.
    ///
    /// # Errors
    /// [`TechniqueError::NotPrepared`].
    pub fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        self.variant.shade(recorder, camera, gbuffer, visibility)
    }

    /// The maps, one a layer, and the triangles they see; for tests and whoever else wants them.
    pub fn layers(&self) -> &DepthLayers {
        self.variant.layers()
    }

    /// Where a filter reads depths from: the buffer, and how many numbers it holds a view. Those of the map come first, row
    /// by row: reversed depth, 0 where there is nothing. `None` where depths are not read.
    pub fn depths(&self) -> Option<(&wgpu::Buffer, u32)> {
        self.variant.depths()
    }
}
