//! Uniforms as the shaders read them. Tests hold every offset against the linked WGSL.

use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec3, Mat4, Vec2, Vec3};

use crate::Camera;
use crate::light::{Light, LightPoint};

/// `Camera` of `camera.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct CameraUniform {
    /// Clip space from world-space positions relative to the eye.
    pub clip_from_relative: Mat4,
    /// Unit, to the right of the picture.
    pub right: Vec3,
    /// Tangent of half the horizontal field of view.
    pub tan_x: f32,
    /// Unit, to the top of the picture.
    pub up: Vec3,
    /// Tangent of half the vertical field of view.
    pub tan_y: f32,
    /// Unit, into the picture.
    pub forward: Vec3,
    /// Distance of the near plane.
    pub near: f32,
    /// Centre of projection.
    pub eye: Vec3,
    /// Distance of the far plane; may be infinite.
    pub far: f32,
    /// Pixels a row and rows.
    pub size: Vec2,
    /// depth = x + y / view depth.
    pub depth_scale: Vec2,
    /// How far seen surfaces are lifted along their normals ([`GpuGBuffer::lift`](super::GpuGBuffer::lift)).
    pub lift: f32,
    /// Fills the last row.
    pub padding: [f32; 3],
}

impl CameraUniform {
    /// What shaders need of `camera`.
    pub fn new(camera: &Camera) -> Self {
        let axes = camera.world_from_view_rotation();
        let projection = camera.projection_from_view();
        let tan = camera.tan_half_fov();
        Self {
            clip_from_relative: projection * Mat4::from_mat3(axes.transpose()),
            right: axes.x_axis,
            tan_x: tan.x,
            up: axes.y_axis,
            tan_y: tan.y,
            forward: -axes.z_axis,
            near: camera.near,
            eye: camera.eye,
            far: camera.far,
            size: Vec2::new(camera.width as f32, camera.height as f32),
            // depth = (a·z + b) / −z with z = −view depth.
            depth_scale: Vec2::new(-projection.z_axis.z, projection.w_axis.z),
            lift: 0.0,
            padding: [0.0; 3],
        }
    }
}

/// `Light` of `light.wesl`: every kind in one.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LightUniform {
    /// The middle; zero for directional light.
    pub center: Vec3,
    /// 0 to 5: directional, point, spot, sphere, rect, disk.
    pub kind: u32,
    /// Unit: towards a directional light, away from a spot, a disk's normal; else zero.
    pub axis: Vec3,
    /// Radius of a sphere or disk; 1 − cos of a directional light's angular radius; cos of a spot's outer angle.
    pub extent: f32,
    /// A rect's half axis; a disk's or directional light's unit vector across the axis.
    pub u: Vec3,
    /// Sine of a directional light's angular radius.
    pub sine: f32,
    /// The other of the two.
    pub v: Vec3,
    /// Zero.
    pub padding: u32,
}

impl LightUniform {
    /// What shaders need of `light`.
    pub fn new(light: &Light) -> Self {
        let zero = Self::zeroed();
        let framed = |axis: DVec3| {
            let (u, v) = axis.any_orthonormal_pair();
            Self { axis: axis.as_vec3(), u: u.as_vec3(), v: v.as_vec3(), ..zero }
        };
        let center = match light.center() {
            LightPoint::At(center) => center,
            LightPoint::Towards(_) => Vec3::ZERO,
        };
        let uniform = match *light {
            Light::Directional { direction, angular_radius } => {
                let angle = f64::from(angular_radius);
                Self {
                    kind: 0,
                    // 1 − cos a, free of cancellation for the 0.0046 rad of the sun.
                    extent: (2.0 * (0.5 * angle).sin().powi(2)) as f32,
                    sine: angle.sin() as f32,
                    ..framed((-direction.as_dvec3()).normalize_or(DVec3::Y))
                }
            }
            Light::Point { .. } => Self { kind: 1, ..zero },
            Light::Spot { direction, outer, .. } => Self {
                kind: 2,
                axis: direction.as_dvec3().normalize_or(DVec3::NEG_Y).as_vec3(),
                extent: outer.cos(),
                ..zero
            },
            Light::Sphere { radius, .. } => Self { kind: 3, extent: radius, ..zero },
            Light::Rect { half_u, half_v, .. } => Self { kind: 4, u: half_u, v: half_v, ..zero },
            Light::Disk { normal, radius, .. } => {
                Self { kind: 5, extent: radius, ..framed(normal.as_dvec3().normalize_or(DVec3::Y)) }
            }
        };
        Self { center, ..uniform }
    }
}

/// `DepthView` of `depth_pass.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct DepthUniform {
    /// Clip space from world-space positions relative to `origin`.
    pub clip_from_relative: Mat4,
    /// A place near what is drawn, world space.
    pub origin: Vec3,
    /// Zero.
    pub padding: u32,
}

impl DepthUniform {
    /// `clip_from_world` applied to positions relative to `origin`, multiplied in f64, so that a shader
    /// subtracts places and not large products.
    pub fn new(clip_from_world: Mat4, origin: Vec3) -> Self {
        let relative = clip_from_world.as_dmat4() * DMat4::from_translation(origin.as_dvec3());
        Self { clip_from_relative: relative.as_mat4(), origin, padding: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assert_layout;
    use crate::gpu::{CasterNode, RUN, shaders, testing};

    fn shader(name: &str) -> &'static str {
        shaders::ALL.iter().find(|(module, _)| *module == name).unwrap().1
    }

    #[test]
    fn layouts_are_those_of_the_shaders() {
        assert_layout!(
            CameraUniform,
            shader("camera"),
            "Camera",
            [clip_from_relative, right, tan_x, up, tan_y, forward, near, eye, far, size, depth_scale, lift]
        );
        assert_layout!(LightUniform, shader("light"), "Light", [center, kind, axis, extent, u, sine, v]);
        assert_layout!(CasterNode, shader("caster_tree"), "Node", [low, skip, high, first, count]);
        assert_layout!(DepthUniform, shader("depth_pass"), "DepthView", [clip_from_relative, origin]);
    }

    #[test]
    fn constants_are_those_of_the_shaders() {
        testing::assert_constants(shader("depth_pass"), &[("RUN", f64::from(RUN))]);
    }

    #[test]
    fn relative_clip_positions_are_the_cameras() {
        for far in [80.0, f32::INFINITY] {
            let camera = Camera {
                eye: Vec3::new(3.0, 2.0, 5.0),
                target: Vec3::ZERO,
                up: Vec3::Y,
                fov_y: 0.8,
                near: 0.5,
                far,
                width: 30,
                height: 20,
            };
            let uniform = CameraUniform::new(&camera);
            let point = Vec3::new(0.3, -0.2, 0.1);
            let clip = uniform.clip_from_relative * (point - camera.eye).extend(1.0);
            let expected = camera.projection_from_world() * point.extend(1.0);
            assert!((clip - expected).abs().max_element() < 1e-5, "{clip} {expected}");
            let depth = uniform.depth_scale.x + uniform.depth_scale.y / expected.w;
            assert!((depth - expected.z / expected.w).abs() < 1e-6);
        }
    }

    /// Far from the origin, products of world positions lose what differences keep.
    #[test]
    fn relative_depth_views_keep_digits_far_out() {
        let far_out = Vec3::splat(1e4);
        let exact =
            DMat4::from_scale(DVec3::new(1.0, 1.0, 0.5)) * DMat4::from_translation(-far_out.as_dvec3());
        let uniform = DepthUniform::new(exact.as_mat4(), far_out);
        let point = far_out + Vec3::new(0.25, 0.5, -0.75);
        let clip = uniform.clip_from_relative * (point - uniform.origin).extend(1.0);
        let expected = exact * point.as_dvec3().extend(1.0);
        assert!((clip.as_dvec4() - expected).abs().max_element() < 1e-6);
    }
}
