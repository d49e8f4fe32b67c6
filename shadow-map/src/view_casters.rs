//! Which casters the texels can hold that a camera's surfaces are looked up in.
//!
//! A lookup reads the surface at the centre of the receiver's texel, so what matters is everything on the lines from
//! the light through those centres, before *and beyond* the receivers: if a surface beyond were left out, another
//! one farther off would be stored and asked in its place. So each texel that is looked up holds the same
//! triangle as in a map of all casters, and no pixel changes.

use glam::DVec3;
use scene_core::light::LightPoint;
use scene_core::relevance::{CasterRegion, HalfSpace, Receivers, RelevantCasters};
use scene_core::{Light, Report, Scene};

use crate::light_maps::Window;
use crate::light_views::{LightView, TexelBounds};

/// What of one view's map matters.
#[derive(Clone, Debug)]
pub struct ViewNeeds {
    /// The casters that the texels can hold.
    pub casters: RelevantCasters,
    /// The texels.
    pub window: Window,
}

impl ViewNeeds {
    /// Books what is left out of a map of `map_size` texels a side.
    pub fn book(&self, report: &mut Report, map_size: u32) {
        self.casters.book(report);
        let texels: u64 = self.window.iter().map(|side| u64::from(side.end - side.start)).product();
        report.skip("texels outside view", u64::from(map_size).pow(2) - texels);
    }
}

/// The region of those lines for `receivers` in maps of `map_size` texels a side, where a lookup reads texels up to `reach`
/// beside the receiver's own.
///
/// Receivers are grown by 1 + `reach` diagonals of the largest texel at the distance of the farthest receiver: a
/// texel's centre is half of one away from the place that is looked up at most, and the rasteriser's snapping
/// ([`scene_core::raster::DEPTH_POSITION_ERROR`]) far less.
pub fn looked_up_behind(
    scene: &Scene,
    light: &Light,
    receivers: &Receivers,
    views: &[LightView],
    map_size: u32,
    reach: f64,
) -> CasterRegion {
    let center = light.center();
    let distance = match center {
        LightPoint::At(place) => receivers.farthest_from(place),
        LightPoint::Towards(_) => 0.0,
    };
    let half_diagonal = views.iter().map(|view| view.half_diagonal_at(distance)).fold(0.0, f64::max);
    let texel = half_diagonal * 2.0 / f64::from(map_size.max(1));
    CasterRegion::along(scene, &receivers.grown(texel * (1.0 + reach)), center)
}

/// The sides of all that is looked up in one face of a cube of `map_size` texels a side, where a lookup reads up to `reach`
/// texels from its own: the face's, and as many texels of those beside it. `None` where that is more than a quarter of a face.
///
/// A direction at 1 + δ from the middle of one face, in units of half a face, is at 1/(1 + δ) in that beside it: so one at
/// 1 − δ there is at 1/(1 − δ) here. Two texels more are for that of the receiver and for rounding.
pub fn looked_up_in(view: &LightView, map_size: u32, reach: f64) -> Option<Vec<HalfSpace>> {
    let beside = 2.0 * (reach + 2.0) / f64::from(map_size.max(1));
    (beside < 0.5).then(|| view.sides(1.0 / (1.0 - beside), 0.0))
}

/// The columns and rows of `view`'s map that lookups for `receivers` read, up to `reach` texels from their own. All of them
/// where part of the receivers may lie behind the view. Two texels more are for that of the receiver and for rounding.
pub fn looked_up_texels(view: &LightView, receivers: &Receivers, map_size: u32, reach: f64) -> Window {
    window_within(view, receivers.region().vertices(), map_size, reach)
}

/// [`looked_up_texels`] for the hull of `points`.
pub(crate) fn window_within(
    view: &LightView,
    points: impl IntoIterator<Item = DVec3>,
    map_size: u32,
    reach: f64,
) -> Window {
    let Some(TexelBounds { min, max, error }) = view.texel_bounds(map_size, points) else {
        return [0..map_size, 0..map_size];
    };
    let reach = reach + error;
    // A cast saturates, and without receivers all is empty.
    let side = |min: f64, max: f64| {
        let end = ((max + reach + 3.0).ceil() as u32).min(map_size);
        ((min - reach - 2.0).floor() as u32).min(end)..end
    };
    if min.cmple(max).all() { [side(min.x, max.x), side(min.y, max.y)] } else { [0..0, 0..0] }
}
