//! The G-buffer pass: what the camera sees, into textures.
//!
//! The position is kept as the distance along the view direction, in f32, and not as a position or a hardware
//! depth: with the pixel's ray it gives the position to a few ulps in 4 bytes, where a reversed depth that is
//! interpolated along a large triangle loses digits with distance.

use glam::Vec4;

use super::held::{HeldBuffer, HeldGroup, binding};
use super::layout::CameraUniform;
use super::pipeline::{RenderPipelineParts, render_pipeline, shader_module};
use super::scene::SceneBindings;
use super::{GpuScene, Recorder, shaders};
use crate::{Camera, GBuffer};

/// What the camera sees, in the caller's textures, all of the same size.
///
/// A renderer with its own depth pre-pass writes these beside its own targets, from a fragment shader of its
/// own, or lets [`GBufferPass`] draw them.
#[derive(Clone, Copy, Debug)]
pub struct GpuGBuffer<'a> {
    /// Pixels a row and rows.
    pub size: [u32; 2],
    /// `Depth32Float`, reversed Z by [`Camera::projection_from_view`]; 0 where nothing is seen. For depth tests.
    pub depth: &'a wgpu::TextureView,
    /// `Rgba32Float`: unit geometric normal in world space, turned to the camera, and in w the distance along the
    /// view direction; w = 0 where nothing is seen.
    pub surface: &'a wgpu::TextureView,
    /// `R32Uint`: object id; [`GBuffer::NOTHING`] where nothing is seen.
    pub object: &'a wgpu::TextureView,
    /// How far surfaces are lifted along their normals before they are asked, in scene units: what the roundings of coordinates
    /// may have put them below ([`Origin::lift`](crate::Origin::lift)). Techniques need none; 0 unless coordinates
    /// were rounded far from zero and then counted from elsewhere.
    pub lift: f32,
}

/// Textures for [`GBufferPass`], with usages to render to, to bind and to read back.
#[derive(Debug)]
pub struct GBufferTargets {
    /// See [`GpuGBuffer::depth`].
    pub depth: wgpu::Texture,
    /// See [`GpuGBuffer::surface`].
    pub surface: wgpu::Texture,
    /// See [`GpuGBuffer::object`].
    pub object: wgpu::Texture,
    /// `R32Uint`: triangle, as an index into [`Scene::triangles`](crate::Scene::triangles).
    pub triangle: wgpu::Texture,
    views: [wgpu::TextureView; 4],
}

impl GBufferTargets {
    /// Format of [`GpuGBuffer::depth`].
    pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
    /// Format of [`GpuGBuffer::surface`].
    pub const SURFACE: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
    /// Format of the ids.
    pub const ID: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;

    /// Textures of `width` × `height` pixels, each at least 1.
    pub fn new(device: &wgpu::Device, width: u32, height: u32) -> Self {
        let texture = |label, format| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: width.max(1), height: height.max(1), depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_DST
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let textures = [
            texture("G-buffer depth", Self::DEPTH),
            texture("G-buffer surface", Self::SURFACE),
            texture("G-buffer object", Self::ID),
            texture("G-buffer triangle", Self::ID),
        ];
        let views = textures.each_ref().map(|texture| texture.create_view(&Default::default()));
        let [depth, surface, object, triangle] = textures;
        Self { depth, surface, object, triangle, views }
    }

    /// Copies a G-buffer of the same size to [`surface`](Self::surface), [`object`](Self::object) and
    /// [`triangle`](Self::triangle), so that a technique is asked about the very same surfaces on both backends. Positions
    /// are kept as view depths, hence rounded anew. Depth cannot be copied and is left alone.
    pub fn upload(&self, queue: &wgpu::Queue, gbuffer: &GBuffer) {
        let surface: Vec<Vec4> = (0..gbuffer.pixel_count())
            .map(|pixel| {
                let seen = gbuffer.is_seen(pixel);
                if seen { gbuffer.normal[pixel].extend(gbuffer.depth[pixel]) } else { Vec4::ZERO }
            })
            .collect();
        for (texture, bytes) in [
            (&self.surface, bytemuck::cast_slice(&surface)),
            (&self.object, bytemuck::cast_slice(&gbuffer.object)),
            (&self.triangle, bytemuck::cast_slice(&gbuffer.triangle)),
        ] {
            let size = texture.size();
            let bytes: &[u8] = bytes;
            if bytes.is_empty() {
                continue;
            }
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(bytes.len() as u32 / gbuffer.height.max(1)),
                rows_per_image: None,
            };
            queue.write_texture(texture.as_image_copy(), bytes, layout, size);
        }
    }

    /// What techniques are given.
    pub fn view(&self) -> GpuGBuffer<'_> {
        let [depth, surface, object, _] = &self.views;
        GpuGBuffer { size: [self.surface.width(), self.surface.height()], depth, surface, object, lift: 0.0 }
    }
}

/// Draws G-buffers: its pipelines, kept from frame to frame.
#[derive(Debug)]
pub struct GBufferPass {
    camera: HeldBuffer,
    camera_group: HeldGroup,
    bindings: SceneBindings,
    solid: wgpu::RenderPipeline,
    cutout: wgpu::RenderPipeline,
}

impl GBufferPass {
    /// Makes the pipelines.
    pub fn new(device: &wgpu::Device) -> Self {
        let module = shader_module(device, "gbuffer_pass", shaders::GBUFFER_PASS);
        let stages = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let camera_group = HeldGroup::new(device, "camera", stages, &[binding::UNIFORM]);
        let camera_layout = camera_group.layout();
        let bindings = SceneBindings::new(device, stages);
        let targets = [GBufferTargets::SURFACE, GBufferTargets::ID, GBufferTargets::ID];
        let pipeline = |vertex, fragment, groups: &[&wgpu::BindGroupLayout]| {
            render_pipeline(
                device,
                &RenderPipelineParts {
                    label: "G-buffer",
                    module: &module,
                    vertex,
                    fragment: Some(fragment),
                    groups,
                    vertex_buffers: &[],
                    targets: &targets,
                    cull: None,
                },
            )
        };
        let (triangles, cutouts) = (&bindings.triangles_layout, &bindings.cutouts_layout);
        let solid = pipeline("solid_vertex", "solid_fragment", &[camera_layout, triangles]);
        let cutout = pipeline("cutout_vertex", "cutout_fragment", &[camera_layout, triangles, cutouts]);
        Self { camera: HeldBuffer::uniform("camera"), camera_group, bindings, solid, cutout }
    }

    /// Records the pass: all objects of `scene`, casters or not, as `camera` sees them. `stage` is the name under
    /// which it is timed. The targets are cleared first; they should have the camera's size.
    pub fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        scene: &GpuScene<'_>,
        camera: &Camera,
        targets: &GBufferTargets,
    ) {
        let uniform = self.camera.get(recorder.device, bytemuck::bytes_of(&CameraUniform::new(camera)));
        let camera_group = self.camera_group.get(recorder.device, &[uniform.into()]);
        let groups = self.bindings.groups(recorder.device, scene);
        let span = recorder.stage(stage);
        let [depth, surface, object, triangle] = &targets.views;
        let color = |view, r: f64| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g: 0.0, b: 0.0, a: 0.0 }),
                    store: wgpu::StoreOp::Store,
                },
            })
        };
        let nothing = f64::from(GBuffer::NOTHING);
        let mut pass = recorder.encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("G-buffer"),
            color_attachments: &[color(surface, 0.0), color(object, nothing), color(triangle, nothing)],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: span.render(),
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_bind_group(0, &camera_group, &[]);
        pass.set_bind_group(1, &groups.triangles, &[]);
        for has_mask in [false, true] {
            match (&groups.cutouts, has_mask) {
                (_, false) => pass.set_pipeline(&self.solid),
                (Some(cutouts), true) => {
                    pass.set_pipeline(&self.cutout);
                    pass.set_bind_group(2, cutouts, &[]);
                }
                // Without masks to read, objects that claim one are drawn whole.
                (None, true) => pass.set_pipeline(&self.solid),
            }
            for (object, id) in scene.objects.iter().zip(0..).filter(|(o, _)| o.has_mask == has_mask) {
                pass.draw(3 * object.triangles.start..3 * object.triangles.end, id..id + 1);
            }
        }
    }
}
