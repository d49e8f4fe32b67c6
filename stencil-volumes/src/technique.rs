//! The trait's implementation, nothing else.

use glam::Vec3;
#[cfg(feature = "gpu")]
use scene_core::Camera;
#[cfg(feature = "gpu")]
use scene_core::gpu::{Gpu, GpuGBuffer, GpuShadowQuery, GpuShadowTechnique, Recorder};
use scene_core::technique::{
    Capability, Description, Params, PreparedShadow, ShadowQuery, ShadowTechnique, Support, TechniqueError,
    TechniqueFromParams,
};
use scene_core::{GBuffer, Report, VisibilityImage};

#[cfg(feature = "gpu")]
use crate::StencilVolumesOnGpu;
use crate::{Casters, PreparedVolumes, StencilVolumes, Variant, VolumeParams};

impl ShadowTechnique for StencilVolumes {
    fn name(&self) -> &'static str {
        VolumeParams::TECHNIQUE
    }

    fn describe(&self) -> Description {
        const CENTRE: Support = Support::Approximate("an extended light is taken for its centre");
        let planar = self.params.variant == Variant::Planar;
        let hard =
            if planar { Support::Approximate("only flat surfaces show shadows") } else { Support::Exact };
        let support = |capability| match capability {
            Capability::DirectionalLight | Capability::PointLight | Capability::SpotLight => hard,
            Capability::Sun | Capability::SphereLight | Capability::RectLight | Capability::DiskLight => {
                CENTRE
            }
            Capability::AlphaMask | Capability::TriangleSoup => hard,
            Capability::FreePoints => Support::Exact,
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
        let casters = report.time("prepare.edges", |_| Casters::new(query.scene));
        let casters = casters.map_err(|error| TechniqueError::Other(Box::new(error)))?;
        let (prepared, rest) = StencilVolumes::prepare(self, &casters, query.light, query.camera);
        report.merge(&rest);
        Ok((Box::new(prepared), report))
    }

    #[cfg(feature = "gpu")]
    fn gpu(
        &self,
        device: &wgpu::Device,
        visibility: wgpu::TextureFormat,
    ) -> Result<Box<dyn GpuShadowTechnique>, TechniqueError> {
        Ok(Box::new(StencilVolumesOnGpu::new(device, self.params, visibility)))
    }
}

#[cfg(feature = "gpu")]
impl GpuShadowTechnique for StencilVolumesOnGpu {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        StencilVolumesOnGpu::prepare(self, recorder, query)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        StencilVolumesOnGpu::shade(self, recorder, camera, gbuffer, visibility)
    }

    fn counted(&mut self, gpu: &Gpu) -> Result<Report, TechniqueError> {
        match self {
            Self::Volumes(volumes) => volumes.counted(gpu),
            Self::Planar(_) => Ok(Report::default()),
        }
    }

    fn survives_camera(&self) -> bool {
        false
    }
}

impl PreparedShadow for PreparedVolumes<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(gbuffer.pixel_count(), visibility.values.len())?;
        Ok(PreparedVolumes::shade(self, gbuffer, visibility))
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(points.len(), visibility.len())?;
        Ok(PreparedVolumes::visibility_at(self, points, visibility))
    }

    fn survives_camera(&self) -> bool {
        false
    }
}

const SUMMARY: &str = "shadow volumes from silhouettes: exact hard shadows on any triangle soup";

/// Makes [`StencilVolumes`] from settings given as text.
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl TechniqueFromParams for Factory {
    type Params = VolumeParams;
    const SUMMARY: &'static str = SUMMARY;

    fn make(params: VolumeParams) -> Box<dyn ShadowTechnique> {
        Box::new(StencilVolumes::new(params))
    }
}
