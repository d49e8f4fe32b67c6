//! Random cameras inside a scene.

use glam::Vec3;
use scene_core::{Camera, Scene};

/// A camera somewhere in the middle of `scene` that looks anywhere, with any opening; the same for the same `seed`.
pub(crate) fn random_view(scene: &Scene, seed: u64) -> Camera {
    let mut state = seed;
    let mut unit = || {
        // SplitMix64.
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ x >> 31) >> 40) as f32 / (1u64 << 24) as f32
    };
    let bounds = scene.bounds();
    let mut place = || bounds.min + bounds.size() * Vec3::from_array([(); 3].map(|()| 0.2 + 0.6 * unit()));
    let (eye, target) = (place(), place());
    let far = if unit() < 0.5 { f32::INFINITY } else { bounds.diagonal() * (0.1 + unit()) };
    let near = bounds.diagonal() * 1e-3;
    Camera { eye, target, up: Vec3::Y, fov_y: 0.2 + 1.4 * unit(), near, far, width: 96, height: 72 }
}
