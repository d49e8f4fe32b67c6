//! Input at the edge of what has a meaning: an answer, never a panic.

use glam::{Affine3A, Vec2, Vec3};
use gnomon_stencil_volumes::{Casters, Factory, StencilVolumes, Variant, VolumeParams};
use scene_core::geometry::{AlphaMask, ObjectFlags, Wrap};
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
                let casters = Casters::new(&scene).expect("few triangles");
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
    let casters = Casters::new(&scene).expect("few triangles");
    let (prepared, _) = StencilVolumes::default().prepare(&casters, &LIGHTS[1], &CAMERA);
    let points = [Vec3::NAN, Vec3::splat(f32::INFINITY), Vec3::new(0.2, -1.0, 0.2), Vec3::new(0.2, 1.0, 0.2)];
    let mut values = [7.0; 4];
    prepared.visibility_at(&points, &mut values);
    assert!(values[0].is_nan() && values[1].is_nan());
    assert_eq!(values[2..], [0.0, 1.0]);
}

/// Half of a leaf is cut out: the other half throws a shadow, as rays say.
#[test]
fn masks_are_asked_by_rays() {
    let corner = |x: f32, z: f32| Vec3::new(x, 1.0, z);
    let corners = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let mut leaf = TriangleMesh::new("leaf", corners.clone(), vec![[0, 1, 2], [0, 2, 3]]);
    leaf.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    leaf.alpha = AlphaMask::from_alpha(2, 1, &[0, 255], 0.5, [Wrap::Repeat; 2]).map(Into::into);
    let ground = corners.iter().map(|p| Vec3::new(p.x * 9.0, 0.0, p.z * 9.0)).collect();
    let ground = TriangleMesh::new("ground", ground, vec![[0, 1, 2], [0, 2, 3]]);
    let mut scene = Scene::new();
    for mesh in [&ground, &leaf] {
        scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    }
    let camera = CAMERA.with_size(160, 120);
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let casters = Casters::new(&scene).expect("few triangles");
    for variant in [Variant::Planar, Variant::Volumes] {
        let technique = StencilVolumes::new(VolumeParams { variant, ..Default::default() });
        let (prepared, _) = technique.prepare(&casters, &LIGHTS[0], &camera);
        let mut visibility = VisibilityImage::new(camera.width, camera.height);
        let report = prepared.shade(&gbuffer, &mut visibility);
        let (mut dark, mut lit) = (0, 0);
        for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.object[pixel] == 0) {
            let place = gbuffer.position[pixel];
            // A pixel is 0.03 wide here; its outline is snapped to 1/256 of that by planar shadows.
            if (place.x.abs() - 1.0).abs() < 1e-3
                || (place.z.abs() - 1.0).abs() < 1e-3
                || place.x.abs() < 1e-3
            {
                continue;
            }
            let under = place.x > 0.0 && place.x < 1.0 && place.z.abs() < 1.0;
            assert_eq!(visibility.values[pixel], if under { 0.0 } else { 1.0 }, "{variant:?} at {place}");
            dark += usize::from(under);
            lit += usize::from(!under);
        }
        assert!(dark > 100 && lit > 1000, "{variant:?}: {dark} dark, {lit} lit");
        if variant == Variant::Volumes {
            assert!(report.skipped["pixels no mask is before"] > 1000);
        }
    }
}

#[test]
fn wrong_sizes_are_refused() {
    let technique = Factory.create(None, &[]).expect("defaults");
    let scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
    let query = ShadowQuery { scene: &scene, light: &LIGHTS[0], camera: &CAMERA };
    let (prepared, _) = technique.prepare(&query).expect("supported");
    assert!(prepared.shade(&GBuffer::new(4, 4), &mut VisibilityImage::new(3, 3)).is_err());
    assert!(prepared.visibility_at(&[Vec3::ZERO], &mut []).is_err());
}
