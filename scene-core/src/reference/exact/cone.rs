//! The cone from a point over a flat light, and triangles projected onto it.
//!
//! The light's plane has coordinates (a, b) in which a rect is the square [−1, 1]². A point p of space has the homogeneous
//! ones (A, B, w), linear in p − apex, with (A/w, B/w) the place on the light that p hides from the apex, w = 0
//! at the apex and w = depth on the light's plane. In them the cone's sides and the two ends are planes, so triangles
//! that reach beyond its ends are cut before anything is divided, and a corner behind the apex needs no care.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, Vec3};

use crate::Light;

/// Sides of the polygon that stands for a disk.
const DISK_SIDES: usize = 256;

/// The light's outline in its own coordinates.
#[derive(Clone, Debug)]
pub(super) struct Outline {
    pub(super) center: DVec3,
    pub(super) axes: [DVec3; 2],
    /// Lengths along `axes` in these, as vectors: their products with an offset in the plane are (a, b).
    pub(super) duals: [DVec3; 2],
    pub(super) normal: DVec3,
    /// Half the side of a square around the outline.
    pub(super) reach: f64,
    polygon: Vec<DVec2>,
    area: f64,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Square,
    /// The unit disk of the plane.
    Disk,
    /// The unit disk of the plane at distance 1, `normal` being the direction to its middle.
    Distant,
}

/// The largest error of V that a flat disk in a round light's stead may leave.
const FLATNESS: f64 = 1e-4;

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
        let center = center.as_dvec3();
        if sides == 0 {
            let polygon = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(DVec2::from).into();
            return Some(Self {
                center,
                axes,
                duals,
                normal,
                reach: 1.0,
                polygon,
                area: 4.0,
                kind: Kind::Square,
            });
        }
        let (reach, polygon) = disk();
        let kind = Kind::Disk;
        Some(Self { center, axes, duals, normal, reach, polygon, area: PI, kind })
    }

    /// A distant light as a disk of directions d/(d·axis) on the plane at distance 1. `None` for other kinds, and where
    /// that is off by more than 10⁻⁴: beyond an angular radius of 1.3°.
    ///
    /// There a solid angle has the density (1 + r²)^(−3/2) ≈ 1 − 3r²/2. Over a disk of radius R that is above its mean where
    /// r² < R²/2, by 3R²/8 on average, so the part of the disk that is seen is off by no more than half of that.
    pub(super) fn distant(light: &Light) -> Option<Self> {
        let Light::Directional { direction, angular_radius } = *light else { return None };
        let normal = (-direction.as_dvec3()).try_normalize()?;
        let radius = f64::from(angular_radius).tan();
        if !(radius > 0.0 && 3.0 / 16.0 * radius * radius < FLATNESS) {
            return None;
        }
        let u = normal.any_orthonormal_vector();
        let pair = [u, normal.cross(u)];
        let (reach, polygon) = disk();
        Some(Self {
            center: DVec3::ZERO,
            axes: pair.map(|axis| axis * radius),
            duals: pair.map(|axis| axis / radius),
            normal,
            reach,
            polygon,
            area: PI,
            kind: Kind::Distant,
        })
    }

    pub(super) fn is_distant(&self) -> bool {
        self.kind == Kind::Distant
    }
}

/// A regular polygon of the unit disk's area: half the side of the square around it, and its corners.
fn disk() -> (f64, Vec<DVec2>) {
    // n triangles of area r²/2·sin(2π/n) add up to π.
    let half_angle = PI / DISK_SIDES as f64;
    let reach = (half_angle / (half_angle.sin() * half_angle.cos())).sqrt();
    let corner = |i: usize| reach * DVec2::from_angle(TAU * i as f64 / DISK_SIDES as f64);
    (reach, (0..DISK_SIDES).map(corner).collect())
}

impl Outline {
    /// A light that holds the outline: `light` itself, or a disk around the polygon.
    pub(super) fn around(&self, light: &Light) -> Light {
        match *light {
            Light::Disk { center, normal, radius } => {
                // Rounding to f32 takes less than the margin that is left around any light.
                Light::Disk { center, normal, radius: (f64::from(radius) * self.reach) as f32 }
            }
            Light::Directional { direction, angular_radius } => {
                let angular_radius = (f64::from(angular_radius) * self.reach) as f32;
                Light::Directional { direction, angular_radius }
            }
            _ => *light,
        }
    }
}

/// A linear function of the homogeneous coordinates, at least 0 inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    gradient: DVec3,
    offset: f64,
}

impl Side {
    pub(super) fn height(&self, homogeneous: DVec3) -> f64 {
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
    pub(super) sides: [Side; 6],
    depth: f64,
    /// The outline above the tangent plane where that cuts it.
    cut: Option<Vec<DVec2>>,
    /// Area of the outline above the tangent plane, in (a, b).
    pub(super) seen_area: f64,
}

/// A point as the apex sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projected {
    /// What it hides on the light, if it lies between.
    pub(super) place: DVec2,
    /// A bit for each of the cone's sides that it is not inside of, and [`FAR`].
    pub(super) outside: u8,
}

/// The point has no place on the light, or one so far out that it has lost digits: triangles with such corners are cut.
pub(super) const FAR: u8 = 1 << 6;

/// Places within this many half sides of the middle are known to 2⁻⁴⁶ of one, and areas of triangles of them to 128 times
/// that at worst: a triangle whose winding is mistaken hides no more than 2⁻³⁹.
pub(super) const FARTHEST: f64 = 64.0;

impl<'a> Cone<'a> {
    /// `position` and unit `normal` are those of the surface, `apex` is where its shadow rays start.
    ///
    /// From a point on the light's own plane it is seen edge-on; such an apex is moved off the plane by 2⁻³⁰
    /// of its distance and the light's size together, which leaves 22 bits to the coordinates.
    pub(super) fn new(outline: &'a Outline, apex: Vec3, position: Vec3, normal: Vec3) -> Self {
        let mut apex = apex.as_dvec3();
        let normal = normal.as_dvec3();
        let slopes = DVec2::new(normal.dot(outline.axes[0]), normal.dot(outline.axes[1]));
        if outline.is_distant() {
            let rows = [outline.duals[0], outline.duals[1], outline.normal];
            return Self::of(outline, apex, rows, f64::INFINITY, slopes, normal.dot(outline.normal));
        }
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

        Self::of(outline, apex, rows, depth, slopes, normal.dot(outline.center - position.as_dvec3()))
    }

    /// `slopes` and `above` give the height over the tangent plane of a place on the light.
    fn of(
        outline: &'a Outline,
        apex: DVec3,
        rows: [DVec3; 3],
        depth: f64,
        slopes: DVec2,
        above: f64,
    ) -> Self {
        let reach = outline.reach;
        let side = |a, b, w| Side { gradient: DVec3::new(a, b, w), offset: 0.0 };
        let sides = [
            side(1.0, 0.0, reach),
            side(-1.0, 0.0, reach),
            side(0.0, 1.0, reach),
            side(0.0, -1.0, reach),
            // Of a distant light there is no end.
            Side { gradient: DVec3::NEG_Z, offset: depth.min(f64::MAX) },
            side(slopes.x, slopes.y, above),
        ];
        let height = |p: DVec2| slopes.dot(p) + above;
        let is_whole = outline.polygon.iter().all(|&p| height(p) >= 0.0);
        let cut = (!is_whole).then(|| clip(&outline.polygon, height, |a, b, t| a.lerp(b, t)));
        let seen_area = cut.as_ref().map_or(outline.area, |seen| {
            0.5 * (0..seen.len()).map(|i| seen[i].perp_dot(seen[(i + 1) % seen.len()])).sum::<f64>().abs()
        });
        Self { outline, apex, rows, sides, depth, cut, seen_area }
    }

    /// Area of the whole outline.
    pub(super) fn area(&self) -> f64 {
        self.outline.area
    }

    /// The outline above the tangent plane; `None` if it is the whole square.
    pub(super) fn seen(&self) -> Option<&[DVec2]> {
        let polygon = self.cut.as_deref().unwrap_or(&self.outline.polygon);
        (self.cut.is_some() || polygon.len() != 4).then_some(polygon)
    }

    /// Half the side of the square around the outline.
    pub(super) fn reach(&self) -> f64 {
        self.outline.reach
    }

    /// (A, B, w) of a point.
    pub(super) fn homogeneous(&self, point: Vec3) -> DVec3 {
        let offset = point.as_dvec3() - self.apex;
        let [a, b, w] = self.rows;
        DVec3::new(a.dot(offset), b.dot(offset), w.dot(offset))
    }

    /// Where a point that surely lies between apex and light is seen on the light.
    pub(super) fn place(&self, point: Vec3) -> DVec2 {
        let p = self.homogeneous(point);
        p.truncate() / p.z
    }

    pub(super) fn project(&self, point: Vec3) -> Projected {
        let p = self.homogeneous(point);
        let mut outside = 0;
        for (bit, side) in self.sides.iter().enumerate() {
            outside |= u8::from(side.height(p) <= 0.0) << bit;
        }
        let far = FARTHEST * self.outline.reach * p.z;
        // Not what may be NaN, but what surely is near.
        let is_near = p.z <= self.depth && p.x.abs() <= far && p.y.abs() <= far && p.z > 0.0;
        Projected { place: p.truncate() / p.z, outside: outside | if is_near { 0 } else { FAR } }
    }

    /// What the triangle hides of the square around the outline and above the tangent plane, as a polygon in (a, b).
    /// Empty for none.
    pub(super) fn shadow(&self, corners: [Vec3; 3]) -> Vec<DVec2> {
        let mut polygon: Vec<DVec3> = corners.iter().map(|&corner| self.homogeneous(corner)).collect();
        for side in &self.sides {
            let heights = polygon.iter().map(|&p| side.height(p));
            let (lowest, highest) =
                heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            // Of no area inside: a triangle in the light's own plane lies before nothing.
            if highest <= 0.0 {
                return Vec::new();
            }
            if lowest < 0.0 {
                polygon = clip(&polygon, |p| side.height(p), |a, b, t| a.lerp(b, t));
            }
        }
        // Only the apex itself has no place on the light; a triangle through it is seen edge-on.
        if polygon.iter().any(|p| p.z <= 0.0) {
            return Vec::new();
        }
        polygon.iter().map(|p| p.truncate() / p.z).collect()
    }

    /// The shadow without what lies beside the outline.
    #[cfg(test)]
    pub(super) fn shadow_on_outline(&self, corners: [Vec3; 3]) -> Vec<DVec2> {
        let mut places = self.shadow(corners);
        let polygon = &self.outline.polygon;
        for (i, &a) in polygon.iter().enumerate() {
            let along = polygon[(i + 1) % polygon.len()] - a;
            if places.iter().any(|&p| along.perp_dot(p - a) < 0.0) {
                places = clip(&places, |p| along.perp_dot(p - a), |a, b, t| a.lerp(b, t));
            }
        }
        places
    }
}

/// The part of a convex polygon where `height`, linear over it, is at least 0.
pub(super) fn clip<P: Copy>(
    polygon: &[P],
    height: impl Fn(P) -> f64,
    lerp: impl Fn(P, P, f64) -> P,
) -> Vec<P> {
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
