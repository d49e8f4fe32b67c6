//! Windows for what a camera sees.
//!
//! One window over a whole scene has the same texels everywhere, however near the camera is. So what is seen is split by its
//! distance, in equal ratios, and each part may have a window of its own with all texels where the part is: cascades, each a
//! PDSM. What is seen is taken from a small image; whatever it missed is answered by the scene's own window, which always
//! is there. A part's functions hold for all points within its bounds, whoever looks at them.

use glam::Vec3;
use gnomon_shadow_map::cascades::{cascade_of, splits};
use scene_core::geometry::Aabb;
use scene_core::{Camera, Light, Scene, raster};

/// Pixels along the longer side of the small image.
const PIXELS: u32 = 128;

/// A part of what a camera sees.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Around its receivers, world space.
    pub bounds: Aabb,
    /// Some of them, as many as a small image shows.
    pub points: Vec<Vec3>,
    /// Side of a pixel of the camera at the nearest of them, in scene units.
    pub pixel: f32,
    /// Texels around a point that are asked for when it is looked up.
    pub rim: u32,
}

impl Part {
    /// What is added on each side for what lies between the points, as a share of their extent: two pixels of the small
    /// image, if the part fills it.
    pub(crate) const BETWEEN: f32 = 2.0 / PIXELS as f32;
}

/// What `camera` sees of the receivers that `light` reaches, in at most `count` parts, the nearest first. None of what an
/// invalid camera sees.
pub fn parts(scene: &Scene, light: &Light, camera: &Camera, count: u32, rim: u32) -> Vec<Part> {
    if count == 0 || camera.validate().is_err() {
        return Vec::new();
    }
    let longer = camera.width.max(camera.height);
    let side =
        |pixels: u32| (u64::from(pixels) * u64::from(PIXELS.min(longer))).div_ceil(u64::from(longer)) as u32;
    let gbuffer = raster::render_gbuffer(scene, &camera.with_size(side(camera.width), side(camera.height)));
    let receives = |pixel: &usize| {
        gbuffer.is_seen(*pixel)
            && scene.objects()[gbuffer.object[*pixel] as usize].flags.receives
            && light.reaches(gbuffer.position[*pixel])
    };
    let seen: Vec<_> = (0..gbuffer.pixel_count()).filter(receives).collect();
    let depths = seen.iter().map(|&pixel| gbuffer.depth[pixel]);
    let [near, far] = depths
        .fold([f32::INFINITY, f32::NEG_INFINITY], |[near, far], depth| [near.min(depth), far.max(depth)]);
    let ends = splits(near, far, count as usize);
    let part = |number: usize| {
        let own = || seen.iter().filter(|&&pixel| cascade_of(&ends, gbuffer.depth[pixel]) == number);
        let points: Vec<_> = own().map(|&pixel| gbuffer.position[pixel]).collect();
        let nearest = own().fold(f32::INFINITY, |nearest, &pixel| nearest.min(gbuffer.depth[pixel]));
        let mut bounds = Aabb::from_points(points.iter().copied());
        let between = bounds.size() * Part::BETWEEN;
        bounds = Aabb { min: bounds.min - between, max: bounds.max + between };
        let pixel = 2.0 * camera.tan_half_fov().y / camera.height as f32 * nearest;
        (!points.is_empty()).then_some(Part { bounds, points, pixel, rim })
    };
    (0..ends.len()).filter_map(part).collect()
}
