//! The trait's implementation, nothing else.

use glam::Vec3;
#[cfg(feature = "gpu")]
use scene_core::Camera;
#[cfg(feature = "gpu")]
use scene_core::gpu::{GpuGBuffer, GpuShadowQuery, GpuShadowTechnique, Recorder};
use scene_core::relevance::CasterChunks;
use scene_core::technique::{
    Capability, Description, Params, PreparedShadow, ShadowQuery, ShadowTechnique, Support, TechniqueError,
    TechniqueFromParams,
};
use scene_core::{GBuffer, Report, VisibilityImage};

#[cfg(feature = "gpu")]
use crate::gpu::ShadowMapOnGpu;
use crate::{PreparedShadowMap, ShadowMap, ShadowMapParams, Variant};

impl ShadowTechnique for ShadowMap {
    fn name(&self) -> &'static str {
        ShadowMapParams::TECHNIQUE
    }

    fn describe(&self) -> Description {
        const CENTRE: Support = Support::Approximate("an extended light is taken for its centre");
        const BLUR: Support = Support::Approximate("the blur is as many texels wide everywhere");
        const MEAN: Support = Support::Approximate("blockers count as if all were at their mean distance");
        let variant = self.params.variant;
        let support = |capability| match capability {
            Capability::DirectionalLight | Capability::PointLight | Capability::SpotLight => match variant {
                Variant::Pcf | Variant::ObjectId | Variant::Moments => BLUR,
                Variant::Hard
                | Variant::Pcss
                | Variant::Cascaded
                | Variant::MultiView
                | Variant::AliasFree => Support::Exact,
            },
            Capability::Sun | Capability::SphereLight | Capability::RectLight | Capability::DiskLight => {
                match variant {
                    Variant::Pcss => MEAN,
                    Variant::MultiView => Support::Exact,
                    Variant::Hard | Variant::Cascaded | Variant::AliasFree => CENTRE,
                    Variant::Pcf | Variant::ObjectId | Variant::Moments => BLUR,
                }
            }
            Capability::AlphaMask | Capability::TriangleSoup | Capability::FreePoints => Support::Exact,
            Capability::Gpu if !cfg!(feature = "gpu") => {
                Support::Unsupported("built without the feature 'gpu'")
            }
            Capability::Gpu => Support::Exact,
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
        if !self.params.view_dependent {
            let (prepared, report) = ShadowMap::prepare(self, query.scene, query.light);
            return Ok((Box::new(prepared), report));
        }
        let mut report = Report::default();
        let chunks = report.time("prepare.chunks", |_| CasterChunks::new(query.scene));
        let (prepared, rest) = self.prepare_for_view(query.scene, query.light, query.camera, &chunks);
        report.merge(&rest);
        Ok((Box::new(ForOneCamera(prepared)), report))
    }

    #[cfg(feature = "gpu")]
    fn gpu(
        &self,
        device: &wgpu::Device,
        visibility: wgpu::TextureFormat,
    ) -> Result<Box<dyn GpuShadowTechnique>, TechniqueError> {
        Ok(Box::new(ShadowMapOnGpu::new(device, self.params, visibility)?))
    }
}

#[cfg(feature = "gpu")]
impl GpuShadowTechnique for ShadowMapOnGpu {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        ShadowMapOnGpu::prepare(self, recorder, query)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        ShadowMapOnGpu::shade(self, recorder, camera, gbuffer, visibility)
    }

    fn survives_camera(&self) -> bool {
        ShadowMapOnGpu::survives_camera(self)
    }
}

impl PreparedShadow for PreparedShadowMap<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(gbuffer.pixel_count(), visibility.values.len())?;
        Ok(PreparedShadowMap::shade(self, gbuffer, visibility))
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(points.len(), visibility.len())?;
        Ok(PreparedShadowMap::visibility_at(self, points, visibility))
    }

    fn survives_camera(&self) -> bool {
        PreparedShadowMap::survives_camera(self)
    }
}

/// Maps that hold for the camera they were made for only.
struct ForOneCamera<'a>(PreparedShadowMap<'a>);

impl PreparedShadow for ForOneCamera<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Result<Report, TechniqueError> {
        PreparedShadow::shade(&self.0, gbuffer, visibility)
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Result<Report, TechniqueError> {
        PreparedShadow::visibility_at(&self.0, points, visibility)
    }

    fn survives_camera(&self) -> bool {
        false
    }
}

const SUMMARY: &str = "depth images from the light; hard shadows at the cost of one extra drawing";

/// Makes [`ShadowMap`]s from settings given as text.
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl TechniqueFromParams for Factory {
    type Params = ShadowMapParams;
    const SUMMARY: &'static str = SUMMARY;

    fn make(params: ShadowMapParams) -> Box<dyn ShadowTechnique> {
        Box::new(ShadowMap::new(params))
    }
}
