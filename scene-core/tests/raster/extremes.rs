//! Coordinates, matrices and scenes at the limits.

use glam::camera::rh::proj::directx::perspective_infinite_reverse;
use glam::{Mat4, Vec3};
use gnomon_scene_core::raster::{
    DepthOptions, DepthRange, count_layers, depth_error, render_depth, render_gbuffer,
};
use gnomon_scene_core::{GBuffer, Scene};

use super::meshes::{camera, scene_of};

#[test]
fn an_empty_scene_is_an_empty_picture() {
    for scene in [Scene::new(), scene_of(Vec::new(), Vec::new()), scene_of(vec![Vec3::ZERO; 3], Vec::new())] {
        let map = render_depth(&scene, Mat4::IDENTITY, 9, 5, &DepthOptions::default());
        assert_eq!(map.depth, vec![0.0; 45]);
        let gbuffer = render_gbuffer(&scene, &camera(9, 5));
        assert!((0..45).all(|i| !gbuffer.is_seen(i) && gbuffer.depth[i] == f32::INFINITY));
    }
}

#[test]
fn degenerate_triangles_cover_nothing() {
    let (a, b) = (Vec3::new(-0.5, -0.5, 0.5), Vec3::new(0.5, 0.5, 0.5));
    let positions = vec![a, b, a.midpoint(b)];
    let scene = scene_of(positions, vec![[0, 0, 0], [0, 1, 1], [0, 1, 0], [0, 1, 2]]);
    for size in [8, 9, 256] {
        let counts = count_layers(&scene, Mat4::IDENTITY, size, size);
        assert!(counts.front.iter().chain(&counts.back).all(|&n| n == 0));
    }
}

/// A floor that reaches to ±1e10: everything below the horizon, at the right depth. Farther out f64 itself no
/// longer tells the floor's height from the eye's.
#[test]
fn a_huge_floor_keeps_its_depth() {
    for reach in [1e3_f32, 1e6, 1e10] {
        let corner = |x: f32, z: f32| Vec3::new(x * reach, -1.0, z * reach);
        let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let scene = scene_of(positions, vec![[0, 1, 2], [0, 2, 3]]);
        let size = 64;
        let near = 0.01;
        let projection = perspective_infinite_reverse(1.0, 1.0, near);
        let map = render_depth(&scene, projection, size, size, &DepthOptions::default());
        let tan = 0.5_f32.tan();
        // What any depth may be off by, and cuts that are exact to a few 2⁻⁵² of the extent.
        let bound = depth_error(near * tan * 2.0 / size as f32, near) + near * reach * 16.0 * 2_f32.powi(-52);
        for y in 0..size {
            let slope = (2.0 * (y as f32 + 0.5) / size as f32 - 1.0) * tan;
            let expected = if slope > 0.0 { near * slope } else { 0.0 };
            for x in 0..size {
                let found = map.depth[(y * size + x) as usize];
                assert!(
                    (found - expected).abs() <= bound,
                    "{found} for {expected} at {x}, {y}, reach {reach}"
                );
            }
        }
    }
}

#[test]
fn broken_and_huge_matrices_draw_nothing_or_something_finite() {
    let positions =
        vec![Vec3::new(-1e30, -1e30, 1e30), Vec3::new(1e30, 0.0, -1e30), Vec3::new(0.0, 1e30, 1e30)];
    let scene = scene_of(positions, vec![[0, 1, 2]]);
    for matrix in [
        Mat4::NAN,
        Mat4::ZERO,
        Mat4::from_cols_array(&[f32::INFINITY; 16]),
        Mat4::from_cols_array(&[f32::MAX; 16]),
        Mat4::from_scale(Vec3::splat(f32::MAX)),
        Mat4::from_scale(Vec3::splat(f32::MIN_POSITIVE)),
        perspective_infinite_reverse(3.1, 1.0, f32::MIN_POSITIVE),
    ] {
        for range in [DepthRange::Clip, DepthRange::Clamp] {
            let map = render_depth(&scene, matrix, 33, 17, &DepthOptions { range, ..Default::default() });
            assert!(map.depth.iter().all(|d| (0.0..=1.0).contains(d)), "{matrix}");
        }
    }
}

#[test]
fn the_largest_side_is_drawn_to_its_last_pixel() {
    let positions = vec![
        Vec3::new(-1.0, -1.0, 0.5),
        Vec3::new(1.0, -1.0, 0.5),
        Vec3::new(1.0, 1.0, 0.5),
        Vec3::new(-1.0, 1.0, 0.5),
    ];
    let scene = scene_of(positions, vec![[0, 1, 2], [0, 2, 3]]);
    for (width, height) in [(16_384, 3), (3, 16_384)] {
        let map = render_depth(&scene, Mat4::IDENTITY, width, height, &DepthOptions::default());
        assert!(map.depth.iter().all(|&d| d == 0.5));
        let counts = count_layers(&scene, Mat4::IDENTITY, width, height);
        assert!(counts.front.iter().all(|&n| n == 1));
    }
}

/// Nothing nearer than near or farther than far is seen, pixel by pixel.
#[test]
fn near_and_far_cut_what_the_camera_sees() {
    let camera = gnomon_scene_core::Camera {
        eye: Vec3::ZERO,
        target: Vec3::NEG_Z,
        up: Vec3::Y,
        fov_y: 1.0,
        near: 2.0,
        far: 5.0,
        width: 64,
        height: 64,
    };
    // A floor one below the eye, through the plane of the eye.
    let positions = vec![
        Vec3::new(-50.0, -1.0, -50.0),
        Vec3::new(50.0, -1.0, -50.0),
        Vec3::new(50.0, -1.0, 50.0),
        Vec3::new(-50.0, -1.0, 50.0),
    ];
    let scene = scene_of(positions, vec![[0, 1, 2], [0, 2, 3]]);
    let gbuffer = render_gbuffer(&scene, &camera);
    let tan = 0.5_f32.tan();
    let mut seen = 0;
    for y in 0..64 {
        let depth = 1.0 / ((2.0 * (y as f32 + 0.5) / 64.0 - 1.0) * tan);
        for x in 0..64 {
            let pixel = y * 64 + x;
            let expected = (2.0..=5.0).contains(&depth);
            assert_eq!(gbuffer.triangle[pixel] != GBuffer::NOTHING, expected, "row {y}, depth {depth}");
            if expected {
                seen += 1;
                assert!((gbuffer.depth[pixel] - depth).abs() < 1e-4);
            }
        }
    }
    assert!(seen > 500);
}
