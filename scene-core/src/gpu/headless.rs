//! Whole frames without a window: G-buffer, prepare, shade, read back. For the command line, tests and benchmarks.
//!
//! A scene that lies far from zero is uploaded in coordinates counted [from its middle](Origin), and camera, light and G-buffer
//! follow: no technique need know. What is given and returned is in world space.

use std::borrow::Cow;
use std::time::Instant;

use thiserror::Error;

use super::{
    GBufferPass, GBufferTargets, Gpu, GpuError, GpuGBuffer, GpuShadowQuery, GpuShadowTechnique, Recorder,
    SceneBuffers, StageTimer,
};
use crate::report::GpuUse;
use crate::technique::{ShadowQuery, ShadowTechnique, TechniqueError};
use crate::{Camera, GBuffer, Light, Origin, Report, Scene, VisibilityImage};

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
    /// As [`HeadlessRun::report`], and `gbuffer` of the pass before.
    pub report: Report,
}

/// What running a technique once yields.
#[derive(Clone, Debug)]
pub struct HeadlessRun {
    /// V of every pixel that sees a surface; NaN elsewhere.
    pub visibility: VisibilityImage,
    /// Bytes and skips of both steps, milliseconds per stage, `prepare.…` and `shade.…`, and the adapter. On a GPU in software
    /// stages run one after the other, timed [on the wall](StageTimer::on_the_wall); on others without timestamps the steps are timed as a whole,
    /// as `prepare.wall` and `shade.wall`.
    pub report: Report,
    /// Wall time of preparation, from recording to the end of the GPU's work.
    pub prepare_ms: f64,
    /// Wall time of shading, likewise.
    pub shade_ms: f64,
}

/// A scene seen by a camera, on the device: techniques run on it any number of times.
#[derive(Debug)]
pub struct HeadlessView<'a> {
    gpu: &'a Gpu,
    origin: Origin,
    /// Both counted from there.
    scene: Cow<'a, Scene>,
    camera: Camera,
    buffers: SceneBuffers,
    /// Made when it is first drawn.
    pass: Option<GBufferPass>,
    targets: GBufferTargets,
    visibility: wgpu::Texture,
    timer: Option<StageTimer>,
}

impl Gpu {
    /// Renders the visibility that `technique` finds for `query`, for a G-buffer drawn on the GPU.
    ///
    /// # Errors
    /// What the device or the technique objects to.
    pub fn render(
        &self,
        technique: &dyn ShadowTechnique,
        query: &ShadowQuery<'_>,
    ) -> Result<HeadlessFrame, HeadlessError> {
        let mut view = self.view(query.scene, query.camera)?;
        let mut on_gpu = view.technique(technique)?;
        let (gbuffer, mut report) = view.draw_gbuffer()?;
        let run = view.run(on_gpu.as_mut(), query.light, &gbuffer)?;
        report.merge(&run.report);
        Ok(HeadlessFrame { visibility: run.visibility, gbuffer, report })
    }

    /// Uploads a scene and makes the textures of a view.
    ///
    /// # Errors
    /// What the device objects to: memory, for one.
    pub fn view<'a>(&'a self, scene: &'a Scene, camera: &'a Camera) -> Result<HeadlessView<'a>, GpuError> {
        let limit = self.device.limits().max_texture_dimension_2d;
        GpuError::within("pixels a row or rows", camera.width.max(camera.height), limit)?;
        let origin = Origin::near(scene.bounds());
        let (scene, camera) = (origin.scene(scene), origin.camera(camera));
        let buffers = self.scoped("the scene", || SceneBuffers::new(&self.device, &scene))??;
        let targets =
            self.scoped("the G-buffer", || GBufferTargets::new(&self.device, camera.width, camera.height))?;
        let visibility = self.scoped("the visibility texture", || self.visibility_texture(&targets))?;
        let timer = match self.is_software() {
            true => Some(StageTimer::on_the_wall()),
            false => StageTimer::new(&self.device, &self.queue, TIMED_PASSES),
        };
        Ok(HeadlessView { gpu: self, origin, scene, camera, buffers, pass: None, targets, visibility, timer })
    }

    /// What V of a view with these targets is written to, to be read back by [`read_visibility`](Self::read_visibility).
    pub fn visibility_texture(&self, targets: &GBufferTargets) -> wgpu::Texture {
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

impl HeadlessView<'_> {
    /// Draws the G-buffer and reads it back; its time is booked as `gbuffer`.
    ///
    /// # Errors
    /// What the device objects to.
    pub fn draw_gbuffer(&mut self) -> Result<(GBuffer, Report), HeadlessError> {
        let Self { gpu, origin, scene, camera, buffers, pass, targets, timer, .. } = self;
        let (report, _) = gpu.step(timer, "gbuffer", |recorder| {
            let scene = buffers.view(Some(scene));
            pass.get_or_insert_with(|| GBufferPass::new(&gpu.device))
                .record(recorder, "gbuffer", &scene, camera, targets);
            Ok(Report::default())
        })?;
        Ok((origin.back(gpu.read_gbuffer(targets, camera)?), report))
    }

    /// Takes a G-buffer of the camera's size instead, so that both backends are asked about the same surfaces.
    ///
    /// # Errors
    /// What the device objects to: another size, for one.
    pub fn upload_gbuffer(&mut self, gbuffer: &GBuffer) -> Result<(), GpuError> {
        self.gpu.scoped("the G-buffer", || self.targets.upload(&self.gpu.queue, gbuffer))
    }

    /// The technique on this device: makes its pipelines.
    ///
    /// # Errors
    /// [`TechniqueError::Unsupported`] if it has no GPU path; what the device objects to.
    pub fn technique(
        &self,
        technique: &dyn ShadowTechnique,
    ) -> Result<Box<dyn GpuShadowTechnique>, HeadlessError> {
        let gpu = self.gpu;
        Ok(gpu.scoped("pipelines", || technique.gpu(&gpu.device, VISIBILITY_FORMAT))??)
    }

    /// Prepares and shades once. `gbuffer` is what was drawn or uploaded last.
    ///
    /// # Errors
    /// What the device or the technique objects to.
    pub fn run(
        &mut self,
        technique: &mut dyn GpuShadowTechnique,
        light: &Light,
        gbuffer: &GBuffer,
    ) -> Result<HeadlessRun, HeadlessError> {
        let Self { gpu, origin, scene, camera, buffers, targets, visibility, timer, .. } = self;
        let light = &origin.light(light);
        let query = GpuShadowQuery { scene: buffers.view(Some(scene)), light, camera };
        let (mut report, prepare_ms) =
            gpu.step(timer, "prepare.wall", |recorder| technique.prepare(recorder, &query))?;
        let view = visibility.create_view(&Default::default());
        let (shaded, shade_ms) = gpu.step(timer, "shade.wall", |recorder| {
            let gbuffer = GpuGBuffer { lift: origin.lift(), ..targets.view() };
            technique.shade(recorder, camera, &gbuffer, &view)
        })?;
        report.merge(&shaded);
        report.merge(&technique.counted(gpu)?);
        report.gpu = Some(GpuUse { adapter: gpu.adapter_name(), features: gpu.features() });
        let visibility = gpu.read_visibility(visibility, gbuffer)?;
        Ok(HeadlessRun { visibility, report, prepare_ms, shade_ms })
    }
}

impl Gpu {
    /// Records, submits and times one step; returns its report and wall time in milliseconds.
    fn step(
        &self,
        timer: &mut Option<StageTimer>,
        wall_stage: &str,
        record: impl FnOnce(&mut Recorder<'_>) -> Result<Report, TechniqueError>,
    ) -> Result<(Report, f64), HeadlessError> {
        let start = Instant::now();
        let mut encoder = self.encoder();
        let mut report = self.scoped(wall_stage, || {
            let mut recorder = Recorder::new(&self.device, &self.queue, &mut encoder);
            recorder.timer = timer.as_mut();
            record(&mut recorder)
        })??;
        if let Some(timer) = timer {
            timer.resolve(&mut encoder);
        }
        self.submit(encoder)?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        match timer {
            Some(timer) => report.merge(&self.read_times(timer)?),
            None => {
                report.stages_ms.insert(wall_stage.to_owned(), wall_ms);
            }
        }
        Ok((report, wall_ms))
    }
}
