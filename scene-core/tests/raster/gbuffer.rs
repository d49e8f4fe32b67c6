//! The G-buffer against a ray caster.

use glam::{Vec2, Vec3};
use gnomon_scene_core::raster::render_gbuffer;
use gnomon_scene_core::{Camera, GBuffer, Scene};
use proptest::prelude::*;

use super::caster::{cast, intersect};
use super::meshes::{add, blob, camera, hash, scene_of};

/// Compares every pixel whose ray passes all edges by more than the rasteriser's snapping; returns how many.
fn compare(scene: &Scene, camera: &Camera) -> usize {
    let gbuffer = render_gbuffer(scene, camera);
    let eye = camera.eye.as_dvec3();
    let (near, far) = (f64::from(camera.near), f64::from(camera.far));
    let mut compared = 0;
    for pixel in 0..gbuffer.pixel_count() {
        let (x, y) = (pixel % camera.width as usize, pixel / camera.width as usize);
        let ray = |dx: f32, dy: f32| {
            let at = Vec2::new(x as f32 + 0.5 + dx, y as f32 + 0.5 + dy);
            camera.ray_direction(at).as_dvec3()
        };
        let hit = |direction| cast(scene, eye, direction, [near, far], |_| true);
        // The same triangle a hundredth of a pixel around: no edge or intersection passes here.
        let found = hit(ray(0.0, 0.0));
        let around = [ray(-0.01, -0.01), ray(0.01, -0.01), ray(-0.01, 0.01), ray(0.01, 0.01)].map(hit);
        if around.iter().any(|h| h.map(|h| h.triangle) != found.map(|h| h.triangle)) {
            continue;
        }
        compared += 1;
        let Some(hit) = found else {
            assert!(!gbuffer.is_seen(pixel), "pixel {x}, {y} sees what no ray hits");
            continue;
        };
        assert_eq!(gbuffer.triangle[pixel] as usize, hit.triangle, "pixel {x}, {y}");
        assert_eq!(gbuffer.object[pixel], scene.object_of(hit.triangle));
        let position = eye + ray(0.0, 0.0) * hit.t;
        let scale = position.abs().max(eye.abs()).max_element();
        // Both are exact up to one rounding to f32, of the result and of the ray.
        let bound = 4.0 * f64::from(f32::EPSILON) * scale;
        assert!((gbuffer.position[pixel].as_dvec3() - position).abs().max_element() <= bound);
        assert!((f64::from(gbuffer.depth[pixel]) - hit.t).abs() <= 2.0 * f64::from(f32::EPSILON) * hit.t);
        let [a, b, c] = scene.corners(hit.triangle);
        let normal = gbuffer.normal[pixel];
        assert!(normal.is_normalized());
        assert!(normal.as_dvec3().dot(ray(0.0, 0.0)) <= 0.0, "the normal is turned away");
        let exact = (b - a).as_dvec3().cross((c - a).as_dvec3()).normalize();
        assert!(exact.dot(normal.as_dvec3()).abs() > 1.0 - 1e-5);
    }
    compared
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn a_random_mesh_on_a_floor_equals_ray_casting(
        seed in any::<u64>(),
        slices in 3_u32..20,
        stacks in 2_u32..14,
        offset in prop_oneof![Just(0.0_f32), Just(1000.0), Just(-20_000.0)],
    ) {
        let noise = |slice, stack| 1.0 - 0.6 * hash(seed ^ (u64::from(slice) << 32) ^ u64::from(stack));
        let (positions, triangles) = blob(slices, stacks, noise);
        let shift = Vec3::new(offset, -offset, offset);
        let mut scene = scene_of(positions.iter().map(|&p| p + shift).collect(), triangles);
        let corner = |x: f32, z: f32| Vec3::new(x, -1.0, z) * Vec3::new(30.0, 1.0, 30.0) + shift;
        let floor = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        add(&mut scene, floor, vec![[0, 1, 2], [0, 2, 3]]);
        let camera = camera(48, 36);
        let camera = Camera { eye: camera.eye + shift, target: camera.target + shift, ..camera };
        prop_assert!(compare(&scene, &camera) > 48 * 36 / 2);
    }
}

#[test]
fn an_infinite_far_plane_works() {
    let (positions, triangles) = blob(12, 9, |_, _| 1.0);
    let camera = Camera { far: f32::INFINITY, near: 1e-4, ..camera(48, 36) };
    assert!(compare(&scene_of(positions, triangles), &camera) > 1000);
}

#[test]
fn of_two_coincident_surfaces_the_first_is_seen() {
    let (positions, triangles) = blob(30, 20, |_, _| 1.0);
    let mut scene = scene_of(positions.clone(), triangles.clone());
    add(&mut scene, positions, triangles);
    let gbuffer = render_gbuffer(&scene, &camera(64, 64));
    assert!(gbuffer.object.iter().all(|&o| o == 0 || o == GBuffer::NOTHING));
    assert!(gbuffer.object.contains(&0));
}

/// A pixel never shows a point off its triangle by more than the snapping, edge-on or not.
#[test]
fn hits_stay_on_their_triangles() {
    let (positions, triangles) =
        blob(300, 200, |slice, stack| 1.0 - 0.1 * hash(u64::from(slice * 999 + stack)));
    let scene = scene_of(positions, triangles);
    let camera = camera(100, 80);
    let gbuffer = render_gbuffer(&scene, &camera);
    for pixel in (0..gbuffer.pixel_count()).filter(|&p| gbuffer.is_seen(p)) {
        let corners = scene.corners(gbuffer.triangle[pixel] as usize);
        let depths = corners.map(|c| (c - camera.eye).dot(camera.forward()));
        let (near, far) = (depths.into_iter().reduce(f32::min), depths.into_iter().reduce(f32::max));
        let slack = 1e-5;
        assert!(
            gbuffer.depth[pixel] >= near.unwrap() - slack && gbuffer.depth[pixel] <= far.unwrap() + slack
        );
        let direction =
            camera.ray_direction(Vec2::new((pixel % 100) as f32 + 0.5, (pixel / 100) as f32 + 0.5));
        if let Some((t, inside)) = intersect(camera.eye.as_dvec3(), direction.as_dvec3(), corners)
            && inside >= 0.0
        {
            assert!((f64::from(gbuffer.depth[pixel]) - t).abs() < 1e-6 * t);
        }
    }
}
