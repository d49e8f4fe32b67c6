//! The trait's implementation, nothing else.

use scene_core::technique::{
    Capability, Description, Params, PreparedShadow, ShadowQuery, ShadowTechnique, Support, TechniqueError,
    TechniqueFromParams,
};
use scene_core::{Camera, GBuffer, Report, VisibilityImage};

use crate::{ContactHardening, ContactHardeningParams, PreparedContactHardening, Scaling};

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
            Capability::Gpu => Support::Unsupported("it has a CPU path only"),
            Capability::FreePoints => Support::Unsupported("it blurs in screen space"),
            Capability::AlphaMask | Capability::TriangleSoup => Support::Exact,
            _ if self.params.scaling == Scaling::Paper => PAPER,
            Capability::DirectionalLight | Capability::PointLight | Capability::SpotLight => Support::Exact,
            Capability::Sun | Capability::SphereLight | Capability::RectLight | Capability::DiskLight => SEEN,
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
        let (prepared, report) = ContactHardening::prepare(self, query)?;
        Ok((Box::new(ForOneCamera { prepared, camera: *query.camera }), report))
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
