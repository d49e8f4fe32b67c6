//! Truth for hard shadows: one exact shadow ray a pixel, and whether a pixel lies at a true shadow's border.
#![allow(dead_code, reason = "shared by tests, benchmarks and an example")]

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use scene_core::bvh::{Bvh, shadow_origin};
use scene_core::light::LightPoint;
use scene_core::{Camera, GBuffer, Light, Scene, VisibilityImage};

/// What a comparison found.
#[derive(Clone, Debug, Default)]
pub(crate) struct Comparison {
    /// Pixels that see a receiver whose light the casters decide.
    pub(crate) asked: usize,
    /// Those with another V than the ray's.
    pub(crate) differ: usize,
    /// Of these, those within 1e-3 pixel of a true shadow's border.
    pub(crate) at_border: usize,
    /// Of those not at such a border, the ones within two lifts of one: a ray starts that far off its surface
    /// ([`shadow_origin`]), perhaps beyond another that crosses it there. Seen from very near, that is more than 1e-3 pixel.
    pub(crate) at_lift: usize,
    /// The others.
    pub(crate) wrong: Vec<usize>,
}

fn height(light: &Light, position: Vec3, normal: Vec3) -> f32 {
    match light.center() {
        LightPoint::At(place) => normal.dot(place - position),
        LightPoint::Towards(direction) => normal.dot(direction),
    }
}

/// V by one shadow ray a pixel towards the light's middle, with the rules of ground truth.
pub(crate) fn trace(scene: &Scene, bvh: &Bvh, light: &Light, gbuffer: &GBuffer) -> Vec<f32> {
    let magnitude = scene.bounds().magnitude();
    let mut values = vec![f32::NAN; gbuffer.pixel_count()];
    values.par_iter_mut().with_min_len(1024).enumerate().for_each(|(pixel, value)| {
        if !gbuffer.is_seen(pixel) {
            return;
        }
        let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
        *value = if !scene.objects()[gbuffer.object[pixel] as usize].flags.receives {
            1.0
        } else if height(light, position, normal) <= 0.0 || !light.reaches(position) {
            0.0
        } else {
            let origin = shadow_origin(position, normal, magnitude);
            f32::from(u8::from(!bvh.is_occluded(origin, light.center())))
        };
    });
    values
}

/// The G-buffer with positions as shaders find them: from a distance in f32, along the ray of the pixel.
pub(crate) fn as_textures_hold_it(gbuffer: &GBuffer, camera: &Camera) -> GBuffer {
    let mut rounded = gbuffer.clone();
    for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)) {
        let (x, y) = (pixel as u32 % gbuffer.width, pixel as u32 / gbuffer.width);
        let ray = camera.ray_direction(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
        rounded.position[pixel] = camera.eye + ray * gbuffer.depth[pixel];
    }
    rounded
}

/// Holds V against the rays'. A pixel that differs is at a border if rays from the same surface, seen 1e-3 pixel beside
/// its centre in one of sixteen directions, do not all agree.
pub(crate) fn compare(
    scene: &Scene,
    bvh: &Bvh,
    light: &Light,
    camera: &Camera,
    gbuffer: &GBuffer,
    truth: &[f32],
    visibility: &VisibilityImage,
) -> Comparison {
    let magnitude = scene.bounds().magnitude();
    let mut result = Comparison::default();
    for pixel in 0..gbuffer.pixel_count() {
        let (own, truth) = (visibility.values[pixel], truth[pixel]);
        assert_eq!(own.is_nan(), truth.is_nan(), "pixel {pixel}");
        if truth.is_nan() {
            continue;
        }
        result.asked += 1;
        if own == truth {
            continue;
        }
        result.differ += 1;
        let normal = gbuffer.normal[pixel];
        let (x, y) = (pixel as u32 % gbuffer.width, pixel as u32 / gbuffer.width);
        let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let eye = camera.eye.as_dvec3();
        let base = camera.ray_direction(center).as_dvec3();
        let (right, down) = (
            camera.ray_direction(center + Vec2::X).as_dvec3() - base,
            camera.ray_direction(center + Vec2::Y).as_dvec3() - base,
        );
        let n = normal.as_dvec3();
        let anchor = gbuffer.position[pixel].as_dvec3() - eye;
        let moved = |dx: f64, dy: f64| -> Option<bool> {
            let direction: DVec3 = base + right * dx + down * dy;
            let t = n.dot(anchor) / n.dot(direction);
            let place = (eye + direction * t).as_vec3();
            place.is_finite().then(|| {
                let origin = shadow_origin(place, normal, magnitude);
                bvh.is_occluded(origin, light.center())
            })
        };
        let around: Vec<_> = (0..16)
            .filter_map(|i| {
                let (sin, cos) = (f64::from(i) * std::f64::consts::FRAC_PI_8).sin_cos();
                moved(1e-3 * cos, 1e-3 * sin)
            })
            .chain([truth == 0.0])
            .collect();
        let lift = 2.0
            * (shadow_origin(gbuffer.position[pixel], normal, magnitude) - gbuffer.position[pixel]).length();
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let off_surface = || {
            (0..16).map(|i| {
                let (sin, cos) = (i as f32 * std::f32::consts::FRAC_PI_8).sin_cos();
                let place = gbuffer.position[pixel] + (tangent * cos + bitangent * sin) * lift;
                bvh.is_occluded(shadow_origin(place, normal, magnitude), light.center())
            })
        };
        if around.iter().any(|&blocked| blocked != around[0]) {
            result.at_border += 1;
        } else if off_surface().any(|blocked| blocked != around[0]) {
            result.at_lift += 1;
        } else {
            result.wrong.push(pixel);
        }
    }
    result
}
