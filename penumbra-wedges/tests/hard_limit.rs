//! As a light shrinks to its middle, its shadow becomes the hard shadow of a light without extent, continuously: what
//! `gnomon-stencil-volumes` finds, one exact ray a pixel.

mod truth;

use glam::Vec3;
use gnomon_penumbra_wedges::{Variant, WedgeParams};
use scene_core::reference::valid_pixels;
use scene_core::{Light, scenes};
use truth::shade;

/// Mean of |V − hard V| over valid pixels, and how many of them differ by more than 1/255.
fn off_from_hard(name: &str, variant: Variant, soft: &Light, hard: &Light) -> (f64, usize, usize) {
    let setup = scenes::build(name, 0.0).expect("built in");
    let camera = setup.camera.with_size(160, 120);
    let params = WedgeParams { variant, ..Default::default() };
    let (gbuffer, soft_image, _) = shade(&setup.scene, soft, &camera, params);
    let (_, hard_image, _) = shade(&setup.scene, hard, &camera, params);
    let valid = valid_pixels(&gbuffer, hard);
    let off = |p: usize| f64::from((soft_image.values[p] - hard_image.values[p]).abs());
    let pixels: Vec<usize> = (0..valid.len()).filter(|&p| valid[p]).collect();
    let differ = pixels.iter().filter(|&&p| off(p) > 1.0 / 255.0).count();
    (pixels.iter().map(|&p| off(p)).sum::<f64>() / pixels.len() as f64, differ, pixels.len())
}

/// Penumbrae are as wide as the light, so that each halving of it halves the mean difference, but for chance: of a pixel's
/// width of 1, penumbrae thinner than that hit one or not. At a millionth no more than ties are left.
fn check(name: &str, variant: Variant, hard: &Light, soft: impl Fn(f32) -> Light) {
    let (first, ..) = off_from_hard(name, variant, &soft(1.0), hard);
    let mut last = first;
    for size in [0.25_f32, 0.0625, 0.015_625, 1e-6] {
        let (mean, differ, pixels) = off_from_hard(name, variant, &soft(size), hard);
        println!("{name} {variant:?} {size}: mean {mean:.6}, {differ} of {pixels} differ");
        assert!(mean <= last, "{name}, {variant:?}, {size}: {mean} after {last}");
        assert!(mean <= 2.0 * first * f64::from(size) + 4.0 / pixels as f64, "{name}, {variant:?}, {size}");
        assert!(size > 1e-5 || differ * 1000 <= pixels, "{name}, {variant:?}: {differ} differ");
        last = mean;
    }
    assert!(first > 0.003, "{name}: a soft shadow is one: {first}");
}

#[test]
fn shadows_harden_as_lights_shrink() {
    for variant in [Variant::Interpolated, Variant::Coverage, Variant::Exact] {
        for name in ["ball", "quads"] {
            let center = Vec3::new(1.0, 6.0, 1.5);
            check(name, variant, &Light::Point { position: center }, |size| Light::Sphere {
                center,
                radius: 0.5 * size,
            });
            check(name, variant, &Light::Point { position: center }, |size| Light::Rect {
                center,
                half_u: Vec3::X * 0.5 * size,
                half_v: Vec3::new(0.0, 0.1, 0.4) * size,
            });
        }
        let direction = Vec3::new(-0.3, -1.0, -0.2);
        check("log-cabin", variant, &Light::Directional { direction, angular_radius: 0.0 }, |size| {
            Light::Directional { direction, angular_radius: 0.08 * size }
        });
    }
}
