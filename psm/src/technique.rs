//! The trait's implementation, nothing else.

use std::sync::OnceLock;

use glam::Vec3;
#[cfg(feature = "gpu")]
use scene_core::Camera;
#[cfg(feature = "gpu")]
use scene_core::gpu::{Gpu, GpuGBuffer, GpuShadowQuery, GpuShadowTechnique, Recorder};
use scene_core::technique::{
    Capability, Description, Params, PreparedShadow, ShadowQuery, ShadowTechnique, Support, TechniqueError,
    TechniqueFromParams,
};
use scene_core::{GBuffer, Report, VisibilityImage, raster};

#[cfg(feature = "gpu")]
use crate::gpu::PsmOnGpu;
use crate::{Casters, PreparedPsm, Psm, PsmParams};

impl ShadowTechnique for Psm {
    fn name(&self) -> &'static str {
        PsmParams::TECHNIQUE
    }

    fn describe(&self) -> Description {
        const CENTRE: Support = Support::Approximate("an extended light is taken for its centre");
        let support = |capability| match capability {
            Capability::DirectionalLight
            | Capability::PointLight
            | Capability::SpotLight
            | Capability::AlphaMask
            | Capability::TriangleSoup => Support::Exact,
            Capability::Sun | Capability::SphereLight | Capability::RectLight | Capability::DiskLight => {
                CENTRE
            }
            Capability::FreePoints => Support::Approximate(
                "only what shadows the camera's view is in the map: elsewhere points are lit",
            ),
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
        let casters = Casters::new(query.scene, &self.params, &mut report);
        let frame = ForAnyFrame { technique: *self, query: *query, casters, free: OnceLock::new() };
        Ok((Box::new(frame), report))
    }

    #[cfg(feature = "gpu")]
    fn gpu(
        &self,
        device: &wgpu::Device,
        visibility: wgpu::TextureFormat,
    ) -> Result<Box<dyn GpuShadowTechnique>, TechniqueError> {
        Ok(Box::new(PsmOnGpu::new(device, self.params, visibility)?))
    }
}

#[cfg(feature = "gpu")]
impl GpuShadowTechnique for PsmOnGpu {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        PsmOnGpu::prepare(self, recorder, query)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        PsmOnGpu::shade(self, recorder, camera, gbuffer, visibility)
    }

    fn counted(&mut self, gpu: &Gpu) -> Result<Report, TechniqueError> {
        PsmOnGpu::counted(self, gpu)
    }

    fn survives_camera(&self) -> bool {
        false
    }
}

/// The maps depend on what is seen, and the trait shows that when it shades: then they are drawn, stage by stage under
/// the same names, for the G-buffer at hand.
struct ForAnyFrame<'a> {
    technique: Psm,
    query: ShadowQuery<'a>,
    casters: Casters,
    /// For free points: the maps of what the camera sees.
    free: OnceLock<PreparedPsm<'a>>,
}

impl PreparedShadow for ForAnyFrame<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(gbuffer.pixel_count(), visibility.values.len())?;
        let ShadowQuery { scene, light, camera } = self.query;
        let (prepared, mut report) =
            self.technique.prepare_with(&self.casters, scene, light, camera, gbuffer);
        report.merge(&prepared.shade(gbuffer, visibility));
        Ok(report)
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Result<Report, TechniqueError> {
        TechniqueError::check_output(points.len(), visibility.len())?;
        let ShadowQuery { scene, light, camera } = self.query;
        let mut report = Report::default();
        let prepared = self.free.get_or_init(|| {
            let gbuffer = raster::render_gbuffer(scene, camera);
            let (prepared, drawn) =
                self.technique.prepare_with(&self.casters, scene, light, camera, &gbuffer);
            report = drawn;
            prepared
        });
        report.merge(&prepared.visibility_at(points, visibility));
        Ok(report)
    }

    fn survives_camera(&self) -> bool {
        false
    }
}

const SUMMARY: &str =
    "shadow maps with texels where the camera looks; hard shadows, drawn anew for every view";

/// Makes [`Psm`]s from settings given as text.
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl TechniqueFromParams for Factory {
    type Params = PsmParams;
    const SUMMARY: &'static str = SUMMARY;

    fn make(params: PsmParams) -> Box<dyn ShadowTechnique> {
        Box::new(Psm::new(params))
    }
}
