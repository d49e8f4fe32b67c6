//! The cone of lines from a receiver to the points of a light, in coordinates of the light's own.
//!
//! A point q = p + a·u + b·v + t·w, with w from the receiver p to the light's centre and u, v the light's half axes,
//! lies on the line to the light's point (a/t, b/t): of a rect where both are within ±1, of a round light where they
//! are in the unit circle. t is the share of the way to the light.
//!
//! A sphere's silhouette is the circle where the tangents from p touch, brought to the centre's distance; the sun's is
//! drawn at distance 1, and t is a distance.

use glam::{Mat3, Vec2, Vec3};
use scene_core::Light;

/// The cone over a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightCone {
    /// Half axes, and to the centre, from the receiver.
    pub u: Vec3,
    /// The other half axis.
    pub v: Vec3,
    /// To the light's centre.
    pub w: Vec3,
    /// Whether the light is round.
    pub is_round: bool,
    height: f32,
    receiver: Vec3,
    light_from_world: Mat3,
}

impl LightCone {
    /// Below this volume of unit axes they lie in one plane within the rounding of positions: the light is seen edge-on.
    pub const FLATTEST: f32 = 1.0 / 1_048_576.0;

    /// The cone from `receiver`; `None` for a light without extent, a receiver within a sphere, and where the cone is
    /// so flat that it has no inside.
    pub fn new(light: &Light, receiver: Vec3) -> Option<Self> {
        let LightAxes { u, v, w, is_round, height } = LightAxes::new(light, receiver)?;
        // By rows of the inverse; lengths may be of any size, so the product of three is not taken.
        let unit = [u, v, w].map(|axis| axis.normalize_or_zero());
        let volume = unit[0].cross(unit[1]).dot(unit[2]);
        if volume.is_nan() || volume.abs() < Self::FLATTEST {
            return None;
        }
        let row = |a: Vec3, b: Vec3, length: f32| a.cross(b) / volume / length;
        let rows = Mat3::from_cols(
            row(unit[1], unit[2], u.length()),
            row(unit[2], unit[0], v.length()),
            row(unit[0], unit[1], w.length()),
        );
        let light_from_world = rows.transpose();
        light_from_world.is_finite().then_some(Self { u, v, w, is_round, height, receiver, light_from_world })
    }

    /// 1 − cos of the angular radius where V is a share of solid angle; 0 where it is one of area.
    #[inline]
    pub fn height(&self) -> f32 {
        self.height
    }

    /// (a, b, t) of a point in world space.
    #[inline]
    pub fn locate(&self, point: Vec3) -> Vec3 {
        self.light_from_world * (point - self.receiver)
    }

    /// What the vector from the receiver to a point is multiplied with for t alone.
    #[inline]
    pub fn share_axis(&self) -> Vec3 {
        self.light_from_world.row(2)
    }

    /// t alone of a point in world space.
    #[inline]
    pub fn share_of(&self, point: Vec3) -> f32 {
        self.share_axis().dot(point - self.receiver)
    }

    /// The matrix that turns a point, counted from the receiver, into (a, b, t).
    #[inline]
    pub fn light_from_receiver(&self) -> Mat3 {
        self.light_from_world
    }

    /// Whether a point with these coordinates lies in the cone, on the light's side of the receiver.
    #[inline]
    pub fn contains(&self, located: Vec3) -> bool {
        let Vec3 { x: a, y: b, z: t } = located;
        t > 0.0 && if self.is_round { a * a + b * b <= t * t } else { a.abs() <= t && b.abs() <= t }
    }

    /// The light's point (a, b) that a point of the square [−1, 1]², or of the unit disk where the light is round,
    /// stands for, so that equal areas are equal shares of V. With r² uniform a direction's angle from the axis has
    /// cos = 1 − r²·height, and lies at tan / tan(radius) of the circle.
    #[inline]
    pub fn share(&self, point: Vec2) -> Vec2 {
        if self.height == 0.0 {
            return point;
        }
        // tan² = h·(2 − h)/(1 − h)² of h = r²·height, over the same for r = 1.
        let lower = point.length_squared() * self.height;
        let (inner, outer) = (1.0 - lower, 1.0 - self.height);
        let ratio = (2.0 - lower) / (2.0 - self.height) * (outer / inner) * (outer / inner);
        point * ratio.max(0.0).sqrt()
    }

    /// From the receiver to the light's point (a, b).
    #[inline]
    pub fn direction(&self, point: Vec2) -> Vec3 {
        self.w + self.u * point.x + self.v * point.y
    }
}

/// A light's half axes as a receiver sees them, and the way to its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightAxes {
    /// Half axis.
    pub u: Vec3,
    /// The other half axis.
    pub v: Vec3,
    /// From the receiver to the light's centre.
    pub w: Vec3,
    /// Whether the light is round.
    pub is_round: bool,
    /// [`LightCone::height`].
    pub height: f32,
}

impl LightAxes {
    /// The axes as seen from `receiver`; `None` for a light without extent or direction, and a receiver within a sphere.
    pub fn new(light: &Light, receiver: Vec3) -> Option<Self> {
        let (u, v, w, is_round, height) = match *light {
            Light::Point { .. } | Light::Spot { .. } => return None,
            Light::Directional { direction, angular_radius } => {
                let w = (-direction).try_normalize()?;
                let (u, v) = w.any_orthonormal_pair();
                // A cone of a right angle or more has no circle: what is left out lies at the horizon.
                let radius = angular_radius.min(1.5).tan();
                (u * radius, v * radius, w, true, one_less_cos(angular_radius))
            }
            Light::Sphere { center, radius } => {
                let w = center - receiver;
                let distance = w.length();
                if distance <= radius {
                    return None;
                }
                let (u, v) = (w / distance).any_orthonormal_pair();
                let sine = radius / distance;
                let cosine = ((1.0 - sine) * (1.0 + sine)).sqrt();
                let height = sine * sine / (1.0 + cosine);
                let radius = sine / cosine * distance;
                (u * radius, v * radius, w, true, height)
            }
            Light::Rect { center, half_u, half_v } => (half_u, half_v, center - receiver, false, 0.0),
            Light::Disk { center, normal, radius } => {
                let (u, v) = normal.try_normalize()?.any_orthonormal_pair();
                (u * radius, v * radius, center - receiver, true, 0.0)
            }
        };
        Some(Self { u, v, w, is_round, height })
    }
}

/// 1 − cos without cancellation.
fn one_less_cos(angle: f32) -> f32 {
    2.0 * (0.5 * angle).sin().powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_located_where_they_were_put() {
        let receiver = Vec3::new(0.3, -0.2, 0.1);
        let center = Vec3::new(1.0, 5.0, 2.0);
        let lights = [
            Light::Rect { center, half_u: Vec3::new(0.5, 0.1, 0.0), half_v: Vec3::new(0.0, 0.2, 0.7) },
            Light::Disk { center, normal: Vec3::new(0.1, -1.0, 0.2), radius: 0.4 },
            Light::Sphere { center, radius: 0.6 },
            Light::Directional { direction: -center, angular_radius: 0.05 },
        ];
        for light in lights {
            let cone = LightCone::new(&light, receiver).unwrap();
            for (a, b, t) in [(0.5, -0.3, 0.7), (0.0, 0.9, 0.1), (-1.2, 0.0, 0.5)] {
                let point = receiver + cone.direction(Vec2::new(a, b)) * t;
                let located = cone.locate(point);
                assert!(
                    (located - Vec3::new(a * t, b * t, t)).abs().max_element() < 1e-5,
                    "{light:?}: {located}"
                );
                assert_eq!(cone.contains(located), a > -1.0, "{light:?}");
            }
        }
    }

    /// A line to the rim of a sphere's circle touches the sphere.
    #[test]
    fn the_rim_of_a_sphere_is_its_silhouette() {
        let (center, radius) = (Vec3::new(0.0, 3.0, 1.0), 1.2);
        let cone = LightCone::new(&Light::Sphere { center, radius }, Vec3::ZERO).unwrap();
        for angle in [0.0f32, 1.0, 2.5] {
            let direction = cone.direction(Vec2::from_angle(angle)).normalize();
            assert!((direction.cross(center).length() - radius).abs() < 1e-5);
        }
    }

    /// Of a cone's solid angle, the circle at share r² has the share r².
    #[test]
    fn shares_are_of_solid_angle() {
        let sun = Light::Directional { direction: Vec3::NEG_Y, angular_radius: 1.0 };
        let cone = LightCone::new(&sun, Vec3::ZERO).unwrap();
        for r in [0.1f32, 0.5, 0.9, 1.0] {
            let tan = cone.share(Vec2::new(r, 0.0)).x * 1.0f32.tan();
            let solid = (1.0 - 1.0 / (1.0 + tan * tan).sqrt()) / (1.0 - 1.0f32.cos());
            assert!((solid - r * r).abs() < 1e-5, "{r}: {solid}");
        }
    }

    #[test]
    fn what_has_no_inside_has_no_cone() {
        assert!(LightCone::new(&Light::Point { position: Vec3::Y }, Vec3::ZERO).is_none());
        assert!(LightCone::new(&Light::Sphere { center: Vec3::Y, radius: 2.0 }, Vec3::ZERO).is_none());
        let edge_on = Light::Rect { center: Vec3::X, half_u: Vec3::X, half_v: Vec3::Z };
        assert!(LightCone::new(&edge_on, Vec3::ZERO).is_none());
        assert!(LightCone::new(&edge_on, Vec3::NAN).is_none());
    }
}
