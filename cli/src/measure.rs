//! Running a technique and taking its time.

use std::time::Instant;

use scene_core::technique::{ShadowQuery, ShadowTechnique};
use scene_core::{GBuffer, VisibilityImage};

use crate::args::Backend;
use crate::error::CliError;
use crate::report::{RunReport, Subject};
use crate::scene_source::View;
use crate::techniques::variant_of;

/// A finished run: the image and what it cost.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) visibility: VisibilityImage,
    pub(crate) report: RunReport,
}

/// Refuses a backend that the technique does not have.
pub(crate) fn check_backend(technique: &dyn ShadowTechnique, backend: Backend) -> Result<(), CliError> {
    match backend {
        // No technique of this build can be run on the GPU from here, whatever its crate offers.
        Backend::Gpu => Err(CliError::NoGpu { technique: technique.name() }),
        Backend::Auto | Backend::Cpu => Ok(()),
    }
}

/// Prepares and shades once.
pub(crate) fn run(technique: &dyn ShadowTechnique, view: &View, gbuffer: &GBuffer) -> Result<Run, CliError> {
    let query = ShadowQuery { scene: &view.setup.scene, light: view.light(), camera: &view.setup.camera };
    let start = Instant::now();
    let (prepared, mut report) = technique.prepare(&query)?;
    let prepare_ms = milliseconds_since(start);
    let mut visibility = VisibilityImage::new(gbuffer.width, gbuffer.height);
    let start = Instant::now();
    let shaded = prepared.shade(gbuffer, &mut visibility)?;
    let shade_ms = milliseconds_since(start);
    report.merge(&shaded);
    let subject = Subject {
        technique: technique.name().to_owned(),
        variant: variant_of(technique),
        settings: technique.settings(),
    };
    Ok(Run { visibility, report: RunReport::cpu(view, subject, prepare_ms, shade_ms, report) })
}

/// The fastest of up to `RUNS` runs; no further one begins after `BUDGET_MS`. The first one pays for cold
/// caches and fresh memory, which a renderer pays once and not per frame.
pub(crate) fn fastest(
    technique: &dyn ShadowTechnique,
    view: &View,
    gbuffer: &GBuffer,
) -> Result<Run, CliError> {
    const RUNS: usize = 3;
    const BUDGET_MS: f64 = 2000.0;
    let total_ms = |run: &Run| run.report.prepare_ms + run.report.shade_ms;
    let start = Instant::now();
    let mut best = run(technique, view, gbuffer)?;
    for _ in 1..RUNS {
        if milliseconds_since(start) > BUDGET_MS {
            break;
        }
        let next = run(technique, view, gbuffer)?;
        if total_ms(&next) < total_ms(&best) {
            best = next;
        }
    }
    Ok(best)
}

/// Milliseconds of wall time.
pub(crate) fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
