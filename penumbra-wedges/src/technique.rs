//! The trait's implementation, nothing else.

use glam::Vec3;
#[cfg(feature = "gpu")]
use scene_core::Camera;
#[cfg(feature = "gpu")]
use scene_core::gpu::{GpuGBuffer, GpuShadowQuery, GpuShadowTechnique, Recorder};
use scene_core::technique::{
    Capability, Description, Params, PreparedShadow, ShadowQuery, ShadowTechnique, Support, TechniqueError,
    TechniqueFromParams,
};
use scene_core::{GBuffer, Report, VisibilityImage};

#[cfg(feature = "gpu")]
use crate::PenumbraWedgesOnGpu;
use crate::{Casters, PenumbraWedges, PreparedWedges, Variant, WedgeParams};

impl ShadowTechnique for PenumbraWedges {
    fn name(&self) -> &'static str {
        WedgeParams::TECHNIQUE
    }

    fn describe(&self) -> Description {
        let soft = match self.params.variant {
            Variant::Exact => Support::Exact,
            Variant::Coverage => {
                Support::Approximate("overlapping shadows add up, one silhouette stands for all")
            }
            Variant::Interpolated => Support::Approximate("each edge is taken for a straight one of its own"),
        };
        let support = |capability| match capability {
            Capability::DirectionalLight | Capability::PointLight | Capability::SpotLight => Support::Exact,
            Capability::Sun | Capability::SphereLight | Capability::RectLight | Capability::DiskLight => soft,
            Capability::AlphaMask if self.params.variant == Variant::Exact => Support::Exact,
            Capability::AlphaMask => {
                Support::Unsupported("the outline of a mask's holes has no edges: only `exact` traces them")
            }
            Capability::TriangleSoup | Capability::FreePoints => soft,
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
        let mut report = Report::default();
        let casters = report.time("prepare.edges", |_| Casters::new(query.scene))?;
        let (prepared, rest) = PenumbraWedges::prepare(self, &casters, query.light, query.camera)?;
        report.merge(&rest);
        Ok((Box::new(prepared), report))
    }

    #[cfg(feature = "gpu")]
    fn gpu(
        &self,
        device: &wgpu::Device,
        visibility: wgpu::TextureFormat,
    ) -> Result<Box<dyn GpuShadowTechnique>, TechniqueError> {
        Ok(Box::new(PenumbraWedgesOnGpu::new(device, self.params, visibility)))
    }
}

#[cfg(feature = "gpu")]
impl GpuShadowTechnique for PenumbraWedgesOnGpu {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        PenumbraWedgesOnGpu::prepare(self, recorder, query)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        PenumbraWedgesOnGpu::shade(self, recorder, camera, gbuffer, visibility)
    }

    fn survives_camera(&self) -> bool {
        false
    }
}

impl PreparedShadow for PreparedWedges<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(gbuffer.pixel_count(), visibility.values.len())?;
        Ok(PreparedWedges::shade(self, gbuffer, visibility))
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(points.len(), visibility.len())?;
        Ok(PreparedWedges::visibility_at(self, points, visibility))
    }

    fn survives_camera(&self) -> bool {
        false
    }
}

const SUMMARY: &str = "soft shadow volumes: penumbra wedges around edges, up to exact";

/// Makes [`PenumbraWedges`] from settings given as text.
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl TechniqueFromParams for Factory {
    type Params = WedgeParams;
    const SUMMARY: &'static str = SUMMARY;

    fn make(params: WedgeParams) -> Box<dyn ShadowTechnique> {
        Box::new(PenumbraWedges::new(params))
    }
}
