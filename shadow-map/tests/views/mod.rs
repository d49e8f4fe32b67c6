//! Random cameras inside a scene.

use glam::Vec3;
use scene_core::{Camera, Scene, splitmix};

/// A camera somewhere in the middle of `scene` that looks anywhere, with any opening; the same for the same `seed`.
pub(crate) fn random_view(scene: &Scene, seed: u64) -> Camera {
    let mut state = seed;
    let mut unit = || {
        state = state.wrapping_add(splitmix::GOLDEN);
        (splitmix::mix(state) >> 40) as f32 / (1u64 << 24) as f32
    };
    let bounds = scene.bounds();
    let mut place = || bounds.min + bounds.size() * Vec3::from_array([(); 3].map(|()| 0.2 + 0.6 * unit()));
    let (eye, target) = (place(), place());
    let far = if unit() < 0.5 { f32::INFINITY } else { bounds.diagonal() * (0.1 + unit()) };
    let near = bounds.diagonal() * 1e-3;
    Camera { eye, target, up: Vec3::Y, fov_y: 0.2 + 1.4 * unit(), near, far, width: 96, height: 72 }
}
