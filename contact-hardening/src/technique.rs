//! The trait's implementation, nothing else.

#[cfg(feature = "gpu")]
use scene_core::gpu::{GpuGBuffer, GpuShadowQuery, GpuShadowTechnique, Recorder};
use scene_core::technique::{
    Capability, Description, Params, PreparedShadow, ShadowQuery, ShadowTechnique, Support, TechniqueError,
    TechniqueFromParams,
};
use scene_core::{Camera, GBuffer, Report, VisibilityImage};

#[cfg(feature = "gpu")]
use crate::gpu::ContactHardeningOnGpu;
use crate::{ContactHardening, ContactHardeningParams, PreparedContactHardening, Scaling, Source};

impl ContactHardening {
    /// Why the source does not take this input, if it does not.
    fn source_excludes(&self, capability: Capability) -> Option<&'static str> {
        match &self.source {
            Source::Technique { technique, .. } => match technique.describe().support(capability) {
                Support::Unsupported(why) => Some(why),
                Support::Exact | Support::Approximate(_) => None,
            },
            Source::Auto | Source::OwnMap => None,
        }
    }
}

impl ShadowTechnique for ContactHardening {
    fn name(&self) -> &'static str {
        ContactHardeningParams::TECHNIQUE
    }

    fn describe(&self) -> Description {
        const SEEN: Support = Support::Approximate(
            "only shadows that the image and one map from the light's centre hold are blurred",
        );
        const PAPER: Support = Support::Approximate("the blur knows nothing of the light's size");
        let support = |capability| match capability {
            Capability::Gpu if !cfg!(feature = "gpu") => {
                Support::Unsupported("built without the feature 'gpu'")
            }
            Capability::Gpu => Support::Exact,
            Capability::FreePoints => Support::Unsupported("it blurs in screen space"),
            Capability::AlphaMask | Capability::TriangleSoup => Support::Exact,
            _ if self.params.scaling == Scaling::Paper => PAPER,
            Capability::DirectionalLight | Capability::PointLight | Capability::SpotLight => Support::Exact,
            Capability::Sun | Capability::SphereLight | Capability::RectLight | Capability::DiskLight => SEEN,
        };
        Description::new(SUMMARY, |capability| {
            let excluded = self.source_excludes(capability);
            excluded.map_or_else(|| support(capability), Support::Unsupported)
        })
    }

    fn settings(&self) -> serde_json::Value {
        let mut settings = self.params.to_json();
        settings["source"] = self.source_name().into();
        settings
    }

    fn prepare<'a>(
        &self,
        query: &ShadowQuery<'a>,
    ) -> Result<(Box<dyn PreparedShadow + 'a>, Report), TechniqueError> {
        let (prepared, report) = ContactHardening::prepare(self, query)?;
        Ok((Box::new(ForOneCamera { prepared, camera: *query.camera }), report))
    }

    #[cfg(feature = "gpu")]
    fn gpu(
        &self,
        device: &wgpu::Device,
        visibility: wgpu::TextureFormat,
    ) -> Result<Box<dyn GpuShadowTechnique>, TechniqueError> {
        Ok(Box::new(ContactHardeningOnGpu::new(device, self, visibility)?))
    }
}

#[cfg(feature = "gpu")]
impl GpuShadowTechnique for ContactHardeningOnGpu {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        ContactHardeningOnGpu::prepare(self, recorder, query)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        ContactHardeningOnGpu::shade(self, recorder, camera, gbuffer, visibility)
    }

    fn survives_camera(&self) -> bool {
        ContactHardeningOnGpu::survives_camera(self)
    }
}

/// A preparation and the camera that its G-buffers are seen by.
struct ForOneCamera<'a> {
    prepared: PreparedContactHardening<'a>,
    camera: Camera,
}

impl PreparedShadow for ForOneCamera<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Result<Report, TechniqueError> {
        self.prepared.shade(&self.camera, gbuffer, visibility)
    }

    fn visibility_at(&self, _: &[glam::Vec3], _: &mut [f32]) -> Result<Report, TechniqueError> {
        Err(TechniqueError::Unsupported {
            technique: ContactHardeningParams::TECHNIQUE,
            input: "free points".to_owned(),
            why: "it blurs in screen space".to_owned(),
        })
    }

    fn survives_camera(&self) -> bool {
        false
    }
}

const SUMMARY: &str = "hard shadows blurred in screen space, as wide as the light's penumbra";

/// Makes [`ContactHardening`]s from settings given as text.
#[derive(Clone, Copy, Debug, Default)]
pub struct Factory;

impl TechniqueFromParams for Factory {
    type Params = ContactHardeningParams;
    const SUMMARY: &'static str = SUMMARY;

    fn make(params: ContactHardeningParams) -> Box<dyn ShadowTechnique> {
        Box::new(ContactHardening::new(params))
    }
}
