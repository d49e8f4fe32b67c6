//! `view_dependent` on the GPU: casters and faces of a cube that nobody looks at are not drawn, and no bit of an image changes.

#![cfg(feature = "gpu")]

mod views;

use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::{Kernel, ShadowMapParams, Variant};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, HeadlessRun, testing};
use scene_core::{Camera, Light, Scene, raster, scenes};
use views::random_view;

/// Draws with these settings, `view_dependent` or not.
fn run(
    gpu: &Gpu,
    scene: &Scene,
    camera: &Camera,
    light: &Light,
    params: ShadowMapParams,
) -> [HeadlessRun; 2] {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let mut view = gpu.view(scene, camera).unwrap();
    view.upload_gbuffer(&gbuffer).unwrap();
    [false, true].map(|view_dependent| {
        let params = ShadowMapParams { view_dependent, ..params };
        let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
        assert_eq!(on_gpu.survives_camera(), !view_dependent);
        view.run(&mut on_gpu, light, &gbuffer).unwrap()
    })
}

const VARIANTS: [(Variant, Kernel); 8] = [
    (Variant::Hard, Kernel::Grid),
    (Variant::Pcf, Kernel::Grid),
    (Variant::Pcf, Kernel::PoissonDisk),
    (Variant::ObjectId, Kernel::Grid),
    (Variant::Moments, Kernel::Grid),
    (Variant::Pcss, Kernel::Grid),
    (Variant::Cascaded, Kernel::Grid),
    (Variant::MultiView, Kernel::Grid),
];

fn params((variant, kernel): (Variant, Kernel)) -> ShadowMapParams {
    ShadowMapParams { variant, kernel, map_size: 128, taps: 16, views: 3, ..Default::default() }
}

#[test]
fn no_image_changes() {
    let Some(gpu) = testing::gpu() else { return };
    let mut dark = 0;
    for spec in ["street", "forest:triangles=20000"] {
        let setup = scenes::build(spec, 1.0).unwrap();
        let bounds = setup.scene.bounds();
        let lamp = Light::Point { position: bounds.center() + 0.1 * bounds.size() };
        for (seed, light) in [(1, lamp), (3, lamp), (5, setup.lights[0])] {
            let camera = random_view(&setup.scene, seed).with_size(64, 48);
            for kind in VARIANTS {
                let runs = run(&gpu, &setup.scene, &camera, &light, params(kind));
                assert!(
                    runs[0].visibility.bits() == runs[1].visibility.bits(),
                    "{spec}, {kind:?}, {light:?}, view {seed}"
                );
                dark += runs[0].visibility.values.iter().filter(|&&v| v < 1.0).count();
            }
        }
    }
    assert!(dark > 5_000, "{dark} pixels in shadow");
}

/// A lamp in the middle of what a narrow camera sees a part of: faces that look elsewhere draw nothing, and that is counted.
#[test]
fn faces_that_nobody_sees_are_not_drawn() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("forest:triangles=20000", 0.0).unwrap();
    let camera = Camera { fov_y: 0.1, ..setup.camera.with_size(64, 64) };
    let light = Light::Point { position: setup.scene.bounds().center() };
    for kind in VARIANTS {
        let runs = run(&gpu, &setup.scene, &camera, &light, params(kind));
        assert!(runs[0].visibility.bits() == runs[1].visibility.bits(), "{kind:?}");
        let [all, seen] = runs.map(|run| run.report.skipped.get("undrawn faces").copied().unwrap_or(0));
        assert!(all == 0 && (1..6 * 3).contains(&seen), "{kind:?}: {all} and {seen} faces not drawn");
        // With `skip` off nothing is left out, `view_dependent` or not.
        let off = ShadowMapParams { skip: false, ..params(kind) };
        let [_, off] = run(&gpu, &setup.scene, &camera, &light, off);
        assert!(!off.report.skipped.contains_key("undrawn faces"), "{kind:?}: {:?}", off.report.skipped);
    }
}

/// Of lights with extent, too: `pcss` asks for what lies between surfaces and all of the light.
#[test]
fn pcss_leaves_out_what_no_cone_meets() {
    let Some(gpu) = testing::gpu() else { return };
    let sun = Light::Directional { direction: glam::Vec3::new(0.4, -1.0, 0.3), angular_radius: 0.02 };
    let (mut faces, mut casters, mut dark) = (0, 0, 0);
    for (spec, is_sun) in [("forest:triangles=20000", true), ("cornell", false)] {
        let setup = scenes::build(spec, 0.0).unwrap();
        let bounds = setup.scene.bounds();
        let radius = 0.01 * bounds.size().min_element();
        // Above both blocks.
        let center = bounds.center() + glam::Vec3::Y * (0.3 * bounds.size().y);
        let light = if is_sun { sun } else { Light::Sphere { center, radius } };
        for seed in 0..6 {
            let camera = random_view(&setup.scene, seed).with_size(64, 48);
            let camera = Camera { fov_y: 0.3, ..camera };
            let runs = run(&gpu, &setup.scene, &camera, &light, params((Variant::Pcss, Kernel::Grid)));
            assert!(runs[0].visibility.bits() == runs[1].visibility.bits(), "{spec}, view {seed}");
            let count = |what| runs[1].report.skipped.get(what).copied().unwrap_or(0);
            faces += count("undrawn faces");
            casters += if is_sun { count("casters outside view") } else { 0 };
            dark += runs[0].visibility.values.iter().filter(|&&v| v < 1.0).count();
        }
    }
    assert!(
        faces > 5 && casters > 20 && dark > 500,
        "{faces} faces, {casters} casters, {dark} pixels in shadow"
    );
}
