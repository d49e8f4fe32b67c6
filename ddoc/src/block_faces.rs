//! The solid faces that a block's receivers are asked about, sixteen at a time: the questions of [`faces`](crate::faces), by
//! the same sums, so that it is the same faces that count.
//!
//! # What is known of all receivers of a block
//! A face counts before a receiver p if p lies behind it, and if the planes through its edges and the light's centre have p on
//! the same side, all three. The first is asked of every receiver. The second is a volume, det(b − a, l − a, p − a) with l
//! the centre, and affine in p: over the box around the receivers it takes its extremes at corners. A face with two sides of
//! different signs all over the box counts before none of them; one with three of the same sign, and behind which all
//! lie, before each.
//!
//! A receiver asks in its own coordinates (a, b, t), whose axes may be up to [`FLATTEST`] from lying in one plane: the sums
//! of products of f32, good to 2⁻²² of their terms, are then good to 2⁻¹⁶. A sign is taken to be known beyond 2⁻¹² of the
//! terms.

use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16};
use glam::Vec3;
use gnomon_shadow_map::light_maps::Receiver;
use scene_core::Light;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;

use crate::chosen::Chosen;
use crate::coverage::{Site, is_left};
use crate::lanes::{Lanes, load_three};
use crate::tile_edges::cross;

/// Below this cosine between a flat light's normal and the way to it nothing is taken to be known of a block.
const FLATTEST: f32 = 1.0 / 64.0;

/// Share of its terms beyond which the sign of a volume is known.
const KNOWN: f32 = 1.0 / 4096.0;

/// Numbers a face: three corners from the origin; a corner in world space, the normal, its length; 1 if the light sees the side
/// that the normal points to, −1 if the other, 0 if it sees none.
const PARTS: usize = 17;

/// Faces of a block, component by component.
#[derive(Debug, Default)]
pub(crate) struct BlockFaces {
    lanes: Lanes<PARTS>,
}

/// What is known of the faces over a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Before {
    /// No face lies between any receiver and the light's centre.
    None,
    /// One does, whichever the receiver.
    All,
    /// Each has to ask.
    Some,
}

impl BlockFaces {
    /// Takes over triangles by their corners in world space, with the sums of `receiver_plane::is_behind`.
    #[inline(always)]
    pub(crate) fn gather<S: Simd>(
        &mut self,
        simd: S,
        triangles: &Chosen<9>,
        origin: Vec3,
        center: LightPoint,
    ) {
        let corners = triangles.corners();
        self.lanes.resize(corners.len());
        let (nothing, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
        for vector in 0..corners.vectors() {
            let parts = corners.vector(vector);
            let (a, b) = (load_three(simd, parts, 0), load_three(simd, parts, 3));
            let c = load_three(simd, parts, 6);
            let normal = cross(from(b, a), from(c, a));
            let length = product(normal, normal).sqrt();
            let way = match center {
                LightPoint::At(place) => [place.x - a[0], place.y - a[1], place.z - a[2]],
                LightPoint::Towards(way) => {
                    [f32x16::splat(simd, way.x), f32x16::splat(simd, way.y), f32x16::splat(simd, way.z)]
                }
            };
            let side = product(normal, way);
            let turn = side.simd_gt(0.0).select(one, side.simd_lt(0.0).select(-one, nothing));
            let turn = length.simd_gt(0.0).select(turn, nothing);
            let origin =
                [f32x16::splat(simd, origin.x), f32x16::splat(simd, origin.y), f32x16::splat(simd, origin.z)];
            let three = [from(a, origin), from(b, origin), from(c, origin), a, normal];
            let into = self.lanes.vector_mut(vector);
            for part in 0..15 {
                into[part] = three[part / 3][part % 3].to_array();
            }
            (into[15], into[16]) = (length.to_array(), turn.to_array());
        }
    }

    /// Keeps the faces that may count before some of the receivers, whose box, relative to the origin, is `bounds`.
    #[inline(always)]
    pub(crate) fn keep_for<S: Simd>(
        &mut self,
        simd: S,
        receivers: &[(u32, Receiver)],
        bounds: &Aabb,
        (light, origin): (&Light, Vec3),
    ) -> Before {
        let is_known = is_steep(light, bounds, origin);
        let center = match light.center() {
            LightPoint::At(place) => LightPoint::At(place - origin),
            towards @ LightPoint::Towards(_) => towards,
        };
        let (mut kept, mut covers) = (0, false);
        for vector in 0..self.lanes.vectors() {
            let valid = self.lanes.valid(vector);
            let (mut inside, mut outside) = (0, 0);
            if is_known {
                (inside, outside) = self.sides(simd, vector, bounds, center);
            }
            let (mut any, mut all) = (0, u64::MAX);
            let asked = valid & !outside;
            for (_, receiver) in receivers {
                let behind = self.behind(simd, vector, receiver);
                (any, all) = (any | behind, all & behind);
                // Whether it lies between is known of none, and all before whom it may.
                if any & asked == asked && all & inside & asked == 0 {
                    break;
                }
            }
            covers |= all & inside & asked != 0;
            kept = self.lanes.keep(vector, any & asked, kept);
        }
        self.lanes.resize(kept);
        match kept {
            0 => Before::None,
            _ if covers => Before::All,
            _ => Before::Some,
        }
    }

    /// How many faces lie between a receiver and the light's centre. `site` is the receiver's.
    #[inline(always)]
    pub(crate) fn before<S: Simd>(&self, simd: S, receiver: &Receiver, site: &Site) -> i32 {
        let mut count = 0;
        for vector in 0..self.lanes.vectors() {
            let behind = self.behind(simd, vector, receiver) & self.lanes.valid(vector);
            if behind == 0 {
                continue;
            }
            let a = site.locate_vector(self.corner(simd, vector, 0, site.point));
            let b = site.locate_vector(self.corner(simd, vector, 3, site.point));
            let c = site.locate_vector(self.corner(simd, vector, 6, site.point));
            let sides = [is_left(cross(a, b)), is_left(cross(b, c)), is_left(cross(c, a))];
            let meets = !(sides[0] ^ sides[1]) & !(sides[0] ^ sides[2]);
            count += (behind & meets).count_ones() as i32;
        }
        count
    }

    #[inline(always)]
    fn part<S: Simd>(&self, simd: S, kind: usize, vector: usize) -> f32x16<S> {
        f32x16::load_array_ref(simd, &self.lanes.vector(vector)[kind])
    }

    /// Corners whose x has the number `kind`, counted from a point.
    #[inline(always)]
    fn corner<S: Simd>(&self, simd: S, vector: usize, kind: usize, point: Vec3) -> [f32x16<S>; 3] {
        let (x, y) = (self.part(simd, kind, vector), self.part(simd, kind + 1, vector));
        [x - point.x, y - point.y, self.part(simd, kind + 2, vector) - point.z]
    }

    /// Faces behind which a receiver lies as the light's centre sees them, a bit each: `receiver_plane::is_behind`.
    #[inline(always)]
    fn behind<S: Simd>(&self, simd: S, vector: usize, receiver: &Receiver) -> u64 {
        let Receiver { point, tolerance, .. } = *receiver;
        let x = point.x - self.part(simd, 9, vector);
        let y = point.y - self.part(simd, 10, vector);
        let z = point.z - self.part(simd, 11, vector);
        let (nx, ny) = (self.part(simd, 12, vector), self.part(simd, 13, vector));
        let height = nx * x + ny * y + self.part(simd, 14, vector) * z;
        let (length, turn) = (self.part(simd, 15, vector), self.part(simd, 16, vector));
        (-(height * turn)).simd_gt(length * tolerance).to_bitmask()
    }

    /// Which faces have all of a box within the planes through their edges and the light's centre, or within those opposite;
    /// and which have all of it neither within nor within.
    #[inline(always)]
    fn sides<S: Simd>(&self, simd: S, vector: usize, bounds: &Aabb, center: LightPoint) -> (u64, u64) {
        let (middle, half) = (bounds.center(), 0.5 * bounds.size());
        let (mut positive, mut negative) = ([0; 3], [0; 3]);
        for side in 0..3 {
            let a = self.corner(simd, vector, 3 * side, Vec3::ZERO);
            let b = self.corner(simd, vector, 3 * ((side + 1) % 3), Vec3::ZERO);
            let along = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
            let way = match center {
                LightPoint::At(place) => [place.x - a[0], place.y - a[1], place.z - a[2]],
                LightPoint::Towards(way) => {
                    [f32x16::splat(simd, way.x), f32x16::splat(simd, way.y), f32x16::splat(simd, way.z)]
                }
            };
            let (mut value, mut reach) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 0.0));
            for axis in 0..3 {
                let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
                let (p, q) = (along[next] * way[last], along[last] * way[next]);
                let (normal, terms) = (p - q, p.abs() + q.abs());
                let from = middle[axis] - a[axis];
                value += normal * from;
                reach = reach + normal.abs() * half[axis] + terms * KNOWN * (from.abs() + half[axis]);
            }
            positive[side] = value.simd_gt(reach).to_bitmask();
            negative[side] = (-value).simd_gt(reach).to_bitmask();
        }
        let inside = positive[0] & positive[1] & positive[2] | negative[0] & negative[1] & negative[2];
        let outside = (positive[0] | positive[1] | positive[2]) & (negative[0] | negative[1] | negative[2]);
        (inside, outside)
    }
}

/// Whether a light's axes are far enough from lying in one plane, wherever in the box it is seen from.
fn is_steep(light: &Light, bounds: &Aabb, origin: Vec3) -> bool {
    let (center, normal) = match *light {
        Light::Rect { center, half_u, half_v } => {
            let [u, v] = [half_u, half_v].map(Vec3::normalize_or_zero);
            (center, u.cross(v))
        }
        Light::Disk { center, normal, .. } => (center, normal.normalize_or_zero()),
        _ => return true,
    };
    let way = center - origin - bounds.center();
    let reach = 0.5 * bounds.size();
    // The least height over the plane against the greatest distance.
    normal.dot(way).abs() - normal.abs().dot(reach) > FLATTEST * (way.length() + reach.length())
}

/// b − a.
#[inline(always)]
fn from<S: Simd>(b: [f32x16<S>; 3], a: [f32x16<S>; 3]) -> [f32x16<S>; 3] {
    [b[0] - a[0], b[1] - a[1], b[2] - a[2]]
}

/// a·b, summed as glam does.
#[inline(always)]
fn product<S: Simd>(a: [f32x16<S>; 3], b: [f32x16<S>; 3]) -> f32x16<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
