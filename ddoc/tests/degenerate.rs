//! Input at the edge of what has a meaning: an answer, never a panic.

use glam::{Affine3A, Vec3};
use gnomon_ddoc::{Ddoc, DdocParams, Factory, Variant};
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

/// A scene that lies 10,000 of its sizes from zero, its vertices rounded to steps of a quarter pixel, is shaded by every variant
/// as at zero but for shadows' borders that move by half a pixel at most: V of a pixel then changes by half of what its neighbours differ
/// from it.
#[test]
fn far_from_zero_shadows_stay() {
    const SIZE: [usize; 2] = [96, 72];
    let near = scenes::build("chess", 0.0).expect("built in");
    let offset = Vec3::new(1.0, 0.5, -1.0) * (1e4 * near.scene.bounds().diagonal());
    // rmse of each variant, and that of a truth whose borders are moved.
    let errors = |offset: Vec3| {
        let scene = near.scene.counted_from(-offset);
        let light = match near.lights[0] {
            Light::Spot { position, direction, outer, inner } => {
                Light::Spot { position: position + offset, direction, outer, inner }
            }
            light => light,
        };
        let (eye, target) = (near.camera.eye + offset, near.camera.target + offset);
        let camera = Camera { eye, target, ..near.camera.with_size(SIZE[0] as u32, SIZE[1] as u32) };
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        let casters = Bvh::casters(&scene);
        let settings = ReferenceSettings { samples: 1, ..Default::default() };
        let truth = reference::reference(&scene, &casters, &light, &gbuffer, &settings, &no_progress)
            .expect("valid")
            .visibility;
        let valid = reference::valid_pixels(&gbuffer, &light);
        let mut moved = truth.clone();
        for (pixel, v) in moved.values.iter_mut().enumerate().filter(|(pixel, _)| valid[*pixel]) {
            let (x, y) = (pixel % SIZE[0], pixel / SIZE[0]);
            let columns = [x.saturating_sub(1), (x + 1).min(SIZE[0] - 1)].map(|x| y * SIZE[0] + x);
            let rows = [y.saturating_sub(1), (y + 1).min(SIZE[1] - 1)].map(|y| y * SIZE[0] + x);
            let around = columns.into_iter().chain(rows).filter(|&beside| valid[beside]);
            let differ = around.map(|beside| (truth.values[beside] - truth.values[pixel]).abs());
            *v += 0.5 * differ.fold(0.0, f32::max);
        }
        let rmse = |image: &VisibilityImage| metrics::errors(image, &truth, &valid).expect("same size").rmse;
        let of_variants = Variant::ALL.map(|variant| {
            let technique = Ddoc::new(DdocParams { variant, ..Default::default() });
            let (prepared, _) = technique.prepare(&scene, &light).expect("few triangles");
            let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
            prepared.shade(&gbuffer, &mut image);
            rmse(&image)
        });
        (of_variants, rmse(&moved))
    };
    let ((here, _), (there, moved)) = (errors(Vec3::ZERO), errors(offset));
    for ((here, there), variant) in here.iter().zip(there).zip(Variant::ALL) {
        assert!(
            there < here + moved,
            "{variant:?}: {there} where it is {here} at zero, {moved} by half a pixel"
        );
    }
}
