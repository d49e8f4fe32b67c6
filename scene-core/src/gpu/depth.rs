//! The shadow-depth pass: nearest casters through any projection, into depth maps, layers, cube faces or parts
//! of an atlas.

use std::ops::Range;

use glam::Mat4;

use super::chosen::{ChosenPipeline, ChosenRuns};
use super::held::{Bound, HeldBuffer, HeldGroup, binding};
use super::layout::DepthUniform;
use super::pipeline::{RenderPipelineParts, render_pipeline, shader_module};
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
    /// If given, the projection is what this holds when the pass is executed, and `clip_from_world` is ignored.
    pub written: Option<WrittenProjection<'a>>,
    /// If given, only triangles in these ranges are drawn, in any order; what lies outside the scene is ignored.
    /// Ranges that overlap are drawn twice.
    pub triangles: Option<&'a [Range<u32>]>,
    /// If given, objects without a mask are drawn by these runs; `triangles` then say which of the others are. Where the pass
    /// writes [`DepthIds::Triangle`]; else it is ignored.
    pub chosen: Option<ChosenRuns<'a>>,
    /// Part of the view that is drawn to, as x, y, width and height in texels; all of it if not given. It must lie
    /// within.
    pub viewport: Option<[u32; 4]>,
    /// Whether the whole view is cleared before.
    pub clear: bool,
}

/// A projection that a pass before computes on the GPU: a [`DepthUniform`] in a buffer of usage `UNIFORM`.
#[derive(Clone, Copy, Debug)]
pub struct WrittenProjection<'a> {
    /// The buffer.
    pub buffer: &'a wgpu::Buffer,
    /// Where in it, in bytes: a multiple of the device's `min_uniform_buffer_offset_alignment` (256 at most).
    pub offset: u64,
}

impl<'a> DepthTarget<'a> {
    /// All casters over the whole, cleared view.
    pub fn new(depth: &'a wgpu::TextureView, clip_from_world: Mat4) -> Self {
        Self {
            depth,
            ids: None,
            clip_from_world,
            written: None,
            triangles: None,
            chosen: None,
            viewport: None,
            clear: true,
        }
    }

    /// Begins the pass that draws to this target, timed by `span`: with [`ids`](Self::ids) if they are given, cleared and limited to the viewport as
    /// it says.
    pub fn begin<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        span: &super::StageSpan,
    ) -> wgpu::RenderPass<'e> {
        let ids = self.ids;
        let nothing = wgpu::Color { r: f64::from(GBuffer::NOTHING), ..wgpu::Color::TRANSPARENT };
        let color = ids.map(|view| wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: if self.clear { wgpu::LoadOp::Clear(nothing) } else { wgpu::LoadOp::Load },
                store: wgpu::StoreOp::Store,
            },
        });
        let colors = [color];
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("depth"),
            color_attachments: if ids.is_some() { &colors } else { &[] },
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: self.depth,
                depth_ops: Some(wgpu::Operations {
                    load: if self.clear { wgpu::LoadOp::Clear(0.0) } else { wgpu::LoadOp::Load },
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: span.render(),
            occlusion_query_set: None,
            multiview_mask: None,
        });
        if let Some([x, y, width, height]) = self.viewport {
            pass.set_viewport(x as f32, y as f32, width as f32, height as f32, 0.0, 1.0);
            pass.set_scissor_rect(x, y, width, height);
        }
        pass
    }
}

/// Draws depth maps of casters: its pipelines, kept from frame to frame.
#[derive(Debug)]
pub struct DepthPass {
    ids: DepthIds,
    view_group: HeldGroup,
    /// What the targets were drawn with last time, in their order.
    views: Vec<(HeldBuffer, HeldGroup)>,
    bindings: SceneBindings,
    cull: Option<wgpu::Face>,
    solid: wgpu::RenderPipeline,
    cutout: wgpu::RenderPipeline,
    /// Once a target has some.
    chosen: Option<ChosenPipeline>,
}

impl DepthPass {
    /// Makes the pipelines. `cull` leaves out faces, front being counter-clockwise as seen; `None` is right for
    /// every mesh.
    pub fn new(device: &wgpu::Device, ids: DepthIds, cull: Option<wgpu::Face>) -> Self {
        let module = shader_module(device, "depth_pass", shaders::DEPTH_PASS);
        let stages = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let view_group = HeldGroup::new(device, "depth view", stages, &[binding::UNIFORM]);
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
            groups: &[view_group.layout()],
            vertex_buffers: &[],
            targets,
            cull,
        };
        let position = wgpu::VertexBufferLayout {
            array_stride: 12,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x3],
        };
        let pulled = [view_group.layout(), &bindings.triangles_layout];
        let masked = [view_group.layout(), &bindings.triangles_layout, &bindings.cutouts_layout];
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
        Self { ids, view_group, views: Vec::new(), bindings, cull, solid, cutout, chosen: None }
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
        let device = recorder.device;
        let groups = self.bindings.groups(device, scene);
        // Without masks to read, objects that claim one are drawn whole.
        let is_masked = |id: u32| scene.objects[id as usize].has_mask && groups.cutouts.is_some();
        // Near what is drawn: its middle, or for an empty scene the world's origin.
        let middle = scene.bounds.center();
        let origin = if middle.is_finite() { middle } else { glam::Vec3::ZERO };
        // Targets mostly share their ranges.
        let mut drawn: Option<(Option<&[Range<u32>]>, Draws)> = None;
        for (index, target) in targets.iter().enumerate() {
            let ids = match (self.ids, target.ids) {
                (DepthIds::None, _) => None,
                (_, Some(ids)) => Some(ids),
                (_, None) => continue,
            };
            let draws = match &mut drawn {
                Some((triangles, draws)) if *triangles == target.triangles => draws,
                drawn => {
                    &mut drawn
                        .insert((target.triangles, draws(scene, target.triangles, self.ids, is_masked)))
                        .1
                }
            };
            if self.views.len() <= index {
                self.views.resize_with(index + 1, || {
                    (HeldBuffer::uniform("depth view"), self.view_group.another())
                });
            }
            let (uniform, group) = &mut self.views[index];
            let view = match target.written {
                Some(WrittenProjection { buffer, offset }) => {
                    Bound::Part { buffer: buffer.clone(), offset, size: size_of::<DepthUniform>() as u64 }
                }
                None => {
                    let view = DepthUniform::new(target.clip_from_world, origin);
                    uniform.get(device, bytemuck::bytes_of(&view)).into()
                }
            };
            let view_group = group.get(device, std::slice::from_ref(&view));
            let span = recorder.stage(stage);
            let mut pass = DepthTarget { ids, ..*target }.begin(recorder.encoder, &span);
            pass.set_bind_group(0, &view_group, &[]);
            if self.ids != DepthIds::None {
                pass.set_bind_group(1, &groups.triangles, &[]);
            }
            if let Some(runs) = target.chosen.as_ref().filter(|_| self.ids == DepthIds::Triangle) {
                let make = || ChosenPipeline::new(device, &self.bindings, self.cull);
                let chosen = self.chosen.get_or_insert_with(make);
                pass.set_bind_group(0, &chosen.group(device, index, view, runs), &[]);
                pass.set_pipeline(&chosen.pipeline);
                pass.draw_indirect(runs.arguments, runs.arguments_offset);
                pass.set_bind_group(0, &view_group, &[]);
            } else {
                draw_solid(&mut pass, scene, &draws.solid, self.ids, &self.solid);
            }
            let Some(cutouts) = &groups.cutouts else { continue };
            pass.set_pipeline(&self.cutout);
            pass.set_bind_group(1, &groups.triangles, &[]);
            pass.set_bind_group(2, cutouts, &[]);
            for (range, id) in &draws.masked {
                pass.draw(3 * range.start..3 * range.end, *id..id + 1);
            }
        }
    }
}

/// Draws `solid`, indexed where nobody asks for ids.
fn draw_solid(
    pass: &mut wgpu::RenderPass<'_>,
    scene: &GpuScene<'_>,
    solid: &[(Range<u32>, u32)],
    ids: DepthIds,
    pipeline: &wgpu::RenderPipeline,
) {
    pass.set_pipeline(pipeline);
    if ids == DepthIds::None {
        pass.set_vertex_buffer(0, scene.positions.slice(..));
        pass.set_index_buffer(scene.triangles.slice(..), wgpu::IndexFormat::Uint32);
    }
    for (range, id) in solid {
        let vertices = 3 * range.start..3 * range.end;
        if ids == DepthIds::None {
            pass.draw_indexed(vertices, 0, 0..1);
        } else {
            pass.draw(vertices, *id..id + 1);
        }
    }
}

/// Draw calls: triangles, and the object that they are drawn as.
#[derive(Debug, Default)]
struct Draws {
    solid: Vec<(Range<u32>, u32)>,
    masked: Vec<(Range<u32>, u32)>,
}

/// The casters of `scene` within `filter`. Solid ones that follow one another are drawn at once where nobody asks which
/// object they are.
fn draws(
    scene: &GpuScene<'_>,
    filter: Option<&[Range<u32>]>,
    ids: DepthIds,
    is_masked: impl Fn(u32) -> bool,
) -> Draws {
    let mut casters: Vec<(Range<u32>, u32)> = scene
        .objects
        .iter()
        .zip(0..)
        .filter(|(object, _)| object.flags.casts && !object.triangles.is_empty())
        .map(|(object, id)| (object.triangles.clone(), id))
        .collect();
    casters.sort_unstable_by_key(|(triangles, _)| triangles.start);
    let everything = 0..u32::MAX;
    let mut draws = Draws::default();
    for range in filter.unwrap_or(std::slice::from_ref(&everything)) {
        let first = casters.partition_point(|(triangles, _)| triangles.end <= range.start);
        for (triangles, id) in casters[first..].iter().take_while(|(t, _)| t.start < range.end) {
            let part = triangles.start.max(range.start)..triangles.end.min(range.end);
            if part.is_empty() {
                continue;
            }
            if is_masked(*id) {
                draws.masked.push((part, *id));
                continue;
            }
            match draws.solid.last_mut() {
                Some((last, _)) if ids != DepthIds::Object && last.end == part.start => last.end = part.end,
                _ => draws.solid.push((part, *id)),
            }
        }
    }
    draws
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_follows_is_drawn_at_once_unless_objects_are_asked_for() {
        let Some(gpu) = crate::gpu::testing::gpu() else { return };
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 12,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        let object = |triangles: Range<u32>, casts| crate::gpu::GpuObject {
            triangles,
            bounds: crate::geometry::Aabb::EMPTY,
            flags: crate::geometry::ObjectFlags { casts, ..Default::default() },
            has_mask: false,
        };
        // In any order, one that does not cast, one empty.
        let objects = [
            object(6..9, true),
            object(0..4, true),
            object(4..6, true),
            object(9..9, true),
            object(9..12, false),
        ];
        let scene = GpuScene {
            positions: &buffer,
            triangles: &buffer,
            objects: &objects,
            bounds: crate::geometry::Aabb::EMPTY,
            cutouts: None,
            geometry: None,
        };
        let solid = |filter: Option<&[Range<u32>]>, ids, masked: u32| {
            let draws = draws(&scene, filter, ids, |id| id == masked);
            (draws.solid, draws.masked)
        };
        assert_eq!(solid(None, DepthIds::Triangle, 9), (vec![(0..9, 1)], vec![]));
        assert_eq!(solid(None, DepthIds::Object, 9), (vec![(0..4, 1), (4..6, 2), (6..9, 0)], vec![]));
        assert_eq!(solid(None, DepthIds::None, 2), (vec![(0..4, 1), (6..9, 0)], vec![(4..6, 2)]));
        let some = [2..5, 8..40];
        assert_eq!(solid(Some(&some), DepthIds::Triangle, 9), (vec![(2..5, 1), (8..9, 0)], vec![]));
    }
}
