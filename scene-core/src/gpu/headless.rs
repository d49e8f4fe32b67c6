//! A whole frame without a window: G-buffer, prepare, shade, read back. For the command line, tests and benchmarks.

use std::time::Instant;

use thiserror::Error;

use super::{GBufferPass, GBufferTargets, Gpu, GpuError, GpuShadowQuery, Recorder, SceneBuffers, StageTimer};
use crate::technique::{ShadowQuery, ShadowTechnique, TechniqueError};
use crate::{GBuffer, Report, VisibilityImage};

/// The format that headless frames are shaded in.
pub const VISIBILITY_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;

/// Passes that one frame may time; what lies beyond is not timed.
const TIMED_PASSES: u32 = 1024;

/// Why a headless frame was not made.
#[derive(Debug, Error)]
pub enum HeadlessError {
    /// The device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The technique.
    #[error(transparent)]
    Technique(#[from] TechniqueError),
}

/// What a headless frame yields.
#[derive(Clone, Debug)]
pub struct HeadlessFrame {
    /// V of every pixel that sees a surface; NaN elsewhere.
    pub visibility: VisibilityImage,
    /// What the camera saw.
    pub gbuffer: GBuffer,
    /// Bytes and skips of both steps, and milliseconds per stage: `prepare.…` and `shade.…` of the technique,
    /// `gbuffer` of the pass before. Without timestamps the steps are timed by the clock on the wall, uploads and
    /// waiting included, as `prepare.wall` and `shade.wall`.
    pub report: Report,
}

impl Gpu {
    /// Renders the visibility that `technique` finds for `query`.
    ///
    /// # Errors
    /// What the device or the technique objects to.
    pub fn render(
        &self,
        technique: &dyn ShadowTechnique,
        query: &ShadowQuery<'_>,
    ) -> Result<HeadlessFrame, HeadlessError> {
        let camera = query.camera;
        let buffers = self.scoped("scene upload", || SceneBuffers::new(&self.device, query.scene))??;
        let targets =
            self.scoped("the G-buffer", || GBufferTargets::new(&self.device, camera.width, camera.height))?;
        let visibility = self.scoped("the visibility texture", || self.visibility_texture(&targets))?;
        let mut on_gpu = self.scoped("pipelines", || technique.gpu(&self.device, VISIBILITY_FORMAT))??;
        let mut timer = StageTimer::new(&self.device, &self.queue, TIMED_PASSES);
        let scene = buffers.view(Some(query.scene));

        let mut report = Report::default();
        self.step(&mut timer, "gbuffer", &mut report, |recorder| {
            GBufferPass::new(&self.device).record(recorder, "gbuffer", &scene, camera, &targets);
            Ok(Report::default())
        })?;
        self.step(&mut timer, "prepare.wall", &mut report, |recorder| {
            on_gpu.prepare(recorder, &GpuShadowQuery { scene, light: query.light, camera })
        })?;
        self.step(&mut timer, "shade.wall", &mut report, |recorder| {
            let view = visibility.create_view(&Default::default());
            on_gpu.shade(recorder, camera, &targets.view(), &view)
        })?;
        let gbuffer = self.read_gbuffer(&targets, camera)?;
        let visibility = self.read_visibility(&visibility, &gbuffer)?;
        Ok(HeadlessFrame { visibility, gbuffer, report })
    }

    /// Records, submits and times one step.
    fn step(
        &self,
        timer: &mut Option<StageTimer>,
        wall_stage: &str,
        report: &mut Report,
        record: impl FnOnce(&mut Recorder<'_>) -> Result<Report, TechniqueError>,
    ) -> Result<(), HeadlessError> {
        let start = Instant::now();
        let mut encoder = self.encoder();
        let recorded = self.scoped(wall_stage, || {
            let mut recorder = Recorder::new(&self.device, &self.queue, &mut encoder);
            recorder.timer = timer.as_mut();
            record(&mut recorder)
        })??;
        if let Some(timer) = timer {
            timer.resolve(&mut encoder);
        }
        self.submit(encoder)?;
        report.merge(&recorded);
        match timer {
            Some(timer) => report.merge(&self.read_times(timer)?),
            None => {
                report.stages_ms.insert(wall_stage.to_owned(), start.elapsed().as_secs_f64() * 1e3);
            }
        }
        Ok(())
    }

    fn visibility_texture(&self, targets: &GBufferTargets) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("visibility"),
            size: targets.surface.size(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: VISIBILITY_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    }
}
