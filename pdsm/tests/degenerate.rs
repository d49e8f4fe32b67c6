//! Input at the edge of what has a meaning: an answer, never a panic.

use glam::{Affine3A, Vec3};
use gnomon_pdsm::compression::Segments;
use gnomon_pdsm::{ErrorMeasure, Factory, Pdsm, PdsmParams, Precision};
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

const PARAMS: PdsmParams = PdsmParams {
    views: 4,
    map_size: 30,
    pdsm_size: 16,
    cascades: 3,
    max_error: 0.01,
    error_measure: ErrorMeasure::Visibility,
    segments: Segments::Greedy,
    bilinear: true,
    filter_radius: 1,
    precision: Precision::Full,
    only_surfaces: false,
    skip: true,
    seed: 0,
};

const LIGHTS: [Light; 8] = [
    Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.0 },
    Light::Directional { direction: Vec3::NEG_Y, angular_radius: 1.5 },
    Light::Point { position: Vec3::ZERO },
    Light::Spot { position: Vec3::Y, direction: Vec3::NEG_Y, outer: 1.57, inner: 0.1 },
    Light::Rect { center: Vec3::Y, half_u: Vec3::X, half_v: Vec3::Z },
    // In the plane of the geometry.
    Light::Disk { center: Vec3::ZERO, normal: Vec3::Y, radius: 1.0 },
    Light::Disk { center: Vec3::ZERO, normal: Vec3::X, radius: 1e6 },
    // All of the scene is inside.
    Light::Sphere { center: Vec3::Y, radius: 50.0 },
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
            let gbuffer = raster::render_gbuffer(&scene, &CAMERA);
            let (pdsm, _) = Pdsm::new(PARAMS).prepare_for(&scene, light, Some(&CAMERA));
            let mut visibility = VisibilityImage::new(CAMERA.width, CAMERA.height);
            pdsm.shade(&gbuffer, &mut visibility);
            for (pixel, &v) in visibility.values.iter().enumerate() {
                let in_range = (0.0..=1.0).contains(&v);
                assert_eq!(gbuffer.is_seen(pixel), in_range, "{light:?}: pixel {pixel} is {v}");
            }
        }
    }
}

#[test]
fn free_points_that_are_not_finite_stay_unknown() {
    let scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
    let light = Light::Point { position: Vec3::new(0.0, 3.0, 0.0) };
    // A second receiver below, so that the triangle shadows something.
    let mut scene = scene;
    let below =
        TriangleMesh::new("b", vec![Vec3::NEG_Y, Vec3::X - Vec3::Y, Vec3::Z - Vec3::Y], vec![[0, 1, 2]]);
    scene.add(&below, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    let params = PdsmParams { map_size: 64, pdsm_size: 64, ..PARAMS };
    let (pdsm, _) = Pdsm::new(params).prepare(&scene, &light);
    let points = [Vec3::NAN, Vec3::splat(f32::INFINITY), Vec3::new(0.3, -0.5, 0.3), Vec3::new(0.2, 1.0, 0.2)];
    let mut values = [7.0; 4];
    pdsm.visibility_at(&points, &mut values);
    assert!(values[0].is_nan() && values[1].is_nan());
    assert_eq!(values[2..], [0.0, 1.0]);
}

#[test]
fn buffers_of_the_wrong_size_are_refused() {
    let scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
    let technique = Factory.create(Some("low"), &[]).expect("a preset");
    let query = ShadowQuery { scene: &scene, light: &LIGHTS[0], camera: &CAMERA };
    let (prepared, _) = technique.prepare(&query).expect("supported");
    let gbuffer = GBuffer::new(4, 4);
    assert!(prepared.shade(&gbuffer, &mut VisibilityImage::new(3, 3)).is_err());
    assert!(prepared.visibility_at(&[Vec3::ZERO], &mut []).is_err());
}

#[test]
fn threads_leave_no_trace() {
    let setup = scene_core::scenes::build("quads", 0.0).expect("a built-in scene");
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let technique = Pdsm::new(PdsmParams { map_size: 64, pdsm_size: 64, ..PARAMS });
        pool.install(|| technique.prepare(&setup.scene, &setup.lights[0]).0.windows()[0].functions.clone())
    };
    let one = build(1);
    assert!(!one.nodes().is_empty());
    assert_eq!(one, build(3));
}
