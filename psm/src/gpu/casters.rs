//! What maps are drawn of, chosen where it is known what they cover: on the GPU. Twin of `cpu::inside_map` and of
//! [`PointClouds::chosen`](crate::points::PointClouds::chosen).
//!
//! Casters without a mask are asked by runs of triangles, and those that the scene marks by pieces of their clouds of points. What is
//! wholly beside a map is left out; what is kept is drawn with one call for triangles and one for points, by arguments that a
//! compute pass writes. Objects with masks are drawn as they are.

use std::ops::Range;
use std::sync::Arc;

use scene_core::Report;
use scene_core::gpu::{
    Bound, ChosenRuns, ComputePass, DepthTarget, Gpu, GpuError, GpuObject, GpuScene, HeldBuffer, HeldGroup,
    Recorder, WorkBuffer, binding,
};

use super::caster_tables::{CasterTables, CloudTables};
use super::layout::{CasterUniform, DrawsOnGpu};
use super::shaders;
use super::splats::SplatPass;
use crate::PsmParams;

/// A run or piece that was chosen: two u32.
const CHOSEN_BYTES: u64 = 8;

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

    /// `prepare.points` and `prepare.runs`: the tables of the objects that are `drawn`, told by their ids, kept from the last call if they
    /// are the same.
    ///
    /// # Errors
    /// More runs or points than the device has memory for.
    pub(super) fn prepare(
        &mut self,
        device: &wgpu::Device,
        scene: &GpuScene<'_>,
        drawn: impl Fn(u32) -> bool,
        report: &mut Report,
    ) -> Result<(), GpuError> {
        let casts = |object: &GpuObject| object.flags.casts && !object.triangles.is_empty();
        let casters: Vec<_> = (0..)
            .zip(scene.objects)
            .filter(|&(id, object)| casts(object) && drawn(id))
            .map(|(id, object)| (id, object.clone()))
            .collect();
        if !self.tables.as_ref().is_some_and(|tables| tables.are_of(scene, &casters)) {
            // What was there is given back first: both together may not fit.
            (self.tables, self.images) = (None, 0);
            let clouds = report.time("prepare.points", |_| {
                scene.geometry.map(|geometry| CloudTables::new(geometry, &casters)).unwrap_or_default()
            });
            let tables =
                report.time("prepare.runs", |_| CasterTables::new(device, scene, casters, clouds))?;
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
