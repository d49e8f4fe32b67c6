//! Casters drawn as points (section 5): their maps cover what their triangles cover.

use std::f32::consts::{PI, TAU};

use glam::{Affine3A, Vec3};
use gnomon_psm::points::{PointClouds, SPLAT};
use gnomon_psm::{Psm, PsmMap, PsmParams, Variant};
use scene_core::bvh::Bvh;
use scene_core::geometry::ObjectFlags;
use scene_core::reference::{ReferenceSettings, no_progress, reference, valid_pixels};
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};

const SUN: Light = Light::Directional { direction: Vec3::new(0.3, -1.0, 0.1), angular_radius: 0.0 };

const CAMERA: Camera = Camera {
    eye: Vec3::new(0.0, 6.0, 9.0),
    target: Vec3::ZERO,
    up: Vec3::Y,
    fov_y: 0.8,
    near: 0.1,
    far: f32::INFINITY,
    width: 96,
    height: 96,
};

/// A ball of radius 1 of 2 · 300 · 300 triangles, `at`, over the ground.
fn ball(at: Vec3, points: bool) -> Scene {
    const STEPS: u32 = 300;
    let position = |i: u32| {
        let (row, column) = (i / (STEPS + 1), i % (STEPS + 1));
        let (polar, around) = (row as f32 / STEPS as f32 * PI, column as f32 / STEPS as f32 * TAU);
        at + Vec3::new(polar.sin() * around.cos(), polar.cos(), polar.sin() * around.sin())
    };
    let quad = |i: u32| {
        let a = i / STEPS * (STEPS + 1) + i % STEPS;
        [[a, a + STEPS + 1, a + 1], [a + 1, a + STEPS + 1, a + STEPS + 2]]
    };
    let positions = (0..(STEPS + 1) * (STEPS + 1)).map(position).collect();
    let ball = TriangleMesh::new("ball", positions, (0..STEPS * STEPS).flat_map(quad).collect());
    let corners = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
    let ground = TriangleMesh::new("ground", corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    let mut scene = Scene::new();
    scene.add(&ground, Affine3A::IDENTITY, ObjectFlags::default()).expect("sound");
    // What it shows of itself is not asked: the maps of both scenes are fitted alike.
    let flags = ObjectFlags { points, receives: false, ..Default::default() };
    scene.add(&ball, Affine3A::IDENTITY, flags).expect("sound");
    scene
}

fn map(scene: &Scene, camera: &Camera, map_size: u32) -> PsmMap {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let technique = Psm::new(PsmParams { variant: Variant::Psm, map_size, ..Default::default() });
    let (prepared, _) = technique.prepare(scene, &SUN, camera, &gbuffer);
    prepared.maps()[0].clone()
}

/// Of the texels whose whole surroundings the mesh covers, `points` miss no more than Poisson's share, plus four standard
/// deviations; and they fill none that is farther from the mesh than half a splat and a texel.
fn assert_covers(by_points: &[u32], by_mesh: &[u32], map_size: i64) {
    // The ground has triangles 0 and 1.
    let covered = |map: &[u32], x: i64, y: i64| {
        let inside = (0..map_size).contains(&x) && (0..map_size).contains(&y);
        let triangle = inside.then(|| map[(y * map_size + x) as usize]);
        triangle.is_some_and(|t| t != GBuffer::NOTHING && t > 1)
    };
    let around = |reach: i64| (-reach..=reach).flat_map(move |y| (-reach..=reach).map(move |x| (x, y)));
    let (mut within, mut missed, mut outside) = (0, 0, 0);
    for (x, y) in (0..map_size).flat_map(|y| (0..map_size).map(move |x| (x, y))) {
        if around(SPLAT / 2 + 1).all(|(dx, dy)| covered(by_mesh, x + dx, y + dy)) {
            within += 1;
            missed += usize::from(!covered(by_points, x, y));
        }
        let near = around(SPLAT / 2 + 2).any(|(dx, dy)| covered(by_mesh, x + dx, y + dy));
        outside += usize::from(covered(by_points, x, y) && !near);
    }
    let expected = f64::from(within) * (-((SPLAT * SPLAT) as f64)).exp();
    println!("{map_size}²: {missed} of {within} missed, {expected:.3} expected");
    let bound = expected + 4.0 * expected.sqrt().max(0.25);
    assert!(within > 50 && missed as f64 <= bound, "{missed} of {within}");
    assert_eq!(outside, 0, "{map_size}²");
}

#[test]
fn points_cover_what_the_mesh_covers() {
    let at = Vec3::new(0.0, 2.0, 0.0);
    let (mesh, points) = (ball(at, false), ball(at, true));
    for map_size in [256, 512] {
        let [by_mesh, by_points] = [&mesh, &points].map(|scene| map(scene, &CAMERA, map_size));
        assert_eq!(by_mesh.view, by_points.view);
        let chosen = PointClouds::new(&points).chosen(&points, &by_points.view, map_size).count();
        println!("{chosen} points");
        assert!(chosen > 0, "drawn by triangles");
        assert_covers(&by_points.triangles, &by_mesh.triangles, i64::from(map_size));
    }
}

/// The GPU draws as many, but for what rounding adds to a number of them, and covers as much.
#[cfg(feature = "gpu")]
#[test]
fn points_cover_what_the_mesh_covers_on_the_gpu() {
    use gnomon_psm::gpu::PsmOnGpu;
    use scene_core::gpu::headless::VISIBILITY_FORMAT;
    use scene_core::gpu::testing;

    let Some(gpu) = testing::gpu() else { return };
    let scenes = [false, true].map(|points| ball(Vec3::new(0.0, 2.0, 0.0), points));
    let gbuffer = raster::render_gbuffer(&scenes[1], &CAMERA);
    for map_size in [256, 512] {
        let params = PsmParams { variant: Variant::Psm, map_size, ..Default::default() };
        let [by_mesh, by_points] = [0, 1].map(|i| {
            let mut technique = PsmOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
            let run = testing::run_over(&gpu, &gbuffer, (&scenes[i], &CAMERA, &SUN), &mut technique).unwrap();
            let ids: Vec<u32> = gpu.read_texture(technique.layers().ids().unwrap(), 0).unwrap();
            (ids, run.report.counted["points drawn"])
        });
        let on_cpu = map(&scenes[1], &CAMERA, map_size);
        let expected = PointClouds::new(&scenes[1]).chosen(&scenes[1], &on_cpu.view, map_size).count();
        // Areas and forms in f32: a few parts in ten million of them, and one where rounding up begins.
        let apart = by_points.1.abs_diff(expected as u64) as f64;
        assert!(by_mesh.1 == 0 && apart <= 1.0 + 1e-5 * expected as f64, "{}, {expected}", by_points.1);
        assert_covers(&by_points.0, &by_mesh.0, i64::from(map_size));
        // Texel by texel: a splat's border may fall on the other side of a centre.
        let is_filled = |triangle: &u32| *triangle != GBuffer::NOTHING;
        let both = || by_points.0.iter().map(is_filled).zip(on_cpu.triangles.iter().map(is_filled));
        let (filled, differ) = (both().filter(|(a, _)| *a).count(), both().filter(|(a, b)| a != b).count());
        println!("{map_size}²: {filled} texels are filled, {differ} by one backend alone");
        assert!(differ * 100 <= filled, "{differ} of {filled}");
    }
}

/// Farther objects fall into fewer texels, and get fewer points; coarser maps too.
#[test]
fn the_farther_the_fewer() {
    let count = |at: Vec3, map_size: u32| {
        let scene = ball(at, true);
        let view = map(&scene, &CAMERA, map_size).view;
        PointClouds::new(&scene).chosen(&scene, &view, map_size).count()
    };
    let near = count(Vec3::new(0.0, 1.5, 4.0), 128);
    let far = count(Vec3::new(0.0, 1.5, -6.0), 128);
    assert!(far > 0 && far * 2 < near, "{far}, {near}");
    let coarse = count(Vec3::new(0.0, 1.5, 4.0), 64);
    // A quarter, but for rounding up.
    assert!((coarse as f64 / near as f64 - 0.25).abs() < 0.01, "{coarse}, {near}");
}

/// Trees as points: their shadows on the ground are as dark as those of their triangles, to a share of what both get wrong.
#[test]
fn a_forest_of_points_is_about_as_right_as_one_of_triangles() {
    let wrong = |points: u32| {
        let setup =
            scenes::build(&format!("forest:triangles=300000,points={points}"), 0.0).expect("built in");
        let camera = setup.camera.with_size(192, 144);
        let light = Light::Directional { direction: Vec3::new(0.75, -0.62, 0.3), angular_radius: 0.0 };
        let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
        let casters = Bvh::casters(&setup.scene);
        let settings = ReferenceSettings::default();
        let truth =
            reference(&setup.scene, &casters, &light, &gbuffer, &settings, &no_progress).expect("done");
        let technique = Psm::new(PsmParams { map_size: 512, ..Default::default() });
        let (prepared, _) = technique.prepare(&setup.scene, &light, &camera, &gbuffer);
        let mut image = VisibilityImage::new(camera.width, camera.height);
        prepared.shade(&gbuffer, &mut image);
        let valid = valid_pixels(&gbuffer, &light);
        let pixels = image.values.iter().zip(&truth.visibility.values).zip(&valid);
        let wrong = pixels.filter(|((v, t), valid)| **valid && (*v - *t).abs() > 0.5).count();
        println!("points {points}: {wrong} wrong pixels of {}", valid.iter().filter(|v| **v).count());
        wrong
    };
    let (triangles, points) = (wrong(0), wrong(1));
    // A splat is as coarse as a texel of a map of a third of the size, where these edges are all of the picture.
    assert!(points <= 2 * triangles, "{points}, {triangles}");
}
