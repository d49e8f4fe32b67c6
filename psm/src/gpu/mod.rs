//! The GPU path: the stages of [`cpu`](crate::cpu) and [`views`](crate::views) under the same names, recorded into the caller's
//! encoder.
//!
//! `prepare.images` is the CPU's own code: what does not depend on what is seen. All else is recorded when it shades, since it
//! depends on the G-buffer, and nothing of it is read back, so nothing waits:
//!
//! | stage | pass | what it writes |
//! | --- | --- | --- |
//! | `prepare.receivers` | `see`, a workgroup a tile | nearest, farthest and a typical receiver of each tile |
//! | `prepare.views` | `choose`, a workgroup an image of the light | the parametrisation, and a list of the tiles that may reach beyond its window |
//! | | `fit`, workgroups that share the list | a window around each one's receivers |
//! | | `write_views`, a workgroup an image | the projection, in a buffer that the depth pass draws by |
//! | `prepare.maps` | `choose_casters`, a workgroup an image | what is not wholly beside its map (module `casters`) |
//! | | the depth pass, and points over it (module `splats`) | the nearest triangle a texel |
//! | `shade.lookup` | full screen | V |
//!
//! Where lookups follow surfaces these are found once a scene (`prepare.surfaces`), from its geometry in memory. Without that, or where the
//! device binds less than their 16 bytes a triangle in one piece, receivers are compared with one texel.
//!
//! Nobody on the CPU knows what a map covers: what of the casters is drawn is chosen on the GPU, too, and each map is drawn by one
//! call whatever it holds, one more for points, and one for each object with a mask.
//!
//! Positions are relative to the eye. V differs from the CPU's where the hardware's rasteriser gives a texel on a
//! caster's outline to the other side of it, or a receiver on the border of two texels to the other one: forms are f32 here
//! and f64 there.

mod caster_tables;
mod casters;
pub mod layout;
pub mod shaders;
mod splats;

use gnomon_shadow_map::receiver_plane::plane_tolerance;
use scene_core::geometry::{SurfaceTriangle, Surfaces};
use scene_core::gpu::{
    Bound, ComputePass, DepthIds, DepthLayers, DepthPass, DepthTarget, GeometryBuffers, Gpu, GpuError,
    GpuGBuffer, GpuScene, GpuShadowQuery, HeldBuffer, HeldGroup, Receivers, Recorder, SceneBindings,
    SceneGroups, SceneHandles, VisibilityPass, VisibilityPassParts, WorkBuffer, WrittenProjection, binding,
    binding_limit, storage_buffer,
};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Report, Scene, relevance};

use crate::seen::TileGrid;
use crate::view_frame::ViewFrame;
use crate::views::Images;
use crate::{Lookup, PsmParams, lookup};
use casters::CasterChoice;
use layout::{
    BoxOnGpu, CHOICE_BYTES, FIT_BYTES, FITTERS, FrameUniform, ImageUniform, PROJECTION_STRIDE, TILE_BYTES,
    ViewOnGpu,
};

/// The technique on one device: pipelines, and the light prepared last.
#[derive(Debug)]
pub struct PsmOnGpu {
    params: PsmParams,
    passes: Passes,
    frame: HeldBuffer,
    images: HeldBuffer,
    boxes: HeldBuffer,
    written: Written,
    making: HeldGroup,
    own: HeldGroup,
    casters: CasterChoice,
    depth: DepthPass,
    layers: DepthLayers,
    scene: SceneBindings,
    receivers: Receivers,
    lookup: VisibilityPass,
    surfaces: Option<HeldSurfaces>,
    no_surfaces: HeldBuffer,
    prepared: Option<Prepared>,
    views: Option<wgpu::Buffer>,
}

/// The compute pipelines, in the order in which they run.
#[derive(Debug)]
struct Passes {
    see: ComputePass,
    choose: ComputePass,
    fit: ComputePass,
    write_views: ComputePass,
}

impl Passes {
    fn new(device: &wgpu::Device, own: &wgpu::BindGroupLayout, receivers: &wgpu::BindGroupLayout) -> Self {
        let pass = |label, wgsl| {
            ComputePass::new(device, label, wgsl, label, &[Some(own), None, None, Some(receivers)])
        };
        Self {
            see: pass("see", shaders::SEEN),
            choose: pass("choose", shaders::CHOICE),
            fit: pass("fit", shaders::SEEN),
            write_views: pass("write_views", shaders::VIEWS),
        }
    }
}

/// Buffers that passes write for one another.
#[derive(Debug)]
struct Written {
    tiles: WorkBuffer,
    choices: WorkBuffer,
    fits: WorkBuffer,
    views: WorkBuffer,
    projections: WorkBuffer,
}

/// The surfaces of a scene; `None` where they are more than the device binds.
#[derive(Debug)]
struct HeldSurfaces {
    /// What they were made from.
    made_for: GeometryBuffers,
    buffer: Option<wgpu::Buffer>,
}

impl HeldSurfaces {
    fn new(device: &wgpu::Device, scene: &GpuScene<'_>, geometry: &Scene) -> Self {
        let bytes = size_of::<SurfaceTriangle>() as u64 * geometry.triangles().len() as u64;
        let fits = bytes <= binding_limit(device);
        let surfaces = fits.then(|| Surfaces::new(geometry).ok()).flatten();
        let upload = |surfaces: &Surfaces| {
            storage_buffer(device, "surfaces", bytemuck::cast_slice(surfaces.triangles())).ok()
        };
        Self { made_for: GeometryBuffers::new(scene), buffer: surfaces.as_ref().and_then(upload) }
    }
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    images: Images,
    tolerance: f32,
    surfaces: Option<wgpu::Buffer>,
    scene: SceneGroups,
    drawn: SceneHandles,
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
        let types: Vec<_> = [binding::UNIFORM, binding::STORAGE]
            .into_iter()
            .chain(written)
            .chain([binding::STORAGE])
            .collect();
        let making = HeldGroup::new(device, "psm", wgpu::ShaderStages::COMPUTE, &types);
        let stages = wgpu::ShaderStages::FRAGMENT;
        let types = [binding::UNIFORM, binding::STORAGE, binding::ID_LAYERS, binding::STORAGE];
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
            boxes: HeldBuffer::storage("boxes of casters"),
            written: Written {
                tiles: WorkBuffer::new("tiles"),
                choices: WorkBuffer::new("choices"),
                fits: WorkBuffer::new("fits"),
                views: WorkBuffer::new("views"),
                projections: WorkBuffer::with_usage("projections", wgpu::BufferUsages::UNIFORM),
            },
            making,
            own,
            casters: CasterChoice::new(device, receivers.layout()),
            depth: DepthPass::new(device, DepthIds::Triangle, None),
            layers: DepthLayers::new(DepthIds::Triangle),
            scene,
            receivers,
            lookup,
            surfaces: None,
            no_surfaces: HeldBuffer::storage("no surfaces"),
            prepared: None,
            views: None,
        })
    }

    /// `prepare.images` and, once a scene, `prepare.surfaces`, `prepare.points` and `prepare.runs`: takes over light and scene. Records
    /// nothing; the maps are drawn when it shades.
    ///
    /// # Errors
    /// More casters than the device has memory for.
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        let mut report = Report::default();
        let geometry = query.scene.geometry_or_boxes();
        let tolerance = plane_tolerance(geometry.bounds(), query.light);
        let (casters, images) = report.time("prepare.images", |_| {
            // Boxes in the place of geometry are no solids.
            let has_solids = query.scene.geometry.is_some();
            let told_apart =
                if has_solids { relevance::told_apart_with_solids } else { relevance::told_apart };
            let casters = told_apart(&geometry, query.light, tolerance);
            let boxes = casters.drawn.iter().map(|object| object.bounds).collect();
            (casters, Images::new(&geometry, query.light, query.camera, boxes, self.params.variant))
        });
        report.skip("casters", casters.backdrops.len() as u64);
        let surfaces = self.surfaces_of(recorder.device, &query.scene, &mut report);
        report.bytes = surfaces.as_ref().map_or(0, wgpu::Buffer::size);
        let is_drawn = |id: u32| {
            let object = &geometry.objects()[id as usize];
            !casters.backdrops.iter().any(|backdrop| std::ptr::eq(*backdrop, object))
        };
        self.casters.prepare(recorder.device, &query.scene, is_drawn, &mut report)?;
        self.prepared = Some(Prepared {
            images,
            tolerance: lookup::tolerance(geometry.bounds(), query.light),
            surfaces,
            scene: self.scene.groups(recorder.device, &query.scene),
            drawn: SceneHandles::new(&query.scene),
        });
        self.receivers.prepare(recorder, query);
        Ok(report)
    }

    /// The surfaces of `scene`, kept from the last call if that had the same; `None` where lookups cannot or shall not follow them.
    fn surfaces_of(
        &mut self,
        device: &wgpu::Device,
        scene: &GpuScene<'_>,
        report: &mut Report,
    ) -> Option<wgpu::Buffer> {
        let geometry = scene.geometry.filter(|_| self.params.lookup == Lookup::Surface)?;
        let kept = self.surfaces.take().filter(|surfaces| surfaces.made_for.are_of(scene));
        let surfaces = kept.unwrap_or_else(|| {
            report.time("prepare.surfaces", |_| HeldSurfaces::new(device, scene, geometry))
        });
        self.surfaces.insert(surfaces).buffer.clone()
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
        let frame = FrameUniform::new(
            &self.params,
            count as usize,
            grid,
            prepared.tolerance,
            prepared.surfaces.is_some(),
        );
        let frame = self.frame.get(device, bytemuck::bytes_of(&frame));
        let view_frame = ViewFrame::new(camera);
        let boxes = BoxOnGpu::all(&prepared.images, &view_frame);
        let boxes = self.boxes.get(device, bytemuck::cast_slice(&boxes));
        let images = ImageUniform::all(&prepared.images, &view_frame);
        let images = self.images.get(device, bytemuck::cast_slice(&images));
        let Written { tiles: at_tiles, choices, fits, views, projections } = &mut self.written;
        let views = views.get(device, count * size_of::<ViewOnGpu>() as u64)?;
        let projections = projections.get(device, count * PROJECTION_STRIDE)?;
        let bound: [Bound; 8] = [
            frame.clone().into(),
            images.into(),
            at_tiles.get(device, tiles * TILE_BYTES)?.into(),
            choices.get(device, count * CHOICE_BYTES)?.into(),
            fits.get(device, tiles * FIT_BYTES)?.into(),
            views.clone().into(),
            projections.clone().into(),
            boxes.into(),
        ];
        let making = self.making.get(device, &bound);
        let groups = [Some(&making), None, None, Some(&receivers)];
        let (of_tiles, of_images) = ([grid.columns, grid.rows, count as u32], [count as u32, 1, 1]);
        let Passes { see, choose, fit, write_views } = &self.passes;
        see.record(recorder, "prepare.receivers", &groups, of_tiles);
        choose.record(recorder, "prepare.views", &groups, of_images);
        fit.record(recorder, "prepare.views", &groups, [FITTERS, 1, count as u32]);
        write_views.record(recorder, "prepare.views", &groups, of_images);

        let chosen = self.casters.choose(recorder, &self.params, (&views, count), &receivers)?;
        let chosen = chosen.ok_or_else(not_prepared)?;
        let nowhere = std::iter::repeat_n(glam::Mat4::ZERO, count as usize);
        let targets = self.layers.targets(nowhere, Some(&chosen.masked));
        let targets: Vec<_> = (0..)
            .zip(targets)
            .map(|(index, target)| DepthTarget {
                written: Some(WrittenProjection { buffer: &projections, offset: index * PROJECTION_STRIDE }),
                chosen: Some(chosen.triangles(index)),
                ..target
            })
            .collect();
        let scene = prepared.drawn.view();
        self.depth.record(recorder, "prepare.maps", &scene, &targets);
        self.casters.draw_points(recorder, &self.params, &chosen, &scene, &targets);

        let mut report = Report { bytes: self.layers.bytes(), ..Default::default() };
        let ids = self.layers.bound_ids().ok_or_else(not_prepared)?;
        let surfaces = prepared.surfaces.clone();
        let surfaces = surfaces.unwrap_or_else(|| self.no_surfaces.get(device, &[]));
        let own = self.own.get(device, &[frame.into(), views.clone().into(), ids, surfaces.into()]);
        self.lookup.record(recorder, "shade.lookup", &own, &prepared.scene, &receivers, visibility);
        report.bytes += tiles * (TILE_BYTES + FIT_BYTES);
        self.views = Some(views);
        Ok(report)
    }

    /// What the frame that was submitted last has drawn and left out of its maps. Waits for it.
    ///
    /// # Errors
    /// What reading it back meets.
    pub fn counted(&mut self, gpu: &Gpu) -> Result<Report, TechniqueError> {
        Ok(self.casters.counted(gpu)?)
    }

    /// The maps, one a layer, and the triangles they see; for tests and whoever else wants them.
    pub fn layers(&self) -> &DepthLayers {
        &self.layers
    }

    /// What the maps cover: a [`ViewOnGpu`] for each image of the light, once the frame was executed. `None` before
    /// [`shade`](Self::shade).
    pub fn views(&self) -> Option<&wgpu::Buffer> {
        self.views.as_ref()
    }
}
