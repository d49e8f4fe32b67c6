//! What a frame asks of the map: from the G-buffer, the receivers that need a lookup.

use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::{GBuffer, Light, Scene};

/// Samples a frame, roughly: the mean of so many is known to 3 % of their spread, and they cost as much as one pixel
/// in a hundred.
const SAMPLES: f64 = 1024.0;

/// Below this cosine between normal and light a surface receives next to nothing; errors are not counted there
/// ([`scene_core::reference::valid_pixels`]), nor is aliasing.
const GRAZING_COS: f32 = 0.05;

/// A surface point that the camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// World space.
    pub point: DVec3,
    /// Unit normal, world space.
    pub normal: DVec3,
}

/// What of the G-buffer is turned to the light, reached by it, and shows shadows.
#[derive(Clone, Debug)]
pub struct Seen {
    /// One of each of some thousand squares of pixels that has one, in order.
    pub samples: Vec<Sample>,
    /// Nearest and farthest depth along the view direction, scene units.
    pub depths: [f32; 2],
    /// Bounds of the positions.
    pub bounds: Aabb,
}

/// Which pixels need a lookup.
pub(crate) struct Wanted<'a> {
    scene: &'a Scene,
    gbuffer: &'a GBuffer,
    center: LightPoint,
    /// A spot's place, unit axis and cosine, widened by 16 roundings of `Light::reaches`.
    cone: Option<(Vec3, Vec3, f32)>,
}

impl<'a> Wanted<'a> {
    pub(crate) fn new(scene: &'a Scene, gbuffer: &'a GBuffer, light: &Light) -> Self {
        let cone = match *light {
            Light::Spot { position, direction, outer, .. } => {
                Some((position, direction.normalize_or_zero(), outer.cos() - 1.0 / 1_048_576.0))
            }
            _ => None,
        };
        Self { scene, gbuffer, center: light.center(), cone }
    }

    pub(crate) fn gbuffer(&self) -> &'a GBuffer {
        self.gbuffer
    }

    /// The point that a pixel sees if it is wanted.
    #[inline]
    pub(crate) fn at(&self, pixel: usize) -> Option<Vec3> {
        if !self.gbuffer.is_seen(pixel) {
            return None;
        }
        let (point, normal) = (self.gbuffer.position[pixel], self.gbuffer.normal[pixel]);
        let (to_light, _) = self.center.ray_from(point);
        let object = self.gbuffer.object[pixel] as usize;
        let receives = self.scene.objects().get(object).is_some_and(|o| o.flags.receives);
        let reached = self.cone.is_none_or(|(place, axis, cos)| {
            let from = point - place;
            from.dot(axis) >= cos * from.length()
        });
        (normal.dot(to_light) > 0.0 && receives && reached && point.is_finite()).then_some(point)
    }

    fn sample(&self, pixel: usize, point: Vec3) -> Option<Sample> {
        let normal = self.gbuffer.normal[pixel];
        let (to_light, _) = self.center.ray_from(point);
        let seen = normal.dot(to_light.normalize_or_zero()) > GRAZING_COS;
        seen.then(|| Sample { point: point.as_dvec3(), normal: normal.as_dvec3() })
    }
}

/// Pixels a side of the squares that a sample each is taken of.
fn square(gbuffer: &GBuffer) -> usize {
    ((gbuffer.pixel_count() as f64 / SAMPLES).sqrt() as usize).max(1)
}

/// Pixels that a thread takes at once: a row of squares.
pub(crate) fn bands(gbuffer: &GBuffer) -> impl IndexedParallelIterator<Item = Range<usize>> + use<> {
    let (width, height, square) = (gbuffer.width as usize, gbuffer.height as usize, square(gbuffer));
    (0..height.div_ceil(square))
        .into_par_iter()
        .map(move |band| band * square * width..((band + 1) * square).min(height) * width)
}

/// Looks through the G-buffer for receivers that `keep` takes.
pub(crate) fn seen(wanted: &Wanted<'_>, keep: impl Fn(Vec3) -> bool + Sync) -> Seen {
    let width = wanted.gbuffer.width.max(1) as usize;
    let square = square(wanted.gbuffer);
    let parts: Vec<Seen> = bands(wanted.gbuffer)
        .map(|pixels| {
            let mut part = Seen { samples: Vec::new(), depths: [f32::INFINITY, 0.0], bounds: Aabb::EMPTY };
            let mut of_square = vec![None; width.div_ceil(square)];
            for pixel in pixels.clone() {
                let Some(point) = wanted.at(pixel).filter(|&point| keep(point)) else { continue };
                let depth = wanted.gbuffer.depth[pixel];
                part.depths = [part.depths[0].min(depth), part.depths[1].max(depth)];
                part.bounds = part.bounds.with_point(point);
                // The first, and up to the middle row the last: near the middle where it is all wanted.
                let column = pixel % width;
                let row = (pixel - pixels.start) / width;
                let slot = &mut of_square[column / square];
                if slot.is_none() || row <= square / 2 && column % square <= square / 2 {
                    *slot = wanted.sample(pixel, point).or(*slot);
                }
            }
            part.samples.extend(of_square.into_iter().flatten());
            part
        })
        .collect();
    let mut all = Seen { samples: Vec::new(), depths: [f32::INFINITY, 0.0], bounds: Aabb::EMPTY };
    for part in parts {
        all.samples.extend(part.samples);
        all.depths = [all.depths[0].min(part.depths[0]), all.depths[1].max(part.depths[1])];
        all.bounds = all.bounds.union(part.bounds);
    }
    all
}
