//! Truth to a stated error: unbiased, at that error, and never by a guess over what the first samples missed.

use glam::{Affine3A, Vec3};
use gnomon_scene_core::bvh::Bvh;
use gnomon_scene_core::geometry::{ObjectFlags, TriangleMesh};
use gnomon_scene_core::reference::{
    ReferenceSettings, adaptive_reference, exact_reference, no_progress, reference,
};
use gnomon_scene_core::{GBuffer, Light, Scene, raster, scenes};

/// One pixel on a floor below a rect light, and a bar of this width before it, askew.
fn bar(width: f32) -> (Scene, GBuffer, Light) {
    let mut scene = Scene::new();
    let across = Vec3::new(0.3, 0.0, 1.0).normalize() * width;
    let along = Vec3::new(1.0, 0.0, -0.3) * 5.0;
    let center = Vec3::new(0.13, 1.0, 0.07);
    let corners = vec![
        center - along - across,
        center + along - across,
        center + along + across,
        center - along + across,
    ];
    let mesh = TriangleMesh::new("bar", corners, vec![[0, 1, 2], [0, 2, 3]]);
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    let mut gbuffer = GBuffer::new(1, 1);
    (gbuffer.position[0], gbuffer.normal[0]) = (Vec3::ZERO, Vec3::Y);
    (gbuffer.triangle[0], gbuffer.object[0]) = (0, 7);
    let light = Light::Rect { center: Vec3::Y * 2.0, half_u: Vec3::X, half_v: Vec3::Z };
    (scene, gbuffer, light)
}

#[test]
fn there_is_no_bias() {
    for (width, max_error) in [(0.2, 0.05), (0.02, 0.02), (0.5, 0.1)] {
        let (scene, gbuffer, light) = bar(width);
        let bvh = Bvh::casters(&scene);
        let settings = |seed| ReferenceSettings { samples: 256, seed, skip: true };
        let exact = exact_reference(&scene, &bvh, &light, &gbuffer, &settings(0), &no_progress).unwrap();
        let expected = f64::from(exact.visibility.values[0]);
        assert!(expected > 0.01 && expected < 0.99);
        let (mut sum, mut squares, n) = (0.0, 0.0, 4000);
        for seed in 0..n {
            let truth =
                adaptive_reference(&scene, &bvh, &light, &gbuffer, &settings(seed), max_error, &no_progress)
                    .unwrap();
            let error = f64::from(truth.visibility.values[0]) - expected;
            (sum, squares) = (sum + error, squares + error * error);
        }
        let n = n as f64;
        let (mean, rms) = (sum / n, (squares / n).sqrt());
        assert!(mean.abs() < 4.0 * rms / n.sqrt(), "{width}: {mean}");
        assert!(rms < f64::from(max_error), "{width}: {rms}");
    }
}

/// What the first samples do not see is looked for with all.
#[test]
fn a_hair_costs_all_samples() {
    let (scene, gbuffer, light) = bar(1e-4);
    let bvh = Bvh::casters(&scene);
    let settings = ReferenceSettings { samples: 512, seed: 1, skip: true };
    let truth = adaptive_reference(&scene, &bvh, &light, &gbuffer, &settings, 0.1, &no_progress).unwrap();
    assert_eq!((truth.work.sampled, truth.work.rays), (1, 512 + 32));
}

#[test]
fn a_small_error_is_all_samples_and_a_large_one_few() {
    let setup = scenes::build("ball", 0.0).unwrap();
    let mut camera = setup.camera;
    (camera.width, camera.height) = (48, 36);
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let (bvh, light) = (Bvh::casters(&setup.scene), &setup.lights[0]);
    let settings = ReferenceSettings { samples: 256, seed: 2, skip: true };
    let run = |max_error| {
        adaptive_reference(&setup.scene, &bvh, light, &gbuffer, &settings, max_error, &no_progress).unwrap()
    };
    let plain = reference(&setup.scene, &bvh, light, &gbuffer, &settings, &no_progress).unwrap();
    let (all, few) = (run(0.0), run(0.05));
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&all.visibility.values), bits(&plain.visibility.values));
    // Pixels that are lit or dark and not proved so take all.
    assert!(few.work.rays * 4 < plain.work.rays * 3, "{} {}", few.work.rays, plain.work.rays);
}
