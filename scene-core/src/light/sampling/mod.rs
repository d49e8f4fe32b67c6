//! Points of a light as a receiver sees it, so that equally many of them stand for equal shares of V.
//!
//! Two halves meet in the unit square. A [`LightView`] maps the square onto the light with the measure that V
//! is defined by ([`Light`](super::Light)): area for `rect` and `disk`, solid angle for `sphere` and
//! `directional`. A pattern fills the square: [`Strata`] (jittered cells of equal area, for any number of
//! samples) or [`sobol`] (an Owen-scrambled (0, 2)-sequence).
//!
//! Both patterns are functions of a [`SampleKey`], made from a seed and a pixel: the same key gives the same
//! points on any thread of any machine, and the keys of two pixels share nothing that can be seen. Nothing
//! allocates: the caller's slice is filled.
//!
//! ```
//! use glam::Vec3;
//! use gnomon_scene_core::light::sampling::{LightView, SampleKey, stratified};
//! use gnomon_scene_core::light::{Light, LightPoint};
//!
//! let light = Light::Sphere { center: Vec3::Y, radius: 0.25 };
//! let view = LightView::new(&light, Vec3::ZERO);
//! let mut points = [LightPoint::At(Vec3::ZERO); 13];
//! stratified(&view, SampleKey::new(0, 7), &mut points);
//! ```

mod key;
mod sobol;
mod strata;
mod view;

pub use key::SampleKey;
pub use sobol::{sobol, sobol_of_seeds};
pub use strata::Strata;
pub use view::LightView;

use glam::Vec2;

use super::LightPoint;

/// Points mapped at a time: small enough for the stack, large enough to forget the call.
const BATCH: usize = 64;

/// Fills `points` with one jittered point from each of `points.len()` parts of the light of equal measure.
/// An empty slice stays empty.
pub fn stratified(view: &LightView, key: SampleKey, points: &mut [LightPoint]) {
    if let Ok(samples @ 1..) = u32::try_from(points.len()) {
        Strata::new(samples, view.aspect()).fill(view, key, points);
    }
}

/// Fills `points` with the first `points.len()` points of a scrambled [`sobol`] sequence; any prefix of them is
/// well spread too, powers of two best.
pub fn low_discrepancy(view: &LightView, key: SampleKey, points: &mut [LightPoint]) {
    let mut squares = [Vec2::ZERO; BATCH];
    for (batch, points) in (0..).zip(points.chunks_mut(BATCH)) {
        for (index, square) in (batch * BATCH as u32..).zip(&mut squares[..points.len()]) {
            *square = sobol(index, key);
        }
        view.points(&squares, points);
    }
}
