//! Running a technique and taking its time, on either backend.

use std::time::Instant;

use scene_core::technique::{ShadowQuery, ShadowTechnique};
use scene_core::{GBuffer, VisibilityImage};

use crate::args::Backend;
use crate::backend::{Gpu, Side};
use crate::console::Console;
use crate::error::CliError;
use crate::report::{RunReport, Subject};
use crate::scene_source::View;
use crate::techniques::variant_of;

#[cfg(feature = "gpu")]
use scene_core::gpu::HeadlessView;

/// A finished run: the image and what it cost.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) visibility: VisibilityImage,
    pub(crate) report: RunReport,
}

/// How often a run is repeated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Repeats {
    /// At most so many runs; one at least.
    pub(crate) runs: usize,
    /// No further run begins after so many milliseconds.
    pub(crate) budget_ms: f64,
}

/// Runs of one technique on one view.
#[derive(Clone, Debug)]
pub(crate) struct Repeated {
    pub(crate) fastest: Run,
    /// Milliseconds of each run: prepare and shade. The first pays for cold caches and fresh memory, which a renderer
    /// pays once and not per frame.
    pub(crate) times_ms: Vec<(f64, f64)>,
}

/// A view that techniques are run on. Both backends are asked about the same G-buffer.
pub(crate) struct Stand<'a> {
    view: &'a View,
    gbuffer: &'a GBuffer,
    gpu: Option<&'a Gpu>,
    /// The scene on the GPU, from the first run there on.
    #[cfg(feature = "gpu")]
    on_gpu: Option<HeadlessView<'a>>,
}

impl<'a> Stand<'a> {
    pub(crate) fn new(view: &'a View, gbuffer: &'a GBuffer, gpu: Option<&'a Gpu>) -> Self {
        Self {
            view,
            gbuffer,
            gpu,
            #[cfg(feature = "gpu")]
            on_gpu: None,
        }
    }

    /// Prepares and shades up to `runs` times on `side` (no further run begins after two seconds), and returns the
    /// fastest.
    ///
    /// Under [`Backend::Auto`] what the GPU cannot do is done on the CPU.
    pub(crate) fn run(
        &mut self,
        technique: &dyn ShadowTechnique,
        (backend, side): (Backend, Side),
        runs: usize,
        console: &Console,
    ) -> Result<Run, CliError> {
        let repeats = Repeats { runs, budget_ms: 2000.0 };
        let repeated = match self.repeat(technique, side, repeats) {
            Err(error) if backend == Backend::Auto && side == Side::Gpu && error.is_of_gpu() => {
                console.note(&format!("note: {} runs on the CPU: {error}", technique.name()));
                // A device that failed once is not asked again.
                self.gpu = None;
                self.repeat(technique, Side::Cpu, repeats)
            }
            result => result,
        };
        Ok(repeated?.fastest)
    }

    /// Prepares and shades as often as `repeats` says.
    pub(crate) fn repeat(
        &mut self,
        technique: &dyn ShadowTechnique,
        side: Side,
        repeats: Repeats,
    ) -> Result<Repeated, CliError> {
        match (side, self.gpu) {
            (Side::Cpu, _) | (Side::Gpu, None) => repeat(repeats, || self.on_cpu(technique)),
            (Side::Gpu, Some(gpu)) => self.on_gpu(technique, gpu, repeats),
        }
    }

    /// One run on the CPU. Never inlined: instructions are counted between its ends (`cargo xtask instructions`), which the
    /// optimiser would else take away.
    #[inline(never)]
    fn on_cpu(&self, technique: &dyn ShadowTechnique) -> Result<Run, CliError> {
        let (view, gbuffer) = (self.view, self.gbuffer);
        let query = ShadowQuery { scene: &view.setup.scene, light: view.light(), camera: &view.setup.camera };
        let start = Instant::now();
        let (prepared, mut report) = technique.prepare(&query)?;
        let prepare_ms = milliseconds_since(start);
        let mut visibility = VisibilityImage::new(gbuffer.width, gbuffer.height);
        let start = Instant::now();
        let shaded = prepared.shade(gbuffer, &mut visibility)?;
        let shade_ms = milliseconds_since(start);
        report.merge(&shaded);
        let subject = subject(technique, prepared.survives_camera());
        Ok(Run { visibility, report: RunReport::new(view, subject, prepare_ms, shade_ms, report) })
    }

    /// Runs on the GPU; pipelines are made once.
    #[cfg(feature = "gpu")]
    fn on_gpu(
        &mut self,
        technique: &dyn ShadowTechnique,
        gpu: &'a Gpu,
        repeats: Repeats,
    ) -> Result<Repeated, CliError> {
        let (view, gbuffer) = (self.view, self.gbuffer);
        let stage = match &mut self.on_gpu {
            Some(stage) => stage,
            none => {
                let stage = none.insert(gpu.view(&view.setup.scene, &view.setup.camera)?);
                stage.upload_gbuffer(gbuffer)?;
                stage
            }
        };
        let mut on_gpu = stage.technique(technique)?;
        repeat(repeats, || {
            let run = stage.run(on_gpu.as_mut(), view.light(), gbuffer)?;
            let subject = subject(technique, on_gpu.survives_camera());
            let report = RunReport::new(view, subject, run.prepare_ms, run.shade_ms, run.report);
            Ok(Run { visibility: run.visibility, report })
        })
    }

    #[cfg(not(feature = "gpu"))]
    fn on_gpu(&mut self, _: &dyn ShadowTechnique, gpu: &'a Gpu, _: Repeats) -> Result<Repeated, CliError> {
        match *gpu {}
    }
}

/// Runs, and repeats.
pub(crate) fn repeat(
    repeats: Repeats,
    mut run: impl FnMut() -> Result<Run, CliError>,
) -> Result<Repeated, CliError> {
    let times = |run: &Run| (run.report.prepare_ms, run.report.shade_ms);
    let total_ms = |run: &Run| run.report.prepare_ms + run.report.shade_ms;
    let start = Instant::now();
    let mut fastest = run()?;
    let mut times_ms = vec![times(&fastest)];
    for _ in 1..repeats.runs {
        if milliseconds_since(start) > repeats.budget_ms {
            break;
        }
        let next = run()?;
        times_ms.push(times(&next));
        if total_ms(&next) < total_ms(&fastest) {
            fastest = next;
        }
    }
    Ok(Repeated { fastest, times_ms })
}

fn subject(technique: &dyn ShadowTechnique, survives_camera: bool) -> Subject {
    Subject {
        technique: technique.name().to_owned(),
        variant: variant_of(technique),
        settings: technique.settings(),
        survives_camera,
    }
}

/// Milliseconds of wall time.
pub(crate) fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
