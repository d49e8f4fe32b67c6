//! Pipelines in the few shapes that the passes here need, and how many were made.

use std::cell::Cell;

thread_local! {
    /// Pipelines, layouts of bind groups.
    static MADE: Cell<[u64; 2]> = const { Cell::new([0; 2]) };
}

/// Books a pipeline, beside each call that makes one, so that tests can ask whether frames reuse them.
pub(super) fn count_pipeline() {
    let [pipelines, layouts] = MADE.get();
    MADE.set([pipelines + 1, layouts]);
}

/// Books a layout of bind groups, likewise.
pub(super) fn count_layout() {
    let [pipelines, layouts] = MADE.get();
    MADE.set([pipelines, layouts + 1]);
}

/// Pipelines and layouts made on this thread.
pub(super) fn made() -> [u64; 2] {
    MADE.get()
}

/// A shader module from linked WGSL.
pub fn shader_module(device: &wgpu::Device, label: &str, wgsl: &str) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(wgsl.into()),
    })
}

/// What differs between render pipelines here: all draw triangle lists, both faces, nearest reversed depth first.
#[derive(Clone, Copy, Debug)]
pub struct RenderPipelineParts<'a> {
    /// For errors and messages of the driver.
    pub label: &'a str,
    /// Holds both entry points.
    pub module: &'a wgpu::ShaderModule,
    /// Entry point of the vertex stage.
    pub vertex: &'a str,
    /// None draws depth only.
    pub fragment: Option<&'a str>,
    /// Layouts of the bind groups, from 0.
    pub groups: &'a [&'a wgpu::BindGroupLayout],
    /// None where vertices are read from storage.
    pub vertex_buffers: &'a [Option<wgpu::VertexBufferLayout<'a>>],
    /// Formats of what is written beside depth.
    pub targets: &'a [wgpu::TextureFormat],
    /// Faces that are left out.
    pub cull: Option<wgpu::Face>,
}

/// Makes the pipeline, for a `Depth32Float` target.
pub fn render_pipeline(device: &wgpu::Device, parts: &RenderPipelineParts<'_>) -> wgpu::RenderPipeline {
    let groups: Vec<_> = parts.groups.iter().copied().map(Some).collect();
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(parts.label),
        bind_group_layouts: &groups,
        immediate_size: 0,
    });
    let targets: Vec<_> = parts.targets.iter().map(|&format| Some(format.into())).collect();
    count_pipeline();
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(parts.label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: parts.module,
            entry_point: Some(parts.vertex),
            compilation_options: Default::default(),
            buffers: parts.vertex_buffers,
        },
        primitive: wgpu::PrimitiveState { cull_mode: parts.cull, ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: wgpu::TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: parts.fragment.map(|entry_point| wgpu::FragmentState {
            module: parts.module,
            entry_point: Some(entry_point),
            compilation_options: Default::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}
