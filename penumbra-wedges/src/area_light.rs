//! The light as wedges need it: a convex set that edges are separated from, and a plane that they are projected on.

use glam::{DMat3, DVec2, DVec3, Vec3};
use scene_core::Light;
use scene_core::light::LightPoint;

/// The convex set that a light fills.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightShape {
    /// A parallelogram, by its middle and the ways from there to the middles of two sides.
    Rect {
        /// Middle.
        center: DVec3,
        /// Half axes.
        half: [DVec3; 2],
    },
    /// A disk, by its middle and two perpendicular radii.
    Disk {
        /// Middle.
        center: DVec3,
        /// Radii.
        half: [DVec3; 2],
    },
    /// A ball.
    Ball {
        /// Middle.
        center: DVec3,
        /// Radius.
        radius: f64,
    },
    /// Directions towards a light at infinity.
    Cone {
        /// The middle one, of unit length.
        axis: DVec3,
        /// Half the opening angle, in radians.
        angle: f64,
    },
}

/// An extended light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaLight {
    /// What it fills.
    pub shape: LightShape,
    /// As it was given.
    pub light: Light,
}

/// The plane on which what lies between a receiver and the light is drawn: that of a flat light, that of the circle in
/// which a ball is seen, or, for a light at infinity, any across its middle direction.
///
/// A point at `d` from the receiver has the homogeneous coordinates (U, V, W) = `project(d)`: (U/W, V/W) is where the ray
/// through it meets the plane, in which the light is the square [−1, 1]² or the unit disk; W is 0 at the receiver and 1 on
/// the plane of a light at a place, so that what blocks has 0 < W < 1.
#[derive(Clone, Copy, Debug)]
pub struct LightFrame {
    /// Rows of the matrix.
    rows: [DVec3; 3],
    /// From the receiver to the middle of the light on the plane.
    pub middle: DVec3,
    /// From there to (1, 0) and to (0, 1).
    pub half: [DVec3; 2],
    /// Whether W = 1 is the end of what can block.
    pub is_finite: bool,
    /// −1 if the coordinates are left-handed seen from the receiver: orientations on the plane are turned round.
    pub turn: i32,
    /// What of the plane is light, and with what weight.
    pub outline: Outline,
}

/// What of the plane is light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outline {
    /// The square [−1, 1]², by area.
    Square,
    /// The unit disk, by area.
    Disk,
    /// The unit disk, by the solid angle under which the receiver sees it; the tangent of the angle between middle and rim.
    Cap(f64),
}

/// The largest share of a hemisphere's half angle, as a sine, under which a round light is projected on a plane: closer
/// to 90° its rim lies at infinity. At 0.999 the tangent is 22.
pub(crate) const LARGEST_SIN: f64 = 0.999;

/// The least height of a receiver over a flat light's plane, relative to the distances and half axes that span it. Sums of
/// f64 are off by some 2⁻⁵⁰; 2⁻³⁰ leaves twenty bits for what is projected.
const LEAST_HEIGHT: f64 = 1.0 / 1_073_741_824.0;

impl AreaLight {
    /// `light`, if it has an extent.
    pub fn new(light: &Light) -> Option<Self> {
        if !light.is_extended() {
            return None;
        }
        let shape = match *light {
            Light::Rect { center, half_u, half_v } => {
                LightShape::Rect { center: center.as_dvec3(), half: [half_u.as_dvec3(), half_v.as_dvec3()] }
            }
            Light::Disk { center, normal, radius } => {
                let (x, y) = normal.as_dvec3().normalize_or(DVec3::Y).any_orthonormal_pair();
                let half = [x, y].map(|axis| axis * f64::from(radius));
                LightShape::Disk { center: center.as_dvec3(), half }
            }
            Light::Sphere { center, radius } => {
                LightShape::Ball { center: center.as_dvec3(), radius: f64::from(radius) }
            }
            Light::Directional { direction, angular_radius } => LightShape::Cone {
                axis: (-direction.as_dvec3()).normalize_or(DVec3::Y),
                angle: f64::from(angular_radius),
            },
            Light::Point { .. } | Light::Spot { .. } => return None,
        };
        Some(Self { shape, light: *light })
    }

    /// How far the light reaches beyond its middle along `n`, in units of n's length; for a light at infinity in units of
    /// its distance.
    #[inline]
    pub fn reach(&self, n: DVec3) -> f64 {
        match self.shape {
            LightShape::Rect { half: [x, y], .. } => n.dot(x).abs() + n.dot(y).abs(),
            LightShape::Disk { half: [x, y], .. } => n.dot(x).hypot(n.dot(y)),
            LightShape::Ball { radius, .. } => radius * n.length(),
            LightShape::Cone { angle, .. } => angle.min(std::f64::consts::FRAC_PI_2).sin() * n.length(),
        }
    }

    /// The middle as seen from `origin`: the way to it, or the direction towards it.
    #[inline]
    pub fn from_point(&self, origin: DVec3) -> DVec3 {
        match self.shape {
            LightShape::Rect { center, .. }
            | LightShape::Disk { center, .. }
            | LightShape::Ball { center, .. } => center - origin,
            LightShape::Cone { axis, .. } => axis,
        }
    }

    /// The light's middle as shadow rays are aimed at it.
    pub fn center(&self) -> LightPoint {
        match self.shape {
            LightShape::Rect { center, .. }
            | LightShape::Disk { center, .. }
            | LightShape::Ball { center, .. } => LightPoint::At(center.as_vec3()),
            LightShape::Cone { axis, .. } => LightPoint::Towards(axis.as_vec3()),
        }
    }

    /// The box around a light at a place; `None` for one at infinity.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        let (LightShape::Rect { center, .. }
        | LightShape::Disk { center, .. }
        | LightShape::Ball { center, .. }) = self.shape
        else {
            return None;
        };
        let reach = DVec3::from_array(DVec3::AXES.map(|axis| self.reach(axis)));
        Some([center - reach, center + reach])
    }

    /// Whether a plane through `through` with the normal `n` has all of the light below it, or touches it: by the sign
    /// of n·(light − through), up to `slack` relative to the terms' sizes.
    #[inline]
    pub fn is_below(&self, n: DVec3, through: DVec3, slack: f64) -> bool {
        let way = self.from_point(through);
        let size = n.length() * way.length();
        n.dot(way) + self.reach(n) <= slack * size
    }

    /// The plane to draw on as seen from `origin`. `None` where there is none that serves: the origin lies in a flat
    /// light's plane, or in or close to a ball, or the light fills half of the sky.
    #[inline]
    pub fn frame(&self, origin: DVec3) -> Option<LightFrame> {
        let to_middle = self.from_point(origin);
        let (middle, half, outline) = match self.shape {
            LightShape::Rect { half, .. } => (to_middle, half, Outline::Square),
            LightShape::Disk { half, .. } => (to_middle, half, Outline::Disk),
            LightShape::Ball { radius, .. } => {
                let distance = to_middle.length();
                let sin = radius / distance;
                if sin.is_nan() || sin > LARGEST_SIN {
                    return None;
                }
                let cos_squared = 1.0 - sin * sin;
                let (x, y) = (to_middle / distance).any_orthonormal_pair();
                let rim = radius * cos_squared.sqrt();
                (to_middle * cos_squared, [x * rim, y * rim], Outline::Cap(sin / cos_squared.sqrt()))
            }
            LightShape::Cone { axis, angle } => {
                if angle.sin() > LARGEST_SIN || angle >= std::f64::consts::FRAC_PI_2 {
                    return None;
                }
                let (x, y) = axis.any_orthonormal_pair();
                let tan = angle.tan();
                (axis, [x * tan, y * tan], Outline::Cap(tan))
            }
        };
        let is_finite = !matches!(self.shape, LightShape::Cone { .. });
        LightFrame::new(middle, half, is_finite, outline)
    }

    /// The point of the light that is seen at `at` of the frame, from `origin`: what a shadow ray is aimed at.
    #[inline]
    pub fn point(&self, frame: &LightFrame, origin: DVec3, at: DVec2) -> LightPoint {
        let way = frame.middle + frame.half[0] * at.x + frame.half[1] * at.y;
        match self.shape {
            LightShape::Rect { center, half: [x, y] } | LightShape::Disk { center, half: [x, y] } => {
                LightPoint::At((center + x * at.x + y * at.y).as_vec3())
            }
            LightShape::Ball { center, radius } => {
                // The nearer hit with the ball. On the rim both are one, and rounding may leave less than nothing.
                let to_middle = center - origin;
                let (along, squared) = (way.dot(to_middle), way.length_squared());
                let tangent = (to_middle.length() - radius) * (to_middle.length() + radius);
                let root = (along * along - squared * tangent).max(0.0).sqrt();
                LightPoint::At((origin + way * (tangent / (along + root))).as_vec3())
            }
            LightShape::Cone { .. } => LightPoint::Towards(way.normalize().as_vec3()),
        }
    }
}

impl LightFrame {
    fn new(middle: DVec3, half: [DVec3; 2], is_finite: bool, outline: Outline) -> Option<Self> {
        let [x, y] = half;
        let across = x.cross(y);
        let volume = across.dot(middle);
        let is_flat = volume.abs() <= LEAST_HEIGHT * across.length() * middle.length();
        if is_flat || !volume.is_finite() || volume == 0.0 {
            return None;
        }
        // The inverse of the matrix with the columns x, y, middle.
        let rows = [y.cross(middle) / volume, middle.cross(x) / volume, across / volume];
        let turn = if volume > 0.0 { 1 } else { -1 };
        Some(Self { rows, middle, half, is_finite, turn, outline })
    }

    /// Homogeneous coordinates of a point given from the receiver.
    #[inline(always)]
    pub fn project(&self, from_receiver: Vec3) -> DVec3 {
        let d = from_receiver.as_dvec3();
        DVec3::new(self.rows[0].dot(d), self.rows[1].dot(d), self.rows[2].dot(d))
    }

    /// The matrix of [`project`](Self::project).
    pub fn matrix(&self) -> DMat3 {
        DMat3::from_cols(self.rows[0], self.rows[1], self.rows[2]).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIGHTS: [Light; 4] = [
        Light::Rect {
            center: Vec3::new(0.5, 4.0, 1.0),
            half_u: Vec3::new(0.7, 0.1, 0.0),
            half_v: Vec3::new(0.1, 0.0, -0.4),
        },
        Light::Disk { center: Vec3::new(0.5, 4.0, 1.0), normal: Vec3::new(0.2, -1.0, 0.1), radius: 0.8 },
        Light::Sphere { center: Vec3::new(0.5, 4.0, 1.0), radius: 0.8 },
        Light::Directional { direction: Vec3::new(0.5, -4.0, 1.0), angular_radius: 0.1 },
    ];

    #[test]
    fn points_of_the_light_are_where_the_frame_says() {
        let origin = DVec3::new(-1.0, 0.5, 0.25);
        for light in &LIGHTS {
            let light = AreaLight::new(light).unwrap();
            let frame = light.frame(origin).unwrap();
            for at in [DVec2::ZERO, DVec2::new(0.5, -0.7), DVec2::new(-0.6, 0.1)] {
                let way = match light.point(&frame, origin, at) {
                    LightPoint::At(point) => point - origin.as_vec3(),
                    LightPoint::Towards(direction) => direction,
                };
                let [u, v, w] = frame.project(way).to_array();
                assert!((u / w - at.x).abs() < 1e-5 && (v / w - at.y).abs() < 1e-5, "{light:?}: {u} {v} {w}");
                if let LightShape::Ball { center, radius } = light.shape {
                    let distance = (origin + way.as_dvec3()).distance(center);
                    assert!((distance - radius).abs() < 1e-5 && w < 1.0);
                }
            }
        }
    }

    #[test]
    fn planes_that_touch_the_light_have_it_below() {
        for light in &LIGHTS {
            let light = AreaLight::new(light).unwrap();
            for n in [DVec3::new(0.3, 1.0, -0.2), DVec3::new(-1.0, 0.2, 0.5)] {
                if light.bounds().is_some() {
                    let top = light.from_point(DVec3::ZERO) + n * (light.reach(n) / n.length_squared());
                    assert!(
                        light.is_below(n, top + n * 1e-6, 0.0) && !light.is_below(n, top - n * 1e-6, 0.0)
                    );
                } else {
                    let axis = light.from_point(DVec3::ZERO);
                    assert!(light.is_below(-axis, top_of(n), 0.0) && !light.is_below(axis, top_of(n), 0.0));
                }
            }
        }
        fn top_of(n: DVec3) -> DVec3 {
            n * 9.0
        }
    }

    #[test]
    fn where_no_plane_serves_there_is_none() {
        let frame = |light: usize, origin| AreaLight::new(&LIGHTS[light]).unwrap().frame(origin);
        let Light::Rect { center, half_u, .. } = LIGHTS[0] else { unreachable!() };
        assert!(frame(0, center.as_dvec3() + half_u.as_dvec3() * 3.0).is_none());
        assert!(frame(2, DVec3::new(0.5, 4.5, 1.0)).is_none());
        assert!(frame(2, DVec3::new(0.5, 4.8, 1.0)).is_none());
        assert!(AreaLight::new(&Light::Point { position: Vec3::ZERO }).is_none());
    }
}
