//! Input at the edge of what has a meaning: an answer, never a panic.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, Factory, Scaling, Variant};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams};
use scene_core::bvh::Bvh;
use scene_core::geometry::ObjectFlags;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::technique::{ShadowQuery, TechniqueFactory};
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, metrics, raster, scenes};

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
                for scaling in [Scaling::Physical, Scaling::Paper] {
                    let distance_power = 8.0;
                    let params = ContactHardeningParams {
                        variant,
                        scaling,
                        distance_power,
                        map_size: 64,
                        dilate: 3,
                        taps: 1,
                        ..Default::default()
                    };
                    let query = ShadowQuery { scene: &scene, light, camera: &CAMERA };
                    let (prepared, _) = ContactHardening::new(params).prepare(&query).expect("own map");
                    let mut image = VisibilityImage::new(CAMERA.width, CAMERA.height);
                    prepared.shade(&CAMERA, &gbuffer, &mut image).expect("sizes match");
                    for (pixel, v) in image.values.iter().enumerate() {
                        let fine = (0.0..=1.0).contains(v);
                        assert_eq!(gbuffer.is_seen(pixel), fine, "{light:?} {variant:?} {scaling:?}: {v}");
                    }
                }
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
    assert!(prepared.visibility_at(&[Vec3::ZERO], &mut [0.0]).is_err());
}

/// Its own map and shadow-map's hard shadows of the same size, as a source, are the same.
#[test]
fn any_technique_can_be_the_source() {
    let mut setup = scenes::build("ball", 0.0).expect("built in");
    (setup.camera.width, setup.camera.height) = (96, 64);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let query = ShadowQuery { scene: &setup.scene, light: &setup.lights[0], camera: &setup.camera };
    let params = ContactHardeningParams { map_size: 256, ..Default::default() };
    let shade = |technique: ContactHardening| {
        let (prepared, _) = technique.prepare(&query).expect("supported");
        let mut image = VisibilityImage::new(96, 64);
        prepared.shade(&setup.camera, &gbuffer, &mut image).expect("sizes match");
        image.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    let source = |map_size: u32| -> ContactHardening {
        let hard = ShadowMap::new(ShadowMapParams { map_size, ..Default::default() });
        ContactHardening::new(params).on_top_of("hard", Arc::new(hard))
    };
    let own = shade(ContactHardening::new(params).on_own_map());
    assert_eq!(own, shade(source(256)));
    assert_ne!(own, shade(source(16)), "the source is asked");
}

/// A scene that lies 10,000 of its sizes from zero, its vertices rounded to steps of a quarter pixel, is shaded about as well as
/// at zero: half as much again. Counted from zero, nothing nearer to its caster than six steps of a map's depths would be
/// in shadow.
#[test]
fn far_from_zero_shadows_stay() {
    let near = scenes::build("chess", 0.0).expect("built in");
    let offset = Vec3::new(1.0, 0.5, -1.0) * (1e4 * near.scene.bounds().diagonal());
    let rmse = |technique: &ContactHardening, offset: Vec3| {
        let scene = near.scene.counted_from(-offset);
        let light = match near.lights[0] {
            Light::Spot { position, direction, outer, inner } => {
                Light::Spot { position: position + offset, direction, outer, inner }
            }
            light => light,
        };
        let (eye, target) = (near.camera.eye + offset, near.camera.target + offset);
        let camera = Camera { eye, target, ..near.camera.with_size(96, 72) };
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        let casters = Bvh::casters(&scene);
        let settings = ReferenceSettings { samples: 1, ..Default::default() };
        let truth =
            reference::reference(&scene, &casters, &light, &gbuffer, &settings, &no_progress).expect("valid");
        let query = ShadowQuery { scene: &scene, light: &light, camera: &camera };
        let (prepared, _) = technique.prepare(&query).expect("supported");
        let mut image = VisibilityImage::new(96, 72);
        prepared.shade(&camera, &gbuffer, &mut image).expect("same size");
        let valid = reference::valid_pixels(&gbuffer, &light);
        metrics::errors(&image, &truth.visibility, &valid).expect("same size").rmse
    };
    // Exact hard shadows stay exact.
    let exact = ContactHardening::default();
    for technique in [exact.clone().on_own_map(), exact] {
        let (here, there) = (rmse(&technique, Vec3::ZERO), rmse(&technique, offset));
        assert!(there <= 1.5 * here, "{}: {there} where it is {here} at zero", technique.source_name());
    }
}
