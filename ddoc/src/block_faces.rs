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

use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16};
use glam::Vec3;
use scene_core::Light;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;

use crate::chosen::Chosen;
use crate::coverage::is_left;
use crate::lanes::{LANES, Lanes, Named, Source};
use crate::sites::{SiteVector, Sites, by_receivers};
use crate::vectors::{Vec3x16, cross, dot, length, splat, sub};

/// Below this cosine between a flat light's normal and the way to it nothing is taken to be known of a block.
const FLATTEST: f32 = 1.0 / 64.0;

/// Share of its terms beyond which the sign of a volume is known.
const KNOWN: f32 = 1.0 / 4096.0;

/// Numbers a face: three corners from the origin; a corner in world space, the normal, its length; 1 if the light sees the side
/// that the normal points to, −1 if the other, 0 if it sees none.
const PARTS: usize = 17;
const WORLD: usize = 9;
const NORMAL: usize = 12;
const LENGTH: usize = 15;
const TURN: usize = 16;

/// Sixteen faces, or one sixteen times.
#[derive(Clone, Copy)]
struct FaceVector<S: Simd> {
    corners: [Vec3x16<S>; 3],
    world: Vec3x16<S>,
    normal: Vec3x16<S>,
    length: f32x16<S>,
    turn: f32x16<S>,
}

impl<S: Simd> FaceVector<S> {
    #[inline(always)]
    fn of(numbers: impl Source<S>) -> Self {
        Self {
            corners: [numbers.three(0), numbers.three(3), numbers.three(6)],
            world: numbers.three(WORLD),
            normal: numbers.three(NORMAL),
            length: numbers.number(LENGTH),
            turn: numbers.number(TURN),
        }
    }

    /// Whether a receiver lies behind a face as the light's centre sees it, a bit each: `receiver_plane::is_behind`.
    #[inline(always)]
    fn is_behind(&self, site: &SiteVector<S>) -> u64 {
        let height = dot(self.normal, sub(site.world, self.world));
        (-(height * self.turn)).simd_gt(self.length * site.tolerance).to_bitmask()
    }

    /// Whether the way from a receiver to the light's centre passes between a face's corners, a bit each.
    #[inline(always)]
    fn meets_way(&self, site: &SiteVector<S>) -> u64 {
        let [a, b, c] = self.corners;
        let (a, b) = (site.locate(sub(a, site.point)), site.locate(sub(b, site.point)));
        let c = site.locate(sub(c, site.point));
        let sides = [is_left(cross(a, b)), is_left(cross(b, c)), is_left(cross(c, a))];
        !(sides[0] ^ sides[1]) & !(sides[0] ^ sides[2])
    }
}

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
            let numbers = corners.sixteen(simd, vector);
            let [a, b, c] = [numbers.three(0), numbers.three(3), numbers.three(6)];
            let normal = cross(sub(b, a), sub(c, a));
            let length = length(normal);
            let way = match center {
                LightPoint::At(place) => sub(splat(simd, place), a),
                LightPoint::Towards(way) => splat(simd, way),
            };
            let side = dot(normal, way);
            let turn = side.simd_gt(0.0).select(one, side.simd_lt(0.0).select(-one, nothing));
            let turn = length.simd_gt(0.0).select(turn, nothing);
            let origin = splat(simd, origin);
            let three = [sub(a, origin), sub(b, origin), sub(c, origin), a, normal];
            let into = self.lanes.vector_mut(vector);
            for (part, numbers) in into.iter_mut().zip(three.as_flattened()) {
                *part = numbers.to_array();
            }
            (into[LENGTH], into[TURN]) = (length.to_array(), turn.to_array());
        }
    }

    /// Keeps the faces that may count before some of the receivers, whose box, relative to the origin, is `bounds`.
    #[inline(always)]
    pub(crate) fn keep_for<S: Simd>(
        &mut self,
        simd: S,
        sites: &Sites,
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
            let asked = valid & !outside;
            let (any, all) = self.behind_any_and_all(simd, vector, sites, (asked, inside));
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

    /// Which faces of a vector some of the receivers lie behind, and which all of them do, a bit each. Of those that are not `asked` nothing
    /// is said, and whether all lie behind one of those that are not `inside`.
    #[inline(always)]
    fn behind_any_and_all<S: Simd>(
        &self,
        simd: S,
        vector: usize,
        sites: &Sites,
        (asked, inside): (u64, u64),
    ) -> (u64, u64) {
        let (mut any, mut all) = (0, u64::MAX);
        if by_receivers(sites.len(), self.lanes.len()) {
            for lane in Named(asked) {
                let face = self.one(simd, vector * LANES + lane);
                for of in 0..sites.vectors() {
                    let (valid, behind) = (sites.valid(of), face.is_behind(&sites.sixteen(simd, of)));
                    any |= u64::from(behind & valid != 0) << lane;
                    all &= !(u64::from(behind & valid != valid) << lane);
                    if (any & !(all & inside)) >> lane & 1 == 1 {
                        break;
                    }
                }
            }
        } else {
            let face = self.sixteen(simd, vector);
            for receiver in 0..sites.len() {
                let behind = face.is_behind(&sites.one(simd, receiver));
                (any, all) = (any | behind, all & behind);
                if any & asked == asked && all & inside & asked == 0 {
                    break;
                }
            }
        }
        (any, all)
    }

    /// Adds to `counts` how many faces lie between each receiver and the light's centre.
    #[inline(always)]
    pub(crate) fn add_before<S: Simd>(&self, simd: S, sites: &Sites, counts: &mut [i32]) {
        if by_receivers(sites.len(), self.lanes.len()) {
            for of in 0..sites.vectors() {
                let (site, valid) = (sites.sixteen(simd, of), sites.valid(of));
                for index in 0..self.lanes.len() {
                    let face = self.one(simd, index);
                    let mut before = face.is_behind(&site) & valid;
                    if before != 0 {
                        before &= face.meets_way(&site);
                    }
                    for lane in Named(before) {
                        counts[of * LANES + lane] += 1;
                    }
                }
            }
        } else {
            for (receiver, count) in counts.iter_mut().enumerate() {
                let site = sites.one(simd, receiver);
                for vector in 0..self.lanes.vectors() {
                    let face = self.sixteen(simd, vector);
                    let before = face.is_behind(&site) & self.lanes.valid(vector);
                    if before != 0 {
                        *count += (before & face.meets_way(&site)).count_ones() as i32;
                    }
                }
            }
        }
    }

    /// A vector of faces.
    #[inline(always)]
    fn sixteen<S: Simd>(&self, simd: S, vector: usize) -> FaceVector<S> {
        FaceVector::of(self.lanes.sixteen(simd, vector))
    }

    /// One face, sixteen times.
    #[inline(always)]
    fn one<S: Simd>(&self, simd: S, index: usize) -> FaceVector<S> {
        FaceVector::of(self.lanes.one(simd, index))
    }

    /// Which faces have all of a box within the planes through their edges and the light's centre, or within those opposite;
    /// and which have all of it neither within nor within.
    #[inline(always)]
    fn sides<S: Simd>(&self, simd: S, vector: usize, bounds: &Aabb, center: LightPoint) -> (u64, u64) {
        let (middle, half) = (bounds.center(), 0.5 * bounds.size());
        let (mut positive, mut negative) = ([0; 3], [0; 3]);
        for side in 0..3 {
            let numbers = self.lanes.sixteen(simd, vector);
            let a: Vec3x16<S> = numbers.three(3 * side);
            let along = sub(numbers.three(3 * ((side + 1) % 3)), a);
            let way = match center {
                LightPoint::At(place) => sub(splat(simd, place), a),
                LightPoint::Towards(way) => splat(simd, way),
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

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use gnomon_shadow_map::light_maps::Receiver;

    use crate::sites::tests::{LIGHT, numbers, receivers};

    /// Receivers that ask together, a face at a time, find what each of them finds alone, sixteen faces at a time.
    #[test]
    fn what_lies_before_each_lies_before_it_among_all() {
        let (mut next, mut before_some) = (numbers(), 0);
        for round in 0..200 {
            let receivers: Vec<(u32, Receiver)> = receivers(&mut next, 1 + round % 40);
            let corners: Vec<[f32; 9]> = (0..1 + round % 23)
                .map(|_| {
                    let middle = Vec3::new(next(), next() + 1.0, next());
                    let corners = [(); 3].map(|()| middle + Vec3::new(next(), next(), next()) * 0.8);
                    std::array::from_fn(|part| corners[part / 3][part % 3])
                })
                .collect();
            let indices: Vec<u32> = (0..corners.len() as u32).collect();
            let bounds = Aabb::from_points(receivers.iter().map(|(_, receiver)| receiver.point));
            let asked_by = |held: &[(u32, Receiver)]| {
                let (mut sites, mut counts) = (Sites::default(), vec![0; held.len()]);
                let (mut chosen, mut faces) = (Chosen::default(), BlockFaces::default());
                sites.place(held, Vec3::ZERO);
                let kept = dispatch!(Level::new(), simd => {
                    sites.set_light(simd, &LIGHT);
                    let corners = |index: u32| corners[index as usize];
                    chosen.gather(simd, &indices, corners, None, Vec3::ZERO);
                    faces.gather(simd, &chosen, Vec3::ZERO, LIGHT.center());
                    faces.add_before(simd, &sites, &mut counts);
                    faces.keep_for(simd, &sites, &bounds, (&LIGHT, Vec3::ZERO))
                });
                (kept, counts)
            };
            let (kept, counts) = asked_by(&receivers);
            let alone: Vec<i32> = receivers.iter().flat_map(|&receiver| asked_by(&[receiver]).1).collect();
            assert_eq!(counts, alone, "{round}");
            match kept {
                Before::None => assert!(counts.iter().all(|&count| count == 0), "{round}"),
                Before::All => assert!(counts.iter().all(|&count| count > 0), "{round}"),
                Before::Some => {}
            }
            before_some += usize::from(counts.iter().any(|&count| count > 0));
        }
        assert!((50..200).contains(&before_some), "{before_some}");
    }
}
