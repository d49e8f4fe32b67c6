//! The light in post-perspective space (section 3) and what it sees there, as a [`Warp`]: the variant `psm`.
//!
//! The camera's projection takes a point to q = (X, Y, Z) of the unit cube, and the light to the homogeneous point
//! (L, W): directional lights have W = 0 if they are parallel to the image plane and lie on the infinity plane else,
//! point lights have W > 0 before the camera, W = 0 in its plane, W < 0 behind it. The shadow map is a view of the cube
//! from there.
//!
//! # All cases at once
//! Let C be the middle of the receivers in the cube and v = W·C − L. Then f = v/|v| is the way in which light travels
//! at C, whatever the sign of W: from L/W to C for W > 0; along −L for W = 0; and for W < 0, where the light is
//! *inverted* and rays converge, from C towards L/W. With r and u across f, the view from the light has the forms
//!
//! ```text
//! x = |v| r·(q − C)        y = |v| u·(q − C)        w = W f·q − f·L = |v| + W f·(q − C)
//! ```
//!
//! which vanish at the light and go over into one another where W passes zero: a perspective view, a parallel one, an
//! inverted one. No case is told apart, so nothing jumps as a light crosses the camera's plane. The depth test is not
//! reversed for inverted lights either, since depth does not come from this space (see [`crate::warp`]).

use glam::{DVec2, DVec3, DVec4};
use scene_core::light::LightPoint;

use crate::light_image::MAX_TAN;
use crate::view_frame::ViewFrame;
use crate::warp::{Warp, at};

/// The virtual camera's projection to the unit cube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cube {
    /// Forms on homogeneous world points: X, Y, Z, each times D, and D, the depth from the moved eye.
    pub forms: [DVec4; 4],
    /// The middle of the receivers in the cube.
    pub middle: DVec3,
}

/// The cube that is fitted to `receivers`: their widest tangents and their nearest and farthest depth are its sides. `None`
/// if one of them is not before the moved eye.
pub fn cube_from_world(frame: &ViewFrame, shift: f64, receivers: &[DVec3]) -> Option<Cube> {
    let (mut near, mut far) = (f64::INFINITY, 0f64);
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    let forms = frame.forms(shift);
    for &point in receivers {
        let p = DVec3::from_array(forms.map(|form| at(form, point)));
        near = near.min(p.z);
        far = far.max(p.z);
        let tangents = p.truncate() / p.z;
        (low, high) = (low.min(tangents), high.max(tangents));
    }
    if !(near > 0.0 && near <= far && far.is_finite() && (high - low).is_finite()) {
        return None;
    }
    // Receivers without extent still span a cube: 2⁻²⁰ is the precision of their positions.
    const LEAST: f64 = 1.0 / 1_048_576.0;
    far = far.max(near * (1.0 + LEAST));
    let [x, y, depth] = forms;
    let z = (depth * (far + near) - DVec4::W * (2.0 * far * near)) / (far - near);
    let tan = low.abs().max(high.abs()).max(DVec2::splat(LEAST));
    let middle = ((low + high) * 0.5 / tan).extend(0.0);
    Some(Cube { forms: [x / tan.x, y / tan.y, z, depth], middle })
}

/// Where the light is in post-perspective space, homogeneous, of unit length.
pub fn light_in_cube(cube: &Cube, light: LightPoint) -> DVec4 {
    let light = match light {
        LightPoint::At(place) => place.as_dvec3().extend(1.0),
        LightPoint::Towards(towards) => towards.as_dvec3().extend(0.0),
    };
    DVec4::from_array(cube.forms.map(|form| form.dot(light))).normalize_or_zero()
}

/// The view from the light in post-perspective space of the camera moved back by `shift`. `None` if a receiver is not
/// before the moved eye or not within 60° of the view's axis.
pub fn warp(frame: &ViewFrame, light: LightPoint, shift: f64, receivers: &[DVec3]) -> Option<Warp> {
    let cube = cube_from_world(frame, shift, receivers)?;
    let light = light_in_cube(&cube, light);
    let to_cube = |p: DVec3| {
        let [x, y, z, d] = cube.forms.map(|form| at(form, p));
        DVec3::new(x, y, z) / d
    };
    let center = cube.middle;
    let v = center * light.w - light.truncate();
    let length = v.length();
    let f = v.try_normalize()?;
    // y of the map follows the depth of the cube or, for light along it, its height.
    let along = if f.z.abs() <= f.y.abs().max(f.x.abs()) { DVec3::Z } else { DVec3::Y };
    let u = (along - f * f.dot(along)).try_normalize()?;
    let r = u.cross(-f);
    let x = (r * length).extend(-length * r.dot(center));
    let y = (u * length).extend(-length * u.dot(center));
    let w = (f * light.w).extend(-f.dot(light.truncate()));
    // A tangent is |W| r·(q − C) / w: parallel light has none.
    let inside = |&p: &DVec3| {
        let q = to_cube(p).extend(1.0);
        let w = w.dot(q);
        w > 0.0 && x.dot(q).abs().max(y.dot(q).abs()) * light.w.abs() <= MAX_TAN * w * length
    };
    if !receivers.iter().all(inside) {
        return None;
    }
    let [cube_x, cube_y, cube_z, cube_d] = cube.forms;
    let to_world = |form: DVec4| cube_x * form.x + cube_y * form.y + cube_z * form.z + cube_d * form.w;
    Some(Warp { x: to_world(x), y: to_world(y), w: to_world(w) })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use scene_core::Camera;

    use super::*;

    fn frame() -> ViewFrame {
        ViewFrame::new(&Camera {
            eye: Vec3::new(0.0, 1.0, 0.0),
            target: Vec3::new(0.0, 1.0, -1.0),
            up: Vec3::Y,
            fov_y: 1.0,
            near: 0.1,
            far: 100.0,
            width: 64,
            height: 64,
        })
    }

    /// Corners of a block in the view: some before, some beyond others on any ray.
    fn receivers() -> Vec<DVec3> {
        let at = |i: usize, bit: usize, low: f64, high: f64| if i >> bit & 1 == 0 { low } else { high };
        (0..8).map(|i| DVec3::new(at(i, 0, -0.8, 0.8), at(i, 1, 0.6, 1.4), at(i, 2, -4.0, -2.0))).collect()
    }

    const TOWARDS: [(&str, Vec3, f64); 5] = [
        ("across", Vec3::Y, 0.0),
        ("from the front", Vec3::new(0.0, 0.6, -0.8), 1.0),
        ("from behind", Vec3::new(0.0, 0.6, 0.8), -1.0),
        ("at the viewer", Vec3::NEG_Z, 1.0),
        ("with the view", Vec3::Z, -1.0),
    ];

    /// Figure 4: where directional lights go, and that those not in the image plane lie on the infinity plane
    /// Z = (f + n)/(f − n).
    #[test]
    fn directional_lights_become_parallel_or_points_on_the_infinity_plane() {
        let cube = cube_from_world(&frame(), 0.0, &receivers()).expect("in front");
        for (name, towards, sign) in TOWARDS {
            let light = light_in_cube(&cube, LightPoint::Towards(towards));
            assert!(
                (light.w.signum() == sign && light.w.abs() > 0.1) || (sign == 0.0 && light.w.abs() < 1e-7),
                "{name}: {light}"
            );
            if sign != 0.0 {
                assert!((light.z / light.w - 6.0 / 2.0).abs() < 1e-6, "{name}: {light}");
            }
        }
    }

    /// Figure 5: before, in and behind the camera's plane.
    #[test]
    fn point_lights_keep_their_side_of_the_camera() {
        let cube = cube_from_world(&frame(), 0.0, &receivers()).expect("in front");
        let w_at = |z: f32| light_in_cube(&cube, LightPoint::At(Vec3::new(0.0, 9.0, z))).w;
        assert!(w_at(-3.0) > 0.0 && w_at(0.0).abs() < 1e-9 && w_at(3.0) < 0.0);
    }

    /// Every case keeps rays of light together: two points of one ray fall on one place, whichever side of the camera
    /// the second is on.
    #[test]
    fn rays_of_light_are_points_of_the_map() {
        let lights = TOWARDS
            .map(|(_, towards, _)| LightPoint::Towards(towards))
            .into_iter()
            .chain([-9.0, 0.0, 9.0].map(|z| LightPoint::At(Vec3::new(0.4, 7.0, z))));
        for light in lights {
            let warp = warp(&frame(), light, 0.0, &receivers()).unwrap_or_else(|| panic!("{light:?}"));
            for point in receivers() {
                let caster = match light {
                    LightPoint::At(place) => point.lerp(place.as_dvec3(), 0.9),
                    LightPoint::Towards(towards) => point + towards.as_dvec3() * 50.0,
                };
                assert!(at(warp.w, point) > 0.0 && at(warp.w, caster) > 0.0, "{light:?}");
                let apart = warp.place(point).distance(warp.place(caster));
                assert!(apart < 1e-5, "{light:?}: {point} and {caster} are {apart} apart");
            }
        }
    }

    /// The map goes over from perspective to parallel to inverted as a light crosses the camera's plane.
    #[test]
    fn nothing_jumps_as_the_light_crosses_the_cameras_plane() {
        let place = |lean: f64| {
            let towards = DVec3::new(0.0, 1.0, lean).normalize().as_vec3();
            let warp = warp(&frame(), LightPoint::Towards(towards), 0.0, &receivers()).expect("well seen");
            receivers().iter().map(|&p| warp.place(p)).collect::<Vec<DVec2>>()
        };
        let steps: Vec<_> = (-50..=50).map(|i| place(f64::from(i) * 1e-3)).collect();
        for pair in steps.windows(2) {
            let moved = pair[0].iter().zip(&pair[1]).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            assert!(moved < 0.01, "{moved}");
        }
    }

    /// The worst case of section 3.3: light along the view cancels the perspective, and the map is uniform.
    #[test]
    fn light_along_the_view_gives_a_uniform_map() {
        for towards in [Vec3::Z, Vec3::NEG_Z] {
            let warp = warp(&frame(), LightPoint::Towards(towards), 0.0, &receivers()).expect("well seen");
            let w: Vec<f64> = receivers().iter().map(|&p| at(warp.w, p)).collect();
            assert!(w.iter().all(|&value| (value / w[0] - 1.0).abs() < 1e-9), "{w:?}");
        }
    }

    #[test]
    fn receivers_behind_the_eye_have_no_cube() {
        assert!(cube_from_world(&frame(), 0.0, &[DVec3::Z]).is_none());
        assert!(cube_from_world(&frame(), 0.0, &[DVec3::NAN]).is_none());
        assert!(cube_from_world(&frame(), 0.0, &[]).is_none());
        // A single point does.
        assert!(warp(&frame(), LightPoint::Towards(Vec3::Y), 0.0, &[DVec3::NEG_Z]).is_some());
    }
}
