//! Shadows whose outline is known in closed form. Pixels closer to it than a texel's footprint may differ.

use glam::{Affine3A, Vec3};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams};
use scene_core::geometry::ObjectFlags;
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster};

/// A horizontal square around `center` with sides 2·`half`.
fn square(name: &str, center: Vec3, half: f32) -> TriangleMesh {
    let corner = |x: f32, z: f32| center + Vec3::new(x * half, 0.0, z * half);
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    TriangleMesh::new(name, positions, vec![[0, 1, 2], [0, 2, 3]])
}

fn scene_of(meshes: &[TriangleMesh]) -> Scene {
    let mut scene = Scene::new();
    for mesh in meshes {
        scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
    }
    scene
}

fn camera(eye: Vec3, target: Vec3) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_y: 0.9, near: 0.01, far: f32::INFINITY, width: 160, height: 120 }
}

fn shade(scene: &Scene, light: &Light, camera: &Camera, map_size: u32) -> (GBuffer, VisibilityImage) {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let technique = ShadowMap::new(ShadowMapParams { map_size, ..Default::default() });
    let (maps, _) = technique.prepare(scene, light);
    let mut visibility = VisibilityImage::new(camera.width, camera.height);
    maps.shade(&gbuffer, &mut visibility);
    (gbuffer, visibility)
}

/// The square of half side 1 at height 1 over the ground, from a point light: on the ground it is a square,
/// scaled from the light by h/(h−1).
#[test]
fn square_over_a_plane_is_its_projection() {
    let place = Vec3::new(0.4, 3.0, -0.3);
    let light = Light::Point { position: place };
    let scene = scene_of(&[square("ground", Vec3::ZERO, 8.0), square("caster", Vec3::Y, 1.0)]);
    for map_size in [64, 256, 1024] {
        let (gbuffer, visibility) =
            shade(&scene, &light, &camera(Vec3::new(0.0, 6.0, 7.0), Vec3::ZERO), map_size);
        let scale = place.y / (place.y - 1.0);
        // The map holds the caster's square; a texel on the ground is this wide.
        let texel = 2.0 * scale / map_size as f32 * 1.01;
        let (mut inside, mut compared) = (0, 0);
        for pixel in 0..gbuffer.pixel_count() {
            if gbuffer.object[pixel] != 0 {
                continue;
            }
            let p = gbuffer.position[pixel];
            // Signed distance to the projected square, in the maximum norm.
            let on_caster = (p - place) / scale + place;
            let distance = (on_caster.x.abs().max(on_caster.z.abs()) - 1.0) * scale;
            if distance.abs() > texel {
                let expected = if distance < 0.0 { 0.0 } else { 1.0 };
                assert_eq!(
                    visibility.values[pixel], expected,
                    "map {map_size}, at {p}, {distance} off the edge"
                );
                compared += 1;
                inside += usize::from(distance < 0.0);
            }
        }
        assert!(inside > 50 && compared > 1000, "the test sees its shadow: {inside} of {compared}");
    }
}

/// A lit plane shadows nothing of itself: no pixel is dark, from any angle, at any size of map and scale.
#[test]
fn no_acne_on_a_plane_at_any_angle_size_and_scale() {
    for scale in [1e-3, 1.0, 1e4] {
        // A second, far caster keeps the ground from being left out as a caster.
        let scene = scene_of(&[
            square("ground", Vec3::ZERO, 4.0 * scale),
            square("below", Vec3::NEG_Y * scale, 4.0 * scale),
        ]);
        let camera = Camera {
            near: 0.01 * scale,
            ..camera(Vec3::new(1.0, 3.0, 5.0) * scale, Vec3::new(0.0, 0.0, 0.5) * scale)
        };
        for degrees in [0.0f32, 15.0, 45.0, 70.0, 85.0, 89.0, 89.9] {
            let tilt = degrees.to_radians();
            let light = Light::Directional {
                direction: Vec3::new(tilt.sin() * 0.8, -tilt.cos(), tilt.sin() * 0.6),
                angular_radius: 0.0,
            };
            for map_size in [64, 512, 4096] {
                if map_size == 4096 && degrees != 89.9 {
                    continue;
                }
                let (gbuffer, visibility) = shade(&scene, &light, &camera, map_size);
                let ground = (0..gbuffer.pixel_count()).filter(|&i| gbuffer.object[i] == 0);
                let dark = ground.clone().filter(|&i| visibility.values[i] != 1.0).count();
                assert_eq!(dark, 0, "{degrees}°, map {map_size}, scale {scale}");
                assert!(ground.count() > 5000);
            }
        }
    }
}

/// A light in a closed box sees all six walls through the faces of its cube, and nothing is dark.
#[test]
fn a_room_is_lit_on_all_sides_by_the_light_in_it() {
    let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let positions = (0..8u32)
        .map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - Vec3::ONE)
        .collect();
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let scene = scene_of(&[TriangleMesh::new("room", positions, triangles)]);
    let light = Light::Point { position: Vec3::new(0.1, 0.2, -0.3) };
    for target in [Vec3::X, Vec3::NEG_X, Vec3::new(0.1, 1.0, 0.0), Vec3::Z, Vec3::NEG_Z] {
        let (_, visibility) = shade(&scene, &light, &camera(Vec3::new(-0.2, 0.1, 0.15), target), 128);
        assert_eq!(visibility.values.iter().filter(|&&v| v != 1.0).count(), 0, "towards {target}");
    }
}
