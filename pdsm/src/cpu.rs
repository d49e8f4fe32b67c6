//! The CPU path, one function a stage, in the order and with the names of the report.

use std::ops::Range;

use fearless_simd::{Level, Simd, dispatch};
use glam::{Vec2, Vec3};
use gnomon_shadow_map::receiver_plane::view_tolerance;
use rayon::prelude::*;
use scene_core::geometry::Object;
use scene_core::raster::{DepthMap, DepthOptions, DepthRange, RasterScratch, render_depth_into};
use scene_core::{GBuffer, Light, Scene, VisibilityImage};

use crate::crossings::Crossings;
use crate::emission::{EmissionScratch, emit_events};
use crate::events::EventStrips;
use crate::functions::Functions;
use crate::grid::{DepthGrid, PixelGrid};
use crate::layout::{Layout, WindowPoint};
use crate::maps::{LANES, MapCasters, POSITION_ERROR, Target};

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

/// What the lookups read.
#[derive(Clone, Copy, Debug)]
pub struct Lookup<'a> {
    /// Geometry, for what receives.
    pub scene: &'a Scene,
    /// The light.
    pub light: &'a Light,
    /// Its windows.
    pub windows: &'a [Window],
    /// Those of casters that have a PDSM of their own.
    pub moving: &'a [Window],
    /// [`gnomon_shadow_map::receiver_plane::plane_tolerance`].
    pub tolerance: f32,
    /// Pixels that interpolation reaches along each axis: 1 reads four pixels, 0 the nearest one.
    pub radius: u32,
}

/// Half the diagonal way from a texel's middle to its corner, in texels along each axis, and what the drawing of maps
/// adds (the rasteriser of scene-core half as much): how far the place whose depth a texel holds may be from the ray that
/// reads it.
const READ_DISTANCE: f32 = 0.5 + POSITION_ERROR;

/// What t may be off, relative to |t| + |1 − t|, between a receiver and the map's point of the same place: with u = 2⁻²⁴
/// the receiver's t is off by 3 u of F/z = 1 − t and u of t, the map's depth by 10 u of its own largest
/// ([`scene_core::raster::depth_error`]), which is as much of 1 − t, and the event by 4 u of t. Together below 24 u.
pub(crate) const T_ERROR: f32 = 24.0 / 16_777_216.0;

/// How much before a surface with this slope, in t a texel, it is read: see [`Lookup`].
#[inline]
pub(crate) fn read_before(slope: Vec2) -> f32 {
    READ_DISTANCE * slope.abs().element_sum()
}

impl Lookup<'_> {
    /// `shade.lookup` of one receiver with the unit normal on its lit side.
    ///
    /// A function is read before the receiver's own surface, by what that surface can differ within a texel. On its
    /// plane t changes by g a texel of the window. In the map of a sample with step D a ray at t − b lies where the
    /// plane is at t − b·(g'·D), with g' = g/(1 + g·D) the slope in that map, and the texel's depth was taken up to
    /// [`READ_DISTANCE`] = r away along both axes. The plane does not shadow itself if b·(1 − g'·D) ≥ r·|g'|₁; since
    /// 1 − g'·D = 1/(1 + g·D) that is b ≥ r·|g|₁, the same for every map.
    ///
    /// Four pixels are read each where its own ray meets the receiver's plane.
    #[inline(always)]
    fn surface(&self, windows: &[Window], receiver: Vec3, normal: Vec3, depth: f32) -> f32 {
        let Some((window, at)) = locate(windows, receiver) else { return 1.0 };
        let layout = &window.layout;
        let (slope, lift) = layout.plane_slope(receiver, normal, at.t);
        let rounding = (self.tolerance + view_tolerance(depth)) * lift
            + T_ERROR * (at.t.abs() + (1.0 - at.t).abs())
            + window.functions.nodes().depth_error();
        let before = at.t - read_before(slope) - rounding;
        if !before.is_finite() {
            // The plane holds the light's middle: half of the light is below it at best.
            return layout.share_above(receiver, normal);
        }
        let visibility = window.look_up(at.texel, before, slope, self.radius);
        if visibility == 0.0 {
            return visibility;
        }
        visibility.min(layout.share_above(receiver, normal))
    }

    /// V at a free point, which has no surface of its own.
    #[inline(always)]
    pub fn free(&self, point: Vec3) -> f32 {
        if !point.is_finite() {
            return f32::NAN;
        }
        if !self.light.reaches(point) {
            return 0.0;
        }
        let of = |windows| {
            locate(windows, point)
                .map_or(1.0, |(window, at)| window.look_up(at.texel, at.t, Vec2::ZERO, self.radius))
        };
        // Windows of parts come first, and answer for surfaces alone.
        let parts = self.windows.partition_point(|window| window.layout.is_of_part());
        of(&self.windows[parts..]) * of(self.moving)
    }
}

#[inline(always)]
fn locate(windows: &[Window], point: Vec3) -> Option<(&Window, WindowPoint)> {
    windows.iter().find_map(|window| window.layout.locate(point).map(|at| (window, at)))
}

impl Window {
    /// V at a position on the window, at depth `t` there and `slope` more for every texel to the side.
    #[inline(always)]
    fn look_up(&self, texel: Vec2, t: f32, slope: Vec2, radius: u32) -> f32 {
        let pixel = self.grid.from_texels(texel);
        // Far outside of the window, and for what is no number, there is nothing; the limit keeps the conversion below
        // from saturating.
        let is_near = pixel.abs().max_element() < 1e6;
        if !is_near {
            return 1.0;
        }
        let slope = slope * self.grid.ratio as f32;
        if radius == 0 {
            let nearest = pixel.round();
            let t = t + slope.dot(nearest - pixel);
            return self.functions.visibility(nearest.x as i32, nearest.y as i32, t);
        }
        if radius > 1 {
            return self.look_up_wide(pixel, t, slope, radius);
        }
        let low = pixel.floor();
        let weight = pixel - low;
        let first = t - slope.dot(weight);
        let depths = [first, first + slope.x, first + slope.y, first + slope.x + slope.y];
        let [a, b, c, d] = self.functions.four(low.x as i32, low.y as i32, depths);
        let (top, bottom) = (a + (b - a) * weight.x, c + (d - c) * weight.x);
        top + (bottom - top) * weight.y
    }
}

impl Window {
    /// [`look_up`](Self::look_up) with a tent over 4·radius² pixels; weights along an axis sum to the radius. Each pixel is
    /// read where its own ray meets the receiver's plane, so that a wide filter shadows no more of a plane than a narrow one.
    fn look_up_wide(&self, pixel: Vec2, t: f32, slope: Vec2, radius: u32) -> f32 {
        let reach = radius as f32;
        let first = pixel.floor() - (reach - 1.0);
        let mut sum = 0.0;
        for row in 0..2 * radius {
            for column in 0..2 * radius {
                let at = first + Vec2::new(column as f32, row as f32);
                let way = at - pixel;
                let weight = 1.0 - way.abs() / reach;
                let v = self.functions.visibility(at.x as i32, at.y as i32, t + slope.dot(way));
                sum += weight.x * weight.y * v;
            }
        }
        (sum / (reach * reach)).clamp(0.0, 1.0)
    }
}

/// `shade.lookup`: V of every pixel that sees a surface, NaN elsewhere.
pub fn shade(lookup: &Lookup<'_>, gbuffer: &GBuffer, visibility: &mut VisibilityImage) {
    let width = gbuffer.width.max(1) as usize;
    let level = Level::new();
    visibility.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        // Without vector instructions rounding down is a call.
        dispatch!(level, simd => shade_row(simd, lookup, gbuffer, row * width, values));
    });
}

#[inline(always)]
fn shade_row<S: Simd>(_simd: S, lookup: &Lookup<'_>, gbuffer: &GBuffer, first: usize, values: &mut [f32]) {
    for (value, pixel) in values.iter_mut().zip(first..) {
        *value = shade_pixel(lookup, gbuffer, pixel);
    }
}

/// Free points that a task looks up.
const POINTS: usize = 1024;

/// `shade.lookup` of free points: see [`Lookup::free`].
pub fn free_points(lookup: &Lookup<'_>, points: &[Vec3], visibility: &mut [f32]) {
    let level = Level::new();
    visibility.par_chunks_mut(POINTS).zip(points.par_chunks(POINTS)).for_each(|(values, points)| {
        dispatch!(level, simd => free_chunk(simd, lookup, points, values));
    });
}

#[inline(always)]
fn free_chunk<S: Simd>(_simd: S, lookup: &Lookup<'_>, points: &[Vec3], values: &mut [f32]) {
    for (value, &point) in values.iter_mut().zip(points) {
        *value = lookup.free(point);
    }
}

#[inline(always)]
fn shade_pixel(lookup: &Lookup<'_>, gbuffer: &GBuffer, pixel: usize) -> f32 {
    if !gbuffer.is_seen(pixel) {
        return f32::NAN;
    }
    if !lookup.scene.objects()[gbuffer.object[pixel] as usize].flags.receives {
        return 1.0;
    }
    let (receiver, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
    if !lookup.light.reaches(receiver) {
        return 0.0;
    }
    let of = |windows| lookup.surface(windows, receiver, normal, gbuffer.depth[pixel]);
    let visibility = of(lookup.windows);
    if lookup.moving.is_empty() {
        return visibility;
    }
    // Which part of the light each hides is not known: the product takes the parts to be independent.
    visibility * of(lookup.moving)
}
