//! The CPU path, one function a stage, in the order and with the names of the report.

use std::ops::{Add, Range};

use fearless_simd::{Level, Simd, dispatch};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use scene_core::geometry::Object;
use scene_core::raster::{DepthMap, DepthOptions, DepthRange, RasterScratch, render_depth_into};
use scene_core::{GBuffer, Scene, VisibilityImage};

use crate::crossings::Crossings;
use crate::emission::{EmissionScratch, emit_events};
use crate::events::EventStrips;
use crate::functions::Functions;
use crate::grid::{DepthGrid, PixelGrid};
use crate::layout::Layout;
use crate::lookup::BATCH;
pub use crate::lookup::{Lookup, Skipped};
use crate::maps::{LANES, MapCasters, Target};

/// One window with its functions.
#[derive(Clone, Debug)]
pub struct Window {
    /// Where its rays are.
    pub layout: Layout,
    /// The PDSM's pixels on the maps' texels.
    pub grid: PixelGrid,
    /// V along every ray.
    pub functions: Functions,
}

/// Bytes of maps that a thread holds at most: views that are drawn at once grow fewer as maps grow larger.
const MOST_MAP_BYTES: usize = 1 << 26;

/// A thread's buffers while events are collected.
struct Collector {
    raster: RasterScratch,
    map: DepthMap,
    grids: Vec<DepthGrid>,
    emission: EmissionScratch,
    events: EventStrips,
    skipped: u64,
}

/// `prepare.events`: draws the maps of the light's samples, some at once, and keeps their events; maps are forgotten at
/// once, so that memory grows with the events alone. The parts are in no order. Also how many rows of maps were skipped,
/// if `skip` says so.
pub fn collect_events(
    scene: &Scene,
    casters: &[&Object],
    layout: &Layout,
    grid: PixelGrid,
    skip: bool,
) -> (Vec<EventStrips>, u64) {
    let size = layout.map_size();
    let steps: Vec<_> = layout.steps().collect();
    let at_once = MapCasters::new(scene, casters, layout);
    let ranges: Vec<_> = casters.iter().map(|object| object.triangles.clone()).collect();
    let collector = || Collector {
        raster: RasterScratch::new(),
        map: DepthMap { width: size, height: size, depth: Vec::new() },
        grids: Vec::new(),
        emission: EmissionScratch::default(),
        events: EventStrips::new(grid.size),
        skipped: 0,
    };
    let side = size as usize + 2;
    let threads = rayon::current_num_threads().max(1);
    let fitting = (MOST_MAP_BYTES / (side * side * size_of::<f32>())).clamp(1, LANES);
    let views = steps.len().div_ceil(threads).clamp(1, fitting);
    let parts = steps.par_chunks(views).fold(collector, |mut own, steps| {
        own.grids.resize_with(own.grids.len().max(steps.len()), DepthGrid::default);
        draw_maps(scene, &ranges, at_once.as_ref(), layout, steps, &mut own);
        let Collector { grids, emission, events, skipped, .. } = &mut own;
        for (&step, map) in steps.iter().zip(grids) {
            let crossings = Crossings::new(step, layout.t_range());
            *skipped += emit_events(map, grid, &crossings, skip, emission, events);
        }
        own
    });
    let (events, skipped): (Vec<_>, Vec<u64>) = parts.map(|part| (part.events, part.skipped)).unzip();
    (events, skipped.iter().sum())
}

/// Draws the maps of `steps` into the first of the grids.
fn draw_maps(
    scene: &Scene,
    ranges: &[Range<usize>],
    at_once: Option<&MapCasters>,
    layout: &Layout,
    steps: &[Vec2],
    own: &mut Collector,
) {
    let size = layout.map_size();
    let grids = &mut own.grids[..steps.len()];
    let Some(casters) = at_once else {
        let options =
            DepthOptions { range: DepthRange::Clamp, triangles: Some(ranges), ..Default::default() };
        for (&step, grid) in steps.iter().zip(grids) {
            render_depth_into(scene, layout.map_projection(step), &options, &mut own.raster, &mut own.map);
            grid.fill(size, &own.map.depth, layout.t_of_depth());
        }
        return;
    };
    grids.iter_mut().for_each(|grid| grid.clear(size));
    let stride = size as i32 + 2;
    let target = Target { size: size as i32, start: stride + 1, stride };
    let mut maps: Vec<_> = grids.iter_mut().map(DepthGrid::bordered_mut).collect();
    casters.draw(steps, target, &mut maps);
    grids.iter_mut().for_each(DepthGrid::drawn);
}

/// `shade.lookup`: V of every pixel that sees a surface, NaN elsewhere.
pub fn shade(lookup: &Lookup<'_>, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Skipped {
    let width = gbuffer.width.max(1) as usize;
    let level = Level::new();
    let rows = visibility.values.par_chunks_mut(width).enumerate();
    // Without vector instructions rounding down is a call.
    rows.map(|(row, values)| dispatch!(level, simd => shade_row(simd, lookup, gbuffer, row * width, values)))
        .reduce(Skipped::default, Skipped::add)
}

#[inline(always)]
fn shade_row<S: Simd>(
    _simd: S,
    lookup: &Lookup<'_>,
    gbuffer: &GBuffer,
    first: usize,
    values: &mut [f32],
) -> Skipped {
    let mut skipped = Skipped::default();
    for (values, first) in values.chunks_mut(BATCH).zip((first..).step_by(BATCH)) {
        skipped = skipped + lookup.surfaces(gbuffer, first, values);
    }
    skipped
}

/// Free points that a task looks up.
const POINTS: usize = 1024;

/// `shade.lookup` of free points: V, NaN at what is no point.
pub fn free_points(lookup: &Lookup<'_>, points: &[Vec3], visibility: &mut [f32]) -> Skipped {
    let level = Level::new();
    let tasks = visibility.par_chunks_mut(POINTS).zip(points.par_chunks(POINTS));
    tasks
        .map(|(values, points)| dispatch!(level, simd => free_chunk(simd, lookup, points, values)))
        .reduce(Skipped::default, Skipped::add)
}

#[inline(always)]
fn free_chunk<S: Simd>(_simd: S, lookup: &Lookup<'_>, points: &[Vec3], values: &mut [f32]) -> Skipped {
    let mut skipped = Skipped::default();
    for (values, points) in values.chunks_mut(BATCH).zip(points.chunks(BATCH)) {
        skipped = skipped + lookup.free_points(points, values);
    }
    skipped
}
