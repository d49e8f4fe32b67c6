//! Skipping changes nothing, whatever the variant, the scene and the light, and leaves something out.

use glam::Vec3;
use gnomon_ddoc::{Ddoc, DdocParams, Variant};
use scene_core::{GBuffer, Light, Scene, VisibilityImage, raster, scenes};

/// How many pixels differ, and what was left out with `skip` and without.
fn differences(scene: &Scene, light: &Light, gbuffer: &GBuffer, params: DdocParams) -> (usize, [u64; 2]) {
    let image = |skip: bool| {
        let params = DdocParams { skip, ..params };
        let (prepared, _) = Ddoc::new(params).prepare(scene, light).expect("few triangles");
        let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
        let report = prepared.shade(gbuffer, &mut image);
        let bits = image.bits();
        (bits, report.skipped.values().sum::<u64>())
    };
    let ((with, left_out), (without, none)) = (image(true), image(false));
    (with.iter().zip(&without).filter(|(a, b)| a != b).count(), [left_out, none])
}

#[test]
fn skipping_never_changes_the_image() {
    for scene in ["ball", "fence", "quads", "cornell"] {
        let mut setup = scenes::build(scene, 0.0).expect("built in");
        (setup.camera.width, setup.camera.height) = (131, 97);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        for variant in Variant::ALL {
            let params = DdocParams { variant, map_size: 256, taps: 16, ..Default::default() };
            let (differ, [left_out, none]) = differences(&setup.scene, &setup.lights[0], &gbuffer, params);
            assert_eq!(differ, 0, "{scene} {variant:?}");
            assert_eq!(none, 0);
            assert!(left_out > 0, "{scene} {variant:?} skips nothing");
        }
    }
}

/// Tiles of few receivers and of many, splats over few tiles and over many: what is left out is chosen by how many there are.
#[test]
fn however_much_falls_on_a_tile() {
    for scene in ["pool", "knot", "layers"] {
        let mut setup = scenes::build(scene, 0.0).expect("built in");
        (setup.camera.width, setup.camera.height) = (131, 97);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        for map_size in [16, 64, 512, 2048] {
            let params = DdocParams { map_size, taps: 16, ..Default::default() };
            let (differ, _) = differences(&setup.scene, &setup.lights[0], &gbuffer, params);
            assert_eq!(differ, 0, "{scene}, {map_size} texels");
        }
    }
}

/// Every built-in scene under its own lights, and under every kind of light, from inside the scene, too.
#[test]
fn whatever_the_scene_and_the_light() {
    let mut found = Vec::new();
    for scene in scenes::all() {
        let mut setup = scenes::build(scene.name, 0.0).expect("built in");
        (setup.camera.width, setup.camera.height) = if scene.name == "park" { (24, 18) } else { (96, 72) };
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let bounds = setup.scene.bounds();
        let (center, size) = (bounds.center() + 0.1 * bounds.size(), 0.05 * bounds.size().length());
        let others = [
            Light::Sphere { center, radius: size },
            Light::Disk { center: center + Vec3::Y * bounds.size().y, normal: Vec3::NEG_Y, radius: size },
            Light::Rect { center, half_u: Vec3::X * size, half_v: Vec3::new(0.0, 0.3, 0.9) * size },
            Light::Directional { direction: Vec3::new(0.4, -1.0, 0.3), angular_radius: 0.05 },
            Light::Spot { position: center, direction: Vec3::NEG_Y, outer: 0.9, inner: 0.3 },
        ];
        let is_small = setup.scene.triangles().len() < 20_000;
        let params = DdocParams { map_size: 256, taps: 32, ..Default::default() };
        for light in setup.lights.iter().chain(others.iter().filter(|_| is_small)) {
            let (differ, _) = differences(&setup.scene, light, &gbuffer, params);
            if differ > 0 {
                found.push(format!("{}: {differ} pixels under {light:?}", scene.name));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}
