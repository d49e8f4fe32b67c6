//! No pixel twice, none missed.

use glam::camera::rh::proj::directx::{orthographic, perspective_infinite_reverse};
use glam::camera::rh::view::look_at_mat4;
use glam::{Vec2, Vec3};
use gnomon_scene_core::raster::{LayerCounts, count_layers};
use proptest::prelude::*;

use super::meshes::{blob, camera, flat, hash, pixel_space, scene_of};

const SIZE: u32 = 96;

fn assert_closed(counts: &LayerCounts) {
    for (pixel, (front, back)) in counts.front.iter().zip(&counts.back).enumerate() {
        assert_eq!(front, back, "faces over pixel {pixel}");
    }
    assert!(counts.front.iter().any(|&n| n > 0), "nothing was drawn");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// As many faces turn to the eye as away from it, at every pixel, under any projection.
    #[test]
    fn a_closed_mesh_has_as_many_fronts_as_backs(
        seed in any::<u64>(),
        slices in 3_u32..48,
        stacks in 2_u32..32,
        roughness in 0.0_f32..1.5,
        scale in 0.05_f32..4.0,
        shift in (-1.5_f32..1.5, -1.5_f32..1.5),
        perspective in any::<bool>(),
    ) {
        let noise = |slice, stack| 1.0 - roughness * hash(seed ^ (u64::from(slice) << 32) ^ u64::from(stack));
        let (positions, triangles) = blob(slices, stacks, noise);
        // Before the eye for every scale: at most 4 units out, the eye 6 away.
        let positions = positions.iter().map(|&p| p * scale + Vec3::new(shift.0, shift.1, 0.0)).collect();
        let scene = scene_of(positions, triangles);
        let view = look_at_mat4(Vec3::new(2.0, 3.0, 5.0), Vec3::ZERO, Vec3::Y);
        let projection = if perspective {
            perspective_infinite_reverse(0.7, 1.0, 0.1)
        } else {
            orthographic(-2.0, 2.0, -2.0, 2.0, 20.0, -20.0)
        };
        let counts = count_layers(&scene, projection * view, SIZE, SIZE);
        for (pixel, (front, back)) in counts.front.iter().zip(&counts.back).enumerate() {
            prop_assert_eq!(front, back, "faces over pixel {}", pixel);
        }
    }

    /// A fan around a point covers its whole square once, wherever the point and the rim's corners are; corners
    /// lie on multiples of half a pixel, so that edges pass through centres all the time.
    #[test]
    fn a_fan_covers_every_pixel_once(
        hub in (1_u16..191, 1_u16..191),
        rim in proptest::collection::vec(1_u16..192, 0..40),
        flip in any::<bool>(),
    ) {
        let side = 2.0 * SIZE as f32;
        let mut corners: Vec<Vec2> = Vec::new();
        let mut rim: Vec<f32> = rim.into_iter().map(f32::from).collect();
        rim.sort_by(f32::total_cmp);
        rim.dedup();
        corners.push(Vec2::ZERO);
        corners.extend(rim.iter().map(|&x| Vec2::new(x, 0.0)));
        corners.push(Vec2::new(side, 0.0));
        corners.extend(rim.iter().map(|&y| Vec2::new(side, y)));
        corners.push(Vec2::splat(side));
        corners.push(Vec2::new(0.0, side));
        let mut positions = vec![flat(Vec2::new(f32::from(hub.0), f32::from(hub.1)) * 0.5, 0.5)];
        positions.extend(corners.iter().map(|&c| flat(c * 0.5, 0.5)));
        let n = corners.len() as u32;
        let triangles: Vec<[u32; 3]> = (0..n)
            .map(|i| if flip { [0, 1 + (i + 1) % n, 1 + i] } else { [0, 1 + i, 1 + (i + 1) % n] })
            .collect();
        let counts = count_layers(&scene_of(positions, triangles), pixel_space(SIZE), SIZE, SIZE);
        let (once, never) = if flip { (&counts.front, &counts.back) } else { (&counts.back, &counts.front) };
        prop_assert!(once.iter().all(|&n| n == 1));
        prop_assert!(never.iter().all(|&n| n == 0));
    }

    /// A strip of two rows of random, monotone corners covers its rectangle once.
    #[test]
    fn a_strip_covers_every_pixel_once(steps in proptest::collection::vec((1_u16..900, 1_u16..900), 4..60)) {
        let mut tops = vec![0.0_f32];
        let mut bottoms = vec![0.0_f32];
        for (top, bottom) in steps {
            // Steps of 1/61 pixel: hardly ever on the grid of 1/256.
            tops.push((tops[tops.len() - 1] + f32::from(top) / 61.0).min(SIZE as f32));
            bottoms.push((bottoms[bottoms.len() - 1] + f32::from(bottom) / 61.0).min(SIZE as f32));
        }
        *tops.last_mut().unwrap() = SIZE as f32;
        *bottoms.last_mut().unwrap() = SIZE as f32;
        let mut positions = Vec::new();
        for (&top, &bottom) in tops.iter().zip(&bottoms) {
            positions.push(flat(Vec2::new(top, 0.0), 0.5));
            positions.push(flat(Vec2::new(bottom, SIZE as f32), 0.5));
        }
        let mut triangles = Vec::new();
        for i in 0..tops.len() as u32 - 1 {
            let k = 2 * i;
            triangles.push([k, k + 2, k + 1]);
            triangles.push([k + 1, k + 2, k + 3]);
        }
        let counts = count_layers(&scene_of(positions, triangles), pixel_space(SIZE), SIZE, SIZE);
        prop_assert!(counts.back.iter().all(|&n| n == 1), "{:?}", counts.back.iter().max());
        prop_assert!(counts.front.iter().all(|&n| n == 0));
    }
}

#[test]
fn a_closed_mesh_stays_closed_from_a_few_pixels_to_thousands_of_triangles_a_pixel() {
    for (slices, stacks) in [(5, 4), (60, 50), (400, 300)] {
        let noise = |slice, stack| 1.0 - 0.3 * hash(u64::from(slice) << 32 | u64::from(stack));
        let (positions, triangles) = blob(slices, stacks, noise);
        let scene = scene_of(positions, triangles);
        for size in [1, 7, 40, 333] {
            let camera = camera(size, size);
            let counts = count_layers(&scene, camera.projection_from_world(), size, size);
            assert_closed(&counts);
        }
    }
}

/// Clipped edges stay shared: a closed mesh that reaches far outside the guard band on all sides, though not
/// behind the eye.
#[test]
fn a_mesh_cut_by_the_guard_band_stays_closed() {
    for seed in 0..40 {
        let noise = |slice, stack| 1.0 - 0.9 * hash(seed << 40 | u64::from(slice) << 20 | u64::from(stack));
        let (positions, triangles) = blob(9, 7, noise);
        // A hundred thousand times the view's width.
        let positions = positions.iter().map(|&p| p * Vec3::new(1e5, 1e5, 0.4)).collect();
        let scene = scene_of(positions, triangles);
        let projection = orthographic(-1.0, 1.0, -1.0, 1.0, 10.0, -10.0);
        assert_closed(&count_layers(&scene, projection, SIZE, SIZE));
    }
}

/// A fan around the eye's own foot point, through the plane of the eye: every pixel below the horizon once.
#[test]
fn a_floor_through_the_eye_plane_is_covered_once() {
    let reach = 1e6_f32;
    let rim = 23;
    let mut positions = vec![Vec3::new(0.1, -1.0, -0.3)];
    positions.extend((0..rim).map(|i| {
        let angle = std::f32::consts::TAU * i as f32 / rim as f32;
        Vec3::new(angle.cos() * reach, -1.0, angle.sin() * reach)
    }));
    let triangles = (0..rim).map(|i| [0, 1 + i, 1 + (i + 1) % rim]).collect();
    let scene = scene_of(positions, triangles);
    let projection = perspective_infinite_reverse(1.5, 1.0, 0.01);
    let counts = count_layers(&scene, projection, 128, 128);
    for (pixel, (front, back)) in counts.front.iter().zip(&counts.back).enumerate() {
        let below = pixel / 128 >= 64;
        assert_eq!(front + back, u32::from(below), "row {}, column {}", pixel / 128, pixel % 128);
    }
}
