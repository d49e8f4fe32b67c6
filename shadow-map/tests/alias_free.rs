//! `alias-free` is the ray-traced hard shadow, on every built-in scene.

use glam::{Affine3A, Vec3};
use gnomon_shadow_map::alias_free::AliasFree;
use scene_core::bvh::Bvh;
use scene_core::geometry::ObjectFlags;
use scene_core::light::LightPoint;
use scene_core::reference::{ReferenceSettings, no_progress, reference};
use scene_core::{Camera, Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};

/// The light's centre, as a light.
fn without_extent(light: &Light) -> Light {
    match (*light, light.center()) {
        (Light::Directional { direction, .. }, _) => Light::Directional { direction, angular_radius: 0.0 },
        (spot @ Light::Spot { .. }, _) => spot,
        (_, LightPoint::At(position) | LightPoint::Towards(position)) => Light::Point { position },
    }
}

/// Pixels that see a surface, pixels in shadow that face the light, and pixels that differ from one shadow ray each.
fn compare(scene: &Scene, light: &Light, camera: &Camera) -> [usize; 3] {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let mut image = VisibilityImage::new(camera.width, camera.height);
    let mut all = image.clone();
    AliasFree::new(scene, true).shade(light, &gbuffer, &mut image);
    AliasFree::new(scene, false).shade(light, &gbuffer, &mut all);
    assert!(image.bits() == all.bits(), "skipping changed the image");
    let settings = ReferenceSettings { skip: false, ..Default::default() };
    let truth = reference(scene, &Bvh::casters(scene), light, &gbuffer, &settings, &no_progress);
    let truth = truth.expect("never stopped").visibility;
    let pixels = || image.values.iter().zip(&truth.values);
    [
        pixels().filter(|(v, _)| !v.is_nan()).count(),
        pixels().filter(|(_, t)| **t == 0.0).count(),
        pixels().filter(|(v, t)| v.to_bits() != t.to_bits() && !(v.is_nan() && t.is_nan())).count(),
    ]
}

/// The issue allows differences within a thousandth of a pixel of a shadow's border. There are none at all.
#[test]
fn equals_one_shadow_ray_a_pixel_on_every_scene() {
    let mut wrong = 0;
    for name in scenes::all().iter().map(|scene| scene.name) {
        let setup = scenes::build(name, 0.0).expect("a built-in scene");
        let camera = setup.camera.with_size(192, 144);
        let bounds = setup.scene.bounds();
        let inside = Light::Point { position: bounds.center() + 0.13 * bounds.size() };
        for (of, light) in [("own", without_extent(&setup.lights[0])), ("inner", inside)] {
            let [seen, dark, different] = compare(&setup.scene, &light, &camera);
            println!("{name}, {of} light: {seen} pixels seen, {dark} dark, {different} different");
            wrong += different;
        }
    }
    assert_eq!(wrong, 0);
}

/// Lights on, in and beside the geometry, triangles through the light, lines and points.
#[test]
fn equals_shadow_rays_on_a_soup_around_the_light() {
    let mut state = 7_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut vector = || Vec3::new(unit(), unit(), unit()) * 2.0 - 1.0;
    let mut positions: Vec<Vec3> = (0..240)
        .flat_map(|_| {
            let middle = vector();
            [middle + vector() * 0.3, middle + vector() * 0.3, middle + vector() * 0.3]
        })
        .collect();
    // A few that are lines, points and very large.
    positions[5] = (positions[3] + positions[4]) * 0.5;
    positions[8] = positions[7];
    (positions[9], positions[10]) = (positions[9] * 1e4, positions[10] * 1e4);
    let triangles: Vec<[u32; 3]> = (0..240).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    for (scale, shift) in [(1.0, 0.0), (1e-3, 0.0), (1e4, 0.0), (1.0, 1e4), (1e30, 0.0)] {
        let mut scene = Scene::new();
        let place = |p: Vec3| p * scale + Vec3::new(shift, 0.0, -shift);
        let moved: Vec<_> = positions.iter().map(|&p| place(p)).collect();
        let mesh = TriangleMesh::new("soup", moved.clone(), triangles.clone());
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
        let bvh = Bvh::casters(&scene);
        let mut origins: Vec<_> = (0..3000).map(|_| place(vector() * 1.5)).collect();
        // On corners, on edges, and nowhere.
        origins.extend(moved.iter().take(60));
        origins.extend(moved.chunks(3).map(|t| (t[0] + t[1]) * 0.5));
        origins.extend([Vec3::NAN, Vec3::INFINITY]);
        let lights = [
            LightPoint::At(place(Vec3::ZERO)),
            LightPoint::At(place(Vec3::new(3.0, 5.0, 1.0))),
            LightPoint::At(moved[40]),
            LightPoint::At((moved[60] + moved[61] + moved[62]) / 3.0),
            LightPoint::At(place(Vec3::splat(1e3))),
            LightPoint::Towards(Vec3::Y),
            LightPoint::Towards(Vec3::new(0.48, 0.6, -0.64)),
        ];
        for light in lights {
            let mut blocked = vec![true; origins.len()];
            AliasFree::new(&scene, false).occluded_packet(light, &origins, &mut blocked);
            let wrong: Vec<_> =
                (0..origins.len()).filter(|&i| blocked[i] != bvh.is_occluded(origins[i], light)).collect();
            assert!(wrong.is_empty(), "scale {scale}, shift {shift}, {light:?}: {} wrong", wrong.len());
        }
    }
}
