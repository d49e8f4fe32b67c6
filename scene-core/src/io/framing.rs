//! The rule that completes a mesh to a picture: ground, camera, light.
//!
//! With r half the diagonal of the geometry's box and c its middle:
//!
//! - **light**: a square of half side 0.3 r, 2.5 r from c, facing c; 60° above the horizon, 50° to the right
//!   of the front. It lies outside the ball around the box and above its top, whatever the box's shape.
//! - **ground**: if neither a camera nor a light is given, a square just below the lowest point, at least
//!   4 r to each side of c and large enough for the whole penumbra. It receives and does not cast: nothing
//!   is below it. It is 2⁻¹³ of the diagonal lower (an eighth of a pixel of the picture), so that it does not
//!   coincide with a floor; a mesh that is flat itself floats 0.05 r above it, so that its shadow is seen.
//! - **camera**: 25° above the horizon, 30° to the left of the front, 40° field of view, as near as possible
//!   with all vertices and their shadows (from the light's middle) in the picture.
//!
//! The front is +z for +y up (as in glTF), −y for +z up, +y for +x up. The rule holds at any scale and place
//! that f32 resolves. It is made for objects: a closed room is seen from outside, and needs a scene file with
//! a camera and a light inside.

use glam::{Affine3A, DVec3, Vec3};
use thiserror::Error;

use crate::geometry::{Aabb, ObjectFlags, SceneError};
use crate::light::LightPoint;
use crate::{Camera, Light, SceneSetup, TriangleMesh};

/// Pixels of each side of a picture whose size nobody gave.
pub const DEFAULT_SIDE: u32 = 512;

/// The vertical field of view of a camera that nobody gave, in degrees.
pub const DEFAULT_FOV_Y_DEG: f32 = 40.0;

/// The axis that points upwards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// +x.
    X,
    /// +y, as in glTF and most OBJ files.
    #[default]
    Y,
    /// +z, as in many CAD programs.
    Z,
}

impl UpAxis {
    /// The axis nearest to a direction; +y for zero or NaN.
    pub fn nearest_to(direction: Vec3) -> Self {
        let a = direction.abs();
        if a.z > a.x && a.z > a.y {
            Self::Z
        } else if a.x > a.y {
            Self::X
        } else {
            Self::Y
        }
    }

    /// Right, up and front; right-handed.
    fn axes(self) -> [DVec3; 3] {
        match self {
            Self::X => [DVec3::Z, DVec3::X, DVec3::Y],
            Self::Y => [DVec3::X, DVec3::Y, DVec3::Z],
            Self::Z => [DVec3::X, DVec3::Z, DVec3::NEG_Y],
        }
    }

    /// The unit vector along the axis.
    pub fn direction(self) -> Vec3 {
        self.axes()[1].as_vec3()
    }

    /// The unit vector `elevation` above the horizon and `azimuth` to the right of the front, in degrees.
    fn towards(self, azimuth: f64, elevation: f64) -> DVec3 {
        let [right, up, front] = self.axes();
        let (sin_a, cos_a) = azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = elevation.to_radians().sin_cos();
        right * (sin_a * cos_e) + up * sin_e + front * (cos_a * cos_e)
    }
}

/// Why a scene could not be framed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FramingError {
    /// There is nothing to look at.
    #[error("there is no geometry to look at")]
    Empty,
    /// Squares of lengths leave the range of f32.
    #[error("the geometry is {diagonal:e} across: a camera can be chosen from 1e-15 to 1e15")]
    Size {
        /// The diagonal of its box.
        diagonal: f32,
    },
    /// The mesh is so far from the origin, for its size, that f32 cannot tell the camera's points apart.
    #[error("the geometry is {diagonal:e} across but {distance:e} from the origin: f32 cannot resolve it")]
    Place {
        /// The diagonal of its box.
        diagonal: f32,
        /// Its largest coordinate.
        distance: f32,
    },
    /// The ground could not be added.
    #[error(transparent)]
    Ground(#[from] SceneError),
}

/// A camera before it has been chosen; [`Camera::validate`] refuses it.
pub(super) const UNFRAMED: Camera = Camera {
    eye: Vec3::ZERO,
    target: Vec3::ZERO,
    up: Vec3::ZERO,
    fov_y: 0.0,
    near: 0.0,
    far: 0.0,
    width: 0,
    height: 0,
};

/// The ball around a box, in f64.
#[derive(Clone, Copy, Debug)]
struct Extent {
    bounds: Aabb,
    center: DVec3,
    /// Half the diagonal.
    radius: f64,
}

impl Extent {
    fn of(bounds: Aabb) -> Result<Self, FramingError> {
        if bounds.is_empty() {
            return Err(FramingError::Empty);
        }
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let diagonal = (max - min).length();
        if !(1e-15..=1e15).contains(&diagonal) {
            return Err(FramingError::Size { diagonal: diagonal as f32 });
        }
        // Below a thousand steps of f32 across, a picture shows steps.
        let distance = bounds.magnitude();
        if diagonal < f64::from(distance) * f64::from(f32::EPSILON) * 1024.0 {
            return Err(FramingError::Place { diagonal: diagonal as f32, distance });
        }
        Ok(Self { bounds, center: (min + max) * 0.5, radius: diagonal * 0.5 })
    }

    fn corners(&self) -> [DVec3; 8] {
        self.bounds.corners().map(|corner| corner.as_dvec3())
    }

    /// Height of the ground along `up`.
    fn ground_height(&self, up: DVec3) -> f64 {
        let heights = self.corners().map(|corner| corner.dot(up));
        let lowest = heights.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let step = f64::from(self.bounds.magnitude()) * f64::from(f32::EPSILON);
        let gap = (self.radius * 2.0 / 8192.0).max(4.0 * step);
        if highest - lowest < gap { lowest - 0.05 * self.radius } else { lowest - gap }
    }
}

/// The rule's light for geometry within `bounds`.
///
/// # Errors
/// Geometry that is empty, or whose size or place leaves what f32 resolves.
pub fn framed_light(bounds: Aabb, up: UpAxis) -> Result<Light, FramingError> {
    let extent = Extent::of(bounds)?;
    let towards = up.towards(50.0, 60.0);
    let [_, up, _] = up.axes();
    let half_u = up.cross(towards).normalize();
    let half_v = towards.cross(half_u);
    Ok(Light::Rect {
        center: (extent.center + towards * (2.5 * extent.radius)).as_vec3(),
        half_u: (half_u * (0.3 * extent.radius)).as_vec3(),
        half_v: (half_v * (0.3 * extent.radius)).as_vec3(),
    })
}

/// The rule's ground under geometry within `bounds`: a square of two triangles.
///
/// # Errors
/// Geometry that is empty, or whose size or place leaves what f32 resolves.
pub fn framed_ground(bounds: Aabb, up: UpAxis) -> Result<TriangleMesh, FramingError> {
    let extent = Extent::of(bounds)?;
    let light = framed_light(bounds, up)?;
    let [right, up, front] = up.axes();
    let height = extent.ground_height(up);
    let reach = light_corners(&light)
        .into_iter()
        .flat_map(|light| extent.corners().map(|corner| shadow_on_ground(corner, light, up, height)))
        .map(|p| (p - extent.center).dot(right).abs().max((p - extent.center).dot(front).abs()))
        .fold(0.0, f64::max);
    let half = (1.2 * reach).max(4.0 * extent.radius);
    let middle = extent.center + up * (height - extent.center.dot(up));
    let corner = |x: f64, z: f64| (middle + right * (x * half) + front * (z * half)).as_vec3();
    let positions = vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    Ok(TriangleMesh::new("ground", positions, vec![[0, 1, 2], [0, 2, 3]]))
}

/// The corners of the rule's light: its shadows lie between theirs.
fn light_corners(light: &Light) -> Vec<DVec3> {
    match *light {
        Light::Rect { center, half_u, half_v } => {
            let [c, u, v] = [center, half_u, half_v].map(Vec3::as_dvec3);
            vec![c + u + v, c + u - v, c - u + v, c - u - v]
        }
        _ => Vec::new(),
    }
}

/// Where `point` throws its shadow, seen from a light that lies above it.
fn shadow_on_ground(point: DVec3, light: DVec3, up: DVec3, height: f64) -> DVec3 {
    let along = (light.dot(up) - height) / (light.dot(up) - point.dot(up));
    light + (point - light) * along
}

/// The rule's camera for geometry with vertices at `points`, with a picture of `width` × `height` pixels.
///
/// # Errors
/// Geometry that is empty, or whose size or place leaves what f32 resolves.
pub fn framed_camera(points: &[Vec3], up: UpAxis, width: u32, height: u32) -> Result<Camera, FramingError> {
    let bounds = Aabb::from_points(points.iter().copied());
    let extent = Extent::of(bounds)?;
    let light = framed_light(bounds, up)?;
    let towards = up.towards(-30.0, 25.0);
    let [_, up_axis, _] = up.axes();
    let ground = extent.ground_height(up_axis);
    let throw = |point: DVec3| match light.center() {
        LightPoint::At(middle) => shadow_on_ground(point, middle.as_dvec3(), up_axis, ground),
        LightPoint::Towards(_) => point,
    };

    let right = up_axis.cross(towards).normalize();
    let upright = towards.cross(right);
    // A tenth stays free on each side: the outer half of the penumbra falls there.
    let tan_y = f64::from(DEFAULT_FOV_Y_DEG.to_radians() * 0.5).tan() * 0.9;
    let tan_x = tan_y * f64::from(width.max(1)) / f64::from(height.max(1));
    // A point at `a` along an axis of the picture and `c` towards the camera is inside if
    // |a − e| ≤ tan · (d − c), with the eye at `e` and `d`. So d must part the bounds of all points for e.
    let fit = |axis: DVec3, tan: f64| {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for point in points.iter().map(|point| point.as_dvec3()) {
            for local in [point, throw(point)].map(|place| place - extent.center) {
                let (a, c) = (local.dot(axis), local.dot(towards));
                low = low.max(a + tan * c);
                high = high.min(a - tan * c);
            }
        }
        ((low + high) * 0.5, (low - high) / (2.0 * tan))
    };
    let ((x, distance_x), (y, distance_y)) = (fit(right, tan_x), fit(upright, tan_y));
    let distance = distance_x.max(distance_y);
    let target = extent.center + right * x + upright * y;
    Ok(Camera {
        eye: (target + towards * distance).as_vec3(),
        target: target.as_vec3(),
        up: up.direction(),
        fov_y: DEFAULT_FOV_Y_DEG.to_radians(),
        near: default_near(distance as f32),
        far: f32::INFINITY,
        width,
        height,
    })
}

/// The near plane of a camera that looks at something `distance` away: a hundredth of it. Depth is a float
/// and reversed, so a small one costs no precision. 1 if there is no distance, which is a fault of its own.
pub(super) fn default_near(distance: f32) -> f32 {
    if distance > 0.0 { distance * 0.01 } else { 1.0 }
}

/// Gives `setup` what it lacks: `camera` if there is one, else the rule's, and the rule's light if there is
/// none; the ground if both lack. What was added is said in the notes.
///
/// # Errors
/// Geometry that is empty, or whose size or place leaves what f32 resolves.
pub(super) fn complete(
    setup: &mut SceneSetup,
    camera: Option<Camera>,
    up: UpAxis,
) -> Result<(), FramingError> {
    let bounds = setup.scene.bounds();
    // Without the ground, which comes last.
    let vertices = setup.scene.positions().len();
    let mut added = Vec::new();
    if camera.is_none() && setup.lights.is_empty() {
        let flags = ObjectFlags { casts: false, ..Default::default() };
        setup.scene.add(&framed_ground(bounds, up)?, Affine3A::IDENTITY, flags)?;
        added.push("a ground");
    }
    setup.camera = match camera {
        Some(camera) => camera,
        None => {
            added.push("a camera");
            framed_camera(&setup.scene.positions()[..vertices], up, DEFAULT_SIDE, DEFAULT_SIDE)?
        }
    };
    if setup.lights.is_empty() {
        added.push("a light");
        setup.lights.push(framed_light(bounds, up)?);
    }
    if !added.is_empty() {
        let axis = format!("{up:?}").to_lowercase();
        setup.notes.push(format!("{} were chosen by the size of the mesh, with +{axis} up", list(&added)));
    }
    Ok(())
}

/// "a ground, a camera and a light".
fn list(items: &[&str]) -> String {
    match items {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
