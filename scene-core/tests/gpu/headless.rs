//! A technique on the GPU, driven through the trait as the command line does.

use glam::{Affine3A, Vec3};
use gnomon_scene_core::gpu::{
    GpuGBuffer, GpuShadowQuery, GpuShadowTechnique, HeadlessError, Recorder, testing,
};
use gnomon_scene_core::technique::{Description, PreparedShadow, ShadowQuery, TechniqueError};
use gnomon_scene_core::{Camera, Light, Report, Scene, ShadowTechnique, TriangleMesh};

/// Fills the picture with one value by clearing it.
struct Constant {
    value: f64,
    has_gpu: bool,
}

impl ShadowTechnique for Constant {
    fn name(&self) -> &'static str {
        "constant"
    }

    fn describe(&self) -> Description {
        Description { summary: "one value everywhere", support: Vec::new() }
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::Value::Null
    }

    fn prepare<'a>(
        &self,
        _: &ShadowQuery<'a>,
    ) -> Result<(Box<dyn PreparedShadow + 'a>, Report), TechniqueError> {
        Err(TechniqueError::Unsupported { technique: "constant", input: "cpu".into(), why: "a test".into() })
    }

    fn gpu(
        &self,
        device: &wgpu::Device,
        format: wgpu::TextureFormat,
    ) -> Result<Box<dyn GpuShadowTechnique>, TechniqueError> {
        assert_eq!(format, wgpu::TextureFormat::R32Float);
        let _ = device;
        if self.has_gpu {
            return Ok(Box::new(ConstantOnGpu { value: self.value, is_prepared: false }));
        }
        Err(TechniqueError::Unsupported { technique: "constant", input: "gpu".into(), why: "a test".into() })
    }
}

struct ConstantOnGpu {
    value: f64,
    is_prepared: bool,
}

impl GpuShadowTechnique for ConstantOnGpu {
    fn prepare(
        &mut self,
        _: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        assert_eq!(query.scene.triangle_count(), 1);
        assert!(query.scene.geometry.is_some());
        self.is_prepared = true;
        let mut report = Report { bytes: 7, ..Default::default() };
        report.skip("everything", 1);
        Ok(report)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        _: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        assert!(self.is_prepared && gbuffer.size == [24, 16]);
        let span = recorder.stage("shade.clear");
        let color = wgpu::Color { r: self.value, ..wgpu::Color::TRANSPARENT };
        recorder.encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: visibility,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(color), store: wgpu::StoreOp::Store },
            })],
            timestamp_writes: span.render(),
            ..Default::default()
        });
        Ok(Report::default())
    }

    fn survives_camera(&self) -> bool {
        true
    }
}

#[test]
fn a_technique_is_driven_through_the_trait() {
    let Some(gpu) = testing::gpu() else { return };
    let mut scene = Scene::new();
    let corners = vec![Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];
    let mesh = TriangleMesh::new("t", corners, vec![[0, 1, 2]]);
    scene.add(&mesh, Affine3A::IDENTITY, Default::default()).unwrap();
    let camera = Camera {
        eye: Vec3::new(0.0, 0.0, 3.0),
        target: Vec3::ZERO,
        up: Vec3::Y,
        fov_y: 1.0,
        near: 0.1,
        far: f32::INFINITY,
        width: 24,
        height: 16,
    };
    let light = Light::Point { position: Vec3::Y };
    let query = ShadowQuery { scene: &scene, light: &light, camera: &camera };
    let frame = gpu.render(&Constant { value: 0.25, has_gpu: true }, &query).unwrap();
    let (mut seen, mut unseen) = (0, 0);
    for (pixel, value) in frame.visibility.values.iter().enumerate() {
        if frame.gbuffer.is_seen(pixel) {
            assert_eq!(*value, 0.25);
            seen += 1;
        } else {
            assert!(value.is_nan());
            unseen += 1;
        }
    }
    assert!(seen > 20 && unseen > 20, "{seen} {unseen}");
    assert_eq!((frame.report.bytes, frame.report.skipped["everything"]), (7, 1));
    let shade = if gpu.has_timestamps() { "shade.clear" } else { "shade.wall" };
    assert!(frame.report.stages_ms.contains_key(shade), "{:?}", frame.report);
    assert!(frame.report.stages_ms.contains_key("gbuffer"));

    let refused = gpu.render(&Constant { value: 0.25, has_gpu: false }, &query).unwrap_err();
    assert!(matches!(refused, HeadlessError::Technique(TechniqueError::Unsupported { .. })), "{refused}");
}
