//! The GPU path of the variants that draw their maps for what is seen, `cascaded` and `multi-view`, against the CPU path: at
//! least 99.9 % of the valid pixels within 1/255.
//!
//! Maps are fitted or placed by arithmetic that differs in its last digits, and drawn by another rasteriser, so a shadow's
//! edge may fall on the other side of a texel: V of every other pixel must be among the CPU's answers within a texel.

#![cfg(feature = "gpu")]

mod explained;

use glam::Vec3;
use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::light_maps::LightMaps;
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, testing};
use scene_core::reference::valid_pixels;
use scene_core::{Light, Report, SceneSetup, VisibilityImage, raster, scenes};

const MAP_SIZE: u32 = 256;

fn check(gpu: &Gpu, name: &str, setup: &SceneSetup, light: Light, params: ShadowMapParams) {
    let (scene, camera) = (&setup.scene, &setup.camera);
    let gbuffer = raster::render_gbuffer(scene, camera);
    let (on_cpu, _) = ShadowMap::new(params).prepare(scene, &light);
    let mut expected = VisibilityImage::new(gbuffer.width, gbuffer.height);
    on_cpu.shade(&gbuffer, &mut expected);
    let mut view = gpu.view(scene, camera).unwrap();
    view.upload_gbuffer(&gbuffer).unwrap();
    let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
    let run = view.run(&mut on_gpu, &light, &gbuffer).unwrap();
    let again = view.run(&mut on_gpu, &light, &gbuffer).unwrap();
    assert!(
        run.visibility.values.iter().zip(&again.visibility.values).all(|(a, b)| a.to_bits() == b.to_bits()),
        "a second frame differs from the first"
    );

    let valid = valid_pixels(&gbuffer, &light);
    let seen: Vec<_> = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)).collect();
    let got = |pixel: usize| run.visibility.values[pixel];
    let differs =
        |&pixel: &usize| got(pixel).is_nan() || (got(pixel) - expected.values[pixel]).abs() > 1.0 / 255.0;
    let different: Vec<_> = seen.iter().copied().filter(differs).collect();
    let asked = seen.iter().filter(|&&pixel| valid[pixel]).count();
    let differ = different.iter().filter(|&&pixel| valid[pixel]).count();
    let label = format!("{name}, {:?}, {light:?}", params.variant);
    println!("{label}: {differ} of {asked} valid pixels differ");
    assert!(differ * 1000 <= asked, "{label}: {differ} of {asked} valid pixels differ");
    assert!(seen.iter().any(|&pixel| got(pixel) < 1.0), "{label}: no shadow");

    // A window that holds all casters has the largest texels.
    let hard = ShadowMapParams { variant: Variant::Hard, ..params };
    let whole = LightMaps::draw(scene, &light, &hard, &mut Report::default(), |_, _, _| None);
    let reach = |pixel: usize| {
        let point = gbuffer.position[pixel];
        let texel = |view: &gnomon_shadow_map::light_views::LightView| {
            view.half_diagonal(view.depth_of(point)).abs() * 2.0 / MAP_SIZE as f32
        };
        whole.maps.iter().map(|map| texel(&map.view)).fold(0.0, f32::max)
    };
    let brackets = explained::bracket(&on_cpu, &gbuffer, &different, reach);
    for (pixel, [least, most]) in different.into_iter().zip(brackets) {
        let v = got(pixel);
        assert!(
            (least - 1.0 / 255.0..=most + 1.0 / 255.0).contains(&v),
            "{label}: pixel {pixel} is {} on the CPU, {least} to {most} within a texel, {v} on the GPU",
            expected.values[pixel],
        );
    }
}

fn setup(name: &str) -> SceneSetup {
    let mut setup = scenes::build(name, 0.4).unwrap();
    (setup.camera.width, setup.camera.height) = (160, 120);
    setup
}

#[test]
fn cascades_agree() {
    let Some(gpu) = testing::gpu() else { return };
    let params = ShadowMapParams { variant: Variant::Cascaded, map_size: MAP_SIZE, ..Default::default() };
    for name in ["street", "park", "fence", "chess"] {
        let setup = setup(name);
        let sun = |direction| Light::Directional { direction, angular_radius: 0.0 };
        for light in [sun(Vec3::new(0.4, -1.0, 0.3)), sun(Vec3::new(1.0, -0.3, -0.4))] {
            for cascades in [1, 3, 8] {
                check(&gpu, name, &setup, light, ShadowMapParams { cascades, ..params });
            }
        }
    }
    // At a place it is `hard`.
    let chess = setup("chess");
    let inside = Light::Point { position: chess.scene.bounds().center() };
    check(&gpu, "chess", &chess, inside, params);
}

#[test]
fn many_views_agree() {
    let Some(gpu) = testing::gpu() else { return };
    let params =
        ShadowMapParams { variant: Variant::MultiView, views: 16, map_size: MAP_SIZE, ..Default::default() };
    for name in ["quads", "ball", "chess", "log-cabin"] {
        let setup = setup(name);
        let bounds = setup.scene.bounds();
        let size = bounds.size().max_element();
        let above = bounds.center() + Vec3::new(0.1, 1.0, 0.2) * size;
        let inside = bounds.center() + 0.1 * bounds.size();
        for light in [
            setup.lights[0],
            Light::Sphere { center: above, radius: 0.05 * size },
            Light::Sphere { center: inside, radius: 0.02 * size },
            Light::Directional { direction: Vec3::new(0.4, -1.0, 0.3), angular_radius: 0.04 },
        ] {
            check(&gpu, name, &setup, light, params);
        }
    }
}

/// The scene's own light, on a small picture; cascades under a sun.
#[test]
fn all_agree_on_every_built_in_scene() {
    let Some(gpu) = testing::gpu() else { return };
    for name in scenes::all().iter().map(|scene| scene.name) {
        let mut setup = setup(name);
        (setup.camera.width, setup.camera.height) = (80, 60);
        let sun = Light::Directional { direction: Vec3::new(0.4, -1.0, 0.3), angular_radius: 0.0 };
        let of = |variant| ShadowMapParams { variant, views: 4, map_size: MAP_SIZE, ..Default::default() };
        check(&gpu, name, &setup, sun, of(Variant::Cascaded));
        check(&gpu, name, &setup, setup.lights[0], of(Variant::MultiView));
    }
}
