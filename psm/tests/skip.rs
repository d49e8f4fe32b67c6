//! Leaving casters out never changes an image, bit for bit.

use glam::Vec3;
use gnomon_psm::{Psm, PsmParams, Variant};
use scene_core::{Light, VisibilityImage, raster, scenes};

#[test]
fn skipping_changes_no_pixel() {
    for spec in ["street", "park:leaves=800", "forest:triangles=60000"] {
        let setup = scenes::build(spec, 1.0).expect("a built-in scene");
        let camera = setup.camera.with_size(128, 96);
        let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
        let bounds = setup.scene.bounds();
        let inside = bounds.center() + 0.2 * bounds.size();
        let mut lights = vec![Light::Point { position: inside }];
        lights.push(Light::Spot {
            position: inside,
            direction: Vec3::new(0.3, -1.0, 0.2),
            outer: 0.9,
            inner: 0.3,
        });
        let directions =
            [Vec3::NEG_Y, Vec3::new(0.9, -0.3, 0.2), Vec3::new(0.1, -0.6, 1.0), Vec3::new(-0.4, -0.5, -1.0)];
        lights.extend(directions.map(|direction| Light::Directional { direction, angular_radius: 0.0 }));
        let (mut left_out, mut dark) = (0, 0);
        for light in &lights {
            for variant in [Variant::Auto, Variant::Uniform] {
                let image = |skip| {
                    let params = PsmParams { variant, skip, map_size: 128, ..Default::default() };
                    let (prepared, report) = Psm::new(params).prepare(&setup.scene, light, &camera, &gbuffer);
                    let mut image = VisibilityImage::new(camera.width, camera.height);
                    prepared.shade(&gbuffer, &mut image);
                    let count = report.skipped.get("caster triangles outside view").copied().unwrap_or(0);
                    (image.bits(), count)
                };
                let ((with, count), (without, none)) = (image(true), image(false));
                assert!(with == without, "{spec}, {light:?}, {variant:?}");
                assert_eq!(none, 0);
                left_out += count;
                dark += with.iter().filter(|&&v| v == 0).count();
            }
        }
        assert!(left_out > 0 && dark > 0, "{spec}: {left_out} left out, {dark} dark");
    }
}

/// On the GPU, too: what is left out of a map is in none of its texels.
#[cfg(feature = "gpu")]
#[test]
fn skipping_changes_no_texel_on_the_gpu() {
    use gnomon_psm::gpu::PsmOnGpu;
    use scene_core::gpu::headless::VISIBILITY_FORMAT;
    use scene_core::gpu::testing;

    let Some(gpu) = testing::gpu() else { return };
    for spec in ["street", "park:leaves=800", "forest:triangles=60000,points=1"] {
        let setup = scenes::build(spec, 1.0).expect("a built-in scene");
        let (scene, camera) = (&setup.scene, setup.camera.with_size(96, 72));
        let gbuffer = raster::render_gbuffer(scene, &camera);
        let bounds = scene.bounds();
        let inside = Light::Point { position: bounds.center() + 0.2 * bounds.size() };
        let sun = |direction| Light::Directional { direction, angular_radius: 0.0 };
        let (mut left_out, mut drawn) = (0, 0);
        for light in [inside, sun(Vec3::new(0.9, -0.3, 0.2)), sun(Vec3::new(-0.4, -0.5, -1.0))] {
            let maps = |skip| {
                let params = PsmParams { skip, map_size: 128, ..Default::default() };
                let mut technique = PsmOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
                let run =
                    testing::run_over(&gpu, &gbuffer, (scene, &camera, &light), &mut technique).unwrap();
                let ids = technique.layers().ids().unwrap();
                let layers = 0..ids.depth_or_array_layers();
                let maps: Vec<Vec<u32>> = layers.map(|i| gpu.read_texture(ids, i).unwrap()).collect();
                (maps, run.visibility.bits(), run.report)
            };
            let ((with, v_with, report), (without, v_without, all)) = (maps(true), maps(false));
            assert!(with == without && v_with == v_without, "{spec}, {light:?}");
            let counted = |counts: &std::collections::BTreeMap<String, u64>, name: &str| counts[name];
            left_out += counted(&report.skipped, "caster triangles outside view")
                - counted(&all.skipped, "caster triangles outside view");
            drawn += counted(&report.counted, "caster triangles drawn");
        }
        assert!(left_out > 0 && drawn > 0, "{spec}: {left_out} left out, {drawn} drawn");
    }
}
