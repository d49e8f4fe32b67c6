//! Scenes and ground truth for the tests.
#![allow(dead_code, reason = "shared by several tests")]

use glam::{Affine3A, Vec3};
use gnomon_penumbra_wedges::{Casters, PenumbraWedges, Variant, WedgeParams};
use scene_core::bvh::Bvh;
use scene_core::geometry::ObjectFlags;
use scene_core::reference::{ReferenceSettings, no_progress, reference, valid_pixels};
use scene_core::{Camera, GBuffer, Light, Report, Scene, TriangleMesh, VisibilityImage, raster};

pub(crate) fn scene_of(meshes: &[TriangleMesh]) -> Scene {
    let mut scene = Scene::new();
    for mesh in meshes {
        scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
    }
    scene
}

/// A horizontal rectangle between two corners.
pub(crate) fn sheet(y: f32, min: [f32; 2], max: [f32; 2]) -> TriangleMesh {
    let positions = [[min[0], min[1]], [min[0], max[1]], [max[0], max[1]], [max[0], min[1]]];
    let positions = positions.map(|[x, z]| Vec3::new(x, y, z)).to_vec();
    TriangleMesh::new("sheet", positions, vec![[0, 1, 2], [0, 2, 3]])
}

/// A box around `center`.
pub(crate) fn cube(center: Vec3, half: f32) -> TriangleMesh {
    let corner = |i: u32| {
        let side = |bit: u32| if i >> bit & 1 == 1 { half } else { -half };
        center + Vec3::new(side(0), side(1), side(2))
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriangleMesh::new("cube", (0..8).map(corner).collect(), triangles)
}

pub(crate) fn camera(eye: Vec3, target: Vec3, width: u32, height: u32) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_y: 0.8, near: 0.01, far: f32::INFINITY, width, height }
}

/// V of every pixel, and what it took.
pub(crate) fn shade(
    scene: &Scene,
    light: &Light,
    camera: &Camera,
    params: WedgeParams,
) -> (GBuffer, VisibilityImage, Report) {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let (visibility, report) = shade_gbuffer(scene, light, camera, &gbuffer, params);
    (gbuffer, visibility, report)
}

/// V of every pixel of a G-buffer, and what it took.
pub(crate) fn shade_gbuffer(
    scene: &Scene,
    light: &Light,
    camera: &Camera,
    gbuffer: &GBuffer,
    params: WedgeParams,
) -> (VisibilityImage, Report) {
    let casters = Casters::new(scene).expect("edges");
    let (prepared, mut report) =
        PenumbraWedges::new(params).prepare(&casters, light, camera).expect("no masks");
    let mut visibility = VisibilityImage::new(camera.width, camera.height);
    report.merge(&prepared.shade(gbuffer, &mut visibility));
    (visibility, report)
}

/// The root of the mean squared error against ground truth of `samples` rays, over valid pixels.
pub(crate) fn rmse(
    scene: &Scene,
    light: &Light,
    camera: &Camera,
    variants: &[Variant],
    samples: u32,
) -> Vec<f64> {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let settings = ReferenceSettings { samples, seed: 11, skip: true };
    let truth = reference(scene, &Bvh::casters(scene), light, &gbuffer, &settings, &no_progress)
        .expect("nobody cancels")
        .visibility;
    let valid = valid_pixels(&gbuffer, light);
    let error = |&variant: &Variant| {
        let params = WedgeParams { variant, ..Default::default() };
        let (_, image, _) = shade(scene, light, camera, params);
        let pixels = (0..valid.len()).filter(|&pixel| valid[pixel]);
        let (mut sum, mut count) = (0.0, 0);
        for pixel in pixels {
            sum += f64::from(image.values[pixel] - truth.values[pixel]).powi(2);
            count += 1;
        }
        assert!(count > 100, "{count} valid pixels");
        (sum / f64::from(count)).sqrt()
    };
    variants.iter().map(error).collect()
}

/// Scenes made for what `coverage` does not know, with their camera: two sheets that hide the same part of the light count twice;
/// and of a tall box under a wide light three faces are seen from its border, from above one.
pub(crate) fn known_errors() -> ([(&'static str, Scene, Light); 2], Camera) {
    let floor = sheet(0.0, [-5.0, -5.0], [5.0, 5.0]);
    let light =
        |half: f32| Light::Rect { center: Vec3::Y * 4.0, half_u: Vec3::X * half, half_v: Vec3::Z * half };
    let overlap = scene_of(&[
        floor.clone(),
        sheet(1.0, [-1.0, -1.0], [1.0, 1.0]),
        sheet(1.2, [-0.93, -0.93], [0.93, 0.93]),
    ]);
    let changing = scene_of(&[floor, cube(Vec3::new(0.0, 1.5, 0.0), 1.0)]);
    let view = camera(Vec3::new(1.5, 4.0, 6.0), Vec3::new(0.0, 0.2, 0.0), 128, 96);
    ([("overlap", overlap, light(1.0)), ("changing silhouette", changing, light(2.5))], view)
}
