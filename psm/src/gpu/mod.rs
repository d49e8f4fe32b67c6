//! The GPU path: the stages of [`cpu`](crate::cpu) and [`views`](crate::views) under the same names, recorded into the caller's
//! encoder.
//!
//! `prepare.images` is the CPU's own code: what does not depend on what is seen. All else is recorded when it shades, since it
//! depends on the G-buffer, and nothing of it is read back, so nothing waits:
//!
//! | stage | pass | what it writes |
//! | --- | --- | --- |
//! | `prepare.receivers` | `see`, a workgroup a tile | nearest, farthest and a typical receiver of each tile |
//! | `prepare.views` | `choose`, a workgroup an image of the light | the parametrisation |
//! | | `fit`, a workgroup a tile | its window around the tile's receivers, where that may reach beyond the others' |
//! | | `write_views`, a workgroup an image | the projection, in a buffer that the depth pass draws by |
//! | `prepare.maps` | the depth pass | the nearest triangle a texel |
//! | `shade.lookup` | full screen | V |
//!
//! All casters are drawn, since nobody on the CPU knows what a map covers: that costs time and changes no pixel.
//!
//! Positions are relative to the eye. V differs from the CPU's where the hardware's rasteriser gives a texel on a
//! caster's outline to the other side of it, or a receiver on the border of two texels to the other one: forms are f32 here
//! and f64 there.

pub mod layout;
pub mod shaders;

use std::ops::Range;

use gnomon_shadow_map::receiver_plane::plane_tolerance;
use scene_core::geometry::Aabb;
use scene_core::gpu::{
    Bound, DepthIds, DepthLayers, DepthPass, DepthTarget, GpuCutouts, GpuError, GpuGBuffer, GpuObject,
    GpuScene, GpuShadowQuery, HeldBuffer, HeldGroup, Receivers, Recorder, SceneBindings, SceneGroups,
    VisibilityPass, VisibilityPassParts, WrittenProjection, binding,
};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Report, relevance};

use crate::PsmParams;
use crate::seen::TileGrid;
use crate::view_frame::ViewFrame;
use crate::views::Images;
use layout::{CHOICE_BYTES, FIT_BYTES, FrameUniform, ImageUniform, PROJECTION_STRIDE, TILE_BYTES, ViewOnGpu};

/// The technique on one device: pipelines, and the light prepared last.
#[derive(Debug)]
pub struct PsmOnGpu {
    params: PsmParams,
    passes: Passes,
    frame: HeldBuffer,
    images: HeldBuffer,
    written: Written,
    making: HeldGroup,
    own: HeldGroup,
    depth: DepthPass,
    layers: DepthLayers,
    scene: SceneBindings,
    receivers: Receivers,
    lookup: VisibilityPass,
    prepared: Option<Prepared>,
}

/// The compute pipelines, in the order in which they run.
#[derive(Debug)]
struct Passes {
    see: wgpu::ComputePipeline,
    choose: wgpu::ComputePipeline,
    fit: wgpu::ComputePipeline,
    write_views: wgpu::ComputePipeline,
}

impl Passes {
    fn new(device: &wgpu::Device, own: &wgpu::BindGroupLayout, receivers: &wgpu::BindGroupLayout) -> Self {
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("psm"),
            bind_group_layouts: &[Some(own), None, None, Some(receivers)],
            immediate_size: 0,
        });
        let pipeline = |wgsl: &str, entry| {
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(entry),
                source: wgpu::ShaderSource::Wgsl(wgsl.into()),
            });
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        Self {
            see: pipeline(shaders::SEEN, "see"),
            choose: pipeline(shaders::CHOICE, "choose"),
            fit: pipeline(shaders::SEEN, "fit"),
            write_views: pipeline(shaders::VIEWS, "write_views"),
        }
    }
}

/// Buffers that passes write for one another, made anew when they must be larger.
#[derive(Debug, Default)]
struct Written {
    tiles: Option<wgpu::Buffer>,
    choices: Option<wgpu::Buffer>,
    fits: Option<wgpu::Buffer>,
    views: Option<wgpu::Buffer>,
    projections: Option<wgpu::Buffer>,
}

fn sized(
    held: &mut Option<wgpu::Buffer>,
    device: &wgpu::Device,
    label: &'static str,
    size: u64,
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    if let Some(buffer) = held.as_ref().filter(|buffer| buffer.size() >= size) {
        return buffer.clone();
    }
    let usage = usage | wgpu::BufferUsages::STORAGE;
    let descriptor =
        wgpu::BufferDescriptor { label: Some(label), size: size.max(256), usage, mapped_at_creation: false };
    let buffer = device.create_buffer(&descriptor);
    *held = Some(buffer.clone());
    buffer
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    images: Images,
    tolerance: f32,
    /// Ranges of triangles that are drawn.
    casters: Vec<Range<u32>>,
    scene: SceneGroups,
    drawn: Drawn,
}

/// The caller's scene: handles of its buffers.
#[derive(Debug)]
struct Drawn {
    positions: wgpu::Buffer,
    triangles: wgpu::Buffer,
    objects: Vec<GpuObject>,
    bounds: Aabb,
    cutouts: Option<[wgpu::Buffer; 2]>,
}

impl Drawn {
    fn new(scene: &GpuScene<'_>) -> Self {
        Self {
            positions: scene.positions.clone(),
            triangles: scene.triangles.clone(),
            objects: scene.objects.to_vec(),
            bounds: scene.bounds,
            cutouts: scene.cutouts.map(|cutouts| [cutouts.uvs.clone(), cutouts.masks.clone()]),
        }
    }

    fn scene(&self) -> GpuScene<'_> {
        GpuScene {
            positions: &self.positions,
            triangles: &self.triangles,
            objects: &self.objects,
            bounds: self.bounds,
            cutouts: self.cutouts.as_ref().map(|[uvs, masks]| GpuCutouts { uvs, masks }),
            geometry: None,
        }
    }
}

impl PsmOnGpu {
    /// Makes the pipelines. `visibility` is the format of the texture that V is written to.
    ///
    /// # Errors
    /// A `map_size` that the device has no texture of.
    pub fn new(
        device: &wgpu::Device,
        params: PsmParams,
        visibility: wgpu::TextureFormat,
    ) -> Result<Self, TechniqueError> {
        let limit = device.limits().max_texture_dimension_2d;
        GpuError::within("texels a side of a map", params.map_size, limit)?;
        let written = [binding::STORAGE_WRITE; 5];
        let types: Vec<_> = [binding::UNIFORM, binding::STORAGE].into_iter().chain(written).collect();
        let making = HeldGroup::new(device, "psm", wgpu::ShaderStages::COMPUTE, &types);
        let stages = wgpu::ShaderStages::FRAGMENT;
        let types = [binding::UNIFORM, binding::STORAGE, binding::ID_LAYERS];
        let own = HeldGroup::new(device, "perspective shadow maps", stages, &types);
        let scene = SceneBindings::new(device, stages);
        let receivers = Receivers::new(device);
        let lookup = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "psm",
                wgsl: shaders::LOOKUP,
                fragment: "shade_psm",
                own: own.layout(),
                scene: &scene,
                receivers: &receivers,
                format: visibility,
            },
        );
        Ok(Self {
            params,
            passes: Passes::new(device, making.layout(), receivers.layout()),
            frame: HeldBuffer::uniform("frame"),
            images: HeldBuffer::storage("images of the light"),
            written: Written::default(),
            making,
            own,
            depth: DepthPass::new(device, DepthIds::Triangle, None),
            layers: DepthLayers::new(DepthIds::Triangle),
            scene,
            receivers,
            lookup,
            prepared: None,
        })
    }

    /// `prepare.images`: takes over light and scene. Records nothing; the maps are drawn when it shades.
    ///
    /// # Errors
    /// None today: what the device has not enough of is told by [`shade`](Self::shade).
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        let mut report = Report::default();
        let geometry = query.scene.geometry_or_boxes();
        let tolerance = plane_tolerance(geometry.bounds(), query.light);
        let (casters, images) = report.time("prepare.images", |_| {
            let casters = relevance::told_apart(&geometry, query.light, tolerance);
            let bounds = casters.drawn.iter().fold(Aabb::EMPTY, |sum, object| sum.union(object.bounds));
            (casters, Images::new(&geometry, query.light, query.camera, bounds))
        });
        report.skip("casters", casters.backdrops.len() as u64);
        let is_drawn = |id: usize| {
            let object = &geometry.objects()[id];
            !casters.backdrops.iter().any(|backdrop| std::ptr::eq(*backdrop, object))
        };
        let objects = query.scene.objects.iter().enumerate().filter(|(id, _)| is_drawn(*id));
        self.prepared = Some(Prepared {
            images,
            tolerance,
            casters: objects.map(|(_, object)| object.triangles.clone()).collect(),
            scene: self.scene.groups(recorder.device, &query.scene),
            drawn: Drawn::new(&query.scene),
        });
        self.receivers.prepare(recorder.device, query);
        Ok(report)
    }

    /// Records everything else: the maps for what `gbuffer` sees, and the pass that writes V of every pixel, 1 where nothing is
    /// seen.
    ///
    /// # Errors
    /// [`TechniqueError::NotPrepared`]; more maps or texels than the device has.
    pub fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        let not_prepared = || TechniqueError::NotPrepared { technique: PsmParams::TECHNIQUE };
        let prepared = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let device = recorder.device;
        let receivers = self.receivers.group(device, camera, gbuffer).ok_or_else(not_prepared)?;
        let count = prepared.images.images.len() as u64;
        self.layers.resize(device, self.params.map_size, count as u32)?;

        let grid = TileGrid::new(gbuffer.size[0], gbuffer.size[1]);
        let tiles = u64::from(grid.columns) * u64::from(grid.rows) * count;
        let frame = FrameUniform::new(&self.params, count as usize, grid, prepared.tolerance);
        let frame = self.frame.get(device, bytemuck::bytes_of(&frame));
        let images = ImageUniform::all(&prepared.images, &ViewFrame::new(camera));
        let images = self.images.get(device, bytemuck::cast_slice(&images));
        let (none, read) = (wgpu::BufferUsages::empty(), wgpu::BufferUsages::COPY_SRC);
        let Written { tiles: at_tiles, choices, fits, views, projections } = &mut self.written;
        let view_bytes = size_of::<ViewOnGpu>() as u64;
        let views = sized(views, device, "views", count * view_bytes, read);
        let uniform = wgpu::BufferUsages::UNIFORM;
        let projections = sized(projections, device, "projections", count * PROJECTION_STRIDE, uniform);
        let bound: [Bound; 7] = [
            frame.clone().into(),
            images.into(),
            sized(at_tiles, device, "tiles", tiles * TILE_BYTES, none).into(),
            sized(choices, device, "choices", count * CHOICE_BYTES, none).into(),
            sized(fits, device, "fits", tiles * FIT_BYTES, none).into(),
            views.clone().into(),
            projections.clone().into(),
        ];
        let making = self.making.get(device, &bound);
        let (of_tiles, of_images) = ([grid.columns, grid.rows, count as u32], [count as u32, 1, 1]);
        for (stage, pipeline, [x, y, z]) in [
            ("prepare.receivers", &self.passes.see, of_tiles),
            ("prepare.views", &self.passes.choose, of_images),
            ("prepare.views", &self.passes.fit, of_tiles),
            ("prepare.views", &self.passes.write_views, of_images),
        ] {
            let span = recorder.stage(stage);
            let mut pass = recorder.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(stage),
                timestamp_writes: span.compute(),
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &making, &[]);
            pass.set_bind_group(3, &receivers, &[]);
            pass.dispatch_workgroups(x, y, z);
        }

        let nowhere = std::iter::repeat_n(glam::Mat4::ZERO, count as usize);
        let targets = self.layers.targets(nowhere, Some(&prepared.casters));
        let targets: Vec<_> = (0..)
            .zip(targets)
            .map(|(index, target)| DepthTarget {
                written: Some(WrittenProjection { buffer: &projections, offset: index * PROJECTION_STRIDE }),
                ..target
            })
            .collect();
        self.depth.record(recorder, "prepare.maps", &prepared.drawn.scene(), &targets);

        let mut report = Report { bytes: self.layers.bytes(), ..Default::default() };
        let ids = self.layers.bound_ids().ok_or_else(not_prepared)?;
        let own = self.own.get(device, &[frame.into(), views.into(), ids]);
        self.lookup.record(recorder, "shade.lookup", &own, &prepared.scene, &receivers, visibility);
        report.bytes += tiles * (TILE_BYTES + FIT_BYTES);
        Ok(report)
    }

    /// The maps, one a layer, and the triangles they see; for tests and whoever else wants them.
    pub fn layers(&self) -> &DepthLayers {
        &self.layers
    }

    /// What the maps cover: a [`ViewOnGpu`] for each image of the light, once the frame was executed. `None` before
    /// [`shade`](Self::shade).
    pub fn views(&self) -> Option<&wgpu::Buffer> {
        self.written.views.as_ref()
    }
}
