//! What maps are drawn of, chosen where it is known what they cover: on the GPU. Twin of `cpu::inside_map` and of
//! [`PointClouds::chosen`].
//!
//! Casters without a mask are asked by runs of triangles, and those that the scene marks by pieces of their clouds of points. What is
//! wholly beside a map is left out; what is kept is drawn with one call for triangles and one for points, by arguments that a
//! compute pass writes. Objects with masks are drawn as they are.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use scene_core::geometry::Aabb;
use scene_core::gpu::{
    Bound, ChosenRuns, ComputePass, DepthTarget, GeometryBuffers, Gpu, GpuError, GpuObject, GpuScene,
    HeldBuffer, HeldGroup, RUN, Recorder, WorkBuffer, binding, binding_limit, storage_buffer,
};
use scene_core::{Report, Scene};

use super::layout::{CasterUniform, CloudOnGpu, DrawsOnGpu, NO_CLOUD, RunOnGpu};
use super::shaders;
use super::splats::SplatPass;
use crate::PsmParams;
use crate::points::{PIECE, PointClouds, along};

/// A run or piece that was chosen: two u32.
const CHOSEN_BYTES: u64 = 8;

/// What is asked of a scene's casters, as tables on the device. They hold as long as the same objects cast.
#[derive(Debug)]
pub(super) struct CasterTables {
    made_for: (GeometryBuffers, Vec<u32>),
    runs: wgpu::Buffer,
    run_count: u32,
    clouds: wgpu::Buffer,
    pieces: wgpu::Buffer,
    piece_count: u32,
    points: wgpu::Buffer,
    /// Triangles in all runs.
    triangles: u64,
    /// Of the objects with masks.
    masked: Arc<[Range<u32>]>,
}

/// The points of objects that are drawn.
#[derive(Default)]
struct CloudTables {
    clouds: Vec<CloudOnGpu>,
    pieces: Vec<[u32; 2]>,
    points: Vec<[u32; 2]>,
    /// Per object.
    of_object: Vec<u32>,
}

impl CloudTables {
    fn new(scene: &Scene, clouds: &PointClouds, drawn: &[u32]) -> Self {
        let mut tables = Self { of_object: vec![NO_CLOUD; scene.objects().len()], ..Self::default() };
        for cloud in
            clouds.clouds().iter().filter(|cloud| drawn.binary_search(&(cloud.object as u32)).is_ok())
        {
            let (id, first) = (tables.clouds.len() as u32, tables.points.len() as u32);
            let bounds = scene.objects()[cloud.object].bounds;
            let count = cloud.points.len() as u32;
            tables.of_object[cloud.object] = id;
            tables.clouds.push(CloudOnGpu {
                low: bounds.min,
                first,
                high: bounds.max,
                count,
                area: cloud.area as f32,
                padding: [0; 3],
            });
            tables.pieces.extend((first..first + count).step_by(PIECE as usize).map(|point| [id, point]));
            let points = (0..).zip(&cloud.points).map(|(index, point)| {
                let [u, v] = along(cloud.object, index).map(|share| (share * 65_535.0).round() as u32);
                [point.triangle, u | v << 16]
            });
            tables.points.extend(points);
        }
        tables
    }
}

impl CasterTables {
    /// Of the objects `drawn`, ids ascending. `clouds` are those of the scene's geometry, if that is in memory.
    fn new(
        device: &wgpu::Device,
        scene: &GpuScene<'_>,
        drawn: Vec<u32>,
        clouds: &PointClouds,
    ) -> Result<Self, GpuError> {
        let mut tables =
            scene.geometry.map(|geometry| CloudTables::new(geometry, clouds, &drawn)).unwrap_or_default();
        // More points than the device binds are drawn by their triangles.
        if size_of_val(tables.points.as_slice()) as u64 > binding_limit(device) {
            tables = CloudTables::default();
        }
        let is_masked = |object: &GpuObject| object.has_mask && scene.cutouts.is_some();
        let mut objects: Vec<_> = drawn
            .iter()
            .map(|&id| (id, &scene.objects[id as usize]))
            .filter(|(_, object)| object.flags.casts && !object.triangles.is_empty())
            .collect();
        objects.sort_unstable_by_key(|(_, object)| object.triangles.start);
        let (masked, solid): (Vec<_>, Vec<_>) =
            objects.into_iter().partition(|(_, object)| is_masked(object));
        let cloud_of = |id: u32| tables.of_object.get(id as usize).copied().unwrap_or(NO_CLOUD);
        let solid: Vec<_> = solid.into_iter().map(|(id, object)| (object, cloud_of(id))).collect();
        let runs = runs(scene, &solid);
        Ok(Self {
            run_count: runs.len() as u32,
            runs: storage_buffer(device, "runs of casters", bytemuck::cast_slice(&runs))?,
            clouds: storage_buffer(device, "clouds", bytemuck::cast_slice(&tables.clouds))?,
            piece_count: tables.pieces.len() as u32,
            pieces: storage_buffer(device, "pieces of clouds", bytemuck::cast_slice(&tables.pieces))?,
            points: storage_buffer(device, "points", bytemuck::cast_slice(&tables.points))?,
            triangles: runs.iter().map(|run| u64::from(run.end - run.first)).sum(),
            masked: masked.into_iter().map(|(_, object)| object.triangles.clone()).collect(),
            made_for: (GeometryBuffers::new(scene), drawn),
        })
    }

    /// Bytes held on the device.
    fn bytes(&self) -> u64 {
        [&self.runs, &self.clouds, &self.pieces, &self.points].into_iter().map(wgpu::Buffer::size).sum()
    }
}

/// Triangles of `solid`, in their order, by runs: small objects that follow one another share one if both fit into it.
fn runs(scene: &GpuScene<'_>, solid: &[(&GpuObject, u32)]) -> Vec<RunOnGpu> {
    let mut runs: Vec<RunOnGpu> = Vec::new();
    for (object, cloud) in solid {
        let Range { start, end } = object.triangles.clone();
        let Aabb { min, max } = object.bounds;
        if let Some(last) = runs.last_mut()
            && (last.end, last.cloud) == (start, *cloud)
            && end - last.first <= RUN
        {
            (last.end, last.low, last.high) = (end, last.low.min(min), last.high.max(max));
            continue;
        }
        runs.extend((start..end).step_by(RUN as usize).map(|first| RunOnGpu {
            low: min,
            first,
            high: max,
            end: end.min(first + RUN),
            cloud: *cloud,
            padding: [0; 3],
        }));
    }
    if let Some(geometry) = scene.geometry {
        runs.par_iter_mut().for_each(|run| {
            let corners = geometry.triangles()[run.first as usize..run.end as usize].iter().flatten();
            let bounds = Aabb::from_points(corners.map(|&i| geometry.positions()[i as usize]));
            (run.low, run.high) = (bounds.min, bounds.max);
        });
    }
    runs
}

/// Chooses what each map is drawn of, and draws the points.
#[derive(Debug)]
pub(super) struct CasterChoice {
    tables: Option<CasterTables>,
    uniform: HeldBuffer,
    group: HeldGroup,
    pass: ComputePass,
    runs: WorkBuffer,
    pieces: WorkBuffer,
    draws: WorkBuffer,
    splats: Option<SplatPass>,
    /// Images of the light that were recorded last.
    images: u64,
}

impl CasterChoice {
    pub(super) fn new(device: &wgpu::Device, receivers: &wgpu::BindGroupLayout) -> Self {
        let read = [binding::STORAGE; 4];
        let types: Vec<_> =
            [binding::UNIFORM].into_iter().chain(read).chain([binding::STORAGE_WRITE; 3]).collect();
        let group = HeldGroup::new(device, "casters", wgpu::ShaderStages::COMPUTE, &types);
        let groups = [Some(group.layout()), None, None, Some(receivers)];
        let pass = ComputePass::new(device, "casters", shaders::CASTERS, "choose_casters", &groups);
        Self {
            tables: None,
            uniform: HeldBuffer::uniform("casters"),
            group,
            pass,
            runs: WorkBuffer::new("chosen runs"),
            pieces: WorkBuffer::new("chosen pieces"),
            draws: WorkBuffer::with_usage("draws", wgpu::BufferUsages::INDIRECT),
            splats: None,
            images: 0,
        }
    }

    /// `prepare.points` and `prepare.runs`: the tables of the objects `drawn` (ids ascending), kept from the last call if they are the same.
    ///
    /// # Errors
    /// More runs or points than the device has memory for.
    pub(super) fn prepare(
        &mut self,
        device: &wgpu::Device,
        scene: &GpuScene<'_>,
        drawn: Vec<u32>,
        report: &mut Report,
    ) -> Result<(), GpuError> {
        let is_same = |tables: &CasterTables| tables.made_for.0.are_of(scene) && tables.made_for.1 == drawn;
        if !self.tables.as_ref().is_some_and(is_same) {
            // What was there is given back first: both together may not fit.
            self.tables = None;
            let clouds =
                report.time("prepare.points", |_| scene.geometry.map(PointClouds::new).unwrap_or_default());
            let tables = report.time("prepare.runs", |_| CasterTables::new(device, scene, drawn, &clouds))?;
            self.tables = Some(tables);
        }
        report.bytes += self.tables.as_ref().map_or(0, CasterTables::bytes);
        Ok(())
    }

    /// `prepare.maps`, its first pass: chooses for each of as many images as `views` hold. `None` before
    /// [`prepare`](Self::prepare).
    ///
    /// # Errors
    /// More runs or pieces than the device binds in one piece.
    pub(super) fn choose(
        &mut self,
        recorder: &mut Recorder<'_>,
        params: &PsmParams,
        (views, images): (&wgpu::Buffer, u64),
        receivers: &wgpu::BindGroup,
    ) -> Result<Option<ChosenCasters>, GpuError> {
        let Some(tables) = &self.tables else { return Ok(None) };
        let device = recorder.device;
        // The runs of an image start where every device takes the start of a binding.
        let room = |count: u32| count.max(1).next_multiple_of(256 / CHOSEN_BYTES as u32);
        let uniform = CasterUniform {
            map_size: params.map_size,
            runs: room(tables.run_count),
            pieces: room(tables.piece_count),
            skips: u32::from(params.skip),
        };
        let sizes = [uniform.runs, uniform.pieces].map(|room| u64::from(room) * CHOSEN_BYTES);
        let runs = self.runs.get(device, images * sizes[0])?;
        let pieces = self.pieces.get(device, images * sizes[1])?;
        let draws = self.draws.get(device, images * size_of::<DrawsOnGpu>() as u64)?;
        let bound: [Bound; 8] = [
            self.uniform.get(device, bytemuck::bytes_of(&uniform)).into(),
            views.clone().into(),
            tables.runs.clone().into(),
            tables.clouds.clone().into(),
            tables.pieces.clone().into(),
            runs.clone().into(),
            pieces.clone().into(),
            draws.clone().into(),
        ];
        let group = self.group.get(device, &bound);
        let groups = [Some(&group), None, None, Some(receivers)];
        self.pass.record(recorder, "prepare.maps", &groups, [images as u32, 1, 1]);
        self.images = images;
        Ok(Some(ChosenCasters { runs, pieces, draws, sizes, masked: tables.masked.clone() }))
    }

    /// `prepare.maps`, its last pass: draws points over what `targets` hold. Nothing where the scene marks nothing.
    pub(super) fn draw_points(
        &mut self,
        recorder: &mut Recorder<'_>,
        params: &PsmParams,
        chosen: &ChosenCasters,
        scene: &GpuScene<'_>,
        targets: &[DepthTarget<'_>],
    ) {
        let Some(tables) = self.tables.as_ref().filter(|tables| tables.piece_count > 0) else { return };
        let splats = self.splats.get_or_insert_with(|| SplatPass::new(recorder.device));
        for (index, target) in targets.iter().enumerate() {
            let pieces = chosen.points(index as u64);
            splats.record(recorder, index, (params.map_size, &tables.points), &pieces, scene, target);
        }
    }

    /// What the frame that was submitted last has drawn and left out. Waits for it.
    ///
    /// # Errors
    /// What reading it back meets.
    pub(super) fn counted(&mut self, gpu: &Gpu) -> Result<Report, GpuError> {
        let mut report = Report::default();
        let Some(tables) = self.tables.as_ref().filter(|_| self.images > 0) else { return Ok(report) };
        let draws = self.draws.get(&gpu.device, self.images * size_of::<DrawsOnGpu>() as u64)?;
        let draws: Vec<DrawsOnGpu> = gpu.read_buffer(&draws)?;
        let sum = |of: fn(&DrawsOnGpu) -> u32| {
            draws[..self.images as usize].iter().map(|draws| u64::from(of(draws))).sum::<u64>()
        };
        let drawn = sum(|draws| draws.triangle_count);
        report.skip("caster triangles outside view", self.images * tables.triangles - drawn);
        report.count("caster triangles drawn", drawn);
        report.count("points drawn", sum(|draws| draws.point_count));
        Ok(report)
    }
}

/// What the maps of a frame are drawn of, once it is executed.
#[derive(Debug)]
pub(super) struct ChosenCasters {
    runs: wgpu::Buffer,
    pieces: wgpu::Buffer,
    draws: wgpu::Buffer,
    /// Bytes of an image's runs and pieces.
    sizes: [u64; 2],
    /// Ranges of the triangles with masks, which are drawn whatever a map covers.
    pub(super) masked: Arc<[Range<u32>]>,
}

impl ChosenCasters {
    /// The triangles of an image's map.
    pub(super) fn triangles(&self, image: u64) -> ChosenRuns<'_> {
        self.part(&self.runs, image, self.sizes[0], 0)
    }

    /// Its points: pieces in the place of runs.
    fn points(&self, image: u64) -> ChosenRuns<'_> {
        self.part(&self.pieces, image, self.sizes[1], size_of::<[u32; 4]>() as u64)
    }

    fn part<'a>(&'a self, runs: &'a wgpu::Buffer, image: u64, size: u64, arguments: u64) -> ChosenRuns<'a> {
        let arguments_offset = image * size_of::<DrawsOnGpu>() as u64 + arguments;
        ChosenRuns { runs, offset: image * size, size, arguments: &self.draws, arguments_offset }
    }
}
