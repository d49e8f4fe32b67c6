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

use fearless_simd::{Simd, SimdBase, SimdMask, f32x16};
use glam::Vec3;
use gnomon_shadow_map::light_maps::Receiver;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::{Light, Scene};

use crate::chosen::{LANES, keep_lanes};
use crate::coverage::{Site, is_left};
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
    parts: [Vec<f32>; PARTS],
    count: usize,
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
    /// Takes over the triangles that `indices` name, and fills the last lanes.
    pub(crate) fn gather(
        &mut self,
        scene: &Scene,
        indices: impl Iterator<Item = u32>,
        origin: Vec3,
        center: LightPoint,
    ) {
        self.parts.iter_mut().for_each(Vec::clear);
        self.count = 0;
        for index in indices {
            let [a, b, c] = scene.corners(index as usize);
            let normal = (b - a).cross(c - a);
            let length = normal.length();
            let side = normal.dot(center.ray_from(a).0);
            let turn = f32::from(i8::from(side > 0.0) - i8::from(side < 0.0));
            let turn = if length > 0.0 { turn } else { 0.0 };
            let corners = [a - origin, b - origin, c - origin, a, normal].map(|v| v.to_array());
            let values = corners.into_iter().flatten().chain([length, turn]);
            self.parts.iter_mut().zip(values).for_each(|(part, value)| part.push(value));
            self.count += 1;
        }
        self.pad();
    }

    fn pad(&mut self) {
        let padded = self.count.next_multiple_of(LANES);
        self.parts.iter_mut().for_each(|part| part.resize(padded, 0.0));
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
        for first in (0..self.count).step_by(LANES) {
            let valid = (1u64 << (self.count - first).min(LANES)) - 1;
            let (mut inside, mut outside) = (0, 0);
            if is_known {
                (inside, outside) = self.sides(simd, first, bounds, center);
            }
            let (mut any, mut all) = (0, u64::MAX);
            let asked = valid & !outside;
            for (_, receiver) in receivers {
                let behind = self.behind(simd, first, receiver);
                (any, all) = (any | behind, all & behind);
                // Whether it lies between is known of none, and all before whom it may.
                if any & asked == asked && all & inside & asked == 0 {
                    break;
                }
            }
            covers |= all & inside & asked != 0;
            kept = keep_lanes(&mut self.parts, first, any & asked, kept);
        }
        self.count = kept;
        self.parts.iter_mut().for_each(|part| part.truncate(kept));
        self.pad();
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
        for first in (0..self.count).step_by(LANES) {
            let behind = self.behind(simd, first, receiver);
            if behind == 0 {
                continue;
            }
            let a = site.locate_vector(self.corner(simd, first, 0, site.point));
            let b = site.locate_vector(self.corner(simd, first, 3, site.point));
            let c = site.locate_vector(self.corner(simd, first, 6, site.point));
            let sides = [is_left(cross(a, b)), is_left(cross(b, c)), is_left(cross(c, a))];
            let meets = !(sides[0] ^ sides[1]) & !(sides[0] ^ sides[2]);
            count += (behind & meets).count_ones() as i32;
        }
        count
    }

    #[inline(always)]
    fn part<S: Simd>(&self, simd: S, kind: usize, first: usize) -> f32x16<S> {
        f32x16::from_slice(simd, &self.parts[kind][first..first + LANES])
    }

    /// Corners whose x has the number `kind`, counted from a point.
    #[inline(always)]
    fn corner<S: Simd>(&self, simd: S, first: usize, kind: usize, point: Vec3) -> [f32x16<S>; 3] {
        let (x, y) = (self.part(simd, kind, first), self.part(simd, kind + 1, first));
        [x - point.x, y - point.y, self.part(simd, kind + 2, first) - point.z]
    }

    /// Faces behind which a receiver lies as the light's centre sees them, a bit each: `receiver_plane::is_behind`.
    #[inline(always)]
    fn behind<S: Simd>(&self, simd: S, first: usize, receiver: &Receiver) -> u64 {
        let Receiver { point, tolerance, .. } = *receiver;
        let x = point.x - self.part(simd, 9, first);
        let y = point.y - self.part(simd, 10, first);
        let z = point.z - self.part(simd, 11, first);
        let (nx, ny) = (self.part(simd, 12, first), self.part(simd, 13, first));
        let height = nx * x + ny * y + self.part(simd, 14, first) * z;
        let (length, turn) = (self.part(simd, 15, first), self.part(simd, 16, first));
        (-(height * turn)).simd_gt(length * tolerance).to_bitmask()
    }

    /// Which faces have all of a box within the planes through their edges and the light's centre, or within those opposite;
    /// and which have all of it neither within nor within.
    #[inline(always)]
    fn sides<S: Simd>(&self, simd: S, first: usize, bounds: &Aabb, center: LightPoint) -> (u64, u64) {
        let (middle, half) = (bounds.center(), 0.5 * bounds.size());
        let (mut positive, mut negative) = ([0; 3], [0; 3]);
        for side in 0..3 {
            let a = self.corner(simd, first, 3 * side, Vec3::ZERO);
            let b = self.corner(simd, first, 3 * ((side + 1) % 3), Vec3::ZERO);
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
