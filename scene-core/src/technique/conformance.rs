//! What every technique owes its callers, as checks for the tests of technique crates, yours too.
//!
//! Input at the edge of what has a meaning gets an answer, never a panic ([`assert_answers`]); points that are not finite stay
//! unknown ([`assert_answers_free_points`]); buffers of the wrong size are refused ([`assert_refuses_wrong_sizes`]); and a scene
//! far from zero keeps its shadows ([`far_from_zero`]); on a GPU one that is bound in two pieces does, too (`assert_same_in_two_pieces`). All of it goes by the trait, so that it holds for whatever a caller can reach.

use std::f32::consts::FRAC_PI_2;

use glam::{Affine3A, Vec3};

use super::{Capability, PreparedShadow, ShadowQuery, ShadowTechnique, TechniqueError};
use crate::bvh::Bvh;
use crate::geometry::ObjectFlags;
use crate::reference::{self, ReferenceSettings, no_progress};
use crate::{
    Camera, GBuffer, Light, Scene, SceneSetup, TriangleMesh, VisibilityImage, metrics, raster, scenes,
};

/// A small image that looks down at zero.
pub const CAMERA: Camera = Camera {
    eye: Vec3::new(0.0, 2.0, 4.0),
    target: Vec3::ZERO,
    up: Vec3::Y,
    fov_y: 0.8,
    near: 0.01,
    far: 100.0,
    width: 33,
    height: 17,
};

/// Lights of every kind: plain ones, on the geometry, in its plane, along the view, at the eye, around all of the scene, of
/// hardly any size and of far too much.
pub const LIGHTS: [Light; 15] = [
    Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.0 },
    Light::Directional { direction: Vec3::new(0.0, -2.0, -4.0), angular_radius: 0.0 },
    Light::Directional { direction: Vec3::new(0.0, 2.0, 4.0), angular_radius: 0.0 },
    Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.3 },
    Light::Directional { direction: Vec3::NEG_Y, angular_radius: FRAC_PI_2 },
    Light::Point { position: Vec3::new(0.0, 3.0, 0.0) },
    Light::Point { position: Vec3::ZERO },
    Light::Point { position: CAMERA.eye },
    Light::Spot { position: Vec3::Y, direction: Vec3::NEG_Y, outer: 1.57, inner: 0.1 },
    Light::Sphere { center: Vec3::ZERO, radius: 0.5 },
    Light::Sphere { center: Vec3::Y, radius: 50.0 },
    Light::Disk { center: Vec3::ZERO, normal: Vec3::Y, radius: 1.0 },
    Light::Disk { center: Vec3::Y, normal: Vec3::X, radius: 1e-20 },
    Light::Rect { center: Vec3::Y, half_u: Vec3::X, half_v: Vec3::Z },
    Light::Rect { center: Vec3::Y, half_u: Vec3::new(1e8, 0.0, 0.0), half_v: Vec3::new(0.0, 0.0, 1e-8) },
];

fn with(mut scene: Scene, corners: &[Vec3]) -> Scene {
    let mesh = TriangleMesh::new("triangle", corners.to_vec(), vec![[0, 1, 2]]);
    // Refused is what has a coordinate that is not finite: then there is nothing to add.
    let _ = scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default());
    scene
}

/// A scene of one triangle.
pub fn triangle(corners: [Vec3; 3]) -> Scene {
    with(Scene::new(), &corners)
}

/// Nothing at all, one triangle, some without area, of sizes at the ends of f32, and a built-in scene with one of those.
pub fn scenes() -> Vec<Scene> {
    let x = Vec3::X;
    let vast = [x * 1e30, Vec3::Z * 1e30, -x * 1e30];
    let quads = scenes::build("quads", 0.0).map(|setup| with(setup.scene, &vast));
    [
        Scene::new(),
        triangle([Vec3::ZERO, x, Vec3::Z]),
        triangle([Vec3::ZERO; 3]),
        triangle([Vec3::ZERO, x, x * 2.0]),
        triangle(vast),
        triangle([x * 1e-30, Vec3::Z * 1e-30, -x * 1e-30]),
    ]
    .into_iter()
    .chain(quads)
    .collect()
}

fn prepared<'a>(technique: &dyn ShadowTechnique, query: &ShadowQuery<'a>) -> Box<dyn PreparedShadow + 'a> {
    match technique.prepare(query) {
        Ok((prepared, _)) => prepared,
        Err(error) => panic!("{} under {:?}: {error}", technique.name(), query.light),
    }
}

/// V of every pixel that sees a surface is in [0, 1], NaN elsewhere, over all [`scenes()`] and all [`LIGHTS`] that the technique
/// takes; so is V of free points where it answers for those.
///
/// # Panics
/// If not.
pub fn assert_answers(technique: &dyn ShadowTechnique) {
    let takes = technique.describe();
    let points = [Vec3::NAN, Vec3::ZERO, Vec3::X * 1e30, Vec3::Y, Vec3::NEG_Y * 1e-30];
    for scene in scenes() {
        let gbuffer = raster::render_gbuffer(&scene, &CAMERA);
        for light in LIGHTS.iter().filter(|light| takes.support(Capability::of_light(light)).is_supported()) {
            let what = || format!("{} with {} under {light:?}", technique.name(), technique.settings());
            let query = ShadowQuery { scene: &scene, light, camera: &CAMERA };
            let prepared = prepared(technique, &query);
            let mut image = VisibilityImage::new(CAMERA.width, CAMERA.height);
            prepared.shade(&gbuffer, &mut image).unwrap_or_else(|error| panic!("{}: {error}", what()));
            for (pixel, v) in image.values.iter().enumerate() {
                let known = (0.0..=1.0).contains(v);
                assert_eq!(gbuffer.is_seen(pixel), known, "{}: pixel {pixel} is {v}", what());
            }
            if takes.support(Capability::FreePoints).is_supported() {
                let mut values = [2.0; 5];
                prepared
                    .visibility_at(&points, &mut values)
                    .unwrap_or_else(|error| panic!("{}: {error}", what()));
                let known = values[1..].iter().all(|v| (0.0..=1.0).contains(v));
                assert!(values[0].is_nan() && known, "{}: {values:?}", what());
            }
        }
    }
}

/// Free points under and above a triangle are dark and lit, those that are not finite unknown; where a technique has no free
/// points it says so.
///
/// # Panics
/// If not.
pub fn assert_answers_free_points(technique: &dyn ShadowTechnique) {
    // A second triangle below: techniques that look for receivers see that the first shadows something.
    let ground = [Vec3::new(-4.0, -2.0, -4.0), Vec3::new(4.0, -2.0, -4.0), Vec3::new(0.0, -2.0, 4.0)];
    let scene = with(triangle([Vec3::ZERO, Vec3::X, Vec3::Z]), &ground);
    let light = Light::Point { position: Vec3::new(0.0, 3.0, 0.0) };
    let prepared = prepared(technique, &ShadowQuery { scene: &scene, light: &light, camera: &CAMERA });
    let points = [Vec3::NAN, Vec3::splat(f32::INFINITY), Vec3::new(0.3, -0.5, 0.3), Vec3::new(0.2, 1.0, 0.2)];
    let mut values = [7.0; 4];
    let answer = prepared.visibility_at(&points, &mut values);
    if technique.describe().support(Capability::FreePoints).is_supported() {
        assert!(answer.is_ok() && values[..2].iter().all(|v| v.is_nan()), "{values:?}");
        // Moments are solved for in f32: a few of its roundings.
        let near = |v: f32, right: f32| (v - right).abs() < 4.0 * f32::EPSILON;
        assert!(near(values[2], 0.0) && near(values[3], 1.0), "{}: {values:?}", technique.settings());
    } else {
        assert!(matches!(answer, Err(TechniqueError::Unsupported { .. })), "{}", technique.name());
    }
}

/// Buffers that do not fit are refused, empty ones are not.
///
/// # Panics
/// If not.
pub fn assert_refuses_wrong_sizes(technique: &dyn ShadowTechnique) {
    let scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
    let prepared = prepared(technique, &ShadowQuery { scene: &scene, light: &LIGHTS[0], camera: &CAMERA });
    assert!(prepared.shade(&GBuffer::new(4, 4), &mut VisibilityImage::new(3, 3)).is_err());
    assert!(prepared.shade(&GBuffer::new(0, 0), &mut VisibilityImage::new(0, 0)).is_ok());
    assert!(prepared.visibility_at(&[Vec3::ZERO], &mut []).is_err());
}

/// What [`far_from_zero`] finds, each an rmse against ground truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FarFromZero {
    /// Of the scene where it is.
    pub here: f64,
    /// Of the scene far away.
    pub there: f64,
    /// Far away, of a truth whose shadows' borders are moved by half a pixel: V of a pixel changes by half of what its neighbours
    /// differ from it.
    pub moved: f64,
}

/// The built-in scene `chess` at zero, and 10,000 of its sizes away from it, where its vertices are rounded to steps of a quarter
/// pixel.
///
/// # Panics
/// If the technique does not take a spot light.
pub fn far_from_zero(technique: &dyn ShadowTechnique) -> FarFromZero {
    far_from_zero_by(&|query, gbuffer| {
        let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
        match prepared(technique, query).shade(gbuffer, &mut image) {
            Ok(_) => image,
            Err(error) => panic!("{}: {error}", technique.name()),
        }
    })
}

/// The same on a GPU.
///
/// # Panics
/// If the technique does not take a spot light there.
#[cfg(feature = "gpu")]
pub fn far_from_zero_on(gpu: &crate::gpu::Gpu, technique: &dyn ShadowTechnique) -> FarFromZero {
    far_from_zero_by(&|query, gbuffer| {
        let image = || {
            let mut view = gpu.view(query.scene, query.camera)?;
            view.upload_gbuffer(gbuffer)?;
            view.run(view.technique(technique)?.as_mut(), query.light, gbuffer)
        };
        match image() {
            Ok(run) => run.visibility,
            Err(error) => panic!("{}: {error}", technique.name()),
        }
    })
}

/// Bytes that the smaller device of [`assert_same_in_two_pieces`] binds of a buffer in one piece.
#[cfg(feature = "gpu")]
const PIECE: u64 = 16 << 20;

/// The built-in scene `chess`, with so many vertices that a device which binds 16 MiB in one piece takes them in two, looks
/// there, bit for bit, as on a device that takes them in one. Under a light with an extent and one without. All else that the technique
/// binds has to fit: take maps of 256 texels a side or fewer.
///
/// # Panics
/// If not.
#[cfg(feature = "gpu")]
pub fn assert_same_in_two_pieces(technique: &dyn ShadowTechnique) {
    let Ok(setup) = scenes::build("chess", 0.0) else { panic!("chess is built in") };
    let scene = with_idle_vertices(&setup.scene, PIECE);
    let bytes = size_of_val(scene.positions()) as u64;
    assert!(bytes > PIECE && bytes < 2 * PIECE, "{bytes} bytes are not two pieces");
    let Light::Spot { position, .. } = setup.lights[0] else { panic!("chess has a spot") };
    let radius = 0.05 * scene.bounds().diagonal();
    let camera = setup.camera.with_size(96, 72);
    for light in [setup.lights[0], Light::Sphere { center: position, radius }] {
        let query = ShadowQuery { scene: &scene, light: &light, camera: &camera };
        let Some([whole, in_pieces]) = whole_and_in_pieces(technique, &query, PIECE) else { return };
        assert!(whole.bits() == in_pieces.bits(), "{} under a {}", technique.name(), light.kind());
        assert!(in_pieces.values.contains(&0.0) && in_pieces.values.contains(&1.0), "{}", technique.name());
    }
}

/// What a technique answers on the device of a test, and on one that binds no more than `bytes` of a buffer in one piece. `None`
/// where `GNOMON_GPU=off` asks for that.
///
/// # Panics
/// If it does not answer.
#[cfg(feature = "gpu")]
pub fn whole_and_in_pieces(
    technique: &dyn ShadowTechnique,
    query: &ShadowQuery<'_>,
    bytes: u64,
) -> Option<[VisibilityImage; 2]> {
    let gpus = [crate::gpu::testing::gpu()?, crate::gpu::testing::gpu_that_binds(bytes)?];
    Some(gpus.map(|gpu| match gpu.render(technique, query) {
        Ok(frame) => frame.visibility,
        Err(error) => panic!("{}: {error}", technique.name()),
    }))
}

/// A scene with so many vertices that no triangle has, in the midst of those of each object, that positions are just more than
/// `bytes`.
#[cfg(feature = "gpu")]
fn with_idle_vertices(scene: &Scene, bytes: u64) -> Scene {
    let idle = bytes as usize / size_of::<Vec3>() / scene.objects().len() + 1;
    let mut more = Scene::new();
    for object in scene.objects() {
        let vertices = &scene.positions()[object.vertices.clone()];
        let (before, after) = vertices.split_at(vertices.len() / 2);
        let positions = [before, &vec![vertices[0]; idle], after].concat();
        let moved = |vertex: u32| {
            let own = vertex as usize - object.vertices.start;
            (if own < before.len() { own } else { own + idle }) as u32
        };
        let triangles = scene.triangles()[object.triangles.clone()].iter().map(|corners| corners.map(moved));
        let mesh = TriangleMesh::new(object.name.clone(), positions, triangles.collect());
        if let Err(error) = more.add(&mesh, Affine3A::IDENTITY, object.flags) {
            panic!("what was in a scene fits into one: {error}");
        }
    }
    more
}

fn far_from_zero_by(shade: &dyn Fn(&ShadowQuery<'_>, &GBuffer) -> VisibilityImage) -> FarFromZero {
    let Ok(near) = scenes::build("chess", 0.0) else { panic!("chess is built in") };
    let offset = Vec3::new(1.0, 0.5, -1.0) * (1e4 * near.scene.bounds().diagonal());
    let [here, _] = errors_at(&near, Vec3::ZERO, shade);
    let [there, moved] = errors_at(&near, offset, shade);
    FarFromZero { here, there, moved }
}

/// The rmse of what is shaded, and of a truth with moved borders.
fn errors_at(
    near: &SceneSetup,
    offset: Vec3,
    shade: &dyn Fn(&ShadowQuery<'_>, &GBuffer) -> VisibilityImage,
) -> [f64; 2] {
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
    let settings = ReferenceSettings { samples: 1, ..Default::default() };
    let casters = Bvh::casters(&scene);
    let Ok(truth) = reference::reference(&scene, &casters, &light, &gbuffer, &settings, &no_progress) else {
        panic!("nothing cancels it")
    };
    let valid = reference::valid_pixels(&gbuffer, &light);
    let image = shade(&ShadowQuery { scene: &scene, light: &light, camera: &camera }, &gbuffer);
    [&image, &with_moved_borders(&truth.visibility, &valid)].map(|image| {
        metrics::errors(image, &truth.visibility, &valid).unwrap_or_else(|error| panic!("{error}")).rmse
    })
}

fn with_moved_borders(truth: &VisibilityImage, valid: &[bool]) -> VisibilityImage {
    let [width, height] = [truth.width, truth.height].map(|side| side as usize);
    let mut moved = truth.clone();
    for (pixel, v) in moved.values.iter_mut().enumerate().filter(|(pixel, _)| valid[*pixel]) {
        let (x, y) = (pixel % width, pixel / width);
        let columns = [x.saturating_sub(1), (x + 1).min(width - 1)].map(|x| y * width + x);
        let rows = [y.saturating_sub(1), (y + 1).min(height - 1)].map(|y| y * width + x);
        let around = columns.into_iter().chain(rows).filter(|&beside| valid[beside]);
        let differ = around.map(|beside| (truth.values[beside] - truth.values[pixel]).abs());
        *v += 0.5 * differ.fold(0.0, f32::max);
    }
    moved
}
