//! The CPU path, one function a stage, in the order and with the names of the report.

use std::ops::Range;

use glam::Vec3;
use gnomon_shadow_map::receiver_plane::view_tolerance;
use rayon::prelude::*;
use scene_core::raster::{
    DEPTH_POSITION_ERROR, DepthMap, DepthOptions, DepthRange, RasterScratch, render_depth_into,
};
use scene_core::{GBuffer, Light, Scene, VisibilityImage};

use crate::crossings::Crossings;
use crate::emission::{EmissionScratch, emit_events};
use crate::events::EventStrips;
use crate::functions::Functions;
use crate::grid::{DepthGrid, PixelGrid};
use crate::layout::Layout;

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

/// A thread's buffers while events are collected.
struct Collector {
    raster: RasterScratch,
    map: DepthMap,
    grid: DepthGrid,
    emission: EmissionScratch,
    events: EventStrips,
}

/// `prepare.events`: draws the map of every sample of the light and keeps its events; the map is forgotten at once, so
/// that memory grows with the events alone. The parts are in no order. Also how many rows of maps were skipped, if `skip`
/// says so.
pub fn collect_events(
    scene: &Scene,
    casters: &[Range<usize>],
    layout: &Layout,
    grid: PixelGrid,
    skip: bool,
) -> (Vec<EventStrips>, u64) {
    let size = layout.map_size();
    let options = DepthOptions { range: DepthRange::Clamp, triangles: Some(casters), ..Default::default() };
    let steps: Vec<_> = layout.steps().collect();
    let collector = || Collector {
        raster: RasterScratch::new(),
        map: DepthMap { width: size, height: size, depth: Vec::new() },
        grid: DepthGrid::default(),
        emission: EmissionScratch::default(),
        events: EventStrips::new(grid.size),
    };
    let threads = rayon::current_num_threads().max(1);
    let parts = steps.par_chunks(steps.len().div_ceil(threads).max(1)).map(|steps| {
        let (mut own, mut skipped) = (collector(), 0);
        for &step in steps {
            let projection = layout.map_projection(step);
            render_depth_into(scene, projection, &options, &mut own.raster, &mut own.map);
            own.grid.fill(size, &own.map.depth, layout.t_of_depth());
            let crossings = Crossings::new(step, layout.t_range());
            let Collector { grid: map, emission, events, .. } = &mut own;
            skipped += emit_events(map, grid, &crossings, skip, emission, events);
        }
        (own.events, skipped)
    });
    let (events, skipped): (Vec<_>, Vec<u64>) = parts.unzip();
    (events, skipped.iter().sum())
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
    /// [`gnomon_shadow_map::receiver_plane::plane_tolerance`].
    pub tolerance: f32,
    /// Whether four pixels are read.
    pub bilinear: bool,
}

/// Half the diagonal way from a texel's middle to its corner, in texels along each axis, and what the rasteriser's
/// snapping adds: how far the place whose depth a texel holds may be from the ray that reads it.
const READ_DISTANCE: f32 = 0.5 + DEPTH_POSITION_ERROR;

/// What t may be off, relative to |t| + |1 − t|, between a receiver and the map's point of the same place: with u = 2⁻²⁴
/// the receiver's t is off by 3 u of F/z = 1 − t and u of t, the map's depth by 10 u of its own largest
/// ([`scene_core::raster::depth_error`]), which is as much of 1 − t, and the event by 4 u of t. Together below 24 u.
const T_ERROR: f32 = 24.0 / 16_777_216.0;

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
    #[inline]
    fn surface(&self, receiver: Vec3, normal: Vec3, depth: f32) -> f32 {
        let Some((window, at)) = self.locate(receiver) else { return 1.0 };
        let layout = &window.layout;
        let (slope, lift) = layout.plane_slope(receiver, normal, at.t);
        let rounding =
            (self.tolerance + view_tolerance(depth)) * lift + T_ERROR * (at.t.abs() + (1.0 - at.t).abs());
        let before = at.t - READ_DISTANCE * slope.abs().element_sum() - rounding;
        if !before.is_finite() {
            // The plane holds the light's middle: half of the light is below it at best.
            return layout.share_above(receiver, normal);
        }
        let visibility = window.look_up(at.texel, before, slope, self.bilinear);
        visibility.min(layout.share_above(receiver, normal))
    }

    /// V at a free point, which has no surface of its own.
    pub fn free(&self, point: Vec3) -> f32 {
        if !point.is_finite() {
            return f32::NAN;
        }
        if !self.light.reaches(point) {
            return 0.0;
        }
        self.locate(point)
            .map_or(1.0, |(window, at)| window.look_up(at.texel, at.t, glam::Vec2::ZERO, self.bilinear))
    }

    #[inline]
    fn locate(&self, point: Vec3) -> Option<(&Window, crate::layout::WindowPoint)> {
        self.windows.iter().find_map(|window| window.layout.locate(point).map(|at| (window, at)))
    }
}

impl Window {
    /// V at a position on the window, at depth `t` there and `slope` more for every texel to the side.
    #[inline]
    fn look_up(&self, texel: glam::Vec2, t: f32, slope: glam::Vec2, bilinear: bool) -> f32 {
        let pixel = self.grid.from_texels(texel);
        // Far outside of the window, and for what is no number, there is nothing; the limit keeps the conversion below
        // from saturating.
        let is_near = pixel.abs().max_element() < 1e6;
        if !is_near {
            return 1.0;
        }
        let slope = slope * self.grid.ratio as f32;
        let at = |column: f32, row: f32| {
            let t = t + slope.dot(glam::Vec2::new(column, row) - pixel);
            self.functions.visibility(column as i32, row as i32, t)
        };
        if !bilinear {
            return at(pixel.x.round(), pixel.y.round());
        }
        let (low, weight) = (pixel.floor(), pixel - pixel.floor());
        let row = |row: f32| {
            let (left, right) = (at(low.x, row), at(low.x + 1.0, row));
            left + (right - left) * weight.x
        };
        let (top, bottom) = (row(low.y), row(low.y + 1.0));
        top + (bottom - top) * weight.y
    }
}

/// `shade.lookup`: V of every pixel that sees a surface, NaN elsewhere.
pub fn shade(lookup: &Lookup<'_>, gbuffer: &GBuffer, visibility: &mut VisibilityImage) {
    let width = gbuffer.width.max(1) as usize;
    visibility.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        for (column, value) in values.iter_mut().enumerate() {
            *value = shade_pixel(lookup, gbuffer, row * width + column);
        }
    });
}

#[inline]
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
    lookup.surface(receiver, normal, gbuffer.depth[pixel])
}
