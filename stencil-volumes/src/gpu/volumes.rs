//! Shadow volumes on the GPU: buffers, pipelines and the order of the passes.

use glam::Vec4;
use scene_core::gpu::{
    Bound, ComputePass, Gpu, GpuGBuffer, GpuShadowQuery, HeldBuffer, HeldGroup, HeldGroups, Receivers,
    Recorder, SceneBindings, SceneGroups, VisibilityPass, VisibilityPassParts, WorkBuffer, binding,
    binding_limit, pieces,
};
use scene_core::light::LightPoint;
use scene_core::relevance::CasterRegion;
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Light, Report, Scene};

use super::layout::VolumesUniform;
use super::shaders;
use super::tables::{Tables, TablesError};
use crate::casters::{in_anothers_shadow, near_box};
use crate::cpu::{BLOCK, TILE};
use crate::runs::RUN;
use crate::volumes::{DENSE, most_edges};
use crate::{Count, Skips, VolumeParams};

/// Bytes that the lists of edges of all blocks may take together. A block that has no room for its edges tells its
/// tiles to take all there are.
const LISTS: u64 = 64 << 20;

/// Words of `counters`.
const COUNTERS: u64 = 276;

/// Words of `counters` in which `volumes.wesl` counts for reports: from here on faces that are outside of the region, in another's
/// shadow, and turned to the light; then what `shade` counts, pairs of sides in two words each.
const FACES: usize = 256;
const UNLIT_PIXELS: usize = 264;
const UNIFORM_TILES: usize = 266;
const RUNS_SKIPPED: usize = 267;
const RUNS_ASKED: usize = 268;
const TILE_PAIRS: usize = 270;
const PIXEL_PAIRS: usize = 272;

/// Edges that are counted at most, also if `rays` is off: 64 invocations go through them together. Drivers end a dispatch that
/// takes too long, and Mesa's software ones all loops of an invocation after 65,535 rounds in sum; here are 2¹⁴ over edges and
/// as many over sides.
const MOST_EDGES: u32 = 64 << 14;

/// Bytes of an edge's vertices, and of where its faces start.
const VERTICES_BYTES: u64 = 8;
const FIRST_BYTES: u64 = 4;

/// Bytes of an edge of the silhouette.
const EDGE_BYTES: u64 = 16;

/// A compute pass with its group 0.
#[derive(Debug)]
struct Pass {
    pass: ComputePass,
    own: HeldGroup,
}

/// A compute pass with a group 0 for each piece of the tables that it takes.
#[derive(Debug)]
struct PiecewisePass {
    pass: ComputePass,
    own: HeldGroups,
}

/// Which of groups 1 to 3 a pass binds.
#[derive(Clone, Copy)]
enum Binds {
    Positions,
    Triangles,
    TrianglesAndReceivers,
    All,
}

/// Shadow volumes on one device: pipelines, and what the last `prepare` left.
#[derive(Debug)]
pub struct VolumesOnGpu {
    params: VolumeParams,
    skips: Skips,
    list_bytes: u64,
    tables: Option<Tables>,
    settings: HeldBuffer,
    region: HeldBuffer,
    shadowed: HeldBuffer,
    facing: WorkBuffer,
    counters: WorkBuffer,
    edges: WorkBuffer,
    pixels: WorkBuffer,
    lists: WorkBuffer,
    runs: WorkBuffer,
    no_masks: HeldBuffer,
    no_cutouts: HeldGroup,
    scene: SceneBindings,
    receivers: Receivers,
    find_facing: Pass,
    extract: PiecewisePass,
    bound_runs: Pass,
    ask: Pass,
    list_edges: Pass,
    count: Pass,
    trace: Pass,
    write_group: HeldGroup,
    write: VisibilityPass,
    prepared: Option<Prepared>,
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    uniform: VolumesUniform,
    scene: SceneGroups,
    cutouts: wgpu::BindGroup,
}

impl VolumesOnGpu {
    /// Makes the pipelines. `visibility` is the format of the texture that V is written to.
    pub fn new(device: &wgpu::Device, params: VolumeParams, visibility: wgpu::TextureFormat) -> Self {
        const READ: wgpu::BindingType = binding::STORAGE;
        const WRITE: wgpu::BindingType = binding::STORAGE_WRITE;
        let stages = wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::COMPUTE;
        let scene = SceneBindings::new(device, stages);
        let receivers = Receivers::new(device);
        let pass = |label, wgsl, entry, binds, types: &[wgpu::BindingType]| {
            let types = [&[binding::UNIFORM], types].concat();
            let own = HeldGroup::new(device, label, stages, &types);
            let (triangles, cutouts) = (Some(&scene.triangles_layout), Some(&scene.cutouts_layout));
            let groups = match binds {
                Binds::Positions => vec![Some(own.layout()), Some(&scene.positions_layout)],
                Binds::Triangles => vec![Some(own.layout()), triangles],
                Binds::TrianglesAndReceivers => {
                    vec![Some(own.layout()), triangles, None, Some(receivers.layout())]
                }
                Binds::All => vec![Some(own.layout()), triangles, cutouts, Some(receivers.layout())],
            };
            Pass { pass: ComputePass::new(device, label, wgsl, entry, &groups), own }
        };
        let lit = Binds::TrianglesAndReceivers;
        let find_facing = pass(
            "volumes facing",
            shaders::FACING,
            "find_facing",
            Binds::Triangles,
            &[READ, WRITE, WRITE, READ, READ],
        );
        let extract = pass(
            "volumes silhouette",
            shaders::SILHOUETTE,
            "extract_silhouette",
            Binds::Positions,
            &[READ, READ, READ, READ, WRITE, WRITE],
        );
        let extract = PiecewisePass { pass: extract.pass, own: HeldGroups::new(extract.own) };
        let bound_runs =
            pass("volumes runs", shaders::RUNS, "bound_runs", Binds::Positions, &[READ, READ, WRITE]);
        let ask = pass("volumes ask", shaders::ASK, "ask", lit, &[READ, READ, WRITE, WRITE]);
        let list_edges =
            pass("volumes blocks", shaders::BLOCKS, "list_edges", lit, &[READ, WRITE, READ, WRITE, READ]);
        let count = pass("volumes tiles", shaders::TILES, "count", lit, &[READ, WRITE, WRITE, READ]);
        let trace = pass("volumes rays", shaders::RAYS, "trace", Binds::All, &[READ, READ, WRITE]);
        let write_group = HeldGroup::new(device, "volumes write", stages, &[binding::UNIFORM, READ]);
        let write = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "volumes write",
                wgsl: shaders::WRITE,
                fragment: "write",
                own: write_group.layout(),
                scene: &scene,
                receivers: &receivers,
                format: visibility,
            },
        );
        Self {
            params,
            skips: Skips::new(params.skip),
            list_bytes: LISTS,
            tables: None,
            settings: HeldBuffer::uniform("volumes"),
            region: HeldBuffer::storage("region of casters"),
            shadowed: HeldBuffer::storage("casters in another's shadow"),
            facing: WorkBuffer::new("facings"),
            counters: WorkBuffer::new("counters"),
            edges: WorkBuffer::new("edges of the silhouette"),
            pixels: WorkBuffer::new("states of pixels"),
            lists: WorkBuffer::new("edges of blocks"),
            runs: WorkBuffer::new("runs of edges"),
            no_masks: HeldBuffer::storage("no masks"),
            no_cutouts: HeldGroup::new(device, "no cut-outs", stages, &[READ, READ]),
            scene,
            receivers,
            find_facing,
            extract,
            bound_runs,
            ask,
            list_edges,
            count,
            trace,
            write_group,
            write,
            prepared: None,
        }
    }

    /// `prepare.facing` and `prepare.silhouette`.
    pub(super) fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
        geometry: &Scene,
    ) -> Result<Report, TechniqueError> {
        let mut report = Report::default();
        let device = recorder.device;
        self.prepared = None;
        let kept = self.tables.take().filter(|tables| tables.made_for.are_of(&query.scene));
        let tables = match kept {
            Some(tables) => tables,
            None => report.time("prepare.edges", |_| Tables::new(device, &query.scene, geometry)).map_err(
                |error| match error {
                    TablesError::Gpu(error) => TechniqueError::from(error),
                    TablesError::Volumes(error) => TechniqueError::Other(Box::new(error)),
                },
            )?,
        };
        let (planes, shadowed) = report.time("prepare.relevance", |report| {
            let planes = if self.skips.outside { region_planes(geometry, query, report) } else { Vec::new() };
            let shadowed =
                if self.skips.shadowed { shadowed_ranges(geometry, query.light, report) } else { Vec::new() };
            (planes, shadowed)
        });
        let uniform = self.uniform(&tables, query, device, shadowed.len() as u32);
        let settings = self.settings.get(device, bytemuck::bytes_of(&uniform));
        let facing = self.facing.get(device, 4 * u64::from(tables.triangles))?;
        let counters = self.counters.get(device, 4 * COUNTERS)?;
        let edges = self.edges.get(device, silhouette_bytes(device, tables.edges))?;
        recorder.encoder.clear_buffer(&counters, 0, None);
        let region = self.region.get(device, bytemuck::cast_slice(&planes));
        let shadowed = self.shadowed.get(device, bytemuck::cast_slice(&shadowed));
        let scene = self.scene.groups(device, &query.scene);

        let own = [
            settings.clone().into(),
            tables.casts.clone().into(),
            facing.clone().into(),
            counters.clone().into(),
            region.into(),
            shadowed.into(),
        ];
        let own = self.find_facing.own.get(device, &own);
        let groups = [Some(&own), Some(&scene.triangles)];
        self.find_facing.pass.record(recorder, "prepare.facing", &groups, workgroups(tables.triangles));

        for (piece, range) in pieces(device, tables.edges, VERTICES_BYTES).enumerate() {
            let own = [
                settings.clone().into(),
                Bound::elements(&tables.vertices, range.clone(), VERTICES_BYTES),
                Bound::elements(&tables.first, range.start..range.end + 1, FIRST_BYTES),
                tables.incident.clone().into(),
                facing.clone().into(),
                counters.clone().into(),
                edges.clone().into(),
            ];
            let own = self.extract.own.get(device, piece, &own);
            let groups = [Some(&own), Some(&scene.positions)];
            let edges = workgroups(range.end - range.start);
            self.extract.pass.record(recorder, "prepare.silhouette", &groups, edges);
        }

        if self.skips.bounded {
            let runs = self.runs.get(device, run_bytes(&tables))?;
            let own = [settings.into(), edges.into(), counters.into(), runs.into()];
            let own = self.bound_runs.own.get(device, &own);
            let groups = [Some(&own), Some(&scene.positions)];
            let edges = workgroups(tables.edges.min(MOST_EDGES));
            self.bound_runs.pass.record(recorder, "prepare.runs", &groups, edges);
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

    fn uniform(
        &self,
        tables: &Tables,
        query: &GpuShadowQuery<'_>,
        device: &wgpu::Device,
        shadowed: u32,
    ) -> VolumesUniform {
        let (camera, rays) = (query.camera, self.params.rays);
        let near = near_box(camera);
        let light_point = match query.light.center() {
            LightPoint::At(place) => place.extend(1.0),
            LightPoint::Towards(direction) => direction.extend(0.0),
        };
        let limit = self.list_bytes.min(binding_limit(device));
        let [columns, rows] = tiles(camera, BLOCK);
        let room = limit / (4 * u64::from(columns) * u64::from(rows)).max(1);
        let magnitude = query.scene.bounds.magnitude();
        VolumesUniform {
            eye: camera.eye,
            near: camera.near,
            light_point: if light_point.is_finite() { light_point } else { Vec4::ZERO },
            near_low: near.min,
            magnitude: if magnitude.is_finite() { magnitude } else { 0.0 },
            near_high: near.max,
            eye_counts: u32::from(self.params.count != Count::ZPass),
            size: [camera.width, camera.height],
            triangles: tables.triangles,
            capacity: u64::from(tables.edges).min(room.saturating_sub(2)) as u32,
            solid_nodes: tables.solid_nodes,
            nodes: tables.all_nodes,
            dense: if rays { DENSE } else { MOST_EDGES / 64 },
            most_edges: most_listed(device).min(if rays { most_edges(camera) as u32 } else { u32::MAX }),
            skip_unlit: u32::from(self.skips.unlit),
            skip_runs: u32::from(self.skips.bounded),
            shadowed,
            padding: 0,
        }
    }

    /// `shade.ask` to `shade.write`.
    pub(super) fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        let device = recorder.device;
        let not_prepared = || TechniqueError::NotPrepared { technique: VolumeParams::TECHNIQUE };
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
        let settings: Bound = self.settings.get(device, bytemuck::bytes_of(uniform)).into();
        let pixels: Bound = self.pixels.get(device, 4 * (4 + 2 * count))?.into();
        let lists: Bound = self.lists.get(device, 4 * blocks * (u64::from(uniform.capacity) + 2))?.into();
        let counters = self.counters.get(device, 4 * COUNTERS)?;
        recorder.encoder.clear_buffer(&counters, 4 * UNLIT_PIXELS as u64, None);
        let counters: Bound = counters.into();
        let edges: Bound = self.edges.get(device, silhouette_bytes(device, tables.edges))?.into();
        let nodes: Bound = tables.nodes.clone().into();
        let leaves: Bound = tables.leaves.clone().into();

        let [tile_columns, tile_rows] = tiles(camera, TILE);
        let (triangles, receivers) = (Some(&scene.triangles), Some(&receivers));
        let own = [settings.clone(), nodes.clone(), leaves.clone(), counters.clone(), pixels.clone()];
        let own = self.ask.own.get(device, &own);
        let groups = [Some(&own), triangles, None, receivers];
        self.ask.pass.record(recorder, "shade.ask", &groups, [tile_columns, tile_rows, 1]);

        let runs: Bound = self.runs.get(device, run_bytes(tables))?.into();
        let own = [settings.clone(), edges.clone(), counters.clone(), pixels.clone(), lists.clone(), runs];
        let own = self.list_edges.own.get(device, &own);
        let groups = [Some(&own), triangles, None, receivers];
        self.list_edges.pass.record(recorder, "shade.blocks", &groups, [columns, rows, 1]);

        let own = [settings.clone(), edges, counters, pixels.clone(), lists];
        let own = self.count.own.get(device, &own);
        let groups = [Some(&own), triangles, None, receivers];
        self.count.pass.record(recorder, "shade.tiles", &groups, [tile_columns, tile_rows, 1]);

        let own = [settings.clone(), nodes, leaves, pixels.clone()];
        let own = self.trace.own.get(device, &own);
        let groups = [Some(&own), triangles, Some(&prepared.cutouts), receivers];
        // As many threads as there are pixels, up to what keeps a large GPU busy; each takes every so-manieth of the list.
        let threads = (count.div_ceil(64) as u32).min(1024);
        self.trace.pass.record(recorder, "shade.rays", &groups, [threads, 1, 1]);

        let own = self.write_group.get(device, &[settings, pixels]);
        if let Some(receivers) = receivers {
            self.write.record(recorder, "shade.write", &own, scene, receivers, visibility);
        }
        Ok(Report { bytes: self.bytes(), ..Default::default() })
    }

    fn bytes(&self) -> u64 {
        let work = [&self.facing, &self.counters, &self.edges, &self.pixels, &self.lists, &self.runs];
        work.into_iter().map(WorkBuffer::bytes).sum::<u64>() + self.tables.as_ref().map_or(0, Tables::bytes)
    }

    /// What the last frame left out and counted, by the names of the CPU path. Waits for the device.
    ///
    /// # Errors
    /// What went wrong on the device.
    pub fn counted(&mut self, gpu: &Gpu) -> Result<Report, TechniqueError> {
        let mut report = Report::default();
        let words: Vec<u32> = gpu.read_buffer(&self.counters(&gpu.device)?)?;
        let pixels: Vec<u32> = gpu.read_buffer(&self.pixels(&gpu.device)?)?;
        let word = |index: usize| u64::from(words[index]);
        let wide = |index: usize| word(index) | word(index + 1) << 32;
        report.skip("caster triangles outside view", word(FACES));
        report.skip("caster triangles in another's shadow", word(FACES + 1));
        report.skip("caps", word(FACES + 2));
        report.skip("pixels the light cannot reach", word(UNLIT_PIXELS));
        report.skip("tiles of one count", word(UNIFORM_TILES));
        report.skip("runs of edges beside a block", word(RUNS_SKIPPED));
        report.count("pairs of run and block", word(RUNS_ASKED));
        report.count("pairs of side and tile", wide(TILE_PAIRS));
        report.count("pairs of side and pixel", wide(PIXEL_PAIRS));
        report.count("pixels traced", pixels.first().map_or(0, |&count| u64::from(count)));
        Ok(report)
    }

    /// Other skips than [`VolumeParams::skip`] says, to measure one by one. No image changes.
    pub fn set_skips(&mut self, skips: Skips) {
        self.skips = skips;
    }

    /// Bytes that the lists of edges of all blocks may take together, 64 MiB if nothing is said. Less costs time, no pixel.
    pub fn set_list_bytes(&mut self, bytes: u64) {
        self.list_bytes = bytes;
    }

    /// The buffer of counters of the last frame: edges found, faces between eye and light, faces before the near plane.
    /// For tests and benchmarks.
    ///
    /// # Errors
    /// If the device has no room for it.
    pub fn counters(&mut self, device: &wgpu::Device) -> Result<wgpu::Buffer, TechniqueError> {
        Ok(self.counters.get(device, 4 * COUNTERS)?)
    }

    /// The buffer of facings of the last frame, an `i32` a triangle. For tests.
    ///
    /// # Errors
    /// If the device has no room for it.
    pub fn facings(&mut self, device: &wgpu::Device) -> Result<wgpu::Buffer, TechniqueError> {
        let triangles = self.tables.as_ref().map_or(0, |tables| tables.triangles);
        Ok(self.facing.get(device, 4 * u64::from(triangles))?)
    }

    /// The buffer of pixels of the last frame: word 0 says how many of them a ray decided. For tests and benchmarks.
    ///
    /// # Errors
    /// If the device has no room for it.
    pub fn pixels(&mut self, device: &wgpu::Device) -> Result<wgpu::Buffer, TechniqueError> {
        Ok(self.pixels.get(device, 16)?)
    }
}

/// The half-spaces around all that can shadow what the camera sees, as the facing pass reads them; books the objects outside.
fn region_planes(scene: &Scene, query: &GpuShadowQuery<'_>, report: &mut Report) -> Vec<Vec4> {
    // Only the middle of the light throws shadows.
    let light = query.light.reduced_to(query.light.center());
    let region = CasterRegion::of(scene, query.camera, &light);
    let casters = scene.objects().iter().filter(|o| o.flags.casts && !o.triangles.is_empty());
    let outside = casters.filter(|o| !region.touches(&o.bounds)).count();
    report.skip("casters outside view", outside as u64);
    if region.is_empty() {
        // No point has 0·x ≤ −1.
        return vec![Vec4::NEG_W];
    }
    let planes = region.planes().iter().filter_map(|plane| {
        let length = plane.normal.length();
        let unit = (plane.normal / length).extend(plane.offset / length).as_vec4();
        unit.is_finite().then_some(unit)
    });
    planes.collect()
}

/// The triangles of casters that lie wholly in another's shadow, as the facing pass reads them; books the casters.
fn shadowed_ranges(scene: &Scene, light: &Light, report: &mut Report) -> Vec<[u32; 2]> {
    let shadowed = in_anothers_shadow(scene, light);
    report.skip("casters in another's shadow", shadowed.len() as u64);
    let triangles = shadowed.iter().map(|&id| &scene.objects()[id as usize].triangles);
    let mut ranges: Vec<[u32; 2]> = triangles.map(|t| [t.start as u32, t.end as u32]).collect();
    ranges.sort_unstable();
    ranges
}

/// Bytes of the boxes around all runs that there may be: room for one where there are no edges, as a binding holds an element.
fn run_bytes(tables: &Tables) -> u64 {
    32 * u64::from(tables.edges.min(MOST_EDGES)).div_ceil(RUN as u64).max(1)
}

/// Edges of a silhouette that are listed, at most: where there are more, rays decide about all pixels.
fn most_listed(device: &wgpu::Device) -> u32 {
    u64::from(MOST_EDGES).min(binding_limit(device) / EDGE_BYTES) as u32
}

/// Room for the silhouette of so many edges.
fn silhouette_bytes(device: &wgpu::Device, edges: u32) -> u64 {
    EDGE_BYTES * u64::from(edges.min(most_listed(device)))
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

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn workgroups_reach_every_element() {
        for elements in [0, 1, 64, 65, 32_768 * 64, 32_768 * 64 + 1, 20_000_000] {
            let [x, y, _] = workgroups(elements);
            assert!(u64::from(x) * u64::from(y) * 64 >= u64::from(elements) && x <= 65_535 && y <= 65_535);
        }
        assert_eq!(workgroups(0)[0], 0);
        let camera = Camera {
            eye: Vec3::ZERO,
            target: Vec3::Z,
            up: Vec3::Y,
            fov_y: 1.0,
            near: 0.1,
            far: 1.0,
            width: 65,
            height: 64,
        };
        assert_eq!(tiles(&camera, BLOCK), [2, 1]);
    }
}
