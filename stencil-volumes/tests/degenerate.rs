//! Input at the edge of what has a meaning: an answer, never a panic.

use glam::{Affine3A, Vec2, Vec3};
use gnomon_stencil_volumes::{Casters, Factory, StencilVolumes, Variant, VolumeParams};
use scene_core::geometry::{AlphaMask, ObjectFlags, Wrap};
use scene_core::technique::{ShadowQuery, TechniqueError, TechniqueFactory};
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
            for variant in [Variant::Planar, Variant::Volumes] {
                let gbuffer = raster::render_gbuffer(&scene, &CAMERA);
                let casters = Casters::new(&scene).expect("no masks");
                let technique = StencilVolumes::new(VolumeParams { variant, ..Default::default() });
                let (prepared, _) = technique.prepare(&casters, light, &CAMERA);
                let mut visibility = VisibilityImage::new(CAMERA.width, CAMERA.height);
                prepared.shade(&gbuffer, &mut visibility);
                for (pixel, &v) in visibility.values.iter().enumerate() {
                    assert_eq!(
                        gbuffer.is_seen(pixel),
                        v == 0.0 || v == 1.0,
                        "{light:?}: pixel {pixel} is {v}"
                    );
                }
            }
        }
    }
}

#[test]
fn free_points_are_counted_and_those_that_are_not_finite_stay_unknown() {
    let scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
    let casters = Casters::new(&scene).expect("no masks");
    let (prepared, _) = StencilVolumes::default().prepare(&casters, &LIGHTS[1], &CAMERA);
    let points = [Vec3::NAN, Vec3::splat(f32::INFINITY), Vec3::new(0.2, -1.0, 0.2), Vec3::new(0.2, 1.0, 0.2)];
    let mut values = [7.0; 4];
    prepared.visibility_at(&points, &mut values);
    assert!(values[0].is_nan() && values[1].is_nan());
    assert_eq!(values[2..], [0.0, 1.0]);
}

#[test]
fn masked_casters_and_wrong_sizes_are_refused() {
    let mut mesh = TriangleMesh::new("leaf", vec![Vec3::ZERO, Vec3::X, Vec3::Z], vec![[0, 1, 2]]);
    mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::Y];
    mesh.alpha = AlphaMask::from_alpha(2, 1, &[0, 255], 0.5, [Wrap::Repeat; 2]).map(Into::into);
    let mut masked = Scene::new();
    masked.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    let technique = Factory.create(None, &[]).expect("defaults");
    let query = ShadowQuery { scene: &masked, light: &LIGHTS[0], camera: &CAMERA };
    assert!(matches!(technique.prepare(&query), Err(TechniqueError::Unsupported { .. })));

    let scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
    let query = ShadowQuery { scene: &scene, ..query };
    let (prepared, _) = technique.prepare(&query).expect("supported");
    assert!(prepared.shade(&GBuffer::new(4, 4), &mut VisibilityImage::new(3, 3)).is_err());
    assert!(prepared.visibility_at(&[Vec3::ZERO], &mut []).is_err());
}
