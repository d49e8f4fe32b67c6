//! Depth maps of the casters: what a shadow map is made of.

use std::ops::Range;

use glam::Mat4;
use rayon::prelude::*;

use super::MAX_SIDE;
use super::bins::BAND_ROWS;
use super::draw::{Drawing, RasterScratch, draw};
use super::pixels::{DepthPixels, TrianglePixels};
use super::projection::Projection;
use crate::{GBuffer, Scene};

/// Which end of [0, 1] is near.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthConvention {
    /// 1 at the near plane, 0 at the far plane or at infinity; cleared to 0, the greater depth wins.
    #[default]
    Reversed,
    /// 0 at the near plane, 1 at the far plane; cleared to 1, the lesser depth wins.
    Forward,
}

impl DepthConvention {
    /// Depth where there is nothing.
    pub fn clear_value(self) -> f32 {
        match self {
            Self::Reversed => 0.0,
            Self::Forward => 1.0,
        }
    }

    /// Whether depth `a` is nearer than depth `b`; never with NaN.
    pub fn is_nearer(self, a: f32, b: f32) -> bool {
        match self {
            Self::Reversed => a > b,
            Self::Forward => a < b,
        }
    }
}

/// What becomes of a surface before the near plane or beyond the far one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthRange {
    /// It is not drawn, pixel by pixel.
    #[default]
    Clip,
    /// It is drawn with its depth clamped to [0, 1]. For parallel light: a caster before the near plane still
    /// throws its shadow. What lies at or behind the eye of a perspective projection is never drawn.
    Clamp,
}

/// Faces that are left out. A front face has its corners counter-clockwise as seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cull {
    /// None: all meshes are double-sided.
    #[default]
    None,
    /// Front faces.
    Front,
    /// Back faces.
    Back,
}

/// How a depth map is drawn.
#[derive(Clone, Copy, Debug, Default)]
pub struct DepthOptions<'a> {
    /// Which end of the depth range is near; must be that of the projection.
    pub convention: DepthConvention,
    /// What becomes of depths out of range.
    pub range: DepthRange,
    /// Faces left out.
    pub cull: Cull,
    /// If given, only triangles in one of these ranges of [`Scene::triangles`] are drawn. They may come in any
    /// order; what lies outside the scene is ignored. Objects that do not cast are never drawn.
    pub triangles: Option<&'a [Range<usize>]>,
    /// If given, the columns and rows that matter: pixels inside of them are those of the whole target, bit for bit;
    /// one outside may hold what it held before or a part of what lies there, and rows after them may not be held at all.
    pub window: Option<&'a [Range<u32>; 2]>,
}

/// Depth seen through a projection, row by row from the top left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthMap {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Depth after projection, in [0, 1]; the convention's clear value where there is nothing.
    pub depth: Vec<f32>,
}

/// How far from a pixel's centre, in pixels along x and along y, the point of a triangle may project whose depth
/// is stored: half a step of the snapped coordinates.
pub const DEPTH_POSITION_ERROR: f32 = 0.5 / super::projection::SUBPIXELS as f32;

/// A bound for the error of a stored depth against the exact depth of its triangle's plane at the pixel's
/// centre, from the plane's `slope` (change of depth a pixel, along x plus along y, absolute) and the largest
/// depth of the triangle's corners (0 to 1; the range of depths is at most that).
///
/// The first term is [`DEPTH_POSITION_ERROR`] and, where blocks of eight pixels are stepped through in f32, two
/// roundings over eight steps. The second counts roundings of half an ulp (2⁻²⁴): one a corner when projected,
/// seven relative to the depth range in the weights, their products and sum, two when the result is put
/// together.
pub fn depth_error(slope: f32, largest: f32) -> f32 {
    const HALF_ULP: f32 = f32::EPSILON * 0.5;
    slope * (DEPTH_POSITION_ERROR + 16.0 * HALF_ULP) + largest * (10.0 * HALF_ULP)
}

/// Draws the casters of `scene` as seen through `clip_from_world`, nearest depth first.
///
/// The matrix may be any: perspective, orthographic, a cube's face. Clip space is that of wgpu: x and y in
/// [−w, w] (y up, row 0 on top), depth in [0, w]. An empty scene, a side of 0 and a matrix that is not finite
/// give an empty map.
///
/// # Panics
/// If a side is longer than [`MAX_SIDE`].
pub fn render_depth(
    scene: &Scene,
    clip_from_world: Mat4,
    width: u32,
    height: u32,
    options: &DepthOptions<'_>,
) -> DepthMap {
    let mut target = DepthMap { width, height, depth: Vec::new() };
    render_depth_into(scene, clip_from_world, options, &mut RasterScratch::new(), &mut target);
    target
}

/// [`render_depth`] into a map that is there already, of its width and height; with the same `scratch` a repeated
/// frame allocates nothing.
///
/// # Panics
/// If a side is longer than [`MAX_SIDE`].
pub fn render_depth_into(
    scene: &Scene,
    clip_from_world: Mat4,
    options: &DepthOptions<'_>,
    scratch: &mut RasterScratch,
    target: &mut DepthMap,
) {
    let drawing = drawing(scene, clip_from_world, options, target.width, target.height);
    let band = band_pixels(target, options);
    let bands = target.depth.par_chunks_mut(band).map(|depth| depth_pixels(depth, options));
    draw(&drawing, casters(scene, options), scratch, bands);
}

/// [`render_depth_into`], and into `triangles` the triangle that is seen, [`GBuffer::NOTHING`] where there is
/// none. Of equally near surfaces the one with the lowest triangle index is seen.
///
/// # Panics
/// If a side is longer than [`MAX_SIDE`].
pub fn render_depth_and_triangles_into(
    scene: &Scene,
    clip_from_world: Mat4,
    options: &DepthOptions<'_>,
    scratch: &mut RasterScratch,
    target: &mut DepthMap,
    triangles: &mut Vec<u32>,
) {
    let drawing = drawing(scene, clip_from_world, options, target.width, target.height);
    let band = band_pixels(target, options);
    if options.window.is_some() && triangles.is_empty() {
        // Zeroes that nobody looks at cost no memory.
        *triangles = vec![0; target.depth.len()];
    } else {
        triangles.resize(target.depth.len(), GBuffer::NOTHING);
    }
    let bands = target
        .depth
        .par_chunks_mut(band)
        .zip(triangles.par_chunks_mut(band))
        .map(|(depth, triangle)| TrianglePixels { depth: depth_pixels(depth, options), triangle });
    draw(&drawing, casters(scene, options), scratch, bands);
}

/// [`render_depth_and_triangles_into`], with the id of the triangle's object in its place.
///
/// # Panics
/// If a side is longer than [`MAX_SIDE`].
pub fn render_depth_and_objects_into(
    scene: &Scene,
    clip_from_world: Mat4,
    options: &DepthOptions<'_>,
    scratch: &mut RasterScratch,
    target: &mut DepthMap,
    objects: &mut Vec<u32>,
) {
    render_depth_and_triangles_into(scene, clip_from_world, options, scratch, target, objects);
    let band = (target.width as usize * BAND_ROWS).max(1);
    objects.par_chunks_mut(band).for_each(|objects| {
        // Neighbours mostly see the same object.
        let (mut range, mut id) = (0..0, GBuffer::NOTHING);
        for object in objects.iter_mut().filter(|object| **object != GBuffer::NOTHING) {
            let triangle = *object as usize;
            if !range.contains(&triangle) {
                id = scene.object_of(triangle);
                range = scene.objects()[id as usize].triangles.clone();
            }
            *object = id;
        }
    });
}

/// Sizes a target, to the last band that matters, and returns the pixels of a full band.
fn band_pixels(target: &mut DepthMap, options: &DepthOptions<'_>) -> usize {
    let (width, height) = (target.width as usize, target.height as usize);
    let rows = options
        .window
        .map_or(height, |window| (window[1].end as usize).next_multiple_of(BAND_ROWS).min(height));
    if target.depth.is_empty() {
        target.depth = vec![0.0; width * rows];
    } else {
        target.depth.resize(width * rows, 0.0);
    }
    (width * BAND_ROWS).max(1)
}

fn depth_pixels<'a>(depth: &'a mut [f32], options: &DepthOptions<'_>) -> DepthPixels<'a> {
    let negate = options.convention == DepthConvention::Forward;
    let clear = options.convention.clear_value();
    DepthPixels { depth, clear: if negate { -clear } else { clear }, negate }
}

pub(super) fn drawing<'a>(
    scene: &'a Scene,
    clip_from_world: Mat4,
    options: &DepthOptions<'_>,
    width: u32,
    height: u32,
) -> Drawing<'a> {
    assert!(width <= MAX_SIDE && height <= MAX_SIDE, "a side of {width} × {height} is above {MAX_SIDE}");
    let reversed = options.convention == DepthConvention::Reversed;
    let window = |axis: usize, size: u32| {
        let all = 0..size as i32;
        options.window.map_or(all, |w| w[axis].start.min(size) as i32..w[axis].end.min(size) as i32)
    };
    Drawing {
        scene,
        projection: Projection::new(&clip_from_world.as_dmat4(), width, height, reversed),
        width,
        height,
        cull: options.cull,
        clamp: options.range == DepthRange::Clamp,
        window: [window(0, width), window(1, height)],
    }
}

/// The ranges to draw, each within one object.
pub(super) fn casters<'a>(
    scene: &'a Scene,
    options: &DepthOptions<'a>,
) -> impl Iterator<Item = (Range<usize>, u32)> + Clone + use<'a> {
    let all = 0..scene.triangles().len();
    let (filter, all) = match options.triangles {
        Some(ranges) => (ranges, None),
        None => (&[] as &[Range<usize>], Some(all)),
    };
    filter.iter().cloned().chain(all).flat_map(move |range| {
        let first = scene.objects().partition_point(|o| o.triangles.end <= range.start);
        let objects = scene.objects().iter().enumerate().skip(first);
        let end = range.end;
        objects
            .take_while(move |(_, o)| o.triangles.start < end)
            .filter(|(_, o)| o.flags.casts)
            .map(move |(id, o)| {
                (o.triangles.start.max(range.start)..o.triangles.end.min(range.end), id as u32)
            })
            .filter(|(range, _)| !range.is_empty())
    })
}
