//! Ground truth of a view: the one place that asks the ray tracer.

use std::ops::ControlFlow;
use std::time::Instant;

use scene_core::bvh::Bvh;
use scene_core::reference::{
    Reference, ReferenceSettings, adaptive_reference, exact_reference, reference, valid_pixels,
};
use scene_core::{GBuffer, Report, VisibilityImage};
use serde_json::json;

use crate::args::TruthArgs;
use crate::console::Console;
use crate::error::{CliError, count_of};
use crate::measure::milliseconds_since;
use crate::report::{RunReport, Subject};
use crate::scene_source::View;

/// V, the standard error of each pixel's V, and which pixels may be compared.
pub(crate) struct GroundTruth {
    pub(crate) visibility: VisibilityImage,
    /// NaN where nothing is seen.
    pub(crate) std_error: Vec<f32>,
    pub(crate) valid: Vec<bool>,
}

impl GroundTruth {
    /// Root mean square of the standard error over valid pixels; NaN if there is none.
    pub(crate) fn noise(&self) -> f64 {
        let valid = || self.std_error.iter().zip(&self.valid).filter(|(_, valid)| **valid);
        let sum: f64 = valid().map(|(error, _)| f64::from(*error).powi(2)).sum();
        (sum / valid().count() as f64).sqrt()
    }
}

/// Traces ground truth and books what it cost as if it were a technique: the BVH is its preparation.
pub(crate) fn trace(
    view: &View,
    gbuffer: &GBuffer,
    args: &TruthArgs,
    seed: u64,
    console: &Console,
) -> Result<(GroundTruth, RunReport), CliError> {
    let a_pixel = count_of(args.samples as usize, "sample") + " a pixel";
    let mut settings = json!({ "samples": args.samples, "seed": seed });
    let variant = match args.max_error {
        _ if args.exact => "exact".to_owned(),
        Some(error) => format!("to an error of {error}, at most {a_pixel}"),
        None => a_pixel.clone(),
    };
    if let Some(error) = args.max_error {
        settings["max_error"] = json!(error);
    }
    let (scene, light) = (&view.setup.scene, view.light());
    let mut report = Report::default();
    let start = Instant::now();
    let bvh = {
        let _working = console.working(format!("building the tree of {} triangles", scene.caster_count()));
        report.time("prepare.bvh", |_| Bvh::casters(scene))
    };
    let bar = console.progress(format!("ground truth, {variant}"));
    let progress = |fraction: f32| {
        bar.set(fraction);
        ControlFlow::Continue(())
    };
    report.bytes = bvh.bytes() as u64;
    let prepare_ms = milliseconds_since(start);
    let start = Instant::now();
    let traced = report.time("shade.rays", |_| -> Result<Reference, CliError> {
        let sampling = ReferenceSettings { samples: args.samples, seed, skip: true };
        if args.exact {
            return Ok(exact_reference(scene, &bvh, light, gbuffer, &sampling, &progress)?);
        }
        if let Some(max_error) = args.max_error {
            return Ok(adaptive_reference(scene, &bvh, light, gbuffer, &sampling, max_error, &progress)?);
        }
        Ok(reference(scene, &bvh, light, gbuffer, &sampling, &progress)?)
    })?;
    let shade_ms = milliseconds_since(start);
    report.skip("wholly lit pixels", traced.work.proved_lit);
    report.skip("wholly dark pixels", traced.work.proved_dark);
    if args.exact {
        // Lights without extent are decided by one ray a pixel.
        let hang_on_masks = if light.is_extended() { traced.work.sampled } else { 0 };
        settings = json!({ "exact": true });
        if hang_on_masks > 0 {
            settings = json!({
                "exact": true, "sampled_pixels": hang_on_masks, "samples": args.samples, "seed": seed,
            });
            console.note(&format!(
                "note: cut-out masks leave {} to sampling, {a_pixel}; all others are exact",
                count_of(hang_on_masks as usize, "pixel"),
            ));
        }
    }
    let truth = GroundTruth {
        visibility: traced.visibility,
        std_error: traced.std_error,
        valid: valid_pixels(gbuffer, light),
    };
    let subject = Subject { technique: "reference".to_owned(), variant, settings, survives_camera: true };
    Ok((truth, RunReport::new(view, subject, prepare_ms, shade_ms, report)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_that_of_valid_pixels() {
        let mut truth = GroundTruth {
            visibility: VisibilityImage::new(4, 1),
            std_error: vec![0.3, 0.4, 9.0, f32::NAN],
            valid: vec![true, true, false, false],
        };
        assert!((truth.noise() - 0.125f64.sqrt()).abs() < 1e-6);
        truth.valid = vec![false; 4];
        assert!(truth.noise().is_nan());
    }
}
