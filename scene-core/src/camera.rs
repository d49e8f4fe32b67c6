//! The pinhole camera. Pixel (x, y) looks through its centre, row 0 is on top.

use glam::{Mat3, Mat4, Vec2, Vec3, Vec4};
use thiserror::Error;

/// Why a camera was refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CameraError {
    /// A component is NaN or infinite where that has no meaning.
    #[error("camera.{field} is not finite")]
    NotFinite {
        /// The field's name in a scene file.
        field: &'static str,
    },
    /// Eye and target coincide.
    #[error("camera.eye and camera.target are the same point: the camera looks nowhere")]
    NoDirection,
    /// `up` is zero or along the view direction.
    #[error("camera.up is zero or parallel to the view direction: the picture has no upright")]
    NoUp,
    /// The field of view leaves (0, 180) degrees.
    #[error("camera.fov_y_deg is {0}: it must lie between 0.01 and 179")]
    FieldOfView(f32),
    /// Clip planes are inverted, zero or negative.
    #[error("camera.near is {near} and camera.far {far}: 0 < near < far must hold")]
    ClipPlanes {
        /// Near distance.
        near: f32,
        /// Far distance.
        far: f32,
    },
    /// A side of the image is zero or too large.
    #[error("the image is {width} × {height}: each side must be 1 to {max}", max = Camera::MAX_SIDE)]
    Size {
        /// Pixels a row.
        width: u32,
        /// Rows.
        height: u32,
    },
}

/// A pinhole camera. View space looks along −z with +y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Centre of projection, world space.
    pub eye: Vec3,
    /// A point in the middle of the picture, world space.
    pub target: Vec3,
    /// Roughly upwards, world space; any length.
    pub up: Vec3,
    /// Vertical field of view in radians.
    pub fov_y: f32,
    /// Distance of the near plane along the view direction; nothing nearer is seen.
    pub near: f32,
    /// Distance of the far plane; nothing farther is seen. May be infinite.
    pub far: f32,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Camera {
    /// The longest side of an image in pixels: what the rasteriser's fixed point reaches.
    pub const MAX_SIDE: u32 = 16_384;

    /// Checks that the camera makes a picture.
    ///
    /// # Errors
    /// The first fault, by its field's name in a scene file.
    pub fn validate(&self) -> Result<(), CameraError> {
        for (field, v) in [("eye", self.eye), ("target", self.target), ("up", self.up)] {
            if !v.is_finite() {
                return Err(CameraError::NotFinite { field });
            }
        }
        if !(1..=Self::MAX_SIDE).contains(&self.width) || !(1..=Self::MAX_SIDE).contains(&self.height) {
            return Err(CameraError::Size { width: self.width, height: self.height });
        }
        let degrees = self.fov_y.to_degrees();
        if !(0.0099..=179.001).contains(&degrees) {
            return Err(CameraError::FieldOfView(degrees));
        }
        if !(self.near > 0.0 && self.near.is_finite() && self.near < self.far) {
            return Err(CameraError::ClipPlanes { near: self.near, far: self.far });
        }
        let Some(forward) = (self.target - self.eye).try_normalize() else {
            return Err(CameraError::NoDirection);
        };
        let up = self.up.try_normalize().ok_or(CameraError::NoUp)?;
        // Below this sine the cross product is rounding noise.
        if forward.cross(up).length() < 1e-5 {
            return Err(CameraError::NoUp);
        }
        Ok(())
    }

    /// Unit vector along the view direction.
    pub fn forward(&self) -> Vec3 {
        (self.target - self.eye).normalize_or(Vec3::NEG_Z)
    }

    /// Columns are the view-space axes x (right), y (up), z (backwards) in world space.
    pub fn world_from_view_rotation(&self) -> Mat3 {
        let forward = self.forward();
        let right = forward.cross(self.up).normalize_or(forward.any_orthonormal_vector());
        Mat3::from_cols(right, right.cross(forward), -forward)
    }

    /// World to view space.
    pub fn view_from_world(&self) -> Mat4 {
        let view_from_world = self.world_from_view_rotation().transpose();
        Mat4::from_cols(
            view_from_world.x_axis.extend(0.0),
            view_from_world.y_axis.extend(0.0),
            view_from_world.z_axis.extend(0.0),
            (-(view_from_world * self.eye)).extend(1.0),
        )
    }

    /// View to clip space, reversed Z: depth 1 at `near`, 0 at `far` (or at infinity).
    pub fn projection_from_view(&self) -> Mat4 {
        let Vec2 { x: tan_x, y: tan_y } = self.tan_half_fov();
        let (a, b) = if self.far.is_finite() {
            // depth = (a·z + b) / −z is 1 at z = −near and 0 at z = −far.
            let range = self.far - self.near;
            (self.near / range, self.near * (self.far / range))
        } else {
            (0.0, self.near)
        };
        Mat4::from_cols(
            Vec4::new(1.0 / tan_x, 0.0, 0.0, 0.0),
            Vec4::new(0.0, 1.0 / tan_y, 0.0, 0.0),
            Vec4::new(0.0, 0.0, a, -1.0),
            Vec4::new(0.0, 0.0, b, 0.0),
        )
    }

    /// World to clip space.
    pub fn projection_from_world(&self) -> Mat4 {
        self.projection_from_view() * self.view_from_world()
    }

    /// Tangents of half the horizontal and half the vertical field of view.
    pub fn tan_half_fov(&self) -> Vec2 {
        let tan_y = (self.fov_y * 0.5).tan();
        Vec2::new(tan_y * self.width as f32 / self.height as f32, tan_y)
    }

    /// The ray through pixel position `pixel` (pixel (0, 0) has its centre at (0.5, 0.5)): world-space
    /// direction whose length is 1 along the view direction, so that `eye + t·direction` lies at depth `t`.
    pub fn ray_direction(&self, pixel: Vec2) -> Vec3 {
        self.rays().direction(pixel)
    }

    /// What rays have in common, for many of them: [`CameraRays::direction`] is
    /// [`ray_direction`](Self::ray_direction), bit for bit.
    pub fn rays(&self) -> CameraRays {
        CameraRays {
            world_from_view: self.world_from_view_rotation(),
            tan_half_fov: self.tan_half_fov(),
            size: Vec2::new(self.width as f32, self.height as f32),
        }
    }

    /// The same camera with another image size; the vertical field of view stays.
    #[must_use]
    pub fn with_size(self, width: u32, height: u32) -> Self {
        Self { width, height, ..self }
    }

    /// Pixels of the image.
    pub fn pixel_count(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// Rays of one camera, see [`Camera::rays`].
#[derive(Clone, Copy, Debug)]
pub struct CameraRays {
    world_from_view: Mat3,
    tan_half_fov: Vec2,
    size: Vec2,
}

impl CameraRays {
    /// The ray through pixel position `pixel`, as [`Camera::ray_direction`] gives it.
    #[inline]
    pub fn direction(&self, pixel: Vec2) -> Vec3 {
        let x = (2.0 * pixel.x / self.size.x - 1.0) * self.tan_half_fov.x;
        let y = (1.0 - 2.0 * pixel.y / self.size.y) * self.tan_half_fov.y;
        self.world_from_view * Vec3::new(x, y, -1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera {
            eye: Vec3::new(1.0, 2.0, 6.0),
            target: Vec3::new(0.0, 0.5, 0.0),
            up: Vec3::Y,
            fov_y: 40f32.to_radians(),
            near: 0.5,
            far: 50.0,
            width: 320,
            height: 200,
        }
    }

    #[test]
    fn matrices_and_rays_agree() {
        for far in [50.0, f32::INFINITY] {
            let camera = Camera { far, ..camera() };
            for pixel in [Vec2::new(0.5, 0.5), Vec2::new(160.0, 100.0), Vec2::new(300.5, 17.5)] {
                for depth in [0.5, 3.0, 49.0] {
                    let point = camera.eye + camera.ray_direction(pixel) * depth;
                    let clip = camera.projection_from_world() * point.extend(1.0);
                    let ndc = clip.truncate() / clip.w;
                    let x = (ndc.x * 0.5 + 0.5) * 320.0;
                    let y = (0.5 - ndc.y * 0.5) * 200.0;
                    assert!((Vec2::new(x, y) - pixel).length() < 1e-2, "{x} {y} {pixel}");
                    assert!((clip.w - depth).abs() < 1e-4);
                }
            }
        }
    }

    #[test]
    fn depth_is_reversed() {
        let camera = camera();
        let depth_at = |distance: f32| {
            let clip = camera.projection_from_view() * Vec4::new(0.0, 0.0, -distance, 1.0);
            clip.z / clip.w
        };
        assert!((depth_at(0.5) - 1.0).abs() < 1e-6);
        assert!(depth_at(50.0).abs() < 1e-6);
        assert!(depth_at(1.0) > depth_at(2.0));
    }

    #[test]
    fn faults_are_named() {
        let with = |f: fn(&mut Camera)| {
            let mut c = camera();
            f(&mut c);
            c.validate()
        };
        assert_eq!(camera().validate(), Ok(()));
        assert_eq!(with(|c| c.eye.x = f32::NAN), Err(CameraError::NotFinite { field: "eye" }));
        assert_eq!(with(|c| c.target = c.eye), Err(CameraError::NoDirection));
        assert_eq!(with(|c| c.up = c.eye - c.target), Err(CameraError::NoUp));
        assert_eq!(with(|c| c.near = 60.0), Err(CameraError::ClipPlanes { near: 60.0, far: 50.0 }));
        assert_eq!(with(|c| c.height = 0), Err(CameraError::Size { width: 320, height: 0 }));
        assert!(matches!(with(|c| c.fov_y = 4.0), Err(CameraError::FieldOfView(_))));
    }
}
