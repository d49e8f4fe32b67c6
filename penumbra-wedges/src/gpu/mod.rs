//! The GPU path: the CPU's counting of edges in compute passes, recorded into the caller's encoder.
//!
//! | pass | what it does | twin |
//! | --- | --- | --- |
//! | `prepare.facing` | how each face lies to the light, once a triangle | [`edges::side_of`](crate::edges::side_of) |
//! | `prepare.silhouette` | edges that are silhouettes from some point of the light, or from its middle | [`Edges`](crate::edges::Edges) |
//! | `prepare.sides` | for `interpolated`: the side planes that neighbours share | [`Side`](crate::interpolated::Side) |
//! | `shade.blocks` | edges against blocks of 64 × 64 pixels | `cpu`'s strips |
//! | `shade.masks` | where there are masks, which tiles they may hide the light from | [`wedges`](crate::wedges) |
//! | `shade.wedges` | the rest against tiles of 8 × 8 pixels, and what is left drawn for each pixel | `cpu`, [`exact`](crate::exact), [`coverage`](crate::coverage), [`interpolated`](crate::interpolated) |
//! | `shade.asked` | for `exact`: pixels that this has left, in tiles with too many edges or too many of whose faces the light lies on both sides | [`exact`](crate::exact) |
//! | `shade.rays` | one exact ray for each pixel that was counted | [`Bvh`](scene_core::bvh::Bvh) |
//! | `shade.traced` | rays to all samples of pixels that were not | [`Exact::traced`](crate::exact::Exact::traced) |
//! | `shade.write` | V | |
//!
//! # Tiles, not stencils
//! The published way draws each wedge as a volume, and lets depth and stencil find the pixels inside, for which a fragment shader adds to
//! a buffer of light intensity. That buffer needs blending of floats or a format with a sign, in any order; every wedge is rasterised
//! over all that it covers; and depth complexity, one count for each of 256 samples, does not fit into a pixel. Here a tile
//! gathers the edges of all wedges it may lie in ([`shaft`](shaders): the planes that bound a wedge, asked from the receivers' end, which
//! needs nothing to be kept for an edge; the wedges of `interpolated`, which are wider, by their own planes), and sums over them in
//! registers, in integers: no order of edges changes a sum.
//!
//! `exact` counts four pixels of a tile at a time, a team of sixteen threads each. The faces that edges bound are the same for all pixels
//! of a tile, but for the few that have a pixel and the light on both sides of their plane: what is the same is found once, by f32 with a
//! bound, and the rest is asked from each pixel before it is counted, exactly. So the loop over pixels and edges draws and counts, and does
//! nothing else. Tiles that have no room for what pixels ask are left to `shade.asked`, whose loop asks all of it.
//!
//! # A limit of one driver
//! Mesa's software Vulkan ends all loops of an invocation after 65,535 rounds together. A tile whose block has millions of edges, or more
//! than some hundred thousand edges and samples to count, loses some there; no hardware does that. For sums of areas and shares a round takes four
//! edges: tiles at the horizon of the built-in street have some hundred thousand.
//!
//! # Exactness
//! What decides about topology, the facing of faces with the light on both sides, is asked exactly (`scene_core::predicates`). Places
//! on the light's plane are f32: an outline is off by some 10⁻⁶ of the light, and neighbours compare with the same numbers, as on
//! the CPU. Where half of the light hangs on a sign that the ray to the light's middle has to agree with, that is asked exactly, too: on which side
//! of the middle an edge passes. Pixels close to a flat light's plane, where f32 does not suffice, are traced.

pub mod layout;
mod passes;
pub mod shaders;
pub mod tables;

use scene_core::gpu::{
    Bound, GpuGBuffer, GpuShadowQuery, HeldBuffer, HeldGroup, Receivers, Recorder, SceneBindings,
    SceneGroups, WorkBuffer, binding, binding_limit, pieces,
};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Report};

use crate::cpu::{EDGES_A_RAY, TILE};
use crate::error::WedgeError;
use crate::params::{Variant, WedgeParams};
use layout::WedgesUniform;
use passes::{Pass, Passes};
use tables::{Tables, TablesError};

/// Bytes that the lists of edges of all blocks may take together. A block that has no room for its edges tells its
/// tiles to take all there are.
const LISTS: u64 = 64 << 20;

/// Words of `counters`.
const COUNTERS: u64 = 4;

/// Bytes of an edge with its faces.
const EDGE_BYTES: u64 = 16;

/// Pixels a side of a block.
const BLOCK: usize = 64;

/// The technique on one device: pipelines, and what the last `prepare` left.
#[derive(Debug)]
pub struct PenumbraWedgesOnGpu {
    params: WedgeParams,
    list_bytes: u64,
    tables: Option<Tables>,
    settings: HeldBuffer,
    facing: WorkBuffer,
    counters: WorkBuffer,
    candidates: WorkBuffer,
    variable: WorkBuffer,
    corners: WorkBuffer,
    sides: WorkBuffer,
    pixels: WorkBuffer,
    lists: WorkBuffer,
    no_masks: HeldBuffer,
    no_cutouts: HeldGroup,
    scene: SceneBindings,
    receivers: Receivers,
    passes: Passes,
    prepared: Option<Prepared>,
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    uniform: WedgesUniform,
    scene: SceneGroups,
    cutouts: wgpu::BindGroup,
}

impl PenumbraWedgesOnGpu {
    /// Makes the pipelines. `visibility` is the format of the texture that V is written to.
    pub fn new(device: &wgpu::Device, params: WedgeParams, visibility: wgpu::TextureFormat) -> Self {
        let stages = wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::COMPUTE;
        let scene = SceneBindings::new(device, stages);
        let receivers = Receivers::new(device);
        let passes = Passes::new(device, params.variant, &scene, &receivers, visibility);
        Self {
            params,
            list_bytes: LISTS,
            tables: None,
            settings: HeldBuffer::uniform("wedges"),
            facing: WorkBuffer::new("sides of faces"),
            counters: WorkBuffer::new("counters"),
            candidates: WorkBuffer::new("edges that count"),
            variable: WorkBuffer::new("faces on both sides of the light"),
            corners: WorkBuffer::new("edges at vertices"),
            sides: WorkBuffer::new("side planes"),
            pixels: WorkBuffer::new("states of pixels"),
            lists: WorkBuffer::new("edges of blocks"),
            no_masks: HeldBuffer::storage("no masks"),
            no_cutouts: HeldGroup::new(device, "no cut-outs", stages, &[binding::STORAGE; 2]),
            scene,
            receivers,
            passes,
            prepared: None,
        }
    }

    /// Records `prepare.facing` and `prepare.silhouette`. The first call for a scene builds its edges and its tree on the CPU; later
    /// ones only record.
    ///
    /// # Errors
    /// [`TechniqueError::Unsupported`] without the geometry in memory, and for a caster with a cut-out mask by variants other
    /// than `exact`; more than the device binds.
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        let mut report = Report::default();
        let device = recorder.device;
        self.prepared = None;
        let kept = self.tables.take().filter(|tables| tables.made_for.are_of(&query.scene));
        let tables = match kept {
            Some(tables) => tables,
            None => report.time("prepare.edges", |_| new_tables(device, query, self.params.variant))?,
        };
        if let Some(object) = tables.masked.as_ref().filter(|_| self.params.variant != Variant::Exact) {
            return Err(WedgeError::Masked { object: object.clone() }.into());
        }
        let uniform = self.uniform(&tables, query, device);
        let settings = self.settings.get(device, bytemuck::bytes_of(&uniform));
        let facing: Bound = self.facing.get(device, 4 * u64::from(tables.triangles))?.into();
        let counters = self.counters.get(device, 4 * COUNTERS)?;
        let candidates = self.candidates.get(device, candidate_bytes(&tables, device))?;
        let interpolated = self.params.variant == Variant::Interpolated;
        // Of its edges no face is asked from receivers; what meets at their ends is noted instead.
        let noted = if interpolated {
            let corners = self.corners.get(device, 8 * u64::from(tables.vertices.max(1)))?;
            recorder.encoder.clear_buffer(&corners, 0, None);
            corners
        } else {
            self.variable.get(device, variable_bytes(&tables, device))?
        };
        recorder.encoder.clear_buffer(&counters, 0, None);
        let scene = self.scene.groups(device, &query.scene);
        // A light of no extent has no wedges: one ray a pixel.
        if query.light.is_extended() {
            let settings: Bound = settings.into();
            let own =
                [settings.clone(), tables.kinds.clone().into(), facing.clone(), counters.clone().into()];
            let own = self.passes.find_facing.group.get(device, &own);
            let groups = [Some(&own), Some(&scene.triangles)];
            let triangles = workgroups(tables.triangles);
            self.passes.find_facing.pass.record(recorder, "prepare.facing", &groups, triangles);
            for (piece, range) in pieces(device, tables.edge_count, EDGE_BYTES).enumerate() {
                let own = [
                    settings.clone(),
                    Bound::elements(&tables.edges, range.clone(), EDGE_BYTES),
                    tables.incident.clone().into(),
                    facing.clone(),
                    counters.clone().into(),
                    candidates.clone().into(),
                    noted.clone().into(),
                ];
                let own = self.passes.extract.groups.get(device, piece, &own);
                let groups = [Some(&own), Some(&scene.positions)];
                let edges = workgroups(range.end - range.start);
                self.passes.extract.pass.record(recorder, "prepare.silhouette", &groups, edges);
            }
            if let Some(find_sides) = &mut self.passes.find_sides {
                let sides = self.sides.get(device, side_bytes(&tables))?;
                let edges = workgroups(tables.edge_count);
                let own = [
                    settings,
                    tables.edges.clone().into(),
                    noted.into(),
                    counters.into(),
                    candidates.into(),
                    sides.into(),
                ];
                let own = find_sides.group.get(device, &own);
                find_sides.pass.record(recorder, "prepare.sides", &[Some(&own)], edges);
            }
        }
        let cutouts = scene.cutouts.clone().unwrap_or_else(|| {
            let none: Bound = self.no_masks.get(device, &[]).into();
            self.no_cutouts.get(device, &[none.clone(), none])
        });
        self.receivers.prepare(recorder, query);
        self.tables = Some(tables);
        self.prepared = Some(Prepared { uniform, scene, cutouts });
        report.bytes = self.bytes();
        Ok(report)
    }

    fn uniform(&self, tables: &Tables, query: &GpuShadowQuery<'_>, device: &wgpu::Device) -> WedgesUniform {
        let camera = query.camera;
        let limit = self.list_bytes.min(binding_limit(device));
        let [columns, rows] = tiles(camera, BLOCK);
        let room = limit / (4 * u64::from(columns) * u64::from(rows)).max(1);
        let magnitude = query.scene.bounds.magnitude();
        let dense = u32::try_from(EDGES_A_RAY * self.params.views as usize).unwrap_or(u32::MAX);
        WedgesUniform {
            magnitude: if magnitude.is_finite() { magnitude } else { 0.0 },
            size: [camera.width, camera.height],
            triangles: tables.triangles,
            capacity: u64::from(tables.edge_count).min(room.saturating_sub(1)) as u32,
            solid_nodes: tables.solid_nodes,
            nodes: tables.all_nodes,
            views: self.params.views,
            dense: if self.params.rays { dense } else { u32::MAX },
            seeds: WedgesUniform::seeds(self.params.seed),
            ..WedgesUniform::of_light(query.light)
        }
    }

    /// Records `shade.blocks` to `shade.write`: V of every pixel, 1 where nothing is seen. `camera` must be the one prepared for.
    ///
    /// # Errors
    /// [`TechniqueError::NotPrepared`]; a G-buffer of another size than the camera's.
    pub fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        let device = recorder.device;
        let not_prepared = || TechniqueError::NotPrepared { technique: WedgeParams::TECHNIQUE };
        let prepared = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let tables = self.tables.as_ref().ok_or_else(not_prepared)?;
        let (uniform, scene) = (&prepared.uniform, &prepared.scene);
        if gbuffer.size != uniform.size || [camera.width, camera.height] != uniform.size {
            let area = |[width, height]: [u32; 2]| width as usize * height as usize;
            return Err(TechniqueError::OutputSize { expected: area(uniform.size), got: area(gbuffer.size) });
        }
        let receivers = self.receivers.group(device, camera, gbuffer).ok_or_else(not_prepared)?;
        let count = u64::from(uniform.size[0]) * u64::from(uniform.size[1]);
        let [columns, rows] = tiles(camera, BLOCK);
        let blocks = u64::from(columns) * u64::from(rows);
        let pixels = self.pixels.get(device, 4 * (4 + 3 * count))?;
        recorder.encoder.clear_buffer(&pixels, 0, Some(16));
        let settings: Bound = self.settings.get(device, bytemuck::bytes_of(uniform)).into();
        let pixels: Bound = pixels.into();
        let lists: Bound = self.lists.get(device, 4 * blocks * (u64::from(uniform.capacity) + 1))?.into();
        let counters: Bound = self.counters.get(device, 4 * COUNTERS)?.into();
        let candidates: Bound = self.candidates.get(device, candidate_bytes(tables, device))?.into();
        let facing: Bound = self.facing.get(device, 4 * u64::from(tables.triangles))?.into();
        // What a variant keeps for an edge besides.
        let of_edges: Option<Bound> = match self.params.variant {
            Variant::Exact => Some(self.variable.get(device, variable_bytes(tables, device))?.into()),
            Variant::Interpolated => Some(self.sides.get(device, side_bytes(tables))?.into()),
            Variant::Coverage => None,
        };
        let (nodes, leaves): (Bound, Bound) = (tables.nodes.clone().into(), tables.leaves.clone().into());
        let (triangles, receivers) = (Some(&scene.triangles), Some(&receivers));
        let cutouts = Some(&prepared.cutouts);
        let passes = &mut self.passes;

        let exact = self.params.variant == Variant::Exact;
        let shared = [settings.clone(), candidates, counters, lists];
        let own = if exact { &[][..] } else { of_edges.as_slice() };
        let own = passes.list_edges.group.get(device, &[&shared[..], own].concat());
        let groups = [Some(&own), triangles, None, receivers];
        passes.list_edges.pass.record(recorder, "shade.blocks", &groups, [columns, rows, 1]);

        let [columns, rows] = tiles(camera, TILE);
        if let Some(pass) = passes.find_masked.as_mut().filter(|_| uniform.nodes > uniform.solid_nodes) {
            let own = [settings.clone(), nodes.clone(), leaves.clone(), pixels.clone()];
            let own = pass.group.get(device, &own);
            let groups = [Some(&own), triangles, None, receivers];
            pass.pass.record(recorder, "shade.masks", &groups, [columns, rows, 1]);
        }
        let own = [&shared[..], of_edges.as_slice(), std::slice::from_ref(&pixels)].concat();
        let counts =
            [("shade.wedges", Some(&mut passes.count)), ("shade.asked", passes.count_asked.as_mut())];
        for (stage, pass) in counts {
            let Some(Pass { pass, group }) = pass else { continue };
            let groups = [Some(&group.get(device, &own)), triangles, None, receivers];
            pass.record(recorder, stage, &groups, [columns, rows, 1]);
        }

        let shared = [settings.clone(), nodes, leaves];
        let own = if exact { vec![pixels.clone()] } else { vec![facing, pixels.clone()] };
        let own = passes.ask.group.get(device, &[&shared[..], &own].concat());
        let groups = [Some(&own), triangles, cutouts.filter(|_| exact), receivers];
        passes.ask.pass.record(recorder, "shade.rays", &groups, [columns, rows, 1]);
        let own = passes.trace.group.get(device, &[&shared[..], std::slice::from_ref(&pixels)].concat());
        let groups = [Some(&own), triangles, cutouts, receivers];
        // As many groups as there are pixels, up to what keeps a large GPU busy; each takes every so-manieth of the list.
        passes.trace.pass.record(recorder, "shade.traced", &groups, [(count as u32).min(4096), 1, 1]);

        let own = passes.write_group.get(device, &[settings, pixels]);
        if let Some(receivers) = receivers {
            passes.write.record(recorder, "shade.write", &own, scene, receivers, visibility);
        }
        Ok(Report { bytes: self.bytes(), ..Default::default() })
    }

    fn bytes(&self) -> u64 {
        let work = [
            &self.facing,
            &self.counters,
            &self.candidates,
            &self.variable,
            &self.corners,
            &self.sides,
            &self.pixels,
            &self.lists,
        ];
        work.into_iter().map(WorkBuffer::bytes).sum::<u64>() + self.tables.as_ref().map_or(0, Tables::bytes)
    }

    /// Bytes that the lists of edges of all blocks may take together, 64 MiB if nothing is said. Less costs time, no pixel.
    pub fn set_list_bytes(&mut self, bytes: u64) {
        self.list_bytes = bytes;
    }

    /// The buffer of counters of the last frame: edges found, words of faces with the light on both sides, faces that touch the
    /// light. For tests and benchmarks.
    ///
    /// # Errors
    /// If the device has no room for it.
    pub fn counters(&mut self, device: &wgpu::Device) -> Result<wgpu::Buffer, TechniqueError> {
        Ok(self.counters.get(device, 4 * COUNTERS)?)
    }

    /// The buffer of pixels of the last frame: word 0 says how many of them were traced. For tests and benchmarks.
    ///
    /// # Errors
    /// If the device has no room for it.
    pub fn pixels(&mut self, device: &wgpu::Device) -> Result<wgpu::Buffer, TechniqueError> {
        Ok(self.pixels.get(device, 16)?)
    }
}

/// Room for all edges, or for as many as the device binds: where more are found all pixels are traced. A binding must hold one.
fn candidate_bytes(tables: &Tables, device: &wgpu::Device) -> u64 {
    (32 * u64::from(tables.edge_count.max(1))).min(binding_limit(device) / 32 * 32)
}

/// Room for all faces of all edges, and their numbers, or for as many as the device binds, likewise.
fn variable_bytes(tables: &Tables, device: &wgpu::Device) -> u64 {
    (4 * (u64::from(tables.incident_count) + u64::from(tables.edge_count))).min(binding_limit(device) / 4 * 4)
}

/// Room for the side planes of all edges.
fn side_bytes(tables: &Tables) -> u64 {
    48 * u64::from(tables.edge_count.max(1))
}

fn new_tables(
    device: &wgpu::Device,
    query: &GpuShadowQuery<'_>,
    variant: Variant,
) -> Result<Tables, TechniqueError> {
    let geometry = query.scene.geometry.ok_or_else(|| TechniqueError::Unsupported {
        technique: WedgeParams::TECHNIQUE,
        input: "a scene without its geometry in memory".to_owned(),
        why: "edges are found from it, once a scene".to_owned(),
    })?;
    Tables::new(device, &query.scene, geometry, variant).map_err(|error| match error {
        TablesError::Gpu(error) => error.into(),
        TablesError::Wedges(error) => error.into(),
    })
}

/// Workgroups of 64 for so many elements, in two dimensions.
fn workgroups(elements: u32) -> [u32; 3] {
    /// What every device takes in one dimension.
    const MOST: u32 = 32_768;
    let groups = elements.div_ceil(64);
    [groups.min(MOST), groups.div_ceil(MOST), 1]
}

/// Squares of `side` pixels that cover the image, columns and rows.
fn tiles(camera: &Camera, side: usize) -> [u32; 2] {
    [camera.width, camera.height].map(|pixels| pixels.div_ceil(side as u32))
}
