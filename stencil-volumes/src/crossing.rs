//! How often a path crosses the sides of shadow volumes: the predicates, free of any backend.
//!
//! # The side of an edge
//! The side of the edge (a, b) is what the light's rays through it fill beyond it: {y + σ(y − L)} with y on the edge
//! and σ ≥ 0, or {y − σ d} for a light in direction d. Write the light as (l, w) relative to a point O, the *apex*:
//! l = L − O with w = 1, or l = d with w = 0; a′ = a − O, b′ = b − O. With
//!
//! > n_a = l × a′, n_b = l × b′, m = a′ × b′, D = l · m
//!
//! a point O + q is `(−(n_b·q) a′ + (n_a·q) b′ + (m·q) l) / D`. Let `α = n_a·q`, `β = n_b·q`, μ = m·q. The segment from O to
//! O + q crosses the side if and only if both ends lie on different sides of its plane and
//!
//! > α ≥ 0, β < 0, μ < 0 (D > 0), or α < 0, β ≥ 0, μ ≥ 0 (D < 0).
//!
//! # Why this is watertight
//! Each sign belongs to a thing that neighbours share: α to a vertex, μ to an edge in one fixed direction, the side of
//! a plane to a point and an edge. It is computed by the same operations wherever it is asked for, and zero counts as
//! positive everywhere. So the faces around an edge or a vertex never disagree about it, and a path that passes
//! exactly through one is counted once. The sums are f64 of differences of f32: exact but for about 2⁻⁴⁹ of their
//! terms.

use glam::{DVec3, Vec3};
use scene_core::light::LightPoint;

/// A light as a homogeneous point: (place, 1) or (direction towards it, 0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomogeneousLight {
    /// The place, or a direction towards the light.
    pub point: DVec3,
    /// Whether `point` is a direction.
    pub at_infinity: bool,
}

impl From<LightPoint> for HomogeneousLight {
    fn from(light: LightPoint) -> Self {
        match light {
            LightPoint::At(place) => Self { point: place.as_dvec3(), at_infinity: false },
            LightPoint::Towards(direction) => Self { point: direction.as_dvec3(), at_infinity: true },
        }
    }
}

impl HomogeneousLight {
    /// The light as seen from a point: the way to it, of any length.
    #[inline(always)]
    pub fn from_point(&self, origin: DVec3) -> DVec3 {
        if self.at_infinity { self.point } else { self.point - origin }
    }
}

/// An edge that carries the sides of volumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// The end that comes first by x, then y, then z.
    pub a: DVec3,
    /// The other end.
    pub b: DVec3,
    /// How many sides, signed: [`scene_core::geometry::SilhouetteEdge::multiplicity`].
    pub multiplicity: i32,
}

impl Edge {
    /// The edge from `from` to `to`, turned so that its ends are in order.
    pub fn new(from: Vec3, to: Vec3, multiplicity: i32) -> Self {
        let (a, b) = (from.as_dvec3(), to.as_dvec3());
        if in_order(a, b) {
            Self { a, b, multiplicity }
        } else {
            Self { a: b, b: a, multiplicity: -multiplicity }
        }
    }

    /// The normal of the side's plane. It points out of the volume where the multiplicity is positive.
    #[inline(always)]
    pub fn plane(&self, light: &HomogeneousLight) -> DVec3 {
        -light.from_point(self.a).cross(self.b - self.a)
    }

    /// Whether a point lies outside: on the side of [`plane`](Self::plane)'s normal, or in the plane.
    #[inline(always)]
    pub fn is_outside(&self, plane: DVec3, point: DVec3) -> bool {
        plane.dot(point - self.a) >= 0.0
    }
}

/// What is the same for all paths from one apex across one side.
#[derive(Clone, Copy, Debug)]
pub struct SideFromApex {
    /// l × a′: its sign says on which side of the light's ray through a a direction passes.
    pub along_a: DVec3,
    /// l × b′.
    pub along_b: DVec3,
    /// a′ × b′: its sign says on which side of the edge.
    pub edge: DVec3,
}

impl SideFromApex {
    /// The coefficients of the side of `edge` as seen from `apex`.
    #[inline(always)]
    pub fn new(edge: &Edge, light: &HomogeneousLight, apex: DVec3) -> Self {
        let (l, a, b) = (light.from_point(apex), edge.a - apex, edge.b - apex);
        Self { along_a: l.cross(a), along_b: l.cross(b), edge: a.cross(b) }
    }
}

/// The change of the count along a path with the direction `q` from the apex, which begins outside of the plane or
/// not and ends outside of it or not, by a side of multiplicity 1. `beyond_edge` is the sign of μ.
#[inline(always)]
pub fn crossing(side: &SideFromApex, q: DVec3, beyond_edge: bool, begins: bool, ends: bool) -> i32 {
    let (a, b) = (side.along_a.dot(q) >= 0.0, side.along_b.dot(q) >= 0.0);
    let leaves = a & !b & !beyond_edge & !begins & ends;
    let enters = !a & b & beyond_edge & begins & !ends;
    i32::from(enters) - i32::from(leaves)
}

/// The change of the count along the ray from `origin` towards `direction` by a turned face: +1 from the light's
/// side to the far one. `facing` is that of the face towards the light.
#[inline(always)]
pub fn cap_crossing(corners: [DVec3; 3], facing: i8, origin: DVec3, direction: DVec3) -> i32 {
    let inside = directed_sign(corners, origin, direction);
    if inside == 0 {
        return 0;
    }
    // The plane lies ahead if the normal has products of the same sign with the direction and with the corners.
    let [a, b, c] = corners.map(|corner| corner - origin);
    let ahead = a.dot(b.cross(c));
    if (ahead >= 0.0) == (inside > 0) { -inside * i32::from(facing) } else { 0 }
}

/// What lies between the light and the point at infinity in `direction`, by one turned face: 1 if the back cap, the
/// face's image at infinity, holds it. For a light at a place; one at infinity has a back cap without extent.
#[inline(always)]
pub fn back_cap(corners: [DVec3; 3], facing: i8, light: DVec3, direction: DVec3) -> i32 {
    // Seen from the light, a direction inside the cone of a counter-clockwise face is against its normal.
    let inside = directed_sign(corners, light, direction);
    i32::from(inside != 0 && inside == -i32::from(facing))
}

/// +1 if `direction` passes all three edges, as seen from `origin`, with positive sign, −1 if with negative, else 0.
/// Each edge's product is formed between its ends in order, so that all faces and sides of it find the same sign.
#[inline(always)]
fn directed_sign(corners: [DVec3; 3], origin: DVec3, direction: DVec3) -> i32 {
    let sign = |i: usize, j: usize| {
        let (a, b) = (corners[i], corners[j]);
        let forward = in_order(a, b);
        let (a, b) = if forward { (a, b) } else { (b, a) };
        ((a - origin).cross(b - origin).dot(direction) >= 0.0) == forward
    };
    let signs = [sign(0, 1), sign(1, 2), sign(2, 0)];
    i32::from(signs == [true; 3]) - i32::from(signs == [false; 3])
}

/// Whether `a` comes before `b` by x, then y, then z.
#[inline(always)]
fn in_order(a: DVec3, b: DVec3) -> bool {
    (a.x, a.y, a.z) <= (b.x, b.y, b.z)
}

/// How many faces lie between a point and the light, face by face: the count by its definition. Linear in the
/// number of triangles; the yardstick of the tests, and the answer for free points.
pub fn faces_between(corners: impl Iterator<Item = [Vec3; 3]>, point: Vec3, light: LightPoint) -> u32 {
    use robust::{Coord3D, orient3d};
    let coord = |p: Vec3| Coord3D { x: f64::from(p.x), y: f64::from(p.y), z: f64::from(p.z) };
    let origin = Coord3D { x: 0.0, y: 0.0, z: 0.0 };
    // Relative to the point, each coordinate rounded once: as shadow rays do.
    let (end, finite) = match light {
        LightPoint::At(place) => (coord(place - point), true),
        LightPoint::Towards(direction) => (coord(direction), false),
    };
    let crosses = |corners: [Vec3; 3]| {
        let [a, b, c] = corners.map(|corner| coord(corner - point));
        let volume = orient3d(a, b, c, origin);
        let weights = [orient3d(a, b, end, origin), orient3d(b, c, end, origin), orient3d(c, a, end, origin)];
        let turned = if volume > 0.0 { weights } else { weights.map(|w| -w) };
        volume != 0.0
            && turned.iter().all(|&w| w >= 0.0)
            && turned != [0.0; 3]
            && (!finite || orient3d(a, b, c, end) * volume < 0.0)
    };
    corners.filter(|&c| crosses(c)).count() as u32
}
