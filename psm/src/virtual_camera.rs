//! The virtual camera (section 4): how far the eye is moved back before anything is projected.
//!
//! The paper moves the camera back until all of H, the casters' region, lies in front: near distance kept, far
//! extended. The farther, the weaker the foreshortening; at infinity the cube is the world, and the map uniform.
//!
//! This crate's maps stay valid with casters behind the viewer (see [`crate::warp`]), so the shift is a choice, not a
//! need, and the variant `psm` makes it as the paper does. What *is* needed is that
//! the light sees the receivers' cube within 60°: [`least`] finds the smallest shift that makes it so.

use crate::warp::Warp;

/// The paper's shift, in scene units: as much as takes the nearest point of H, at the depth `nearest_caster`, to the depth
/// `near` of the nearest receiver there could be. 0 if it is there already or there is no H.
pub fn holding(near: f64, nearest_caster: f64) -> f64 {
    if nearest_caster < near && (near - nearest_caster).is_finite() { near - nearest_caster } else { 0.0 }
}

/// Steps of one round of [`least`]: a GPU tries all of them at once.
pub const STEPS: u32 = 64;

/// Rounds of [`least`]: the last step is 2⁻¹⁸ of the shift, less than shows.
pub const ROUNDS: u32 = 4;

/// The shift that step `step` of the first round adds, in units of the scene's depth: from 2⁻¹⁰ to 2³⁰.
#[inline]
pub fn ladder(step: u32) -> f64 {
    (f64::from(step) * (40.0 / f64::from(STEPS - 1)) - 10.0).exp2()
}

/// The smallest shift of at least `from` for which `warp` has one, and that warp. `unit` is a length of the scene's
/// (the depth of what is seen): shifts up to 2³⁰ of it are tried on a [`ladder`] of [`STEPS`], and each further round
/// cuts the step that was found into as many. `None` if there is none: no perspective helps.
pub fn least(from: f64, unit: f64, warp: impl Fn(f64) -> Option<Warp>) -> Option<(f64, Warp)> {
    if let Some(found) = warp(from) {
        return Some((from, found));
    }
    // What works once works for all larger shifts, so that the first step is found by halving.
    let first_of = |shift: &dyn Fn(u32) -> f64| {
        let (mut low, mut high, mut found) = (0, STEPS, None);
        while low < high {
            let middle = (low + high) / 2;
            match warp(from + shift(middle)) {
                Some(warp) => (high, found) = (middle, Some((middle, warp))),
                None => low = middle + 1,
            }
        }
        found
    };
    let (step, mut found) = first_of(&|step| unit * ladder(step))?;
    let (mut low, mut high) = (if step == 0 { 0.0 } else { unit * ladder(step - 1) }, unit * ladder(step));
    for _ in 1..ROUNDS {
        let width = (high - low) / f64::from(STEPS);
        // The last step is `high`, which works.
        let Some((step, warp)) = first_of(&|step| low + width * f64::from(step + 1)) else { break };
        (low, high, found) = (low + width * f64::from(step), low + width * f64::from(step + 1), warp);
    }
    Some((from + high, found))
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3, Vec3};
    use scene_core::Camera;
    use scene_core::light::LightPoint;

    use super::*;
    use crate::post_perspective;
    use crate::view_frame::ViewFrame;
    use crate::warp::{Window, at};

    fn frame() -> ViewFrame {
        ViewFrame::new(&Camera {
            eye: Vec3::ZERO,
            target: Vec3::NEG_Z,
            up: Vec3::Y,
            fov_y: 1.0,
            near: 0.1,
            far: 100.0,
            width: 64,
            height: 64,
        })
    }

    fn ground() -> Vec<DVec3> {
        [(-1.0, -2.0), (1.0, -2.0), (-5.0, -40.0), (5.0, -40.0)].map(|(x, z)| DVec3::new(x, -1.0, z)).to_vec()
    }

    #[test]
    fn the_shift_brings_the_nearest_caster_to_the_near_distance() {
        // Five units behind the eye; four before it; nowhere.
        assert_eq!(holding(2.0, -5.0), 7.0);
        assert_eq!(holding(2.0, 4.0), 0.0);
        assert_eq!(holding(2.0, f64::INFINITY), 0.0);
        assert_eq!(holding(f64::INFINITY, f64::INFINITY), 0.0);
    }

    /// Section 4.2: "if we move the camera to infinity … the resulting perspective shadow map corresponds to a standard
    /// uniform shadow map". What a texel spans then is the same everywhere; the spread falls with the shift.
    #[test]
    fn the_map_becomes_uniform_as_the_shift_grows() {
        let light = LightPoint::Towards(Vec3::new(0.0, 0.9, 0.43));
        let mut last = f64::INFINITY;
        for shift in [0.0, 4.0, 16.0, 64.0, 256.0, 65_536.0] {
            let warp = post_perspective::warp(&frame(), light, shift, &ground()).expect("well seen");
            let w: Vec<f64> = ground().iter().map(|&p| at(warp.w, p)).collect();
            let spread =
                w.iter().copied().fold(0.0, f64::max) / w.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(spread < last, "shift {shift}: {spread}");
            last = spread;
        }
        assert!((last - 1.0).abs() < 1e-3, "{last}");
        // And places are those of an affine map: a middle stays a middle.
        let warp = post_perspective::warp(&frame(), light, 1e9, &ground()).expect("well seen");
        let window = ground().iter().fold(Window::EMPTY, |window, &p| window.with(warp.place(p)));
        let places: Vec<DVec2> = ground().iter().map(|&p| warp.place(p)).collect();
        let off = warp.place((ground()[0] + ground()[3]) * 0.5) - (places[0] + places[3]) * 0.5;
        assert!((off / (window.max - window.min)).length() < 1e-6, "{off}");
    }

    #[test]
    fn the_least_shift_is_found_or_there_is_none() {
        let warp = post_perspective::warp(&frame(), LightPoint::Towards(Vec3::Y), 0.0, &ground())
            .expect("well seen");
        let (shift, _) = least(1.0, 10.0, |s| (s >= 3.3).then_some(warp)).expect("found");
        assert!((3.3..3.3001).contains(&shift), "{shift}");
        assert_eq!(least(5.0, 10.0, |s| (s >= 3.3).then_some(warp)).map(|f| f.0), Some(5.0));
        assert!(least(0.0, 10.0, |_| None).is_none());
        assert!(least(0.0, f64::NAN, |_| None).is_none());
    }
}
