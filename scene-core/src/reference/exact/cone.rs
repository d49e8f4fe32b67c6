//! The cone from a point over a flat light, and triangles cut to it.
//!
//! The light's plane has coordinates (a, b) in which a rect is the square [−1, 1]². A point p of space has the homogeneous
//! ones (A, B, w), linear in p − apex, with (A/w, B/w) the place on the light that p hides from the apex, w = 0
//! at the apex and w = depth on the light's plane. In them the cone's sides and the two ends are planes, so triangles
//! are cut before anything is divided, and a corner behind the apex needs no care.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, Vec3};

use super::union_area::UnionArea;
use crate::Light;
use crate::geometry::Aabb;

/// Sides of the polygon that stands for a disk.
const DISK_SIDES: usize = 256;

/// The light's outline in its own coordinates.
#[derive(Clone, Debug)]
pub(super) struct Outline {
    center: DVec3,
    axes: [DVec3; 2],
    /// Lengths along `axes` in these, as vectors: their products with an offset in the plane are (a, b).
    duals: [DVec3; 2],
    normal: DVec3,
    /// Half the side of a square around the outline.
    reach: f64,
    /// Sides beyond those of the square: unit normals outwards, all `apothem` from the middle.
    sides: Vec<DVec2>,
    apothem: f64,
    polygon: Vec<DVec2>,
}

impl Outline {
    /// The outline of a flat light: a rect's own, and for a disk a regular polygon of 256 sides and the same area.
    /// `None` for other kinds and for lights without area.
    pub(super) fn new(light: &Light) -> Option<Self> {
        let (center, axes, sides) = match *light {
            Light::Rect { center, half_u, half_v } => (center, [half_u.as_dvec3(), half_v.as_dvec3()], 0),
            Light::Disk { center, normal, radius } => {
                let (u, v) = normal.as_dvec3().try_normalize()?.any_orthonormal_pair();
                (center, [u, v].map(|axis| axis * f64::from(radius)), DISK_SIDES)
            }
            _ => return None,
        };
        let [u, v] = axes;
        let normal = u.cross(v);
        let scale = normal.length_squared();
        if !(scale > 0.0 && scale.is_finite() && center.is_finite()) {
            return None;
        }
        let duals = [v.cross(normal) / scale, normal.cross(u) / scale];
        let polygon: Vec<DVec2>;
        let (reach, apothem, mut normals) = (1.0, 1.0, Vec::new());
        let center = center.as_dvec3();
        if sides == 0 {
            polygon = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(DVec2::from).into();
            return Some(Self { center, axes, duals, normal, reach, sides: normals, apothem, polygon });
        }
        // n triangles of area r²/2·sin(2π/n) add up to π.
        let half_angle = PI / sides as f64;
        let circumradius = (half_angle / (half_angle.sin() * half_angle.cos())).sqrt();
        let direction = |i: f64| DVec2::from_angle(TAU * i / sides as f64);
        normals.extend((0..sides).map(|i| direction(i as f64 + 0.5)));
        polygon = (0..sides).map(|i| circumradius * direction(i as f64)).collect();
        let apothem = circumradius * half_angle.cos();
        Some(Self { center, axes, duals, normal, reach: circumradius, sides: normals, apothem, polygon })
    }
}

/// A linear function of the homogeneous coordinates, at least 0 inside.
#[derive(Clone, Copy, Debug)]
struct Side {
    gradient: DVec3,
    offset: f64,
}

impl Side {
    fn height(&self, homogeneous: DVec3) -> f64 {
        self.gradient.dot(homogeneous) + self.offset
    }
}

/// The cone from an apex over the part of an outline that lies above the apex's surface.
#[derive(Debug)]
pub(super) struct Cone<'a> {
    outline: &'a Outline,
    apex: DVec3,
    /// Products with p − apex are (A, B, w).
    rows: [DVec3; 3],
    /// The square around the outline, the light's plane, the tangent plane.
    sides: [Side; 6],
    /// Area of the outline above the tangent plane, in (a, b).
    pub(super) seen_area: f64,
}

impl<'a> Cone<'a> {
    /// `position` and unit `normal` are those of the surface, `apex` is where its shadow rays start.
    ///
    /// From a point on the light's own plane it is seen edge-on; such an apex is moved off the plane by 2⁻³⁰
    /// of its distance and the light's size together, which leaves 22 bits to the coordinates.
    pub(super) fn new(outline: &'a Outline, apex: Vec3, position: Vec3, normal: Vec3) -> Self {
        let mut apex = apex.as_dvec3();
        let unit = outline.normal.normalize();
        let size = outline.center.distance(apex) + outline.axes[0].length() + outline.axes[1].length();
        let clearance = size * 2f64.powi(-30);
        if (outline.center - apex).dot(unit).abs() < clearance {
            apex = outline.center + (apex - outline.center).reject_from_normalized(unit) - unit * clearance;
        }
        let to_center = outline.center - apex;
        // Towards the light, whichever of its sides is seen. Not made a unit vector: for a light square to an axis
        // w and depth are then the very same number for a triangle in its plane.
        let facing = if to_center.dot(outline.normal) < 0.0 { -outline.normal } else { outline.normal };
        let depth = to_center.dot(facing);
        let row = |dual: DVec3| dual * depth - facing * to_center.dot(dual);
        let rows = [row(outline.duals[0]), row(outline.duals[1]), facing];

        let normal = normal.as_dvec3();
        let slopes = DVec2::new(normal.dot(outline.axes[0]), normal.dot(outline.axes[1]));
        let above = normal.dot(outline.center - position.as_dvec3());
        let reach = outline.reach;
        let side = |a, b, w| Side { gradient: DVec3::new(a, b, w), offset: 0.0 };
        let sides = [
            side(1.0, 0.0, reach),
            side(-1.0, 0.0, reach),
            side(0.0, 1.0, reach),
            side(0.0, -1.0, reach),
            Side { gradient: DVec3::NEG_Z, offset: depth },
            side(slopes.x, slopes.y, above),
        ];
        let seen = clip(&outline.polygon, |p| slopes.dot(p) + above, |a, b, t| a.lerp(b, t));
        let seen_area =
            0.5 * (0..seen.len()).map(|i| seen[i].perp_dot(seen[(i + 1) % seen.len()])).sum::<f64>();
        Self { outline, apex, rows, sides, seen_area: seen_area.abs() }
    }

    /// Area of the whole outline.
    pub(super) fn area(&self) -> f64 {
        if self.outline.sides.is_empty() { 4.0 } else { PI }
    }

    /// Whether the box may reach into the cone: it is not wholly beyond one of its sides.
    pub(super) fn may_meet(&self, bounds: Aabb) -> bool {
        let (min, max) = (bounds.min.as_dvec3() - self.apex, bounds.max.as_dvec3() - self.apex);
        self.sides.iter().all(|side| {
            let [a, b, w] = self.rows;
            let gradient = a * side.gradient.x + b * side.gradient.y + w * side.gradient.z;
            (gradient * min).max(gradient * max).element_sum() + side.offset >= 0.0
        })
    }

    /// Adds what the triangle hides of the outline, as a polygon in (a, b), to `hidden`.
    pub(super) fn add_shadow(&self, corners: [Vec3; 3], hidden: &mut UnionArea) {
        let [a, b, w] = self.rows;
        let mut polygon: Vec<DVec3> = corners
            .iter()
            .map(|c| c.as_dvec3() - self.apex)
            .map(|c| DVec3::new(a.dot(c), b.dot(c), w.dot(c)))
            .collect();
        for side in &self.sides {
            let heights = polygon.iter().map(|&p| side.height(p));
            let (lowest, highest) =
                heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            // Of no area inside: a triangle in the light's own plane lies before nothing.
            if highest <= 0.0 {
                return;
            }
            if lowest < 0.0 {
                polygon = clip(&polygon, |p| side.height(p), |a, b, t| a.lerp(b, t));
            }
        }
        // Only the apex itself has no place on the light; a triangle through it is seen edge-on.
        if polygon.iter().any(|p| p.z <= 0.0) {
            return;
        }
        let mut places: Vec<DVec2> = polygon.iter().map(|p| p.truncate() / p.z).collect();
        let outline = self.outline;
        let inside_circle = places.iter().all(|p| p.length() <= outline.apothem);
        if !inside_circle {
            for normal in &outline.sides {
                if places.iter().any(|p| normal.dot(*p) > outline.apothem) {
                    places = clip(&places, |p| outline.apothem - normal.dot(p), |a, b, t| a.lerp(b, t));
                }
            }
        }
        hidden.add(places);
    }
}

/// The part of a convex polygon where `height`, linear over it, is at least 0.
fn clip<P: Copy>(polygon: &[P], height: impl Fn(P) -> f64, lerp: impl Fn(P, P, f64) -> P) -> Vec<P> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (ha, hb) = (height(a), height(b));
        if ha >= 0.0 {
            kept.push(a);
        }
        if (ha > 0.0 && hb < 0.0) || (ha < 0.0 && hb > 0.0) {
            kept.push(lerp(a, b, ha / (ha - hb)));
        }
    }
    kept
}
