//! The points of the light that V is counted at.

use glam::Vec2;
use scene_core::Light;
use scene_core::light::sampling::{SampleKey, sobol};

/// `taps` points of the square [−1, 1]², or of the unit disk where the light is round, in equal shares of V (before
/// [`LightCone::share`](gnomon_shadow_map::light_cone::LightCone::share)): a scrambled (0, 2)-sequence, the same for all
/// receivers, so that penumbrae have steps of 1/`taps` and no noise.
pub(crate) fn light_points(light: &Light, taps: u32, seed: u32) -> Vec<Vec2> {
    let key = SampleKey::new(u64::from(seed), 0);
    let is_round = !matches!(light, Light::Rect { .. });
    let place = |square: Vec2| {
        let p = 2.0 * square - 1.0;
        if !is_round {
            return p;
        }
        // Shirley and Chiu's concentric map.
        let (radius, turn) = if p.x.abs() > p.y.abs() {
            (p.x, std::f32::consts::FRAC_PI_4 * (p.y / p.x))
        } else if p.y != 0.0 {
            (p.y, std::f32::consts::FRAC_PI_2 - std::f32::consts::FRAC_PI_4 * (p.x / p.y))
        } else {
            (0.0, 0.0)
        };
        Vec2::from_angle(turn) * radius
    };
    (0..taps.max(1)).map(|index| place(sobol(index, key))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Half of the points lie on either side of any line through the middle, within what (0, 2)-sequences leave: a line
    /// cuts at most 2·√n cells of the square, each off by half a point, twice that on a disk.
    #[test]
    fn halves_are_halves() {
        let sphere = Light::Sphere { center: Vec3::ZERO, radius: 1.0 };
        let rect = Light::Rect { center: Vec3::ZERO, half_u: Vec3::X, half_v: Vec3::Y };
        for light in [sphere, rect] {
            let points = light_points(&light, 1024, 3);
            assert!(points.iter().all(|p| p.abs().max_element() <= 1.0));
            for turn in [0.0, 0.4, 1.1, 2.0] {
                let axis = Vec2::from_angle(turn);
                let left = points.iter().filter(|p| axis.perp_dot(**p) > 0.0).count();
                assert!(left.abs_diff(512) <= 64, "{left} of 1024 at {turn}");
            }
        }
    }
}
