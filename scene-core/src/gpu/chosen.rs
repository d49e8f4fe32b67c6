//! Triangles that a pass before chooses on the GPU, so that a depth map is drawn of those alone that it may see.

use super::held::{Bound, HeldGroup, HeldGroups, binding};
use super::pipeline::{RenderPipelineParts, render_pipeline, shader_module};
use super::scene::SceneBindings;
use super::shaders;

/// Triangles of a run at most. Each that is chosen is drawn as if it had so many: short ones should be few.
pub const RUN: u32 = 256;

/// What is drawn of the objects without a mask, once the pass that draws it is executed.
#[derive(Clone, Copy, Debug)]
pub struct ChosenRuns<'a> {
    /// Of each run its first triangle and the end of its last, two u32; [`RUN`] triangles at most. Usage `STORAGE`.
    pub runs: &'a wgpu::Buffer,
    /// Where in it the first run lies, in bytes: a multiple of 256.
    pub offset: u64,
    /// Bytes of all runs that may be chosen, more than 0.
    pub size: u64,
    /// 3 · [`RUN`] for each run that was chosen; 1, 0 and 0: four u32. Usage `INDIRECT`.
    pub arguments: &'a wgpu::Buffer,
    /// Where in it, in bytes: a multiple of 4.
    pub arguments_offset: u64,
}

/// Draws [`ChosenRuns`] with the ids of triangles: group 0 holds them beside the view.
#[derive(Debug)]
pub(super) struct ChosenPipeline {
    pub(super) pipeline: wgpu::RenderPipeline,
    /// Of the targets, in their order.
    groups: HeldGroups,
}

impl ChosenPipeline {
    pub(super) fn new(device: &wgpu::Device, scene: &SceneBindings, cull: Option<wgpu::Face>) -> Self {
        let types = [binding::UNIFORM, binding::STORAGE];
        let stages = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let group = HeldGroup::new(device, "view and chosen runs", stages, &types);
        let pipeline = render_pipeline(
            device,
            &RenderPipelineParts {
                label: "chosen depth",
                module: &shader_module(device, "depth_pass", shaders::DEPTH_PASS),
                vertex: "chosen_vertex",
                fragment: Some("solid_triangle_fragment"),
                groups: &[group.layout(), &scene.triangles_layout],
                vertex_buffers: &[],
                targets: &[wgpu::TextureFormat::R32Uint],
                cull,
            },
        );
        Self { pipeline, groups: HeldGroups::new(group) }
    }

    /// Group 0 of the target `index`.
    pub(super) fn group(
        &mut self,
        device: &wgpu::Device,
        index: usize,
        view: Bound,
        chosen: &ChosenRuns<'_>,
    ) -> wgpu::BindGroup {
        let runs = Bound::Part { buffer: chosen.runs.clone(), offset: chosen.offset, size: chosen.size };
        self.groups.get(device, index, &[view, runs])
    }
}
