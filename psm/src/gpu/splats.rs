//! The points that were chosen, drawn over the triangles. Twin of [`Chosen::draw`](crate::points::Chosen::draw).

use scene_core::gpu::{
    Bound, ChosenRuns, DepthTarget, DepthUniform, GpuScene, HeldBuffer, HeldGroup, HeldGroups, Recorder,
    RenderPipelineParts, SceneBindings, binding, render_pipeline, shader_module,
};

use super::shaders;
use crate::points::SPLAT;

/// Draws points as squares of texels, each at its own depth.
#[derive(Debug)]
pub(super) struct SplatPass {
    pipeline: wgpu::RenderPipeline,
    bindings: SceneBindings,
    reach: HeldBuffer,
    /// Of the maps, in their order.
    groups: HeldGroups,
}

impl SplatPass {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let stages = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let types = [binding::UNIFORM, binding::STORAGE, binding::STORAGE, binding::UNIFORM];
        let group = HeldGroup::new(device, "splats", stages, &types);
        let bindings = SceneBindings::new(device, stages);
        let pipeline = render_pipeline(
            device,
            &RenderPipelineParts {
                label: "splats",
                module: &shader_module(device, "splats", shaders::SPLATS),
                vertex: "splat_vertex",
                fragment: Some("splat_fragment"),
                groups: &[group.layout(), &bindings.triangles_layout],
                vertex_buffers: &[],
                targets: &[wgpu::TextureFormat::R32Uint],
                cull: None,
            },
        );
        Self {
            pipeline,
            bindings,
            reach: HeldBuffer::uniform("reach of splats"),
            groups: HeldGroups::new(group),
        }
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
        let Some(view) = target.written else { return };
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
        let group = self.groups.get(recorder.device, index, &bound);
        let scene = self.bindings.groups(recorder.device, scene);
        let span = recorder.stage("prepare.maps");
        let mut pass = DepthTarget { clear: false, ..*target }.begin(recorder.encoder, &span);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.set_bind_group(1, &scene.triangles, &[]);
        pass.draw_indirect(pieces.arguments, pieces.arguments_offset);
    }
}
