//! Shadows in a wgpu frame that is not Gnomon's: a device with default limits and no features, a depth pre-pass and a
//! lighting pass with shaders of their own. Between the two the technique records its own passes into the same encoder;
//! the frame is one submission.
//!
//! `cargo run --release --example plain_wgpu_frame -- frame.png`

use std::error::Error;

use glam::{Mat4, Vec3};
use gnomon_shadow_map::ShadowMapParams;
use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use scene_core::geometry::Aabb;
use scene_core::gpu::{GpuGBuffer, GpuObject, GpuScene, GpuShadowQuery, Recorder};
use scene_core::{Camera, Light};
use wgpu::util::DeviceExt as _;

/// Boxes, each an object: the ground first.
pub(crate) const BOXES: [Aabb; 5] = [
    Aabb { min: Vec3::new(-6.0, -0.5, -6.0), max: Vec3::new(6.0, 0.0, 6.0) },
    Aabb { min: Vec3::new(-1.6, 0.0, -0.4), max: Vec3::new(-0.8, 2.2, 0.4) },
    Aabb { min: Vec3::new(0.8, 0.0, -0.4), max: Vec3::new(1.6, 2.2, 0.4) },
    Aabb { min: Vec3::new(-2.0, 2.2, -0.6), max: Vec3::new(2.0, 2.6, 0.6) },
    Aabb { min: Vec3::new(-0.3, 0.0, 1.0), max: Vec3::new(0.3, 0.6, 1.6) },
];

/// The lamp, above and to the left.
pub(crate) const LAMP: Vec3 = Vec3::new(-3.0, 6.0, 4.0);

/// The camera: reversed Z, infinite far plane.
pub(crate) const CAMERA: Camera = Camera {
    eye: Vec3::new(3.5, 3.2, 6.5),
    target: Vec3::new(0.0, 0.8, 0.0),
    up: Vec3::Y,
    fov_y: 0.75,
    near: 0.1,
    far: f32::INFINITY,
    width: 480,
    height: 320,
};

/// What the lighting pass leaves of a surface in full shadow.
pub(crate) const AMBIENT: f32 = 0.25;

const SURFACE: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
const OBJECT: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
const VISIBILITY: wgpu::TextureFormat = wgpu::TextureFormat::R8Unorm;
const PICTURE: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// The renderer's own shaders.
const SHADERS: &str = "
struct Frame { clip_from_world: mat4x4f, eye: vec3f, forward: vec3f, lamp: vec3f, ambient: f32 }
@group(0) @binding(0) var<uniform> frame: Frame;

struct Vertex {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) @interpolate(flat) object: u32,
}

@vertex
fn prepass_vertex(@location(0) position: vec3f, @location(1) normal: vec3f, @location(2) object: u32) -> Vertex {
    return Vertex(frame.clip_from_world * vec4f(position, 1.0), position, normal, object);
}

struct Surface { @location(0) normal_and_depth: vec4f, @location(1) object: u32 }

// What techniques want to know of a pixel: unit normal turned to the camera, distance along the view direction, object.
@fragment
fn prepass_fragment(vertex: Vertex) -> Surface {
    let to_eye = frame.eye - vertex.position;
    let normal = select(-vertex.normal, vertex.normal, dot(vertex.normal, to_eye) > 0.0);
    return Surface(vec4f(normal, dot(frame.forward, -to_eye)), vertex.object);
}

@group(0) @binding(1) var surfaces: texture_2d<f32>;
@group(0) @binding(2) var visibilities: texture_2d<f32>;
@group(0) @binding(3) var objects: texture_2d<u32>;

@vertex
fn light_vertex(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    return vec4f(vec2f(f32(vertex / 2u), f32(vertex % 2u)) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn light_fragment(@builtin(position) fragment: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(fragment.xy);
    let surface = textureLoad(surfaces, pixel, 0);
    if surface.w == 0.0 {
        return vec4f(0.35, 0.55, 0.8, 1.0);
    }
    let hue = f32(textureLoad(objects, pixel, 0).x);
    let albedo = vec3f(0.8) + 0.15 * cos(vec3f(0.0, 2.1, 4.2) + hue);
    // Parallel enough for a picture: what the visibility multiplies is the renderer's own business.
    let cosine = max(dot(surface.xyz, normalize(frame.lamp)), 0.0);
    let visibility = textureLoad(visibilities, pixel, 0).x;
    return vec4f(albedo * (frame.ambient + (1.0 - frame.ambient) * cosine * visibility), 1.0);
}
";

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Frame {
    clip_from_world: Mat4,
    eye: Vec3,
    padding: f32,
    forward: Vec3,
    padding_2: f32,
    lamp: Vec3,
    ambient: f32,
}

/// The renderer's meshes: tightly packed positions and indices are what techniques read, the rest is its own.
struct Meshes {
    positions: wgpu::Buffer,
    normals: wgpu::Buffer,
    ids: wgpu::Buffer,
    triangles: wgpu::Buffer,
    objects: Vec<GpuObject>,
}

impl Meshes {
    fn new(device: &wgpu::Device) -> Self {
        let (mut positions, mut normals, mut ids) = (Vec::new(), Vec::new(), Vec::new());
        let (mut triangles, mut objects) = (Vec::<[u32; 3]>::new(), Vec::new());
        for (id, bounds) in (0u32..).zip(BOXES) {
            let first = triangles.len() as u32;
            for axis in 0..3 {
                for side in [bounds.min, bounds.max] {
                    let corner = positions.len() as u32;
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    for (at_u, at_v) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                        let mut position = side;
                        position[u] = [bounds.min, bounds.max][at_u][u];
                        position[v] = [bounds.min, bounds.max][at_v][v];
                        positions.push(position);
                        normals.push(Vec3::AXES[axis] * (side[axis] - bounds.center()[axis]).signum());
                        ids.push(id);
                    }
                    triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i| corner + i)));
                }
            }
            objects.push(GpuObject {
                triangles: first..triangles.len() as u32,
                bounds,
                flags: Default::default(),
                has_mask: false,
            });
        }
        let buffer = |contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents, usage })
        };
        let (vertex, storage) = (wgpu::BufferUsages::VERTEX, wgpu::BufferUsages::STORAGE);
        Self {
            positions: buffer(bytemuck::cast_slice(&positions), vertex | storage),
            normals: buffer(bytemuck::cast_slice(&normals), vertex),
            ids: buffer(bytemuck::cast_slice(&ids), vertex),
            triangles: buffer(bytemuck::cast_slice(&triangles), wgpu::BufferUsages::INDEX | storage),
            objects,
        }
    }

    fn as_scene(&self) -> GpuScene<'_> {
        GpuScene {
            positions: &self.positions,
            triangles: &self.triangles,
            objects: &self.objects,
            bounds: BOXES.into_iter().fold(Aabb::EMPTY, Aabb::union),
            cutouts: None,
            // The renderer keeps no copy in memory; techniques that need none take the bounds of objects.
            geometry: None,
        }
    }
}

/// The frame's textures.
struct Targets {
    depth: wgpu::TextureView,
    surface: wgpu::TextureView,
    object: wgpu::TextureView,
    visibility: wgpu::TextureView,
    picture: wgpu::Texture,
}

impl Targets {
    fn new(device: &wgpu::Device) -> Self {
        let texture = |format, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d { width: CAMERA.width, height: CAMERA.height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            })
        };
        let bound =
            |format| texture(format, wgpu::TextureUsages::TEXTURE_BINDING).create_view(&Default::default());
        Self {
            depth: bound(DEPTH),
            surface: bound(SURFACE),
            object: bound(OBJECT),
            visibility: bound(VISIBILITY),
            picture: texture(PICTURE, wgpu::TextureUsages::COPY_SRC),
        }
    }
}

/// The renderer's two pipelines.
struct Renderer {
    prepass: wgpu::RenderPipeline,
    lighting: wgpu::RenderPipeline,
}

impl Renderer {
    fn new(device: &wgpu::Device) -> Self {
        let source = wgpu::ShaderSource::Wgsl(SHADERS.into());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
        let vertex = |stride, attributes| {
            let step_mode = wgpu::VertexStepMode::Vertex;
            Some(wgpu::VertexBufferLayout { array_stride: stride, step_mode, attributes })
        };
        let pipeline = |entries: [&str; 2], buffers: &[_], targets: &[wgpu::TextureFormat], depth_stencil| {
            let targets: Vec<_> = targets.iter().map(|&format| Some(format.into())).collect();
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: None,
                layout: None,
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(entries[0]),
                    compilation_options: Default::default(),
                    buffers,
                },
                primitive: Default::default(),
                depth_stencil,
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(entries[1]),
                    compilation_options: Default::default(),
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let depth = wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        };
        let buffers = [
            vertex(12, &wgpu::vertex_attr_array![0 => Float32x3]),
            vertex(12, &wgpu::vertex_attr_array![1 => Float32x3]),
            vertex(4, &wgpu::vertex_attr_array![2 => Uint32]),
        ];
        let prepass = ["prepass_vertex", "prepass_fragment"];
        Self {
            prepass: pipeline(prepass, &buffers, &[SURFACE, OBJECT], Some(depth)),
            lighting: pipeline(["light_vertex", "light_fragment"], &[], &[PICTURE], None),
        }
    }
}

fn begin<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    colors: &[&wgpu::TextureView],
    depth: Option<&wgpu::TextureView>,
) -> wgpu::RenderPass<'e> {
    let ops =
        wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store };
    let color =
        |&view| Some(wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops });
    let colors: Vec<_> = colors.iter().map(color).collect();
    let depth = depth.map(|view| wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
        stencil_ops: None,
    });
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &colors,
        depth_stencil_attachment: depth,
        ..Default::default()
    })
}

/// Renders the frame; RGBA, row by row from the top.
///
/// # Errors
/// If there is no GPU.
pub(crate) fn render() -> Result<image::RgbaImage, Box<dyn Error>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&Default::default()))?;
    let (meshes, targets, renderer) = (Meshes::new(&device), Targets::new(&device), Renderer::new(&device));
    // Made once, kept from frame to frame.
    let mut shadows = ShadowMapOnGpu::new(&device, ShadowMapParams::default(), VISIBILITY)?;

    let frame = Frame {
        clip_from_world: CAMERA.projection_from_world(),
        eye: CAMERA.eye,
        padding: 0.0,
        forward: (CAMERA.target - CAMERA.eye).normalize(),
        padding_2: 0.0,
        lamp: LAMP,
        ambient: AMBIENT,
    };
    let frame = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: bytemuck::bytes_of(&frame),
        usage: wgpu::BufferUsages::UNIFORM,
    });
    let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
    let group = |pipeline: &wgpu::RenderPipeline, entries: &[wgpu::BindGroupEntry<'_>]| {
        let layout = &pipeline.get_bind_group_layout(0);
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries })
    };
    let prepass_group = group(&renderer.prepass, &[entry(0, frame.as_entire_binding())]);
    let lighting_group = group(
        &renderer.lighting,
        &[
            entry(0, frame.as_entire_binding()),
            entry(1, wgpu::BindingResource::TextureView(&targets.surface)),
            entry(2, wgpu::BindingResource::TextureView(&targets.visibility)),
            entry(3, wgpu::BindingResource::TextureView(&targets.object)),
        ],
    );

    let mut encoder = device.create_command_encoder(&Default::default());
    {
        let mut pass = begin(&mut encoder, &[&targets.surface, &targets.object], Some(&targets.depth));
        pass.set_pipeline(&renderer.prepass);
        pass.set_bind_group(0, &prepass_group, &[]);
        for (slot, buffer) in (0..).zip([&meshes.positions, &meshes.normals, &meshes.ids]) {
            pass.set_vertex_buffer(slot, buffer.slice(..));
        }
        pass.set_index_buffer(meshes.triangles.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..3 * meshes.as_scene().triangle_count(), 0, 0..1);
    }

    // The technique: maps of the lamp, then V of every pixel.
    let lamp = Light::Point { position: LAMP };
    let mut recorder = Recorder::new(&device, &queue, &mut encoder);
    let query = GpuShadowQuery { scene: meshes.as_scene(), light: &lamp, camera: &CAMERA };
    shadows.prepare(&mut recorder, &query)?;
    let gbuffer = GpuGBuffer {
        size: [CAMERA.width, CAMERA.height],
        depth: &targets.depth,
        surface: &targets.surface,
        object: &targets.object,
        lift: 0.0,
    };
    shadows.shade(&mut recorder, &CAMERA, &gbuffer, &targets.visibility)?;

    {
        let picture = targets.picture.create_view(&Default::default());
        let mut pass = begin(&mut encoder, &[&picture], None);
        pass.set_pipeline(&renderer.lighting);
        pass.set_bind_group(0, &lighting_group, &[]);
        pass.draw(0..3, 0..1);
    }
    read_back(&device, &queue, encoder, &targets.picture)
}

/// Submits the frame and copies its picture to memory. Only for there is no window.
fn read_back(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    mut encoder: wgpu::CommandEncoder,
    picture: &wgpu::Texture,
) -> Result<image::RgbaImage, Box<dyn Error>> {
    let row = (4 * CAMERA.width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let staging = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row * CAMERA.height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    let to = wgpu::TexelCopyBufferInfo { buffer: &staging, layout };
    encoder.copy_texture_to_buffer(picture.as_image_copy(), to, picture.size());
    queue.submit([encoder.finish()]);
    let (send, receive) = std::sync::mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, .., move |result| {
        let _ = send.send(result);
    });
    device.poll(wgpu::PollType::wait_indefinitely())?;
    receive.recv()??;
    let bytes = staging.get_mapped_range(..)?;
    let rows = bytes.chunks(row as usize).flat_map(|padded| &padded[..4 * CAMERA.width as usize]);
    image::RgbaImage::from_raw(CAMERA.width, CAMERA.height, rows.copied().collect())
        .ok_or_else(|| "a picture of another size".into())
}

#[allow(dead_code, reason = "a test includes this file for `render`")]
fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "frame.png".to_owned());
    render()?.save(&path)?;
    println!("wrote {path}");
    Ok(())
}
