//! The camera as the warps see it: axes in f64, and pixels as functions of the place.

use glam::{DVec2, DVec3, DVec4};
use scene_core::Camera;

/// A camera's axes, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewFrame {
    /// Centre of projection.
    pub eye: DVec3,
    /// Unit vector to the right.
    pub right: DVec3,
    /// Unit vector up.
    pub up: DVec3,
    /// Unit vector of the view direction.
    pub forward: DVec3,
    /// Pixels a unit of tangent, across and up.
    pub pixels: DVec2,
}

impl ViewFrame {
    /// Of `camera`.
    pub fn new(camera: &Camera) -> Self {
        let axes = camera.world_from_view_rotation().as_dmat3();
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        Self {
            eye: camera.eye.as_dvec3(),
            right: axes.x_axis,
            up: axes.y_axis,
            forward: -axes.z_axis,
            pixels: size * 0.5 / camera.tan_half_fov().as_dvec2(),
        }
    }

    /// The forms of the coordinates right, up and depth of homogeneous world points, with the eye moved back by
    /// `shift`.
    pub fn forms(&self, shift: f64) -> [DVec4; 3] {
        let form = |axis: DVec3, offset: f64| axis.extend(offset - axis.dot(self.eye));
        [form(self.right, 0.0), form(self.up, 0.0), form(self.forward, shift)]
    }

    /// Distance along the view direction.
    #[inline]
    pub fn depth(&self, point: DVec3) -> f64 {
        self.forward.dot(point - self.eye)
    }

    /// How the pixel that sees `point` moves with it: gradients of its column and row.
    #[inline]
    pub fn pixel_gradients(&self, point: DVec3) -> [DVec3; 2] {
        let from_eye = point - self.eye;
        let depth = self.forward.dot(from_eye);
        let gradient = |axis: DVec3, pixels: f64| {
            (axis - self.forward * (axis.dot(from_eye) / depth)) * (pixels / depth)
        };
        [gradient(self.right, self.pixels.x), gradient(-self.up, self.pixels.y)]
    }
}
