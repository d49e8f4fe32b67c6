//! How coarse a map is where it is looked at (section 1.1): d, the size of a texel in the image, in pixels.
//!
//! The paper's `d = d_s (r_s/r_i)(cos β/cos α)` is for one direction in a plane. On a surface a texel is a parallelogram;
//! here d is the mean length of its sides in the image, exact for any warp: with t₁, t₂ spanning the surface, `J_m` the
//! derivatives of the place in the map along them and `J_i` those of the pixel, the sides are the columns of
//! `J_i J_m⁻¹` times the texel's size. The mean width of a parallelogram, over all directions that a shadow's edge may
//! have, is 2/π times the sum of its two sides: wrong pixels along edges grow in proportion to d.

use glam::{DMat2, DVec3};
use rayon::prelude::*;

use crate::seen::Sample;
use crate::view_frame::ViewFrame;
use crate::warp::{Warp, Window, at};

/// Samples that a task measures at least, some 10 µs: a smaller one costs more to hand over.
const SAMPLES_A_TASK: usize = 128;

/// d at a surface point with the unit normal `normal`, of a map of `map_size` texels a side. Infinite where the map or
/// the camera sees the surface edge-on.
pub fn texel_in_pixels(
    warp: &Warp,
    window: &Window,
    map_size: u32,
    frame: &ViewFrame,
    point: DVec3,
    normal: DVec3,
) -> f64 {
    let [c1, c2] = texel_sides(warp, window, map_size, frame, point, normal);
    let d = (c1 + c2) * 0.5;
    if d.is_nan() { f64::INFINITY } else { d }
}

/// The lengths of a texel's sides in the image in pixels: along x and along y of the map.
pub fn texel_sides(
    warp: &Warp,
    window: &Window,
    map_size: u32,
    frame: &ViewFrame,
    point: DVec3,
    normal: DVec3,
) -> [f64; 2] {
    let (t1, t2) = normal.any_orthonormal_pair();
    let [i, j] = frame.pixel_gradients(point);
    let in_image = along(i, j, [t1, t2]) * surface_from_place(warp, point, [t1, t2]);
    let texel = window.texel(map_size);
    [in_image.x_axis.length() * texel.x, in_image.y_axis.length() * texel.y]
}

/// Derivatives of two functions with these gradients along the surface's two directions.
fn along(a: DVec3, b: DVec3, [t1, t2]: [DVec3; 2]) -> DMat2 {
    DMat2::from_cols_array(&[a.dot(t1), b.dot(t1), a.dot(t2), b.dot(t2)])
}

/// How a point moves on the surface with its place in the map: the inverse of `J_m`.
pub(crate) fn surface_from_place(warp: &Warp, point: DVec3, surface: [DVec3; 2]) -> DMat2 {
    let w = at(warp.w, point);
    let place = warp.place(point);
    let u = (warp.x - warp.w * place.x).truncate() / w;
    let v = (warp.y - warp.w * place.y).truncate() / w;
    along(u, v, surface).inverse()
}

/// What wrong pixels go by: the mean length of a texel's sides on the surface, in scene units.
///
/// Where shadows have ρ of edges on a unit of surface, a map moves each by a share of the texel's width c there, and the share
/// ρc of the surface is wrong: that of the pixels that see it, too, however large they are on it. d is c over the width of a pixel,
/// so that a mean of d counts the near ground, of which pixels see little and edges are few, for more than its wrong pixels.
/// How ρ varies is not known before there is a map; it is taken for the same everywhere.
pub fn expected_error(warp: &Warp, window: &Window, map_size: u32, point: DVec3, normal: DVec3) -> f64 {
    let (t1, t2) = normal.any_orthonormal_pair();
    let on_surface = surface_from_place(warp, point, [t1, t2]);
    let texel = window.texel(map_size);
    (on_surface.x_axis.length() * texel.x + on_surface.y_axis.length() * texel.y) * 0.5
}

/// [`expected_error`] at each sample.
pub fn expected_errors(warp: &Warp, window: &Window, map_size: u32, samples: &[Sample]) -> Vec<f64> {
    let samples = samples.par_iter().with_min_len(SAMPLES_A_TASK);
    samples.map(|s| expected_error(warp, window, map_size, s.point, s.normal)).collect()
}

/// d over what is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Aliasing {
    /// Mean, in pixels a texel.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Samples it is of; with none all is 0.
    pub samples: usize,
}

impl Aliasing {
    /// Of values of d; those that are not finite count as samples, and in the percentiles.
    pub fn of(mut values: Vec<f64>) -> Self {
        if values.is_empty() {
            return Self::default();
        }
        let samples = values.len();
        let mean = values.iter().sum::<f64>() / samples as f64;
        let mut rank = |q: f64| {
            let index = ((samples - 1) as f64 * q).round() as usize;
            *values.select_nth_unstable_by(index, f64::total_cmp).1
        };
        Self { mean, median: rank(0.5), p99: rank(0.99), samples }
    }
}

/// d of each sample.
pub fn of_samples(
    warp: &Warp,
    window: &Window,
    map_size: u32,
    frame: &ViewFrame,
    samples: &[Sample],
) -> Vec<f64> {
    let samples = samples.par_iter().with_min_len(SAMPLES_A_TASK);
    samples.map(|s| texel_in_pixels(warp, window, map_size, frame, s.point, s.normal)).collect()
}
