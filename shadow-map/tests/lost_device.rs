//! A device that is lost is an error, wherever in a frame it happens, and never a panic.

#![cfg(feature = "gpu")]

use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{
    Gpu, GpuError, GpuGBuffer, GpuShadowQuery, GpuShadowTechnique, HeadlessError, Recorder, testing,
};
use scene_core::technique::TechniqueError;
use scene_core::{Camera, Light, Report, Scene, scenes};

const VARIANTS: [Variant; 8] = [
    Variant::Hard,
    Variant::Pcf,
    Variant::ObjectId,
    Variant::Pcss,
    Variant::Moments,
    Variant::Cascaded,
    Variant::MultiView,
    Variant::AliasFree,
];

/// When the device is destroyed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum When {
    BeforeUpload,
    BeforePipelines,
    BeforeGBuffer,
    BeforePrepare,
    AfterPrepare,
    AfterShade,
    BeforeSecondFrame,
    Never,
}

/// A technique whose device goes while it is in use.
struct Losing {
    technique: ShadowMapOnGpu,
    when: When,
}

impl GpuShadowTechnique for Losing {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        if self.when == When::BeforePrepare {
            recorder.device.destroy();
        }
        let report = self.technique.prepare(recorder, query);
        if self.when == When::AfterPrepare {
            recorder.device.destroy();
        }
        report
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        let report = self.technique.shade(recorder, camera, gbuffer, visibility);
        if self.when == When::AfterShade {
            recorder.device.destroy();
        }
        report
    }

    fn survives_camera(&self) -> bool {
        self.technique.survives_camera()
    }
}

/// A frame, and a second one, up to the first error.
fn render(
    gpu: &Gpu,
    variant: Variant,
    when: When,
    (scene, camera, light): (&Scene, &Camera, &Light),
) -> Result<(), HeadlessError> {
    let lose_at = |now| {
        if now == when {
            gpu.device.destroy();
        }
    };
    let params = ShadowMapParams { variant, map_size: 32, views: 2, taps: 4, ..Default::default() };
    lose_at(When::BeforeUpload);
    let mut view = gpu.view(scene, camera)?;
    lose_at(When::BeforePipelines);
    // As the command makes it, too.
    view.technique(&ShadowMap::new(params))?;
    let technique = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT)?;
    let mut technique = Losing { technique, when };
    lose_at(When::BeforeGBuffer);
    let (gbuffer, _) = view.draw_gbuffer()?;
    view.run(&mut technique, light, &gbuffer)?;
    lose_at(When::BeforeSecondFrame);
    view.run(&mut technique, light, &gbuffer)?;
    Ok(())
}

#[test]
fn a_render_on_a_lost_device_is_an_error() {
    if testing::gpu().is_none() {
        return;
    }
    let setup = scenes::build("ball", 0.0).unwrap();
    let camera = setup.camera.with_size(24, 16);
    let lamp = Light::Point { position: setup.scene.bounds().center() + setup.scene.bounds().size() };
    let sun = Light::Directional { direction: glam::Vec3::new(0.3, -1.0, 0.2), angular_radius: 0.01 };
    for (index, variant) in VARIANTS.into_iter().enumerate() {
        let light = if index % 2 == 0 { lamp } else { sun };
        for when in [
            When::BeforeUpload,
            When::BeforePipelines,
            When::BeforeGBuffer,
            When::BeforePrepare,
            When::AfterPrepare,
            When::AfterShade,
            When::BeforeSecondFrame,
            When::Never,
        ] {
            let gpu = Gpu::open().unwrap();
            let result = render(&gpu, variant, when, (&setup.scene, &camera, &light));
            if when == When::Never {
                result.unwrap();
                continue;
            }
            assert!(
                matches!(result, Err(HeadlessError::Gpu(GpuError::Lost { .. }))),
                "{variant:?}, lost {when:?}: {result:?}"
            );
        }
    }
}
