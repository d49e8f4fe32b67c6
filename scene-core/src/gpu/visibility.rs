//! A pass over all pixels that writes V: what `shade` of most techniques comes down to.

use super::pipeline::{count_pipeline, shader_module};
use super::scene::SceneGroups;
use super::{Receivers, Recorder, SceneBindings};

/// A full-screen pass with a fragment shader of a technique's own.
///
/// Bind groups have fixed places: 0 is the technique's own, 1 the scene's triangles (`scene.wesl`), 2 its cut-outs
/// (`cutout.wesl`), 3 the receivers and the light (`receivers.wesl`). The vertex stage is
/// `full_screen_corner` of `full_screen.wesl`, in an entry point `full_screen`.
#[derive(Debug)]
pub struct VisibilityPass {
    label: &'static str,
    pipeline: wgpu::RenderPipeline,
}

/// What tells one [`VisibilityPass`] from another.
#[derive(Debug)]
pub struct VisibilityPassParts<'a> {
    /// A name for messages of the driver.
    pub label: &'static str,
    /// The linked WGSL.
    pub wgsl: &'a str,
    /// The fragment shader's entry point: V at location 0, as one float.
    pub fragment: &'a str,
    /// Layout of group 0.
    pub own: &'a wgpu::BindGroupLayout,
    /// Layouts of groups 1 and 2.
    pub scene: &'a SceneBindings,
    /// Layout of group 3.
    pub receivers: &'a Receivers,
    /// Format of the texture that is written.
    pub format: wgpu::TextureFormat,
}

impl VisibilityPass {
    /// Makes the pipeline.
    pub fn new(device: &wgpu::Device, parts: &VisibilityPassParts<'_>) -> Self {
        let module = shader_module(device, parts.label, parts.wgsl);
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(parts.label),
            bind_group_layouts: &[
                Some(parts.own),
                Some(&parts.scene.triangles_layout),
                None,
                Some(parts.receivers.layout()),
            ],
            immediate_size: 0,
        });
        count_pipeline();
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(parts.label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("full_screen"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(parts.fragment),
                compilation_options: Default::default(),
                targets: &[Some(parts.format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { label: parts.label, pipeline }
    }

    /// Records the pass: every pixel of `visibility` is written.
    pub fn record(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        own: &wgpu::BindGroup,
        scene: &SceneGroups,
        receivers: &wgpu::BindGroup,
        visibility: &wgpu::TextureView,
    ) {
        let span = recorder.stage(stage);
        let mut pass = recorder.encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(self.label),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: visibility,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::WHITE),
                    store: wgpu::StoreOp::Store,
                },
            })],
            timestamp_writes: span.render(),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, own, &[]);
        pass.set_bind_group(1, &scene.triangles, &[]);
        pass.set_bind_group(3, receivers, &[]);
        pass.draw(0..3, 0..1);
    }
}
