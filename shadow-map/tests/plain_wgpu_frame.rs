//! The example of a technique in a frame that is not Gnomon's: it runs, and its picture has the shadows that rays have.

#![cfg(feature = "gpu")]

#[path = "../examples/plain_wgpu_frame.rs"]
mod plain_wgpu_frame;

use glam::{Vec2, Vec3};
use plain_wgpu_frame::{AMBIENT, BOXES, CAMERA, LAMP, render};
use scene_core::geometry::Aabb;

/// Where a ray meets a box: the parameters of entry and exit; empty if entry is not before exit.
fn slab(bounds: &Aabb, origin: Vec3, direction: Vec3) -> (f32, f32) {
    let (a, b) = ((bounds.min - origin) / direction, (bounds.max - origin) / direction);
    (a.min(b).max_element(), a.max(b).min_element())
}

fn meets(bounds: &Aabb, origin: Vec3, direction: Vec3, range: (f32, f32)) -> bool {
    let (entry, exit) = slab(bounds, origin, direction);
    entry.max(range.0) < exit.min(range.1)
}

/// V on the ground's top under a pixel position; `None` where something else is seen.
fn ground_visibility(pixel: Vec2) -> Option<f32> {
    let direction = CAMERA.ray_direction(pixel);
    let nearest = BOXES
        .iter()
        .enumerate()
        .filter_map(|(id, bounds)| {
            let (entry, exit) = slab(bounds, CAMERA.eye, direction);
            (entry < exit && exit > 0.0).then_some((entry, id))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let point = CAMERA.eye + direction * nearest.0;
    if nearest.1 != 0 || point.y < -1e-3 {
        return None;
    }
    let hidden = BOXES[1..].iter().any(|b| meets(b, point, LAMP - point, (1e-4, 1.0)));
    Some(if hidden { 0.0 } else { 1.0 })
}

#[test]
fn the_picture_has_the_shadows_that_rays_have() {
    if std::env::var("GNOMON_GPU").is_ok_and(|value| value.eq_ignore_ascii_case("off")) {
        return;
    }
    let picture = render().unwrap();
    // Of the ground's red channel: what the lighting pass makes of V, halfway between its two values.
    let albedo = 0.8 + 0.15;
    let lit = albedo * (AMBIENT + (1.0 - AMBIENT) * LAMP.normalize().y);
    let threshold = 0.5 * (albedo * AMBIENT + lit);
    let linear = |byte: u8| ((f32::from(byte) / 255.0 + 0.055) / 1.055).powf(2.4);
    let (mut compared, mut dark, mut wrong) = (0, 0, 0);
    for (x, y, color) in picture.enumerate_pixels() {
        // The same all around, so that an edge within a pixel and a half, or two texels, is not asked about.
        let around: Vec<_> = (0..9)
            .map(|i| Vec2::new((x + i % 3) as f32 - 0.5, (y + i / 3) as f32 - 0.5))
            .map(ground_visibility)
            .collect();
        let Some(expected) = around[4].filter(|_| around.iter().all(|v| *v == around[4])) else { continue };
        compared += 1;
        dark += usize::from(expected == 0.0);
        wrong += usize::from((linear(color.0[0]) > threshold) != (expected == 1.0));
    }
    assert!(compared > 40_000 && dark > 4_000, "{dark} of {compared} dark");
    // Map texels are as large as pixels here: what is left are the corners of shadows.
    assert!(wrong * 500 < compared, "{wrong} of {compared} wrong");
    // The sky.
    assert_eq!(picture.get_pixel(2, 2).0[3], 255);
    assert!(picture.get_pixel(2, 2).0[2] > picture.get_pixel(2, 2).0[0]);
}
