//! Input at the edge of what has a meaning: an answer, never a panic.

use glam::{Affine3A, Vec3};
use gnomon_psm::{Factory, Psm, PsmParams, Show, Variant};
use scene_core::geometry::ObjectFlags;
use scene_core::technique::conformance::{self, CAMERA, LIGHTS, triangle};
use scene_core::technique::{ShadowQuery, TechniqueFactory};
use scene_core::{Camera, TriangleMesh, VisibilityImage, raster};

#[test]
fn every_scene_and_light_is_answered() {
    for variant in Variant::ALL {
        for (map_size, show) in [(1, Show::Visibility), (64, Show::Visibility), (64, Show::Texels)] {
            let params = PsmParams { variant, map_size, show, ..Default::default() };
            conformance::assert_answers(&Psm::new(params));
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
    conformance::assert_refuses_wrong_sizes(&Psm::default());
}

/// A scene far from zero is shaded about as well as at zero, where no pixel may be wrong: its borders move by half a pixel at most,
/// which vertices rounded to steps of a quarter pixel leave. Counted from zero, nothing nearer to its caster than six steps of a map's
/// depths would be in shadow.
#[test]
fn far_from_zero_shadows_stay() {
    let error = conformance::far_from_zero(&Psm::default());
    assert!(error.there < error.here + error.moved, "{error:?}");
}

/// The G-buffer of a GPU holds a distance, from which positions follow along the ray of a pixel's centre: they lie beside the rounded ones
/// that the truth is asked at, half a pixel at most.
#[cfg(feature = "gpu")]
#[test]
fn far_from_zero_shadows_stay_on_the_gpu() {
    let Some(gpu) = scene_core::gpu::testing::gpu() else { return };
    let error = conformance::far_from_zero_on(&gpu, &Psm::default());
    assert!(error.there < error.here + error.moved, "{error:?}");
}

/// Vertices are read from the second piece that they are bound in as from the first.
#[cfg(feature = "gpu")]
#[test]
fn scenes_bound_in_two_pieces_look_the_same() {
    for variant in Variant::ALL {
        conformance::assert_same_in_two_pieces(&Psm::new(PsmParams {
            variant,
            map_size: 256,
            ..Default::default()
        }));
    }
}
