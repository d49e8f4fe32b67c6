//! Input at the edge of what has a meaning: an answer, never a panic.

use glam::{Affine3A, Vec3};
use gnomon_ddoc::{Ddoc, DdocParams, Factory, Variant};
use scene_core::geometry::ObjectFlags;
use scene_core::technique::{ShadowQuery, TechniqueFactory};
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};

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

fn triangle(corners: [Vec3; 3]) -> Scene {
    let mut scene = Scene::new();
    let mesh = TriangleMesh::new("t", corners.to_vec(), vec![[0, 1, 2]]);
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    scene
}

#[test]
fn every_scene_and_light_is_answered() {
    let x = Vec3::X;
    let lights = [
        Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.0 },
        Light::Directional { direction: Vec3::NEG_Y, angular_radius: 1.57 },
        Light::Point { position: Vec3::ZERO },
        Light::Spot { position: Vec3::Y, direction: Vec3::NEG_Y, outer: 1.57, inner: 0.1 },
        Light::Sphere { center: Vec3::Y, radius: 50.0 },
        Light::Disk { center: Vec3::Y, normal: Vec3::X, radius: 1e-20 },
        Light::Rect { center: Vec3::Y, half_u: Vec3::X * 1e8, half_v: Vec3::Z * 1e-8 },
    ];
    let mut shaded = scenes::build("quads", 0.0).expect("built in").scene;
    shaded
        .add(
            &TriangleMesh::new("far", vec![x * 1e30, Vec3::Z * 1e30, -x * 1e30], vec![[0, 1, 2]]),
            Affine3A::IDENTITY,
            ObjectFlags::default(),
        )
        .expect("finite");
    for scene in [
        Scene::new(),
        triangle([Vec3::ZERO, x, Vec3::Z]),
        triangle([Vec3::ZERO; 3]),
        triangle([x * 1e30, Vec3::Z * 1e30, -x * 1e30]),
        shaded,
    ] {
        let gbuffer = raster::render_gbuffer(&scene, &CAMERA);
        for light in &lights {
            for variant in Variant::ALL {
                let params = DdocParams { variant, map_size: 64, taps: 3, ..Default::default() };
                let (prepared, _) = Ddoc::new(params).prepare(&scene, light).expect("few triangles");
                let mut image = VisibilityImage::new(CAMERA.width, CAMERA.height);
                prepared.shade(&gbuffer, &mut image);
                for (pixel, v) in image.values.iter().enumerate() {
                    let fine = (0.0..=1.0).contains(v);
                    assert_eq!(gbuffer.is_seen(pixel), fine, "{light:?} {variant:?}: {v}");
                }
                let points = [Vec3::NAN, Vec3::ZERO, x * 1e30, Vec3::Y, Vec3::NEG_Y * 1e-30];
                let mut values = [2.0; 5];
                prepared.visibility_at(&points, &mut values);
                assert!(values[0].is_nan() && values[1..].iter().all(|v| (0.0..=1.0).contains(v)));
            }
        }
    }
}

#[test]
fn buffers_of_the_wrong_size_are_refused() {
    let scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
    let technique = Factory.create(None, &[]).expect("defaults");
    let light = Light::Point { position: Vec3::Y };
    let query = ShadowQuery { scene: &scene, light: &light, camera: &CAMERA };
    let (prepared, _) = technique.prepare(&query).expect("supported");
    assert!(prepared.shade(&GBuffer::new(4, 4), &mut VisibilityImage::new(3, 3)).is_err());
    assert!(prepared.shade(&GBuffer::new(0, 0), &mut VisibilityImage::new(0, 0)).is_ok());
    assert!(prepared.visibility_at(&[Vec3::ZERO], &mut [0.0; 2]).is_err());
}

/// A map of one texel and one of a thousand agree about objects: silhouettes are not the map's.
#[test]
fn the_map_may_be_small() {
    let mut setup = scenes::build("quads", 0.0).expect("built in");
    (setup.camera.width, setup.camera.height) = (96, 64);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let shade = |map_size: u32| {
        let technique = Ddoc::new(DdocParams { map_size, taps: 16, ..Default::default() });
        let (prepared, _) = technique.prepare(&setup.scene, &setup.lights[0]).expect("few triangles");
        let mut image = VisibilityImage::new(96, 64);
        prepared.shade(&gbuffer, &mut image);
        image.values
    };
    let (small, large) = (shade(16), shade(1024));
    // A vertex is snapped to the map's own steps; a pixel so close to an outline may differ.
    let differ = small.iter().zip(&large).filter(|(a, b)| a.to_bits() != b.to_bits() && !a.is_nan()).count();
    assert!(differ * 200 < small.len(), "{differ} of {} pixels differ", small.len());
}
