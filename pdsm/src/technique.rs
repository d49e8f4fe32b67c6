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

use crate::baked::{Baked, refused};
#[cfg(feature = "gpu")]
use crate::gpu::PdsmOnGpu;
use crate::{Pdsm, PdsmParams, PreparedPdsm};

impl ShadowTechnique for Pdsm {
    fn name(&self) -> &'static str {
        PdsmParams::TECHNIQUE
    }

    fn describe(&self) -> Description {
        describe(&self.params)
    }

    fn settings(&self) -> serde_json::Value {
        self.params.to_json()
    }

    fn prepare<'a>(
        &self,
        query: &ShadowQuery<'a>,
    ) -> Result<(Box<dyn PreparedShadow + 'a>, Report), TechniqueError> {
        let (prepared, report) = self.prepare_for(query.scene, query.light, Some(query.camera));
        Ok((Box::new(prepared), report))
    }

    #[cfg(feature = "gpu")]
    fn gpu(
        &self,
        device: &wgpu::Device,
        visibility: wgpu::TextureFormat,
    ) -> Result<Box<dyn GpuShadowTechnique>, TechniqueError> {
        Ok(Box::new(PdsmOnGpu::new(device, self.params, visibility)))
    }
}

#[cfg(feature = "gpu")]
impl GpuShadowTechnique for PdsmOnGpu {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        PdsmOnGpu::prepare(self, recorder, query)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        PdsmOnGpu::shade(self, recorder, camera, gbuffer, visibility)
    }

    fn survives_camera(&self) -> bool {
        PdsmOnGpu::survives_camera(self)
    }
}

impl PreparedShadow for PreparedPdsm<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(gbuffer.pixel_count(), visibility.values.len())?;
        Ok(PreparedPdsm::shade(self, gbuffer, visibility))
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(points.len(), visibility.len())?;
        if self.params.only_surfaces {
            return Err(TechniqueError::Unsupported {
                technique: PdsmParams::TECHNIQUE,
                input: "free points".to_owned(),
                why: "only_surfaces keeps V at the scene's surfaces alone".to_owned(),
            });
        }
        Ok(PreparedPdsm::visibility_at(self, points, visibility))
    }

    fn survives_camera(&self) -> bool {
        PreparedPdsm::survives_camera(self)
    }
}

/// Functions from a file take the place of those that are built.
impl ShadowTechnique for Baked {
    fn name(&self) -> &'static str {
        PdsmParams::TECHNIQUE
    }

    fn describe(&self) -> Description {
        describe(self.params())
    }

    fn settings(&self) -> serde_json::Value {
        self.params().to_json()
    }

    fn prepare<'a>(
        &self,
        query: &ShadowQuery<'a>,
    ) -> Result<(Box<dyn PreparedShadow + 'a>, Report), TechniqueError> {
        let (prepared, report) = Baked::prepare(self, query.scene, query.light).map_err(refused)?;
        Ok((Box::new(prepared), report))
    }

    #[cfg(feature = "gpu")]
    fn gpu(
        &self,
        device: &wgpu::Device,
        visibility: wgpu::TextureFormat,
    ) -> Result<Box<dyn GpuShadowTechnique>, TechniqueError> {
        Ok(Box::new(PdsmOnGpu::from_baked(device, self.clone(), visibility)))
    }
}

fn describe(params: &PdsmParams) -> Description {
    let only_surfaces = params.only_surfaces;
    let support = |capability| match capability {
        Capability::DirectionalLight
        | Capability::Sun
        | Capability::PointLight
        | Capability::SpotLight
        | Capability::RectLight
        | Capability::DiskLight => Support::Exact,
        Capability::SphereLight => {
            Support::Approximate("a sphere is taken for the disk that the middle of the casters sees")
        }
        Capability::AlphaMask | Capability::TriangleSoup => Support::Exact,
        Capability::FreePoints if only_surfaces => {
            Support::Unsupported("only_surfaces keeps V at the scene's surfaces alone")
        }
        Capability::FreePoints => Support::Exact,
        Capability::Gpu if !cfg!(feature = "gpu") => Support::Unsupported("built without the feature 'gpu'"),
        Capability::Gpu => Support::Exact,
    };
    Description::new(SUMMARY, support)
}

const SUMMARY: &str =
    "many shadow maps of an extended light, merged into one function of depth a ray; baked soft shadows";

/// Makes [`Pdsm`]s from settings given as text.
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl TechniqueFromParams for Factory {
    type Params = PdsmParams;
    const SUMMARY: &'static str = SUMMARY;

    fn make(params: PdsmParams) -> Box<dyn ShadowTechnique> {
        Box::new(Pdsm::new(params))
    }
}
