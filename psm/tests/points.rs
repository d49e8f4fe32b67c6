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

/// Of the texels whose whole surroundings the mesh covers, points miss no more than Poisson's share, plus four standard
/// deviations; and they fill none that is farther from the mesh than half a splat and a texel.
#[test]
fn points_cover_what_the_mesh_covers() {
    let at = Vec3::new(0.0, 2.0, 0.0);
    let (mesh, points) = (ball(at, false), ball(at, true));
    for map_size in [256i64, 512] {
        let [by_mesh, by_points] = [&mesh, &points].map(|scene| map(scene, &CAMERA, map_size as u32));
        assert_eq!(by_mesh.view, by_points.view);
        let clouds = PointClouds::new(&points);
        let chosen = clouds.chosen(&points, &by_points.view, map_size as u32);
        assert!(chosen.count() > 0, "drawn by triangles");
        // The ground has triangles 0 and 1.
        let covered = |map: &PsmMap, x: i64, y: i64| {
            let inside = (0..map_size).contains(&x) && (0..map_size).contains(&y);
            let triangle = inside.then(|| map.triangles[(y * map_size + x) as usize]);
            triangle.is_some_and(|t| t != GBuffer::NOTHING && t > 1)
        };
        let around = |reach: i64| (-reach..=reach).flat_map(move |y| (-reach..=reach).map(move |x| (x, y)));
        let (mut within, mut missed, mut outside) = (0, 0, 0);
        for (x, y) in (0..map_size).flat_map(|y| (0..map_size).map(move |x| (x, y))) {
            if around(SPLAT / 2 + 1).all(|(dx, dy)| covered(&by_mesh, x + dx, y + dy)) {
                within += 1;
                missed += usize::from(!covered(&by_points, x, y));
            }
            let near = around(SPLAT / 2 + 2).any(|(dx, dy)| covered(&by_mesh, x + dx, y + dy));
            outside += usize::from(covered(&by_points, x, y) && !near);
        }
        let expected = f64::from(within) * (-((SPLAT * SPLAT) as f64)).exp();
        println!(
            "{map_size}²: {} points, {missed} of {within} missed, {expected:.3} expected",
            chosen.count()
        );
        assert!(
            within > 50 && missed as f64 <= expected + 4.0 * expected.sqrt().max(0.25),
            "{missed} of {within}"
        );
        assert_eq!(outside, 0, "{map_size}²");
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
