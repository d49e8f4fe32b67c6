//! The receiver's plane in the texels of a view: question 1 of [`receiver_plane`](crate::receiver_plane) for every
//! tap of a filter, by one comparison with a depth that is affine in the texel's column and row.
//!
//! A filter looks away from the receiver's own texel, where the receiver's surface has another depth. A constant
//! bias must be as large as the surface's slope times the filter's radius; the plane itself needs none. A stored
//! point q rises above the plane through p with normal n if n·(q − p) > tolerance. With q written in the
//! view's coordinates (x, y, d) that is
//!
//! - for parallel light, q = o + X·x + Y·y + Z·d:  n·Z·d + n·X·x + n·Y·y + n·(o − p) − tolerance > 0;
//! - for a central view, q = e + (F + X·x + Y·y)·near/d, multiplied by d > 0:
//!   (n·(e − p) − tolerance)·d + near·(n·F + n·X·x + n·Y·y) > 0.
//!
//! Rounding is a few units in the last place of distances within scene and light, as in the point's own form: what
//! [`plane_tolerance`](crate::receiver_plane::plane_tolerance) allows for.

use glam::Vec3;
use scene_core::raster::DEPTH_POSITION_ERROR;

use crate::light_maps::Receiver;
use crate::light_views::{LightView, Unprojection};

/// `depth`·d + `origin` + `row`·r + `column`·c is positive if the point at depth d in row r and column c rises
/// above the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelPlane {
    depth: f32,
    origin: f32,
    column: f32,
    row: f32,
}

impl TexelPlane {
    /// The plane of `receiver` in a map of `size` texels a side, drawn through `view`.
    #[inline]
    pub fn new(view: &LightView, size: u32, receiver: &Receiver) -> Self {
        let Receiver { point, normal, tolerance, .. } = *receiver;
        let texel = 2.0 / size as f32;
        let along = |axis: Vec3| normal.dot(axis);
        // What the rasteriser's snapping moves a stored point: a share of the texel's diagonal.
        let snapping = |x: Vec3, y: Vec3| {
            (x.length_squared() + y.length_squared()).sqrt() * texel * DEPTH_POSITION_ERROR
        };
        let (depth, origin, x, y) = match view.unproject {
            Unprojection::Parallel { origin, x, y, z } => {
                (along(z), along(origin - point) - tolerance - snapping(x, y), along(x), along(y))
            }
            Unprojection::Central { eye, forward, x, y, near } => (
                along(eye - point) - tolerance,
                near * (along(forward) - snapping(x, y)),
                near * along(x),
                near * along(y),
            ),
        };
        // From the texel's centre to device coordinates: x = (c + ½)·texel − 1, y = 1 − (r + ½)·texel.
        let first = 0.5 * texel - 1.0;
        Self { depth, origin: origin + x * first - y * first, column: x * texel, row: -y * texel }
    }

    /// Positive if the surface stored with `depth` in a texel rises above the plane. In each argument it never
    /// falls, or never rises, rounding included.
    #[inline]
    pub fn rise(&self, column: f32, row: f32, depth: f32) -> f32 {
        self.depth * depth + ((self.origin + self.row * row) + self.column * column)
    }

    /// The nearest depth that the plane itself has between two corners in columns and rows; infinite where the light
    /// shines along it.
    #[inline]
    pub fn nearest(&self, first: [f32; 2], last: [f32; 2]) -> f32 {
        let at = |column: f32, row: f32| -((self.origin + self.row * row) + self.column * column);
        let upper = at(first[0], first[1]).max(at(last[0], first[1]));
        let lower = at(first[0], last[1]).max(at(last[0], last[1]));
        if self.depth > 0.0 { upper.max(lower) / self.depth } else { f32::INFINITY }
    }

    /// Whether no depth up to `nearest` in the texels `first` to `last` (column and row, inclusive) rises: by
    /// monotony what holds at the corners holds for all of them.
    #[inline]
    pub fn hides_none(&self, first: [f32; 2], last: [f32; 2], nearest: f32) -> bool {
        let corner = |column: f32, row: f32| self.rise(column, row, nearest) <= 0.0;
        nearest <= 0.0
            || self.depth >= 0.0
                && corner(first[0], first[1])
                && corner(last[0], first[1])
                && corner(first[0], last[1])
                && corner(last[0], last[1])
    }
}
