//! The maps of a frame: which there are, how each is warped, and the window it covers.

use glam::{DVec3, Mat4, Vec3};
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::relevance::{CasterRegion, HalfSpace, Polyhedron, Receivers};
use scene_core::{Camera, GBuffer, Light, Report, Scene};

use crate::aliasing::{self, Aliasing};
use crate::caster_image::{CasterImage, Within};
use crate::choice::{Parametrisation, Situation};
use crate::light_image::{FACES, LightImage, face_of, face_volume};
use crate::seen::{Sample, Seen, Wanted};
use crate::view_frame::ViewFrame;
use crate::warp::{self, Warp, Window};
use crate::{PsmParams, Variant, caster_boxes, virtual_camera};

/// A map's projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapView {
    /// How its texels are spread.
    pub parametrisation: Parametrisation,
    /// d over samples of the receivers, in pixels a texel.
    pub aliasing: Aliasing,
    /// Mean of [`aliasing::expected_error`] over the samples near shadows, scene units.
    pub measure: f64,
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

/// What of a frame does not depend on what is seen: the images of the light, and what casts.
#[derive(Clone, Debug)]
pub struct Images {
    /// One, or one for each face of a cube around a light at a place that may see receivers in all directions.
    pub images: Vec<LightImage>,
    /// For each image, the paper's shift of the camera in scene units: by as much as the casters' region H reaches nearer
    /// than the receivers that it belongs to. 0 for variants that have no virtual camera.
    pub papers_shift: Vec<f64>,
    /// Bounds of all that casts.
    pub casters: Aabb,
    /// Bounds of each object that casts.
    pub boxes: Vec<Aabb>,
    /// For each image, the part of it that they fill.
    pub filled: Vec<CasterImage>,
}

impl Images {
    /// For what `camera` may see, with the bounds of each object that casts.
    pub fn new(scene: &Scene, light: &Light, camera: &Camera, boxes: Vec<Aabb>, variant: Variant) -> Self {
        let (frame, center) = (ViewFrame::new(camera), light.center());
        let has_shift = variant == Variant::Psm;
        if let (LightPoint::Towards(towards), false) = (center, has_shift) {
            let image = LightImage::new(center, towards.as_dvec3(), frame.forward);
            return Self::with_boxes(vec![image], vec![0.0], boxes);
        }
        let receivers = Receivers::seen_by(scene, camera, light);
        let corners: Vec<_> = receivers.region().vertices().collect();
        let nearest = |region: &Polyhedron| {
            region.vertices().map(|point| frame.depth(point)).fold(f64::INFINITY, f64::min)
        };
        let shift = |receivers: &Receivers| {
            if !has_shift {
                return 0.0;
            }
            let region = CasterRegion::between(scene, receivers, light);
            virtual_camera::holding(nearest(receivers.region()), nearest(region.polyhedron()))
        };
        let (images, papers_shift) = match (LightImage::of_all(light, &corners, frame.forward), center) {
            (Some(image), _) => (vec![image], vec![shift(&receivers)]),
            (None, LightPoint::Towards(_)) => Default::default(),
            (None, LightPoint::At(place)) => (0..FACES.len())
                .map(|face| {
                    let image = LightImage::new(center, FACES[face].as_dvec3(), frame.forward);
                    (image, shift(&receivers.clone().inside(&face_volume(place, face))))
                })
                .unzip(),
        };
        Self::with_boxes(images, papers_shift, boxes)
    }

    fn with_boxes(images: Vec<LightImage>, papers_shift: Vec<f64>, boxes: Vec<Aabb>) -> Self {
        let casters = boxes.iter().fold(Aabb::EMPTY, |sum, &bounds| sum.union(bounds));
        let filled = images.iter().map(|image| CasterImage::new(image, &boxes)).collect();
        Self { images, papers_shift, casters, boxes, filled }
    }

    /// Which image a receiver lies in.
    #[inline]
    pub fn image_of(&self, point: Vec3) -> usize {
        match self.images.first().map(|image| image.light) {
            Some(LightPoint::At(place)) if self.images.len() > 1 => face_of(point - place),
            _ => 0,
        }
    }
}

/// `prepare.receivers` and `prepare.views`: the maps that what `camera` sees in `gbuffer` needs, with the bounds of each
/// object that casts. One at most for each of the light's [`Images`]; an image without a receiver gets none.
pub fn map_views(
    scene: &Scene,
    light: &Light,
    camera: &Camera,
    gbuffer: &GBuffer,
    boxes: &[Aabb],
    params: &PsmParams,
    report: &mut Report,
) -> Vec<MapView> {
    if boxes.iter().all(Aabb::is_empty) {
        return Vec::new();
    }
    // Many short steps: from outside the pool each would wait for a thread to wake.
    rayon::scope(|_| {
        let images = report
            .time("prepare.images", |_| Images::new(scene, light, camera, boxes.to_vec(), params.variant));
        let wanted = Wanted::new(scene, gbuffer, camera, light);
        let seen = report
            .time("prepare.receivers", |_| wanted.seen(images.images.len(), |point| images.image_of(point)));
        let frame = ViewFrame::new(camera);
        report.time("prepare.views", |_| {
            let of_image = |(image, seen): (usize, &Seen<'_>)| map_view(&images, image, seen, &frame, params);
            seen.iter().enumerate().filter_map(of_image).collect()
        })
    })
}

/// The map of one image; `None` if there is nothing to see.
fn map_view(
    images: &Images,
    index: usize,
    seen: &Seen<'_>,
    frame: &ViewFrame,
    params: &PsmParams,
) -> Option<MapView> {
    let image = images.images[index];
    // The light itself has no place in its image, and what is so near to it has none that f32 can tell.
    let largest = seen.ends.iter().map(|&p| image.w(p)).fold(0.0, f64::max);
    let mut receivers: Vec<_> =
        seen.ends.iter().copied().filter(|&p| image.w(p) > largest / 1_048_576.0).collect();
    if receivers.is_empty() {
        return None;
    }
    // The paper's maps hold all receivers; the one that is fitted, those which something may shadow. Where no sample is among them
    // nothing is known of how they lie.
    let filled = if params.variant == Variant::Auto { images.filled[index] } else { CasterImage::EVERYWHERE };
    let within = |part: &CasterImage| -> Vec<Sample> {
        seen.samples.iter().copied().filter(|s| part.holds(image.warp.place(s.point))).collect()
    };
    let mut samples = within(&filled);
    let near_shadows = caster_boxes::near_shadows(&images.boxes, image.light, &samples);
    let part = if near_shadows.is_empty() { CasterImage::EVERYWHERE } else { filled };
    if near_shadows.is_empty() {
        samples = within(&part);
    }
    receivers.retain(|&point| part.holds(image.warp.place(point)));
    let situation = Situation {
        image,
        frame,
        depths: seen.depths.map(f64::from),
        receivers,
        papers_shift: images.papers_shift[index],
        samples: &samples,
        near_shadows: &near_shadows,
        map_size: params.map_size,
        lookup: params.lookup,
    };
    let (mut parametrisation, mut warp) = situation.chosen(params.variant);
    let fit = |warp: &Warp| {
        let within = Within { image: &image.warp, part: &part };
        seen.fit(warp, within, |point| images.image_of(point) == index)
    };
    let (mut window, mut w) = fit(&warp);
    let is_before = w[0] > 0.0;
    if !is_before {
        // A receiver on the wrong side of w: between those that span the others. The light's own image has none.
        (parametrisation, warp) = (Parametrisation::Uniform, image.warp);
        (window, w) = fit(&warp);
    }
    if window.is_empty() || !(w[0] > 0.0 && w[1].is_finite()) {
        return None;
    }
    // World positions have far-out offsets where the scene lies far out, and f32 rounds the projection.
    let offsets = window.widened().fitted(&warp);
    let rounding =
        [offsets.x.w, offsets.y.w, offsets.w.w].map(f64::abs).into_iter().fold(0.0, f64::max) / w[0];
    let window = window.widened().grown(rounding * f64::from(f32::EPSILON));
    let values = aliasing::of_samples(&warp, &window, params.map_size, frame, &samples);
    let errors = aliasing::expected_errors(&warp, &window, params.map_size, &near_shadows);
    let measure = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
    let clip_from_world = warp::clip_from_world(&window.fitted(&warp), image.light, w, images.casters);
    if !clip_from_world.is_finite() {
        return None;
    }
    // As the rasteriser sees it: rounded.
    let [x, y, w] = [0, 1, 3].map(|row| clip_from_world.row(row).as_dvec4());
    let aliasing = Aliasing::of(values);
    Some(MapView { parametrisation, aliasing, measure, clip_from_world, ndc: Warp { x, y, w } })
}
