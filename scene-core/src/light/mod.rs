//! Light kinds: what a point can see of each, and how to sample that.

mod hull;
pub mod sampling;

use glam::Vec3;
use thiserror::Error;

pub use hull::LightHull;

/// Why a light was refused. Field names are those of a scene file.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LightError {
    /// A component is NaN or infinite.
    #[error("light.{field} is not finite")]
    NotFinite {
        /// The field.
        field: &'static str,
    },
    /// A direction or normal has no length.
    #[error("light.{field} is zero: it must point somewhere")]
    NoDirection {
        /// The field.
        field: &'static str,
    },
    /// A size is zero or negative. A light without extent is a `point`, `spot` or `directional` one.
    #[error("light.{field} is {value}: it must be above 0 (a light without extent is kind = \"point\")")]
    NoExtent {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f32,
    },
    /// A rectangle's half axes span no area.
    #[error("light.half_u and light.half_v span no area: they must be non-zero and not parallel")]
    NoArea,
    /// An angle leaves its range.
    #[error("light.{field} is {value_deg}°: it must lie in {range}")]
    Angle {
        /// The field.
        field: &'static str,
        /// Its value in degrees.
        value_deg: f32,
        /// The range, for people.
        range: &'static str,
    },
}

/// A light. Positions and directions are in world space, lengths in scene units, angles in radians.
///
/// | kind | V is the fraction of … |
/// | --- | --- |
/// | `Rect`, `Disk` | its area, uniform; both sides count |
/// | `Sphere` | the solid angle of the sphere |
/// | `Directional` | the solid angle of the cone of its angular radius |
/// | `Point`, `Spot` | 0 or 1 |
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Parallel light, the sun.
    Directional {
        /// The way light travels; any length.
        direction: Vec3,
        /// Half the angle under which the light is seen; 0 for a hard shadow.
        angular_radius: f32,
    },
    /// A point that shines everywhere.
    Point {
        /// Where it is.
        position: Vec3,
    },
    /// A point that shines into a cone.
    Spot {
        /// Where it is.
        position: Vec3,
        /// The cone's axis, away from the light; any length.
        direction: Vec3,
        /// Half opening angle, outside of which no light arrives (V = 0).
        outer: f32,
        /// Half angle up to which the light is full. Falloff between is the renderer's; V does not hold it.
        inner: f32,
    },
    /// A ball.
    Sphere {
        /// Its middle.
        center: Vec3,
        /// Its radius.
        radius: f32,
    },
    /// A parallelogram, usually a rectangle.
    Rect {
        /// Its middle.
        center: Vec3,
        /// From the middle to the middle of one side.
        half_u: Vec3,
        /// From the middle to the middle of the next side.
        half_v: Vec3,
    },
    /// A flat disk.
    Disk {
        /// Its middle.
        center: Vec3,
        /// Perpendicular to it; any length.
        normal: Vec3,
        /// Its radius.
        radius: f32,
    },
}

/// A point of a light, at a place or at infinity: what a shadow ray is aimed at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightPoint {
    /// A place in world space; only what lies before it can block it.
    At(Vec3),
    /// A unit direction towards the light; everything along it can block.
    Towards(Vec3),
}

impl LightPoint {
    /// The ray from `origin`: a direction and the ray parameter up to which hits block (1 or infinity).
    #[inline]
    pub fn ray_from(self, origin: Vec3) -> (Vec3, f32) {
        match self {
            Self::At(point) => (point - origin, 1.0),
            Self::Towards(direction) => (direction, f32::INFINITY),
        }
    }

    /// The point as a light of its own, which shines everywhere.
    pub fn as_light(self) -> Light {
        match self {
            Self::At(position) => Light::Point { position },
            Self::Towards(direction) => Light::Directional { direction: -direction, angular_radius: 0.0 },
        }
    }
}

impl Light {
    /// The light as one of its points, without extent; a spot keeps its cone.
    pub fn reduced_to(&self, point: LightPoint) -> Self {
        if let Self::Spot { .. } = self { *self } else { point.as_light() }
    }

    /// The kind's name, as in a scene file.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Directional { .. } => "directional",
            Self::Point { .. } => "point",
            Self::Spot { .. } => "spot",
            Self::Sphere { .. } => "sphere",
            Self::Rect { .. } => "rect",
            Self::Disk { .. } => "disk",
        }
    }

    /// Whether the light has an extent, so that it throws penumbrae.
    pub fn is_extended(&self) -> bool {
        match self {
            Self::Directional { angular_radius, .. } => *angular_radius > 0.0,
            Self::Point { .. } | Self::Spot { .. } => false,
            Self::Sphere { .. } | Self::Rect { .. } | Self::Disk { .. } => true,
        }
    }

    /// The middle of the light: what hard techniques take for all of it.
    pub fn center(&self) -> LightPoint {
        match *self {
            Self::Directional { direction, .. } => LightPoint::Towards((-direction).normalize_or(Vec3::Y)),
            Self::Point { position } | Self::Spot { position, .. } => LightPoint::At(position),
            Self::Sphere { center, .. } | Self::Rect { center, .. } | Self::Disk { center, .. } => {
                LightPoint::At(center)
            }
        }
    }

    /// Whether light is sent from the light's middle towards `point` at all: everywhere but outside the
    /// cone of a spot.
    pub fn reaches(&self, point: Vec3) -> bool {
        match *self {
            Self::Spot { position, direction, outer, .. } => {
                let to_point = point - position;
                to_point.dot(direction) >= outer.cos() * to_point.length() * direction.length()
            }
            _ => true,
        }
    }

    /// Whether the whole light lies above the plane through `point` with the unit normal `normal`.
    pub fn is_above_plane(&self, point: Vec3, normal: Vec3) -> bool {
        let height = |p: Vec3| normal.dot(p - point);
        match *self {
            Self::Directional { direction, angular_radius } => {
                let elevation = normal.dot((-direction).normalize_or_zero()).clamp(-1.0, 1.0).asin();
                elevation > angular_radius
            }
            Self::Point { position } | Self::Spot { position, .. } => height(position) > 0.0,
            Self::Sphere { center, radius } => height(center) > radius,
            Self::Rect { center, half_u, half_v } => {
                height(center) > normal.dot(half_u).abs() + normal.dot(half_v).abs()
            }
            Self::Disk { center, normal: axis, radius } => {
                let cos = normal.dot(axis.normalize_or_zero()).clamp(-1.0, 1.0);
                height(center) > radius * (1.0 - cos * cos).sqrt()
            }
        }
    }

    /// Checks that every technique can work with this light.
    ///
    /// # Errors
    /// The first fault, by its field's name in a scene file.
    pub fn validate(&self) -> Result<(), LightError> {
        let finite =
            |field, v: Vec3| if v.is_finite() { Ok(()) } else { Err(LightError::NotFinite { field }) };
        let direction = |field, v: Vec3| {
            finite(field, v)?;
            v.try_normalize().map(|_| ()).ok_or(LightError::NoDirection { field })
        };
        let extent = |field, value: f32| match value {
            v if !v.is_finite() => Err(LightError::NotFinite { field }),
            v if v <= 0.0 => Err(LightError::NoExtent { field, value }),
            _ => Ok(()),
        };
        match *self {
            Self::Directional { direction: d, angular_radius } => {
                direction("direction", d)?;
                let value_deg = angular_radius.to_degrees();
                if !(0.0..=90.0).contains(&value_deg) {
                    let range = "0° to 90°";
                    return Err(LightError::Angle { field: "angular_radius_deg", value_deg, range });
                }
            }
            Self::Point { position } => finite("position", position)?,
            Self::Spot { position, direction: d, outer, inner } => {
                finite("position", position)?;
                direction("direction", d)?;
                let (outer, inner) = (outer.to_degrees(), inner.to_degrees());
                if !(outer > 0.0 && outer <= 90.0) {
                    let range = "above 0° to 90°";
                    return Err(LightError::Angle { field: "outer_deg", value_deg: outer, range });
                }
                if !(inner >= 0.0 && inner <= outer) {
                    let range = "0° to outer_deg";
                    return Err(LightError::Angle { field: "inner_deg", value_deg: inner, range });
                }
            }
            Self::Sphere { center, radius } => {
                finite("center", center)?;
                extent("radius", radius)?;
            }
            Self::Rect { center, half_u, half_v } => {
                finite("center", center)?;
                finite("half_u", half_u)?;
                finite("half_v", half_v)?;
                // The cross product of unit vectors, so that the size does not matter; below 1e-6 the two
                // are parallel within f32.
                let cross = half_u.normalize_or_zero().cross(half_v.normalize_or_zero());
                if cross.length() <= 1e-6 {
                    return Err(LightError::NoArea);
                }
            }
            Self::Disk { center, normal, radius } => {
                finite("center", center)?;
                direction("normal", normal)?;
                extent("radius", radius)?;
            }
        }
        Ok(())
    }
}
