//! A plain shaded picture from a visibility image: one light, a sky, a muted colour per object.
//!
//! The picture serves the eye, not a measurement. Direct light is `albedo · n·l · falloff · V`, the light
//! taken at its middle; a hemisphere sky and a faint light at the camera keep the shape readable in shadow.
//! Falloff is normalised by a percentile of the unshadowed light that reaches the picture, so that a scene of
//! any size and a light of any distance are exposed alike, and alike for every visibility image.

use glam::Vec3;
use image::{Rgb as Pixel, RgbImage};
use rayon::prelude::*;
use scene_core::light::LightPoint;
use scene_core::{Camera, GBuffer, Light, VisibilityImage};

use super::colour::{Rgb, object_albedo, srgb_from_linear};

/// Colour and strength of the light relative to the sky: a warm key.
const KEY: Vec3 = Vec3::new(1.30, 1.22, 1.08);
/// Light from straight above and from straight below.
const SKY: Vec3 = Vec3::new(0.19, 0.22, 0.28);
const GROUND: Vec3 = Vec3::new(0.10, 0.09, 0.08);
/// Light at the camera, times n·v.
const HEADLIGHT: f32 = 0.08;
/// The share of reached pixels that are no brighter than full exposure: what lies nearer to the light rolls off.
const EXPOSED_SHARE: f32 = 0.90;
/// What a surface without a visibility looks like; no technique should show it.
const MISSING: Rgb = [255, 0, 255];

/// Everything of the picture that does not depend on visibility.
#[derive(Clone, Debug)]
pub(crate) struct Shading {
    width: u32,
    height: u32,
    /// Per pixel: linear colour at V = 0, and what V = 1 adds. NaN where nothing is seen.
    base: Vec<Vec3>,
    direct: Vec<Vec3>,
}

impl Shading {
    /// Lights a G-buffer without shadows.
    pub(crate) fn new(gbuffer: &GBuffer, camera: &Camera, light: &Light) -> Self {
        let up = camera.up.normalize_or(Vec3::Y);
        let irradiance: Vec<f32> = (0..gbuffer.pixel_count())
            .into_par_iter()
            .map(|i| {
                if gbuffer.is_seen(i) {
                    irradiance(light, gbuffer.position[i], gbuffer.normal[i])
                } else {
                    0.0
                }
            })
            .collect();
        let exposure = exposure(&irradiance);
        let (base, direct) = (0..gbuffer.pixel_count())
            .into_par_iter()
            .map(|i| {
                if !gbuffer.is_seen(i) {
                    return (Vec3::NAN, Vec3::NAN);
                }
                let normal = gbuffer.normal[i];
                let albedo = object_albedo(gbuffer.object[i]);
                let to_camera = (camera.eye - gbuffer.position[i]).normalize_or_zero();
                let sky = GROUND.lerp(SKY, 0.5 + 0.5 * normal.dot(up));
                let ambient = sky + Vec3::splat(HEADLIGHT * normal.dot(to_camera).max(0.0));
                (albedo * ambient, albedo * KEY * (irradiance[i] * exposure))
            })
            .unzip();
        Self { width: gbuffer.width, height: gbuffer.height, base, direct }
    }

    /// The picture under `visibility`, which has the G-buffer's size.
    pub(crate) fn picture(&self, visibility: &VisibilityImage) -> RgbImage {
        RgbImage::from_fn(self.width, self.height, |x, y| {
            let i = y as usize * self.width as usize + x as usize;
            let v = visibility.values[i];
            Pixel(if self.base[i].is_nan() {
                background(y, self.height)
            } else if v.is_nan() {
                MISSING
            } else {
                srgb_from_linear(tone(self.base[i] + self.direct[i] * v))
            })
        })
    }
}

/// Unshadowed light from the light's middle: n·l, the falloff of a near light, the emission cosine of a flat
/// one (two-sided) and the soft border of a spot. Zero behind the surface and for a point on the light.
fn irradiance(light: &Light, position: Vec3, normal: Vec3) -> f32 {
    let (to_light, falloff) = match light.center() {
        LightPoint::Towards(direction) => (direction, 1.0),
        LightPoint::At(point) => {
            let offset = point - position;
            // A surface nearer than the light's own size gets no more than at that distance.
            let distance = offset.length().max(extent(light));
            (offset.normalize_or_zero(), (distance * distance).recip())
        }
    };
    let emission = match *light {
        Light::Rect { half_u, half_v, .. } => half_u
            .normalize_or_zero()
            .cross(half_v.normalize_or_zero())
            .normalize_or_zero()
            .dot(to_light)
            .abs(),
        Light::Disk { normal, .. } => normal.normalize_or_zero().dot(to_light).abs(),
        Light::Spot { direction, outer, inner, .. } => {
            let cos = direction.normalize_or_zero().dot(-to_light);
            let (dark, full) = (outer.cos(), inner.cos());
            let t = ((cos - dark) / (full - dark).max(1e-6)).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        }
        _ => 1.0,
    };
    let light = normal.dot(to_light).max(0.0) * falloff * emission;
    if light.is_finite() { light } else { 0.0 }
}

/// Half the size of a light, in scene units; 0 for one without extent or at infinity.
fn extent(light: &Light) -> f32 {
    match *light {
        Light::Sphere { radius, .. } | Light::Disk { radius, .. } => radius,
        Light::Rect { half_u, half_v, .. } => half_u.length().max(half_v.length()),
        Light::Directional { .. } | Light::Point { .. } | Light::Spot { .. } => 0.0,
    }
}

/// What to multiply irradiance with, so that [`EXPOSED_SHARE`] of the reached pixels are at most 1; 0 if the
/// light reaches none.
fn exposure(irradiance: &[f32]) -> f32 {
    let mut reached: Vec<f32> = irradiance.iter().copied().filter(|&e| e > 0.0).collect();
    if reached.is_empty() {
        return 0.0;
    }
    let rank = ((reached.len() - 1) as f32 * EXPOSED_SHARE) as usize;
    let (_, &mut level, _) = reached.select_nth_unstable_by(rank, f32::total_cmp);
    level.recip()
}

/// Rolls highlights off: Reinhard's extended curve, white at 2.5, per channel.
fn tone(linear: Vec3) -> Vec3 {
    const WHITE: f32 = 2.5;
    linear * (Vec3::ONE + linear / (WHITE * WHITE)) / (Vec3::ONE + linear) * 1.25
}

/// A calm vertical gradient behind the scene.
fn background(row: u32, rows: u32) -> Rgb {
    let t = row as f32 / rows.max(1) as f32;
    srgb_from_linear(Vec3::new(0.19, 0.23, 0.29).lerp(Vec3::new(0.40, 0.42, 0.45), t))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn floor(light: &Light, scale: f32) -> (Shading, usize) {
        let mut gbuffer = GBuffer::new(9, 9);
        for y in 0..9 {
            for x in 0..9 {
                let i = y * 9 + x;
                gbuffer.position[i] = Vec3::new(x as f32 - 4.0, 0.0, y as f32 - 4.0) * scale;
                gbuffer.normal[i] = Vec3::Y;
                (gbuffer.object[i], gbuffer.triangle[i]) = (0, 0);
            }
        }
        gbuffer.triangle[0] = GBuffer::NOTHING;
        let camera = Camera {
            eye: Vec3::new(0.0, 10.0, 10.0) * scale,
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_y: 0.7,
            near: 0.1 * scale,
            far: f32::INFINITY,
            width: 9,
            height: 9,
        };
        (Shading::new(&gbuffer, &camera, light), 40)
    }

    #[test]
    fn size_and_distance_do_not_change_the_exposure() {
        let point = |scale: f32| Light::Point { position: Vec3::new(1.0, 6.0, 0.5) * scale };
        let lit = VisibilityImage { width: 9, height: 9, values: vec![1.0; 81] };
        let pictures = [1e-3f32, 1.0, 1e4].map(|scale| floor(&point(scale), scale).0.picture(&lit));
        for picture in &pictures[1..] {
            for (a, b) in picture.as_raw().iter().zip(pictures[0].as_raw()) {
                assert!(a.abs_diff(*b) <= 1);
            }
        }
    }

    #[test]
    fn shadow_is_darker_but_never_black_and_missing_pixels_stand_out() {
        let (shading, middle) = floor(&Light::Directional { direction: -Vec3::Y, angular_radius: 0.0 }, 1.0);
        let mut visibility = VisibilityImage { width: 9, height: 9, values: vec![1.0; 81] };
        visibility.values[middle] = 0.0;
        visibility.values[middle + 1] = f32::NAN;
        let picture = shading.picture(&visibility);
        let at = |i: usize| picture.get_pixel(i as u32 % 9, i as u32 / 9).0;
        assert!(at(middle)[1] > 20 && at(middle)[1] + 40 < at(middle - 1)[1]);
        assert_eq!(at(middle + 1), MISSING);
        assert_eq!(at(0), background(0, 9));
    }

    #[test]
    fn a_light_behind_everything_leaves_the_sky() {
        let (shading, middle) = floor(&Light::Point { position: -Vec3::Y }, 1.0);
        assert_eq!(shading.direct[middle], Vec3::ZERO);
        assert!(shading.base[middle].min_element() > 0.0);
    }
}
