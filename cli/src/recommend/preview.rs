//! A scene in a small picture, with ground truth: what features are measured on, and candidates tried.

use std::ops::ControlFlow;

use scene_core::bvh::Bvh;
use scene_core::metrics;
use scene_core::raster::render_gbuffer;
use scene_core::reference::{ReferenceSettings, reference, valid_pixels};
use scene_core::technique::{ShadowTechnique, TechniqueError};
use scene_core::{GBuffer, Light};
use serde::{Deserialize, Serialize};

use super::features::Features;
use crate::backend::Side;
use crate::error::CliError;
use crate::ground_truth::GroundTruth;
use crate::measure::{Repeats, Stand};
use crate::scene_source::View;

/// Pixels of the longer side.
const SIDE: u32 = 128;

/// Shadow rays a pixel, where the light is partly seen.
const SAMPLES: u32 = 64;

/// How often a candidate is tried: the first run pays for cold caches.
const TRIES: Repeats = Repeats { runs: 3, budget_ms: 200.0 };

/// A small picture of a scene.
pub(crate) struct Preview {
    view: View,
    gbuffer: GBuffer,
    truth: GroundTruth,
    features: Features,
    pixels_a_pixel: f64,
}

/// What a contender came to on a preview.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Tried {
    pub(crate) prepare_ms: f64,
    /// Of a picture of the size asked for, if every pixel of it cost as much as here.
    pub(crate) shade_ms: f64,
    pub(crate) survives_camera: bool,
    pub(crate) rmse: f64,
}

impl Preview {
    /// `view` in small.
    pub(crate) fn new(mut view: View, seed: u64) -> Result<Self, CliError> {
        let camera = view.setup.camera;
        let longest = camera.width.max(camera.height);
        let small = |side: u32| (side * SIDE.min(longest)).div_ceil(longest);
        view.setup.camera = camera.with_size(small(camera.width), small(camera.height));
        let pixels_a_pixel = f64::from(longest) / f64::from(SIDE.min(longest));
        let (scene, light) = (&view.setup.scene, view.light());
        let gbuffer = render_gbuffer(scene, &view.setup.camera);
        let bvh = Bvh::casters(scene);
        let trace = |light: &Light| {
            let settings = ReferenceSettings { samples: SAMPLES, seed, skip: true };
            reference(scene, &bvh, light, &gbuffer, &settings, &|_| ControlFlow::Continue(()))
        };
        let traced = trace(light)?;
        let truth = GroundTruth {
            visibility: traced.visibility,
            std_error: traced.std_error,
            valid: valid_pixels(&gbuffer, light),
        };
        let hard = trace(&light.reduced_to(light.center()))?.visibility;
        let seen = gbuffer.pixel_count() - truth.visibility.values.iter().filter(|v| v.is_nan()).count();
        let features = Features::new(scene.caster_count(), seen, &hard, &truth, pixels_a_pixel)?;
        Ok(Self { view, gbuffer, truth, features, pixels_a_pixel })
    }

    /// What the scene is like.
    pub(crate) fn features(&self) -> &Features {
        &self.features
    }

    /// What `technique` comes to here; none if it does not take the scene.
    pub(crate) fn try_out(&self, technique: &dyn ShadowTechnique) -> Result<Option<Tried>, CliError> {
        let mut stand = Stand::new(&self.view, &self.gbuffer, None);
        let run = match stand.repeat(technique, Side::Cpu, TRIES) {
            Err(CliError::Technique(TechniqueError::Unsupported { .. })) => return Ok(None),
            run => run?.fastest,
        };
        let errors = metrics::errors(&run.visibility, &self.truth.visibility, &self.truth.valid)?;
        Ok(Some(Tried {
            prepare_ms: run.report.prepare_ms,
            shade_ms: run.report.shade_ms * self.pixels_a_pixel.powi(2),
            survives_camera: run.report.survives_camera,
            rmse: errors.rmse,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene_core::scenes;

    fn preview(scene: &str, size: (u32, u32)) -> Preview {
        let mut setup = scenes::build(scene, 0.0).unwrap();
        setup.camera = setup.camera.with_size(size.0, size.1);
        Preview::new(View { setup, light_index: 0 }, 0).unwrap()
    }

    #[test]
    fn features_speak_of_the_picture_asked_for() {
        let [small, large] = [(128, 96), (512, 384)].map(|size| *preview("quads", size).features());
        assert_eq!((small.hard_rmse, small.penumbra), (large.hard_rmse, large.penumbra));
        assert_eq!((16.0 * small.pixels, 4.0 * small.width), (large.pixels, large.width));
        assert!(small.penumbra > 0.01 && small.width > 1.0, "{small:?}");
    }

    #[test]
    fn an_image_of_one_row_is_previewed() {
        assert!(preview("quads", (4096, 1)).features().logarithms().iter().all(|x| x.is_finite()));
    }
}
