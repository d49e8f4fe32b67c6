//! The maps of a frame: which there are, how each is warped, and the window it covers.

use glam::{DVec3, Mat4, Vec3};
use rayon::prelude::*;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::relevance::{CasterRegion, HalfSpace, Receivers};
use scene_core::{Camera, GBuffer, Light, Scene};

use crate::PsmParams;
use crate::aliasing::{self, Aliasing};
use crate::choice::{Parametrisation, Situation, choose};
use crate::light_image::{FACES, LightImage, face_of, face_volume};
use crate::seen::{Seen, Wanted, bands, seen};
use crate::view_frame::ViewFrame;
use crate::warp::{self, Warp, Window, at};

/// What depths and bounds of what is seen are widened by: more than an f32 position is off (2⁻²⁴ of it).
const SLACK: f32 = 1.0 / 262_144.0;

/// A map's projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapView {
    /// How its texels are spread.
    pub parametrisation: Parametrisation,
    /// d over samples of the receivers, in pixels a texel.
    pub aliasing: Aliasing,
    /// World to clip space; x and y of the map lie in [−w, w], depth is reversed.
    pub clip_from_world: Mat4,
    /// The forms of `clip_from_world` that give the place in the map, −1 to 1.
    pub ndc: Warp,
}

impl MapView {
    /// d at a surface point that the map holds.
    pub fn texel_in_pixels(&self, map_size: u32, frame: &ViewFrame, point: DVec3, normal: DVec3) -> f64 {
        let window = Window { min: glam::DVec2::NEG_ONE, max: glam::DVec2::ONE };
        aliasing::texel_in_pixels(&self.ndc, &window, map_size, frame, point, normal)
    }

    /// The half-spaces of its sides.
    pub fn sides(&self) -> Vec<HalfSpace> {
        warp::sides(&self.ndc)
    }
}

/// The maps that what `camera` sees in `gbuffer` needs, with `casters` the bounds of all that casts. One, or one for
/// each face of a cube around a light at a place that sees receivers in all directions; a face without a receiver gets
/// none. No receivers, or no casters, give no maps.
pub fn map_views(
    scene: &Scene,
    light: &Light,
    camera: &Camera,
    gbuffer: &GBuffer,
    casters: Aabb,
    params: &PsmParams,
) -> Vec<MapView> {
    let wanted = Wanted::new(scene, gbuffer, light);
    let all = seen(&wanted, |_| true);
    if all.bounds.is_empty() || casters.is_empty() {
        return Vec::new();
    }
    let frame = ViewFrame::new(camera);
    let made = Making { scene, light, camera, casters, params, frame, wanted };
    let (receivers, corners) = made.region(&all, &[]);
    match (LightImage::of_all(light, &corners, frame.forward), light.center()) {
        (Some(image), _) => made.view(image, &all, &receivers, corners, |_| true).into_iter().collect(),
        (None, LightPoint::Towards(_)) => Vec::new(),
        (None, LightPoint::At(place)) => (0..FACES.len())
            .filter_map(|face| {
                let keep = |point: Vec3| face_of(point - place) == face;
                let part = seen(&made.wanted, keep);
                if part.bounds.is_empty() {
                    return None;
                }
                let (receivers, corners) = made.region(&part, &face_volume(place, face));
                let image = LightImage::new(light.center(), FACES[face].as_dvec3(), frame.forward);
                made.view(image, &part, &receivers, corners, keep)
            })
            .collect(),
    }
}

/// What all maps of a frame have in common.
struct Making<'a> {
    scene: &'a Scene,
    light: &'a Light,
    camera: &'a Camera,
    casters: Aabb,
    params: &'a PsmParams,
    frame: ViewFrame,
    wanted: Wanted<'a>,
}

impl Making<'_> {
    /// A convex region around what is seen within `volume`, and its corners: the view with its near and far plane at
    /// the nearest and farthest depth that is seen.
    fn region(&self, seen: &Seen, volume: &[HalfSpace]) -> (Receivers, Vec<DVec3>) {
        let near = seen.depths[0] * (1.0 - SLACK);
        let far = (seen.depths[1] * (1.0 + SLACK)).max(near * (1.0 + 4.0 * SLACK));
        let camera = Camera { near, far, ..*self.camera };
        let bounds = Receivers::within(self.scene, &[seen.bounds], self.light);
        let bounds: Vec<_> = bounds.region().planes().collect();
        let receivers = Receivers::seen_by(self.scene, &camera, self.light).inside(&bounds).inside(volume);
        let mut corners: Vec<_> = receivers.region().vertices().collect();
        if corners.is_empty() {
            // Rounding left nothing of it: samples stand for themselves.
            corners.extend(seen.samples.iter().map(|sample| sample.point));
        }
        (receivers, corners)
    }

    /// The map of `image` for the receivers that `keep` takes; `None` if nothing is left to see.
    fn view(
        &self,
        image: LightImage,
        seen: &Seen,
        receivers: &Receivers,
        mut corners: Vec<DVec3>,
        keep: impl Fn(Vec3) -> bool + Sync,
    ) -> Option<MapView> {
        // The light itself has no place in its image, and what is so near to it has none that f32 can tell.
        let largest = corners.iter().map(|&p| image.w(p)).fold(0.0, f64::max);
        corners.retain(|&p| image.w(p) > largest / 1_048_576.0);
        let region = CasterRegion::between(self.scene, receivers, self.light);
        let situation = Situation {
            image,
            frame: &self.frame,
            depths: seen.depths.map(f64::from),
            receivers: corners,
            casters: region.polyhedron(),
            samples: &seen.samples,
            map_size: self.params.map_size,
        };
        let chosen = choose(situation.candidates(self.params.variant))?;
        let mut fit = (chosen.parametrisation, chosen.warp, self.fit(&chosen.warp, &keep));
        // A receiver on the wrong side of w: rounding at the border of what is possible. The light's image has none.
        let all_seen = fit.2.1[0] > 0.0;
        if !all_seen {
            fit = (Parametrisation::Uniform, image.warp, self.fit(&image.warp, &keep));
        }
        let (parametrisation, warp, (window, w)) = fit;
        if window.is_empty() || !(w[0] > 0.0 && w[1].is_finite()) {
            return None;
        }
        let window = window.widened();
        let values = aliasing::of_samples(&warp, &window, self.params.map_size, &self.frame, &seen.samples);
        let clip_from_world = warp::clip_from_world(&window.fitted(&warp), image.light, w, self.casters);
        if !clip_from_world.is_finite() {
            return None;
        }
        // As the rasteriser sees it: rounded.
        let [x, y, w] = [0, 1, 3].map(|row| clip_from_world.row(row).as_dvec4());
        let aliasing = Aliasing::of(values);
        Some(MapView { parametrisation, aliasing, clip_from_world, ndc: Warp { x, y, w } })
    }

    /// The window around all receivers that `keep` takes, and the range of w over them.
    fn fit(&self, warp: &Warp, keep: &(impl Fn(Vec3) -> bool + Sync)) -> (Window, [f64; 2]) {
        let nothing = || (Window::EMPTY, [f64::INFINITY, f64::NEG_INFINITY]);
        bands(self.wanted.gbuffer())
            .map(|pixels| {
                pixels.filter_map(|pixel| self.wanted.at(pixel)).filter(|&p| keep(p)).fold(
                    nothing(),
                    |(window, [low, high]), point| {
                        let point = point.as_dvec3();
                        let w = at(warp.w, point);
                        (window.with(warp.place(point)), [low.min(w), high.max(w)])
                    },
                )
            })
            .reduce(nothing, |(a, [low, high]), (b, [lower, higher])| {
                (a.union(b), [low.min(lower), high.max(higher)])
            })
    }
}
