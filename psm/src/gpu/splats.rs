//! The points that were chosen, drawn over the triangles. Twin of [`Chosen::draw`](crate::points::Chosen::draw).

use scene_core::gpu::{
    Bound, ChosenRuns, DepthTarget, DepthUniform, GpuScene, HeldBuffer, HeldGroup, Recorder, SceneBindings,
    binding,
};

use super::shaders;
use crate::points::SPLAT;

/// Draws points as squares of texels, each at its own depth.
#[derive(Debug)]
pub(super) struct SplatPass {
    pipeline: wgpu::RenderPipeline,
    bindings: SceneBindings,
    reach: HeldBuffer,
    group: HeldGroup,
    /// Of the maps, in their order.
    groups: Vec<HeldGroup>,
}

impl SplatPass {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let stages = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let types = [binding::UNIFORM, binding::STORAGE, binding::STORAGE, binding::UNIFORM];
        let group = HeldGroup::new(device, "splats", stages, &types);
        let bindings = SceneBindings::new(device, stages);
        let pipeline = splat_pipeline(device, [group.layout(), &bindings.triangles_layout]);
        Self { pipeline, bindings, reach: HeldBuffer::uniform("reach of splats"), group, groups: Vec::new() }
    }

    /// Draws `pieces` of `points` into the map `index` of `map_size` texels a side, by the projection that its `target` has in a buffer.
    pub(super) fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        index: usize,
        (map_size, points): (u32, &wgpu::Buffer),
        pieces: &ChosenRuns<'_>,
        scene: &GpuScene<'_>,
        target: &DepthTarget<'_>,
    ) {
        let (Some(view), Some(ids)) = (target.written, target.ids) else { return };
        if self.groups.len() <= index {
            self.groups.resize_with(index + 1, || self.group.another());
        }
        // A texel is 2 / map_size wide in normalised device coordinates.
        let reach = [SPLAT as f32 / map_size as f32, 0.0, 0.0, 0.0];
        let reach = self.reach.get(recorder.device, bytemuck::cast_slice(&reach));
        let part = |buffer: &wgpu::Buffer, offset, size| Bound::Part { buffer: buffer.clone(), offset, size };
        let bound = [
            part(view.buffer, view.offset, size_of::<DepthUniform>() as u64),
            part(pieces.runs, pieces.offset, pieces.size),
            points.clone().into(),
            reach.into(),
        ];
        let group = self.groups[index].get(recorder.device, &bound);
        let scene = self.bindings.groups(recorder.device, scene);
        let span = recorder.stage("prepare.maps");
        let kept = wgpu::StoreOp::Store;
        let mut pass = recorder.encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("splats"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: ids,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: kept },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: target.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: kept }),
                stencil_ops: None,
            }),
            timestamp_writes: span.render(),
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.set_bind_group(1, &scene.triangles, &[]);
        pass.draw_indirect(pieces.arguments, pieces.arguments_offset);
    }
}

fn splat_pipeline(
    device: &wgpu::Device,
    [own, triangles]: [&wgpu::BindGroupLayout; 2],
) -> wgpu::RenderPipeline {
    let label = Some("splats");
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label,
        source: wgpu::ShaderSource::Wgsl(shaders::SPLATS.into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(own), Some(triangles)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("splat_vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: wgpu::TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            // Reversed.
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("splat_fragment"),
            compilation_options: Default::default(),
            targets: &[Some(wgpu::TextureFormat::R32Uint.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
