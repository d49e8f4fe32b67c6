//! The shadow-depth pass: nearest casters through any projection, into depth maps, layers, cube faces or parts
//! of an atlas.

use std::ops::Range;

use glam::Mat4;

use super::layout::DepthUniform;
use super::pipeline::{RenderPipelineParts, render_pipeline, shader_module, uniform_group, uniform_layout};
use super::scene::SceneBindings;
use super::{GpuScene, Recorder, shaders};
use crate::GBuffer;

/// What is stored beside depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DepthIds {
    /// Nothing: the fastest.
    #[default]
    None,
    /// The id of the object that is nearest.
    Object,
    /// The triangle that is nearest, as an index into [`Scene::triangles`](crate::Scene::triangles).
    Triangle,
}

/// One map to draw. Clear it first (the default) or draw on top, as for parts of an atlas.
#[derive(Clone, Copy, Debug)]
pub struct DepthTarget<'a> {
    /// `Depth32Float`, one layer: reversed Z, 0 where there is nothing.
    pub depth: &'a wgpu::TextureView,
    /// `R32Uint`, [`GBuffer::NOTHING`] where there is nothing: needed by the pass unless it is made for
    /// [`DepthIds::None`], and then ignored.
    pub ids: Option<&'a wgpu::TextureView>,
    /// The projection, with reversed Z. Any: perspective, orthographic, a cube's face.
    pub clip_from_world: Mat4,
    /// If given, only triangles in these ranges are drawn, in any order; what lies outside the scene is ignored.
    /// Ranges that overlap are drawn twice.
    pub triangles: Option<&'a [Range<u32>]>,
    /// Part of the view that is drawn to, as x, y, width and height in texels; all of it if not given. It must lie
    /// within.
    pub viewport: Option<[u32; 4]>,
    /// Whether the whole view is cleared before.
    pub clear: bool,
}

impl<'a> DepthTarget<'a> {
    /// All casters over the whole, cleared view.
    pub fn new(depth: &'a wgpu::TextureView, clip_from_world: Mat4) -> Self {
        Self { depth, ids: None, clip_from_world, triangles: None, viewport: None, clear: true }
    }
}

/// Draws depth maps of casters: its pipelines, kept from frame to frame.
#[derive(Debug)]
pub struct DepthPass {
    ids: DepthIds,
    view_layout: wgpu::BindGroupLayout,
    bindings: SceneBindings,
    solid: wgpu::RenderPipeline,
    cutout: wgpu::RenderPipeline,
}

impl DepthPass {
    /// Makes the pipelines. `cull` leaves out faces, front being counter-clockwise as seen; `None` is right for
    /// every mesh.
    pub fn new(device: &wgpu::Device, ids: DepthIds, cull: Option<wgpu::Face>) -> Self {
        let module = shader_module(device, "depth_pass", shaders::DEPTH_PASS);
        let stages = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let view_layout = uniform_layout(device, stages);
        let bindings = SceneBindings::new(device, stages);
        let targets: &[wgpu::TextureFormat] = match ids {
            DepthIds::None => &[],
            DepthIds::Object | DepthIds::Triangle => &[wgpu::TextureFormat::R32Uint],
        };
        let parts = RenderPipelineParts {
            label: "depth",
            module: &module,
            vertex: "depth_vertex",
            fragment: None,
            groups: &[&view_layout],
            vertex_buffers: &[],
            targets,
            cull,
        };
        let position = wgpu::VertexBufferLayout {
            array_stride: 12,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x3],
        };
        let pulled = [&view_layout, &bindings.triangles_layout];
        let masked = [&view_layout, &bindings.triangles_layout, &bindings.cutouts_layout];
        let (solid_fragment, cutout_fragment) = match ids {
            DepthIds::None => (None, "cutout_fragment"),
            DepthIds::Object => (Some("solid_object_fragment"), "cutout_object_fragment"),
            DepthIds::Triangle => (Some("solid_triangle_fragment"), "cutout_triangle_fragment"),
        };
        let solid = if solid_fragment.is_none() {
            // Indexed, so that each vertex is transformed once.
            render_pipeline(device, &RenderPipelineParts { vertex_buffers: &[Some(position)], ..parts })
        } else {
            let parts = RenderPipelineParts { vertex: "solid_vertex", groups: &pulled, ..parts };
            render_pipeline(device, &RenderPipelineParts { fragment: solid_fragment, ..parts })
        };
        let parts = RenderPipelineParts { vertex: "cutout_vertex", groups: &masked, ..parts };
        let cutout =
            render_pipeline(device, &RenderPipelineParts { fragment: Some(cutout_fragment), ..parts });
        Self { ids, view_layout, bindings, solid, cutout }
    }

    /// Records one pass a target: the casters of `scene`. All targets are timed as `stage`.
    ///
    /// A target without [`DepthTarget::ids`] where this pass writes ids is left out.
    pub fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        scene: &GpuScene<'_>,
        targets: &[DepthTarget<'_>],
    ) {
        let groups = self.bindings.groups(recorder.device, scene);
        for target in targets {
            let ids = match (self.ids, target.ids) {
                (DepthIds::None, _) => None,
                (_, Some(ids)) => Some(ids),
                (_, None) => continue,
            };
            // Near what is drawn: its middle, or for an empty scene the world's origin.
            let middle = scene.bounds.center();
            let origin = if middle.is_finite() { middle } else { glam::Vec3::ZERO };
            let uniform = recorder.uniform("depth view", &DepthUniform::new(target.clip_from_world, origin));
            let view_group = uniform_group(recorder.device, &self.view_layout, &uniform);
            let span = recorder.stage(stage);
            let mut pass = begin(recorder.encoder, target, ids, &span);
            pass.set_bind_group(0, &view_group, &[]);
            if self.ids != DepthIds::None {
                pass.set_bind_group(1, &groups.triangles, &[]);
            }
            pass.set_pipeline(&self.solid);
            // Without masks to read, objects that claim one are drawn whole.
            let is_masked = |id: u32| scene.objects[id as usize].has_mask && groups.cutouts.is_some();
            let draws = casters(scene, target.triangles);
            if self.ids == DepthIds::None {
                pass.set_vertex_buffer(0, scene.positions.slice(..));
                pass.set_index_buffer(scene.triangles.slice(..), wgpu::IndexFormat::Uint32);
                for range in merged(draws.iter().filter(|(_, id)| !is_masked(*id)).map(|(r, _)| r.clone())) {
                    pass.draw_indexed(3 * range.start..3 * range.end, 0, 0..1);
                }
            } else {
                for (range, id) in draws.iter().filter(|(_, id)| !is_masked(*id)) {
                    pass.draw(3 * range.start..3 * range.end, *id..id + 1);
                }
            }
            let Some(cutouts) = &groups.cutouts else { continue };
            pass.set_pipeline(&self.cutout);
            pass.set_bind_group(1, &groups.triangles, &[]);
            pass.set_bind_group(2, cutouts, &[]);
            for (range, id) in draws.iter().filter(|(_, id)| is_masked(*id)) {
                pass.draw(3 * range.start..3 * range.end, *id..id + 1);
            }
        }
    }
}

fn begin<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    target: &DepthTarget<'_>,
    ids: Option<&wgpu::TextureView>,
    span: &super::StageSpan,
) -> wgpu::RenderPass<'e> {
    let nothing = wgpu::Color { r: f64::from(GBuffer::NOTHING), ..wgpu::Color::TRANSPARENT };
    let color = ids.map(|view| wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load: if target.clear { wgpu::LoadOp::Clear(nothing) } else { wgpu::LoadOp::Load },
            store: wgpu::StoreOp::Store,
        },
    });
    let colors = [color];
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("depth"),
        color_attachments: if ids.is_some() { &colors } else { &[] },
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: target.depth,
            depth_ops: Some(wgpu::Operations {
                load: if target.clear { wgpu::LoadOp::Clear(0.0) } else { wgpu::LoadOp::Load },
                store: wgpu::StoreOp::Store,
            }),
            stencil_ops: None,
        }),
        timestamp_writes: span.render(),
        occlusion_query_set: None,
        multiview_mask: None,
    });
    if let Some([x, y, width, height]) = target.viewport {
        pass.set_viewport(x as f32, y as f32, width as f32, height as f32, 0.0, 1.0);
        pass.set_scissor_rect(x, y, width, height);
    }
    pass
}

/// Ranges of casters within `filter`, each of one object, with its id.
fn casters(scene: &GpuScene<'_>, filter: Option<&[Range<u32>]>) -> Vec<(Range<u32>, u32)> {
    let everything = 0..u32::MAX;
    let filter = filter.unwrap_or(std::slice::from_ref(&everything));
    let objects = scene.objects.iter().zip(0..).filter(|(object, _)| object.flags.casts);
    objects
        .flat_map(|(object, id)| {
            filter.iter().map(move |range| {
                let start = range.start.max(object.triangles.start);
                (start..range.end.min(object.triangles.end), id)
            })
        })
        .filter(|(range, _)| !range.is_empty())
        .collect()
}

/// Ranges that follow one another as one.
fn merged(ranges: impl Iterator<Item = Range<u32>>) -> Vec<Range<u32>> {
    let mut merged: Vec<Range<u32>> = Vec::new();
    for range in ranges {
        match merged.last_mut() {
            Some(last) if last.end == range.start => last.end = range.end,
            _ => merged.push(range),
        }
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_that_follow_are_drawn_at_once() {
        assert_eq!(merged([0..4, 4..6, 8..9].into_iter()), [0..6, 8..9]);
        assert!(merged(std::iter::empty()).is_empty());
    }
}
