//! Input at the edge of what has a meaning: an answer, never a panic.

use glam::{Affine3A, Vec3};
use gnomon_shadow_map::{Factory, ShadowMap, ShadowMapParams};
use scene_core::geometry::ObjectFlags;
use scene_core::technique::{ShadowQuery, TechniqueFactory};
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster};

const CAMERA: Camera = Camera {
    eye: Vec3::new(0.0, 2.0, 4.0),
    target: Vec3::ZERO,
    up: Vec3::Y,
    fov_y: 0.8,
    near: 0.01,
    far: 100.0,
    width: 33,
    height: 17,
};

const LIGHTS: [Light; 4] = [
    Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.0 },
    Light::Point { position: Vec3::new(0.0, 3.0, 0.0) },
    // On the geometry itself.
    Light::Point { position: Vec3::ZERO },
    Light::Spot { position: Vec3::Y, direction: Vec3::NEG_Y, outer: 1.57, inner: 0.1 },
];

fn triangle(corners: [Vec3; 3]) -> Scene {
    let mut scene = Scene::new();
    let mesh = TriangleMesh::new("t", corners.to_vec(), vec![[0, 1, 2]]);
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    scene
}

fn visibility(scene: &Scene, light: &Light) -> VisibilityImage {
    let gbuffer = raster::render_gbuffer(scene, &CAMERA);
    let (maps, _) = ShadowMap::default().prepare(scene, light);
    let mut visibility = VisibilityImage::new(CAMERA.width, CAMERA.height);
    maps.shade(&gbuffer, &mut visibility);
    for (pixel, &v) in visibility.values.iter().enumerate() {
        assert_eq!(gbuffer.is_seen(pixel), (0.0..=1.0).contains(&v), "{light:?}: pixel {pixel} is {v}");
    }
    visibility
}

#[test]
fn scenes_without_area_are_answered() {
    let x = Vec3::X;
    for light in &LIGHTS {
        for scene in [
            Scene::new(),
            triangle([Vec3::ZERO, x, Vec3::Z]),
            triangle([Vec3::ZERO; 3]),
            triangle([Vec3::ZERO, x, x * 2.0]),
            triangle([x * 1e30, Vec3::Z * 1e30, -x * 1e30]),
            triangle([x * 1e-30, Vec3::Z * 1e-30, -x * 1e-30]),
        ] {
            visibility(&scene, light);
        }
    }
}

#[test]
fn free_points_that_are_not_finite_stay_unknown() {
    let scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
    let (maps, _) = ShadowMap::default().prepare(&scene, &LIGHTS[1]);
    let points = [Vec3::NAN, Vec3::splat(f32::INFINITY), Vec3::new(0.2, -1.0, 0.2), Vec3::new(0.2, 1.0, 0.2)];
    let mut values = [7.0; 4];
    maps.visibility_at(&points, &mut values);
    assert!(values[0].is_nan() && values[1].is_nan());
    assert_eq!(values[2..], [0.0, 1.0]);
}

#[test]
fn skipping_never_changes_the_image() {
    // A light between floor and ceiling: the faces to the sides are empty.
    let mut scene =
        triangle([Vec3::new(-0.5, -1.0, -0.5), Vec3::new(0.5, -1.0, -0.5), Vec3::new(0.0, -1.0, 0.5)]);
    for height in [-0.8, 0.8, 1.0] {
        let small = TriangleMesh::new("s", vec![Vec3::ZERO, Vec3::X * 0.2, Vec3::Z * 0.2], vec![[0, 1, 2]]);
        let place = Affine3A::from_translation(Vec3::new(0.0, height, -0.2));
        scene.add(&small, place, ObjectFlags::default()).expect("finite");
    }
    let gbuffer = raster::render_gbuffer(&scene, &CAMERA);
    let light = Light::Point { position: Vec3::new(0.0, 0.1, 0.0) };
    let mut images = Vec::new();
    for skip in [true, false] {
        let (maps, report) =
            ShadowMap::new(ShadowMapParams { skip, ..Default::default() }).prepare(&scene, &light);
        assert_eq!(report.skipped["faces"] > 0, skip);
        let mut image = VisibilityImage::new(CAMERA.width, CAMERA.height);
        maps.shade(&gbuffer, &mut image);
        images.push(image.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
    }
    assert_eq!(images[0], images[1]);
}

#[test]
fn buffers_of_the_wrong_size_are_refused() {
    let scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
    let technique = Factory.create(None, &[]).expect("defaults");
    let query = ShadowQuery { scene: &scene, light: &LIGHTS[0], camera: &CAMERA };
    let (prepared, _) = technique.prepare(&query).expect("supported");
    let gbuffer = GBuffer::new(4, 4);
    assert!(prepared.shade(&gbuffer, &mut VisibilityImage::new(3, 3)).is_err());
    assert!(prepared.visibility_at(&[Vec3::ZERO], &mut []).is_err());
}
