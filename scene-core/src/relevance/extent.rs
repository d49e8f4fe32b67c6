//! What a light is to a convex region: the smallest simple convex set that holds all of it.

use glam::DVec3;

use super::HalfSpace;
use crate::Light;
use crate::light::LightPoint;

/// How far directions of a light at infinity may be off, as a sine: sampled directions are rounded to f32, each
/// component by 2⁻²⁴ and some sums before; 2⁻²⁰ is sixteen times that.
const DIRECTION_SLACK: f64 = 1.0 / 1_048_576.0;

/// A convex set that holds a light.
#[derive(Clone, Debug)]
pub(super) enum LightExtent {
    /// The hull of points, grown by `radius`.
    Near { points: Vec<DVec3>, radius: f64 },
    /// Directions within an angle of the unit vector `towards`; `sin` is the angle's sine.
    Far { towards: DVec3, sin: f64 },
}

impl LightExtent {
    /// All of a light.
    pub(super) fn of(light: &Light) -> Self {
        match *light {
            Light::Directional { angular_radius, .. } => {
                Self::far(light.center(), f64::from(angular_radius).sin())
            }
            Light::Sphere { center, radius } => {
                Self::Near { points: vec![center.as_dvec3()], radius: f64::from(radius) }
            }
            Light::Rect { center, half_u, half_v } => {
                let (c, u, v) = (center.as_dvec3(), half_u.as_dvec3(), half_v.as_dvec3());
                Self::Near { points: vec![c - u - v, c + u - v, c + u + v, c - u + v], radius: 0.0 }
            }
            Light::Disk { center, normal, radius } => {
                let (x, y) = normal.as_dvec3().normalize_or(DVec3::Y).any_orthonormal_pair();
                // An octagon around the disk.
                let reach = f64::from(radius) / std::f64::consts::FRAC_PI_8.cos();
                let corner = |i: i32| {
                    let (sin, cos) = (f64::from(i) * std::f64::consts::FRAC_PI_4).sin_cos();
                    center.as_dvec3() + (x * cos + y * sin) * reach
                };
                Self::Near { points: (0..8).map(corner).collect(), radius: 0.0 }
            }
            Light::Point { .. } | Light::Spot { .. } => Self::center(light.center()),
        }
    }

    /// One point of a light.
    pub(super) fn center(point: LightPoint) -> Self {
        match point {
            LightPoint::At(place) => Self::Near { points: vec![place.as_dvec3()], radius: 0.0 },
            LightPoint::Towards(_) => Self::far(point, 0.0),
        }
    }

    fn far(center: LightPoint, sin: f64) -> Self {
        let (LightPoint::At(towards) | LightPoint::Towards(towards)) = center;
        Self::Far { towards: towards.as_dvec3().normalize_or(DVec3::Y), sin: sin + DIRECTION_SLACK }
    }

    /// The largest absolute coordinate; 0 at infinity.
    pub(super) fn magnitude(&self) -> f64 {
        match self {
            Self::Near { points, radius } => {
                points.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max) + radius
            }
            Self::Far { .. } => 0.0,
        }
    }

    /// The largest `normal`·x over the light: −∞ if no way to a light at infinity climbs along the unit vector
    /// `normal`, ∞ if one does.
    pub(super) fn support(&self, normal: DVec3) -> f64 {
        match self {
            Self::Near { points, radius } => {
                points.iter().map(|p| normal.dot(*p)).fold(f64::NEG_INFINITY, f64::max) + radius
            }
            // The tangent planes of `tangents` meet this with equality but for rounding.
            Self::Far { towards, sin } => {
                if normal.dot(*towards) <= -sin + 1e-12 {
                    f64::NEG_INFINITY
                } else {
                    f64::INFINITY
                }
            }
        }
    }

    /// Normals of planes through the edge from `a` to `b` that touch the light.
    pub(super) fn edge_tangents(&self, a: DVec3, b: DVec3, mut found: impl FnMut(DVec3)) {
        let Some(edge) = (b - a).try_normalize() else { return };
        let mut around = |to_light: DVec3, radius: f64| {
            // In the plane across the edge: a line through the origin that touches a circle of `radius`
            // around `across`.
            let across = to_light - edge * to_light.dot(edge);
            let distance = across.length();
            let sin = radius / distance;
            if sin.is_finite() && sin < 1.0 {
                let (ahead, beside) = (across / distance, edge.cross(across / distance));
                let cos = (1.0 - sin * sin).sqrt();
                found(beside * cos - ahead * sin);
                found(-beside * cos - ahead * sin);
            }
        };
        match self {
            Self::Near { points, radius } => points.iter().for_each(|&p| around(p - a, *radius)),
            Self::Far { towards, sin } => around(*towards, *sin),
        }
    }

    /// Normals of planes through an edge of the light and a point.
    pub(super) fn point_tangents(&self, point: DVec3, mut found: impl FnMut(DVec3)) {
        let Self::Near { points, .. } = self else { return };
        if points.len() < 3 {
            return;
        }
        for (i, &a) in points.iter().enumerate() {
            let b = points[(i + 1) % points.len()];
            if let Some(normal) = (b - a).cross(point - a).try_normalize() {
                found(normal);
                found(-normal);
            }
        }
    }
}

/// Half-spaces whose intersection holds every point that the light sends anything to: eight planes around the
/// cone of a spot, none for the others. The cone is widened by 2⁻²⁰ in its cosine, sixteen roundings of
/// [`Light::reaches`].
pub fn reach_of(light: &Light) -> Vec<HalfSpace> {
    let Light::Spot { position, direction, outer, .. } = *light else { return Vec::new() };
    let axis = direction.as_dvec3().normalize_or(DVec3::NEG_Y);
    let cos = (f64::from(outer).cos() - DIRECTION_SLACK).max(-1.0);
    // Beyond a right angle the lit part is not convex: everything may be lit.
    if cos < 0.0 {
        return Vec::new();
    }
    let sin = (1.0 - cos * cos).sqrt();
    let (x, y) = axis.any_orthonormal_pair();
    let apex = position.as_dvec3();
    (0..8)
        .map(|i| {
            let (s, c) = (f64::from(i) * std::f64::consts::FRAC_PI_4).sin_cos();
            let normal = (x * c + y * s) * cos - axis * sin;
            HalfSpace { normal, offset: normal.dot(apex) }
        })
        .collect()
}
