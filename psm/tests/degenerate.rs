//! Input at the edge of what has a meaning: an answer, never a panic.

use glam::{Affine3A, Vec3};
use gnomon_psm::{Factory, Psm, PsmParams, Show, Variant};
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

const LIGHTS: [Light; 7] = [
    Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.0 },
    // Along the view, both ways.
    Light::Directional { direction: Vec3::new(0.0, -2.0, -4.0), angular_radius: 0.0 },
    Light::Directional { direction: Vec3::new(0.0, 2.0, 4.0), angular_radius: 0.0 },
    Light::Point { position: Vec3::new(0.0, 3.0, 0.0) },
    // On the geometry itself, and at the eye.
    Light::Point { position: Vec3::ZERO },
    Light::Point { position: Vec3::new(0.0, 2.0, 4.0) },
    Light::Spot { position: Vec3::Y, direction: Vec3::NEG_Y, outer: 1.57, inner: 0.1 },
];

fn triangle(corners: [Vec3; 3]) -> Scene {
    let mut scene = Scene::new();
    let mesh = TriangleMesh::new("t", corners.to_vec(), vec![[0, 1, 2]]);
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    scene
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
            for variant in Variant::ALL {
                for (map_size, show) in [(1, Show::Visibility), (64, Show::Visibility), (64, Show::Texels)] {
                    let params = PsmParams { variant, map_size, show, ..Default::default() };
                    let gbuffer = raster::render_gbuffer(&scene, &CAMERA);
                    let (prepared, _) = Psm::new(params).prepare(&scene, light, &CAMERA, &gbuffer);
                    let mut visibility = VisibilityImage::new(CAMERA.width, CAMERA.height);
                    prepared.shade(&gbuffer, &mut visibility);
                    for (pixel, &v) in visibility.values.iter().enumerate() {
                        let known = (0.0..=1.0).contains(&v);
                        assert_eq!(gbuffer.is_seen(pixel), known, "{light:?}, {variant:?}: {pixel} is {v}");
                    }
                }
            }
        }
    }
}

#[test]
fn cameras_that_are_none_make_no_trouble() {
    let scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
    let gbuffer = raster::render_gbuffer(&scene, &CAMERA);
    for camera in [
        Camera { eye: Vec3::NAN, ..CAMERA },
        Camera { target: CAMERA.eye, ..CAMERA },
        Camera { fov_y: 0.0, ..CAMERA },
        Camera { near: f32::NAN, far: f32::NAN, ..CAMERA },
        Camera { eye: -CAMERA.eye, ..CAMERA },
    ] {
        for light in &LIGHTS {
            let (prepared, _) = Psm::default().prepare(&scene, light, &camera, &gbuffer);
            let mut visibility = VisibilityImage::new(CAMERA.width, CAMERA.height);
            prepared.shade(&gbuffer, &mut visibility);
        }
    }
}

#[test]
fn free_points_are_answered_by_what_the_maps_hold() {
    let mut scene =
        triangle([Vec3::new(-1.0, 1.0, -1.0), Vec3::new(1.0, 1.0, -1.0), Vec3::new(0.0, 1.0, 1.0)]);
    let ground = [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
    let ground = TriangleMesh::new("ground", ground.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    scene.add(&ground, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    let technique = Factory.create(None, &[]).expect("defaults");
    let query = ShadowQuery { scene: &scene, light: &LIGHTS[0], camera: &CAMERA };
    let (prepared, _) = technique.prepare(&query).expect("supported");
    assert!(!prepared.survives_camera());
    let between = Vec3::new(0.0, 0.5, -0.3);
    let points = [Vec3::NAN, Vec3::splat(f32::INFINITY), between, between + Vec3::Y, between - Vec3::Y];
    let mut values = [7.0; 5];
    prepared.visibility_at(&points, &mut values).expect("lengths agree");
    assert!(values[0].is_nan() && values[1].is_nan());
    assert_eq!(values[2..], [0.0, 1.0, 0.0]);
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

/// A scene that lies 10,000 of its sizes from zero, its vertices rounded to steps of a quarter pixel, is shaded about as well as
/// at zero: half as much again. Counted from zero, nothing nearer to its caster than six steps of a map's depths would be
/// in shadow.
#[test]
fn far_from_zero_shadows_stay() {
    let near = scenes::build("chess", 0.0).expect("built in");
    let offset = Vec3::new(1.0, 0.5, -1.0) * (1e4 * near.scene.bounds().diagonal());
    let rmse = |offset: Vec3| {
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
        let technique = Factory.create(None, &[]).expect("defaults");
        let query = ShadowQuery { scene: &scene, light: &light, camera: &camera };
        let (prepared, _) = technique.prepare(&query).expect("supported");
        let mut image = VisibilityImage::new(96, 72);
        prepared.shade(&gbuffer, &mut image).expect("same size");
        let valid = reference::valid_pixels(&gbuffer, &light);
        metrics::errors(&image, &truth.visibility, &valid).expect("same size").rmse
    };
    let (here, there) = (rmse(Vec3::ZERO), rmse(offset));
    assert!(there < 1.5 * here, "{there} where it is {here} at zero");
}
