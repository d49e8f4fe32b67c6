//! The trait's implementation, nothing else.

use glam::Vec3;
use scene_core::technique::{
    Capability, Description, Params, PreparedShadow, ShadowQuery, ShadowTechnique, Support, TechniqueError,
    TechniqueFromParams,
};
#[cfg(feature = "gpu")]
use scene_core::{
    Camera,
    gpu::{GpuGBuffer, GpuShadowQuery, GpuShadowTechnique, Recorder},
};
use scene_core::{GBuffer, Report, VisibilityImage};

#[cfg(feature = "gpu")]
use crate::gpu::DdocOnGpu;
use crate::{Ddoc, DdocParams, PreparedDdoc, Variant};

impl ShadowTechnique for Ddoc {
    fn name(&self) -> &'static str {
        DdocParams::TECHNIQUE
    }

    fn describe(&self) -> Description {
        const MASK: Support = Support::Approximate("a mask's outline is straight between the map's texels");
        const IMAGE: Support = Support::Approximate("only what the light's centre sees throws penumbrae");
        const PAPER: Support =
            Support::Approximate("every penumbra is as wide as on the surface farthest down");
        const OUTER: Support =
            Support::Approximate("the umbra is the hard shadow: penumbrae lie outside of it");
        let variant = self.params.variant;
        let support = |capability| match capability {
            Capability::Gpu if !cfg!(feature = "gpu") => {
                Support::Unsupported("built without the feature 'gpu'")
            }
            Capability::Gpu if variant == Variant::Paper => {
                Support::Unsupported("this variant has a CPU path only")
            }
            Capability::Gpu => Support::Exact,
            Capability::AlphaMask if variant == Variant::Ddoc => MASK,
            Capability::DirectionalLight
            | Capability::PointLight
            | Capability::SpotLight
            | Capability::AlphaMask
            | Capability::TriangleSoup
            | Capability::FreePoints => Support::Exact,
            Capability::Sun | Capability::SphereLight | Capability::RectLight | Capability::DiskLight => {
                match variant {
                    Variant::Ddoc => Support::Exact,
                    Variant::ImageEdges => IMAGE,
                    Variant::Paper => PAPER,
                    Variant::Smoothies | Variant::PenumbraMap => OUTER,
                }
            }
        };
        Description::new(SUMMARY, support)
    }

    fn settings(&self) -> serde_json::Value {
        self.params.to_json()
    }

    fn prepare<'a>(
        &self,
        query: &ShadowQuery<'a>,
    ) -> Result<(Box<dyn PreparedShadow + 'a>, Report), TechniqueError> {
        let (prepared, report) = Ddoc::prepare(self, query.scene, query.light)
            .map_err(|error| TechniqueError::Other(Box::new(error)))?;
        Ok((Box::new(prepared), report))
    }

    #[cfg(feature = "gpu")]
    fn gpu(
        &self,
        device: &wgpu::Device,
        visibility: wgpu::TextureFormat,
    ) -> Result<Box<dyn GpuShadowTechnique>, TechniqueError> {
        Ok(Box::new(DdocOnGpu::new(device, self.params, visibility)?))
    }
}

#[cfg(feature = "gpu")]
impl GpuShadowTechnique for DdocOnGpu {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        DdocOnGpu::prepare(self, recorder, query)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        DdocOnGpu::shade(self, recorder, camera, gbuffer, visibility)
    }

    fn survives_camera(&self) -> bool {
        true
    }
}

impl PreparedShadow for PreparedDdoc<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(gbuffer.pixel_count(), visibility.values.len())?;
        Ok(PreparedDdoc::shade(self, gbuffer, visibility))
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(points.len(), visibility.len())?;
        Ok(PreparedDdoc::visibility_at(self, points, visibility))
    }

    fn survives_camera(&self) -> bool {
        true
    }
}

const SUMMARY: &str = "edges splatted into the light's map; inner and outer penumbrae through all layers";

/// Makes [`Ddoc`]s from settings given as text.
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl TechniqueFromParams for Factory {
    type Params = DdocParams;
    const SUMMARY: &'static str = SUMMARY;

    fn make(params: DdocParams) -> Box<dyn ShadowTechnique> {
        Box::new(Ddoc::new(params))
    }
}
