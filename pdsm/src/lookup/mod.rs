//! Lookups of many receivers side by side (algorithm 2), one function each or four.
//!
//! Receivers are looked up [`BATCH`] at a time, stage by stage: where they lie on a window ([`places`]), which of them lie
//! before the start of all their functions, where the others' nodes are ([`reads`]). What is arithmetic is done for a vector of
//! them at once; what waits for memory does not depend on another such wait of its stage, so that the processor waits for
//! many of them at once, and is fetched by a loop that does nothing else. V is what one lookup after the other gives, bit for bit.

mod places;
mod reads;

use std::ops::Add;

use glam::{Vec2, Vec3};
use gnomon_shadow_map::receiver_plane::view_tolerance;
use scene_core::{GBuffer, Light, Scene};

use crate::cpu::Window;
use crate::functions::Functions;
use crate::maps::POSITION_ERROR;
use places::{Places, Points};
use reads::{interpolate, nearest};

/// Receivers that are looked up side by side.
pub(crate) const BATCH: usize = 32;

/// A number for each receiver of a batch.
type Lanes<T> = [T; BATCH];

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
    /// Whether functions are left out that change nothing: see [`Skipped`].
    pub skip: bool,
}

/// Lookups that read no function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Skipped {
    /// Of receivers that lie before the start of all functions that they would be read from.
    pub lit: u64,
    /// Of receivers whose plane has none of the light above it.
    pub below: u64,
}

impl Add for Skipped {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { lit: self.lit + other.lit, below: self.below + other.below }
    }
}

/// Half the diagonal way from a texel's middle to its corner, in texels along each axis, and what the drawing of maps
/// adds (the rasteriser of scene-core half as much): how far the place whose depth a texel holds may be from the ray that
/// reads it.
pub(crate) const READ_DISTANCE: f32 = 0.5 + POSITION_ERROR;

/// What t may be off, relative to |t| + |1 − t|, between a receiver and the map's point of the same place: with u = 2⁻²⁴
/// the receiver's t is off by 3 u of F/z = 1 − t and u of t, the map's depth by 10 u of its own largest
/// ([`scene_core::raster::depth_error`]), which is as much of 1 − t, and the event by 4 u of t. Together below 24 u.
pub(crate) const T_ERROR: f32 = 24.0 / 16_777_216.0;

/// How much before a surface with this slope, in t a texel, it is read: see [`Lookup::surfaces`].
#[inline]
pub(crate) fn read_before(slope: Vec2) -> f32 {
    READ_DISTANCE * slope.abs().element_sum()
}

impl Lookup<'_> {
    /// `shade.lookup` of at most [`BATCH`] pixels of the G-buffer from `first` on: V, NaN where no surface is seen.
    ///
    /// A function is read before the receiver's own surface, by what that surface can differ within a texel. On its
    /// plane t changes by g a texel of the window. In the map of a sample with step D a ray at t − b lies where the
    /// plane is at t − b·(g'·D), with g' = g/(1 + g·D) the slope in that map, and the texel's depth was taken up to
    /// [`READ_DISTANCE`] = r away along both axes. The plane does not shadow itself if b·(1 − g'·D) ≥ r·|g'|₁; since
    /// 1 − g'·D = 1/(1 + g·D) that is b ≥ r·|g|₁, the same for every map.
    ///
    /// Four pixels are read each where its own ray meets the receiver's plane.
    #[inline(always)]
    pub(crate) fn surfaces(&self, gbuffer: &GBuffer, first: usize, values: &mut [f32]) -> Skipped {
        let objects = self.scene.objects();
        let is_cone = matches!(self.light, Light::Spot { .. });
        let mut asked = [false; BATCH];
        for ((value, asked), pixel) in values.iter_mut().zip(&mut asked).zip(first..) {
            *value = if !gbuffer.is_seen(pixel) {
                f32::NAN
            } else if !objects[gbuffer.object[pixel] as usize].flags.receives {
                1.0
            } else if is_cone && !self.light.reaches(gbuffer.position[pixel]) {
                0.0
            } else {
                *asked = true;
                1.0
            };
        }
        if asked == [false; BATCH] {
            return Skipped::default();
        }
        let seen = first..first + values.len();
        let position = Points::new(&gbuffer.position[seen.clone()]);
        let normal = Points::new(&gbuffer.normal[seen.clone()]);
        let mut tolerance = [self.tolerance; BATCH];
        for (tolerance, &depth) in tolerance.iter_mut().zip(&gbuffer.depth[seen]) {
            *tolerance += view_tolerance(depth);
        }
        // Which part of the light still and moving casters hide is not known: the product takes the parts to be independent.
        let mut skipped = Skipped::default();
        for windows in [self.windows, self.moving] {
            let mut waiting = asked;
            for window in windows {
                let places = Places::of_surfaces(window, &position, &normal, &tolerance, &waiting, self.skip);
                skipped = skipped + self.multiply(window, &places, values);
                if places.take_from(&mut waiting) {
                    break;
                }
            }
        }
        skipped
    }

    /// V at at most [`BATCH`] free points, which have no surface of their own; NaN at what is no point.
    #[inline(always)]
    pub(crate) fn free_points(&self, points: &[Vec3], values: &mut [f32]) -> Skipped {
        let mut asked = [false; BATCH];
        for ((value, asked), &point) in values.iter_mut().zip(&mut asked).zip(points) {
            *value = if !point.is_finite() {
                f32::NAN
            } else if !self.light.reaches(point) {
                0.0
            } else {
                *asked = true;
                1.0
            };
        }
        let position = Points::new(points);
        // Windows of parts come first, and answer for surfaces alone.
        let parts = self.windows.partition_point(|window| window.layout.is_of_part());
        let mut skipped = Skipped::default();
        for windows in [&self.windows[parts..], self.moving] {
            let mut waiting = asked;
            for window in windows {
                let places = Places::of_points(window, &position, &waiting);
                skipped = skipped + self.multiply(window, &places, values);
                if places.take_from(&mut waiting) {
                    break;
                }
            }
        }
        skipped
    }

    /// Multiplies V of the receivers that lie on `window` by what it says of them.
    #[inline(always)]
    fn multiply(&self, window: &Window, places: &Places, values: &mut [f32]) -> Skipped {
        let functions = &window.functions;
        let mut found = [1.0; BATCH];
        let lit = match self.radius {
            0 => nearest(functions, places, self.skip, &mut found),
            1 => interpolate(functions, places, self.skip, &mut found),
            _ => {
                for (k, found) in found.iter_mut().enumerate().filter(|&(k, _)| places.is_read[k]) {
                    *found = places.filter(k, functions, self.radius);
                }
                0
            }
        };
        for (k, value) in values.iter_mut().enumerate() {
            let visibility = found[k];
            *value *= if !places.belongs[k] {
                1.0
            } else if places.is_above[k] || (places.is_read[k] && visibility == 0.0) {
                visibility
            } else if places.is_below[k] {
                0.0
            } else {
                // Where it is not read, the plane holds the light's middle: half of the light is below it at best.
                visibility.min(places.share_above(k, window))
            };
        }
        let below = if self.skip { places.below() } else { 0 };
        Skipped { lit, below }
    }
}

impl Places {
    /// V of a place, with a tent over 4·radius² pixels, weights along an axis summing to the radius. Each pixel is
    /// read where its own ray meets the receiver's plane, so that a wide filter shadows no more of a plane than a narrow one.
    fn filter(&self, k: usize, functions: &Functions, radius: u32) -> f32 {
        if !self.is_near(k) {
            return 1.0;
        }
        let pixel = Vec2::new(self.pixel[0][k], self.pixel[1][k]);
        let slope = Vec2::new(self.slope[0][k], self.slope[1][k]);
        let reach = radius as f32;
        let first = pixel.floor() - (reach - 1.0);
        let mut sum = 0.0;
        for row in 0..2 * radius {
            for column in 0..2 * radius {
                let at = first + Vec2::new(column as f32, row as f32);
                let weight = 1.0 - (at - pixel).abs() / reach;
                let t = self.t[k] + slope.dot(at - pixel);
                sum += weight.x * weight.y * functions.visibility(at.x as i32, at.y as i32, t);
            }
        }
        (sum / (reach * reach)).clamp(0.0, 1.0)
    }
}
