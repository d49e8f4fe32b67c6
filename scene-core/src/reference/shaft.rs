//! The shaft from a group of receivers to a light: a few half-spaces that hold all ways between the two.
//!
//! Any half-space that holds all receivers and the light's outline holds the ways between them, so normals may be
//! chosen freely and offsets follow. Good normals are those of planes that touch both (Haines and Wallace, "Shaft
//! culling for efficient ray-traced radiosity", 1991): for a direction e the two planes along e that do.

use glam::{DVec3, Vec3};

use super::outline::LightOutline;
use crate::bvh::HalfSpace;
use crate::geometry::Aabb;
use crate::light::LightPoint;

/// Directions along which planes touch receivers and light.
const DIRECTIONS: usize = 7;

/// Two planes a direction, the tangent plane, the one behind the light and a flat light's own.
const SIDES: usize = 2 * DIRECTIONS + 3;

/// Steps in which a plane is turned until it touches both; it holds both at any step.
const STEPS: usize = 3;

/// 2⁻²³, twice the rounding of f32: corners relative to a ray's origin are rounded by less than 2 u of the largest
/// coordinate, across any plane.
const ROUNDING: f64 = 1.0 / (1_u32 << 23) as f64;

/// Half-spaces that together hold every way from some receivers to a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightShaft {
    sides: [HalfSpace; SIDES],
    count: usize,
}

fn farthest(points: impl Iterator<Item = DVec3>, normal: DVec3) -> (f64, DVec3) {
    points.fold((f64::NEG_INFINITY, DVec3::ZERO), |best, point| {
        let height = normal.dot(point);
        if height > best.0 { (height, point) } else { best }
    })
}

impl LightShaft {
    /// The shaft from `origins` (of shadow rays) to the light. `normal` is that of the first receiver's surface;
    /// `magnitude` is the largest coordinate of the scene.
    pub(super) fn new(origins: &[Vec3], normal: Vec3, light: &LightOutline, magnitude: f32) -> Self {
        let bounds = Aabb::from_points(origins.iter().copied());
        let down = -normal.as_dvec3();
        let (offset, _) = farthest(origins.iter().map(|origin| origin.as_dvec3()), down);
        Self::between(&bounds, HalfSpace { normal: down, offset }, light, magnitude)
    }

    /// The shaft from all origins in `bounds` that `floor` holds as well, to the light. What lies below the floor of
    /// surfaces that are seen from above is not in it.
    pub(crate) fn between(bounds: &Aabb, floor: HalfSpace, light: &LightOutline, magnitude: f32) -> Self {
        let largest = f64::from(bounds.magnitude().max(magnitude));
        let corners = bounds.corners().map(|corner| corner.as_dvec3());
        let is_distant = matches!(light.points()[0], LightPoint::Towards(_));
        let points = || {
            light.points().iter().map(|point| match *point {
                LightPoint::At(place) => place.as_dvec3(),
                LightPoint::Towards(direction) => direction.as_dvec3(),
            })
        };
        let middle = points().sum::<DVec3>() / light.points().len() as f64;
        let towards = |light: DVec3, from: DVec3| if is_distant { light } else { light - from };
        let axis = towards(middle, bounds.center().as_dvec3());

        let mut shaft = Self { sides: [HalfSpace { normal: DVec3::ZERO, offset: 0.0 }; SIDES], count: 0 };
        let mut add = |normal: DVec3, of_receivers: f64| {
            let (of_light, _) = farthest(points(), normal);
            // What is distant is held by half-spaces that all its directions lead into. The outline's margin is
            // far above the rounding of the product.
            let offset = if is_distant { of_receivers } else { of_receivers.max(of_light) };
            if (!is_distant || of_light <= 1e-9) && normal.is_finite() && shaft.count < SIDES {
                shaft.sides[shaft.count] = HalfSpace { normal, offset: offset + largest * ROUNDING };
                shaft.count += 1;
            }
        };
        add(floor.normal, floor.offset);
        if !is_distant {
            let along = axis.normalize_or_zero();
            add(along, farthest(corners.into_iter(), along).0);
            // A flat light's own plane keeps out what it hangs from. The first points are corners of its outline in
            // their order, whatever its kind.
            let [a, b, c] = [0, 1, 2].map(|i| points().nth(i).unwrap_or(middle));
            let across = (b - a).cross(c - a).normalize_or_zero();
            let behind = if across.dot(axis) < 0.0 { -across } else { across };
            if behind != DVec3::ZERO {
                add(behind, farthest(corners.into_iter(), behind).0);
            }
        }
        let mut edges = points();
        let edge = edges.nth(1).unwrap_or(middle) - points().next().unwrap_or(middle);
        let across = edge.reject_from(axis).normalize_or_zero();
        let upright = axis.cross(across).normalize_or_zero();
        let directions = [across, upright, across + upright, across - upright, DVec3::X, DVec3::Y, DVec3::Z];
        for along in directions {
            for side in [along, -along] {
                let mut normal = side.cross(axis).normalize_or_zero();
                for _ in 0..STEPS {
                    let (_, from) = farthest(corners.into_iter(), normal);
                    let (_, to) = farthest(points(), normal);
                    normal = side.cross(towards(to, from)).normalize_or_zero();
                }
                if normal != DVec3::ZERO {
                    add(normal, farthest(corners.into_iter(), normal).0);
                }
            }
        }
        shaft
    }

    pub(crate) fn sides(&self) -> &[HalfSpace] {
        &self.sides[..self.count]
    }
}
