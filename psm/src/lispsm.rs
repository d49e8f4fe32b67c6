//! Light space perspective shadow maps (Wimmer, Scherzer, Purgathofer 2004): the variant `lispsm`.
//!
//! The perspective is put into the light's own image instead of the camera's: its view direction is y, the part of the
//! camera's view direction across the light, and its centre lies the distance n before the receivers' near end. A
//! large n is uniform, a small one warps more. The paper's n spreads the error of perspective evenly between near and
//! far, for parallel light at the angle γ to the view direction and receivers at depths z₀ to z₁:
//!
//! ```text
//! n = (z₀ + √(z₀ z₁)) / sin γ
//! ```
//!
//! With d the receivers' extent along y, (z₁ − z₀)/sin γ if they fill it, that is d/(√(z₁/z₀) − 1): the form used for
//! a light at a place, whose image has tangents for lengths, with sin γ for how much of the depth lies along y.
//!
//! All of this goes by 1/n, which passes through 0 where the light comes along the view and the map is uniform: no
//! case is told apart.

use glam::DVec3;
use scene_core::light::LightPoint;

use crate::light_image::LightImage;
use crate::view_frame::ViewFrame;
use crate::warp::{Warp, at};

/// 1/n in units of the image: scene units of parallel light, tangents else. `depths` are z₀ and z₁, `extent` is d.
pub fn inverse_n(image: &LightImage, frame: &ViewFrame, depths: [f64; 2], extent: f64) -> f64 {
    let [near, far] = depths;
    let sin = image.axes.z_axis.cross(frame.forward).length();
    let inverse = match image.light {
        LightPoint::Towards(_) => sin / (near + (near * far).sqrt()),
        LightPoint::At(_) => sin * ((far / near).sqrt() - 1.0) / extent,
    };
    if inverse.is_finite() { inverse.max(0.0) } else { 0.0 }
}

/// The warp of `image` for receivers with these corners, seen at `depths`.
pub fn warp(image: &LightImage, frame: &ViewFrame, depths: [f64; 2], receivers: &[DVec3]) -> Warp {
    let places = receivers.iter().filter(|&&p| image.w(p) > 0.0).map(|&p| image.warp.place(p));
    let range = places.map(|p| (p, p)).reduce(|(min, max), (p, _)| (min.min(p), max.max(p)));
    let Some((min, max)) = range else { return image.warp };
    let inverse = inverse_n(image, frame, depths, max.y - min.y);
    // The centre of projection lies beside the eye, so that the view's sides become parallel; a light at a place may
    // not see the eye.
    let across = match image.light {
        LightPoint::Towards(_) => at(image.warp.x, frame.eye),
        LightPoint::At(_) => (min.x + max.x) * 0.5,
    };
    let Warp { x, y, w } = image.warp;
    let along = y - w * min.y;
    Warp { x: x - w * across, y: along, w: w + along * inverse }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use scene_core::Camera;

    use super::*;

    fn frame() -> ViewFrame {
        ViewFrame::new(&Camera {
            eye: Vec3::Y,
            target: Vec3::new(0.0, 1.0, -1.0),
            up: Vec3::Y,
            fov_y: 1.0,
            near: 0.1,
            far: 100.0,
            width: 64,
            height: 64,
        })
    }

    #[test]
    fn n_is_the_papers() {
        let (frame, depths) = (frame(), [2.0, 18.0]);
        for (towards, sin) in [(Vec3::Y, 1.0), (Vec3::new(0.0, 0.6, 0.8), 0.6), (Vec3::Z, 0.0)] {
            let image = LightImage::new(LightPoint::Towards(towards), towards.as_dvec3(), frame.forward);
            let inverse = inverse_n(&image, &frame, depths, 16.0);
            assert!((inverse - sin / 8.0).abs() < 1e-7, "{towards}: {inverse}");
        }
        // Far above, a point light is parallel: the tangents of its image are lengths over 1e6.
        let image = LightImage::new(LightPoint::At(Vec3::Y * 1e6), DVec3::Y, frame.forward);
        assert!((inverse_n(&image, &frame, depths, 16e-6) * 1e-6 - 1.0 / 8.0).abs() < 1e-6);
    }

    #[test]
    fn degenerate_receivers_leave_the_image_as_it_is() {
        let frame = frame();
        let image = LightImage::new(LightPoint::At(Vec3::Y * 9.0), DVec3::Y, frame.forward);
        assert_eq!(warp(&image, &frame, [1.0, 2.0], &[]), image.warp);
        assert_eq!(warp(&image, &frame, [1.0, 2.0], &[DVec3::NEG_Z]).w, image.warp.w);
    }
}
