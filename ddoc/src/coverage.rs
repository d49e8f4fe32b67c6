//! Step 4: V of a receiver from the edges around it.
//!
//! From the receiver p every edge is projected onto the light, in the coordinates (a, b, t) of
//! [`LightCone`](gnomon_shadow_map::light_cone::LightCone): a point of the light is (a/t, b/t). The number of faces before the light's
//! point s is that before its centre c, and what the edges add that the segment from c to s crosses:
//!
//! > n(s) = n(c) + Σ m(e)·o·([s left of e] − [c left of e]),
//!
//! where o = −1 if (u, v, w) is right-handed and +1 otherwise: seen from p, along w, a turn from u to v is clockwise in a
//! right-handed frame, so left as p sees it ([`silhouettes`](mod@crate::silhouettes)) is right in (a, b). V is the share of the
//! light's points with n(s) = 0.
//!
//! The segment crosses the edge (A, B) if A and B lie on different sides of the line through c and s, and c and s on
//! different sides of the line through A and B. The first is asked of a vertex, in the same way for all edges at it, so
//! that no segment slips through between two. In homogeneous coordinates, c = (0, 0, 1), both are determinants, and no
//! division is needed: det(c, s, A) = s × A in the plane, and (A × B)·(s, 1).
//!
//! Edges count as far as they lie above the receiver's plane (below, they are its own surface, and the light is above) and
//! before the light. They are cut there.

use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16};
use glam::{Mat3, Vec2, Vec3};

use crate::lanes::{LANES, Named};
use crate::light_cones::share;
use crate::sites::{SiteVector, Sites};
use crate::tile_edges::{EdgeVector, TileEdges};
use crate::vectors::{cross, dot, sub};

/// A receiver, relative to the edges' origin, and the light over it.
#[derive(Clone, Copy, Debug)]
pub struct Site {
    /// The receiver.
    pub point: Vec3,
    /// Unit normal on the light's side.
    pub normal: Vec3,
    /// Distance from its plane below which a point counts as on it.
    pub tolerance: f32,
    /// From a point counted from the receiver to (a, b, t).
    pub light_from_receiver: Mat3,
    /// Whether nothing lies behind the light.
    pub is_parallel: bool,
}

impl Site {
    /// (a, b, t) of a point.
    #[inline]
    pub(crate) fn locate(&self, point: Vec3) -> Vec3 {
        self.light_from_receiver * (point - self.point)
    }

    /// The part of an edge, in (a, b, t), that lies above the receiver's plane, on the light's side of it and before the
    /// light.
    pub(crate) fn cut(&self, [a, b]: [Vec3; 2]) -> Option<[Vec3; 2]> {
        let (from_a, from_b) = (a - self.point, b - self.point);
        let heights = [self.normal.dot(from_a) - self.tolerance, self.normal.dot(from_b) - self.tolerance];
        let mut ends = [self.light_from_receiver * from_a, self.light_from_receiver * from_b];
        let keep = |by: [f32; 2], ends: &mut [Vec3; 2]| {
            if by[0] <= 0.0 && by[1] <= 0.0 {
                return false;
            }
            if by[0] <= 0.0 || by[1] <= 0.0 {
                let cut = ends[0].lerp(ends[1], by[0] / (by[0] - by[1]));
                ends[usize::from(by[1] <= 0.0)] = cut;
            }
            true
        };
        if !keep(heights, &mut ends) || !keep([ends[0].z, ends[1].z], &mut ends) {
            return None;
        }
        if !self.is_parallel && !keep([1.0 - ends[0].z, 1.0 - ends[1].z], &mut ends) {
            return None;
        }
        Some(ends)
    }
}

/// Whether the light's centre lies left of the way from `a` to `b`, in (a, b, t).
///
/// Every face and every edge asks this of the same numbers, wherever it begins, so that all agree: the determinant is
/// exactly the negative the other way round, and where it is 0 the centre is taken to be moved by (ε, ε²).
#[inline]
pub(crate) fn center_is_left(a: Vec3, b: Vec3) -> bool {
    let line = a.cross(b);
    line.z > 0.0 || (line.z == 0.0 && (line.x > 0.0 || (line.x == 0.0 && line.y > 0.0)))
}

/// An edge as points of the light are asked about it: it may lie over the light.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    /// (a, b) of both ends, cut.
    ends: [[f32; 2]; 2],
    /// a × b.
    line: [f32; 3],
    /// What crossing it on the way from the centre adds, never 0.
    step: f32,
    /// Whether the centre lies left of it.
    center_left: bool,
}

/// The edges that may lie over the light of a receiver.
#[derive(Debug, Default)]
struct Over {
    crossings: Vec<Crossing>,
    /// By how many faces there may be fewer than before the centre, at most.
    fewer: f32,
}

/// Points of the light and what is counted at them; memory that is kept from receiver to receiver.
#[derive(Debug, Default)]
pub(crate) struct Counter {
    /// The points as shares of the light, x and y; copies of the last one fill the last vector.
    shares: [Vec<f32>; 2],
    taps: usize,
    /// Where they lie, in a and b, on a light of a height.
    places: [Vec<f32>; 2],
    height: Option<f32>,
    /// Of sixteen receivers, or of one.
    over: [Over; LANES],
}

impl Counter {
    /// Takes the points of the light, as shares of it.
    pub(crate) fn set_points(&mut self, points: &[Vec2]) {
        self.taps = points.len();
        self.height = None;
        let padded = self.taps.next_multiple_of(LANES);
        for (axis, shares) in self.shares.iter_mut().enumerate() {
            shares.clear();
            shares.extend(points.iter().map(|point| point[axis]));
            shares.resize(padded, shares.last().copied().unwrap_or(0.0));
        }
    }

    /// Finds where the points lie on a light of this height: only of spheres it differs from receiver to receiver.
    #[inline(always)]
    fn set_height<S: Simd>(&mut self, simd: S, height: f32) {
        if self.height == Some(height) {
            return;
        }
        self.height = Some(height);
        let ([x, y], [a, b]) = (&self.shares, &mut self.places);
        a.clear();
        b.clear();
        for (x, y) in x.chunks_exact(LANES).zip(y.chunks_exact(LANES)) {
            let place = share(simd, height, [f32x16::from_slice(simd, x), f32x16::from_slice(simd, y)]);
            a.extend(place[0].to_array());
            b.extend(place[1].to_array());
        }
    }

    /// Finds the edges that may lie over the light of the receiver `index`, sixteen edges a turn: m(e) ≠ 0, not below its plane, and not
    /// beside the square around the light (all tests are linear, so they are asked of the ends).
    #[inline(always)]
    pub(crate) fn set_receiver<S: Simd>(&mut self, simd: S, sites: &Sites, index: usize, edges: &TileEdges) {
        let over = &mut self.over[0];
        over.clear();
        let site = sites.one(simd, index);
        for vector in 0..edges.vectors() {
            let edge = edges.sixteen(simd, vector);
            let Some(found) = Crossings::of(&site, &edge, edges.valid(vector), sites.is_parallel()) else {
                continue;
            };
            for lane in Named(found.there) {
                over.push(found.lane(lane));
            }
        }
    }

    /// The same of a vector of receivers, sixteen receivers a turn.
    #[inline(always)]
    pub(crate) fn set_receivers<S: Simd>(
        &mut self,
        simd: S,
        sites: &Sites,
        vector: usize,
        edges: &TileEdges,
    ) {
        for over in &mut self.over {
            over.clear();
        }
        let (site, valid) = (sites.sixteen(simd, vector), sites.valid(vector));
        for index in 0..edges.len() {
            let edge = edges.one(simd, index);
            let Some(found) = Crossings::of(&site, &edge, valid, sites.is_parallel()) else { continue };
            for lane in Named(found.there) {
                self.over[lane].push(found.lane(lane));
            }
        }
    }

    /// The share of the points before which no face lies, if `at_center` lie before the centre. `lane` is the receiver's among those that
    /// were set, and `height` the light's over it.
    ///
    /// Counts below 0 would be a contradiction: `at_center` was found too small, and is raised.
    #[inline(always)]
    pub(crate) fn visible<S: Simd>(&mut self, simd: S, lane: usize, at_center: i32, height: f32) -> f32 {
        let (Over { crossings, fewer }, raised) = (&self.over[lane], at_center as f32);
        if crossings.is_empty() {
            return if at_center > 0 { 0.0 } else { 1.0 };
        }
        if *fewer < raised {
            return 0.0;
        }
        self.set_height(simd, height);
        let (crossings, places) = (&self.over[lane].crossings, &self.places);
        let mut least = f32x16::splat(simd, 0.0);
        let mut clear = 0;
        for first in (0..self.taps).step_by(LANES) {
            let counts = count(simd, crossings, places, first);
            least = least.min(counts);
            clear += self.equal(counts, -raised, first);
        }
        // Without a contradiction −at_center is the count of clear points; with one the least count is.
        let least = least.reduce_min();
        if -least > raised {
            clear = 0;
            for first in (0..self.taps).step_by(LANES) {
                clear += self.equal(count(simd, crossings, places, first), least, first);
            }
        }
        clear as f32 / self.taps as f32
    }

    /// How many points from `first` on have this count. Copies have none.
    #[inline(always)]
    fn equal<S: Simd>(&self, counts: f32x16<S>, count: f32, first: usize) -> u32 {
        let valid = (1 << (self.taps - first).min(LANES)) - 1;
        (counts.simd_eq(count).to_bitmask() & valid).count_ones()
    }
}

/// n(s) − n(c) of a vector of points.
#[inline(always)]
fn count<S: Simd>(simd: S, crossings: &[Crossing], [x, y]: &[Vec<f32>; 2], first: usize) -> f32x16<S> {
    let x = f32x16::from_slice(simd, &x[first..first + LANES]);
    let y = f32x16::from_slice(simd, &y[first..first + LANES]);
    let (nothing, mut counts) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 0.0));
    for &Crossing { ends: [a, b], line, step, center_left } in crossings {
        let sides = (x * a[1] - y * a[0]).simd_lt(0.0) ^ (x * b[1] - y * b[0]).simd_lt(0.0);
        let left = (x * line[0] + y * line[1] + line[2]).simd_gt(0.0);
        let crossed = sides & (left ^ mask32x16::splat(simd, center_left));
        counts += crossed.select(f32x16::splat(simd, step), nothing);
    }
    counts
}

impl Over {
    fn clear(&mut self) {
        self.crossings.clear();
        self.fewer = 0.0;
    }

    #[inline(always)]
    fn push(&mut self, crossing: Crossing) {
        self.fewer += (-crossing.step).max(0.0);
        self.crossings.push(crossing);
    }
}

/// Edges that may lie over lights, of sixteen pairs of an edge and a receiver.
struct Crossings {
    /// Which pairs, a bit each.
    there: u64,
    /// a and b of both ends.
    ends: [[[f32; LANES]; 2]; 2],
    line: [[f32; LANES]; 3],
    step: [f32; LANES],
    center_left: u64,
}

impl Crossings {
    /// Cuts edges as [`Site::cut`] does. `None` if none of the `valid` pairs is one.
    ///
    /// Sums are in the order of [`Site::locate`] and [`center_is_left`], of which faces ask the same.
    #[inline(always)]
    fn of<S: Simd>(
        site: &SiteVector<S>,
        edge: &EdgeVector<S>,
        valid: u64,
        is_parallel: bool,
    ) -> Option<Self> {
        let (from, to) = (sub(edge.a, site.point), sub(edge.b, site.point));
        let heights = [dot(site.normal, from) - site.tolerance, dot(site.normal, to) - site.tolerance];
        let (mut a, mut b) = (site.locate(from), site.locate(to));
        let multiplicity = edge.multiplicity(site.point);
        let dead = beside([a[0], a[2]], [b[0], b[2]])
            | beside([a[1], a[2]], [b[1], b[2]])
            | multiplicity.simd_eq(0.0).to_bitmask();
        let mut there = !dead & valid;
        if let Some(far) = edge.far {
            // NaN does not rise.
            there &= !dot(site.normal, sub(far, site.point)).simd_gt(site.tolerance).to_bitmask();
        }
        if there == 0 {
            return None;
        }
        let center_left = is_left(cross(a, b));
        there &= keep(heights, &mut a, &mut b);
        there &= keep([a[2], b[2]], &mut a, &mut b);
        if !is_parallel {
            there &= keep([1.0 - a[2], 1.0 - b[2]], &mut a, &mut b);
        }
        if there == 0 {
            return None;
        }
        let [x, y, z] = cross(a, b);
        // −1 where the centre lies left of it.
        let step = multiplicity * site.orientation;
        Some(Self {
            there,
            ends: [[a[0].to_array(), a[1].to_array()], [b[0].to_array(), b[1].to_array()]],
            line: [x.to_array(), y.to_array(), z.to_array()],
            step: step.to_array(),
            center_left,
        })
    }

    #[inline(always)]
    fn lane(&self, lane: usize) -> Crossing {
        let (Self { ends: [a, b], line: [x, y, z], step, .. }, center_left) =
            (self, self.center_left >> lane & 1 == 1);
        Crossing {
            ends: [[a[0][lane], a[1][lane]], [b[0][lane], b[1][lane]]],
            line: [x[lane], y[lane], z[lane]],
            step: if center_left { -step[lane] } else { step[lane] },
            center_left,
        }
    }
}

/// Whether edges lie beyond t on one side of the square, given one coordinate and t of both ends; a bit each.
#[inline(always)]
fn beside<S: Simd>(a: [f32x16<S>; 2], b: [f32x16<S>; 2]) -> u64 {
    let (above, below) =
        (a[0].simd_gt(a[1]) & b[0].simd_gt(b[1]), (-a[0]).simd_gt(a[1]) & (-b[0]).simd_gt(b[1]));
    (above | below).to_bitmask()
}

/// [`center_is_left`] of lines a × b, a bit each.
#[inline(always)]
pub(crate) fn is_left<S: Simd>([x, y, z]: [f32x16<S>; 3]) -> u64 {
    let left = z.simd_gt(0.0).to_bitmask();
    let ties = z.simd_eq(0.0).to_bitmask();
    if ties == 0 {
        return left;
    }
    let below = y.simd_gt(0.0).to_bitmask() & x.simd_eq(0.0).to_bitmask();
    left | ties & (x.simd_gt(0.0).to_bitmask() | below)
}

/// Cuts off where `by` is not above 0. A bit for each edge of which something is left.
#[inline(always)]
fn keep<S: Simd>(by: [f32x16<S>; 2], a: &mut [f32x16<S>; 3], b: &mut [f32x16<S>; 3]) -> u64 {
    let below = [by[0].simd_le(0.0), by[1].simd_le(0.0)];
    if (below[0] | below[1]).to_bitmask() != 0 {
        let share = by[0] / (by[0] - by[1]);
        for (a, b) in a.iter_mut().zip(b) {
            let cut = *a + (*b - *a) * share;
            *a = below[0].select(cut, *a);
            *b = below[1].select(cut, *b);
        }
    }
    !(below[0] & below[1]).to_bitmask()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silhouettes::Edge;
    use fearless_simd::{Level, dispatch};
    use glam::Vec4;
    use gnomon_shadow_map::light_maps::Receiver;
    use scene_core::Light;

    const LIGHT: Light = Light::Rect { center: Vec3::new(0.0, 4.0, 0.0), half_u: Vec3::X, half_v: Vec3::Z };

    /// An open edge along z at (x, 1, ·) of a face that reaches to −∞: 1 face left of it as the ground sees it.
    fn half_plane(x: f32) -> Edge {
        // The face's normal points down: seen from the ground it is counter-clockwise with +z running… the sum says it.
        let (a, b) = (Vec3::new(x, 1.0, -50.0), Vec3::new(x, 1.0, 50.0));
        let corners = [a, b, Vec3::new(x - 50.0, 1.0, 0.0)];
        let plane = crate::silhouettes::plane(corners, Vec3::ZERO);
        let planes = [plane, Vec4::ZERO];
        Edge { a, b, planes, signs: [1.0, 0.0], from_center: 0, far: Vec3::NAN }
    }

    /// By a receiver and sixteen edges at once, and by an edge and sixteen receivers.
    fn visible(point: Vec3, edges: &[Edge], at_center: i32) -> f32 {
        let receiver = Receiver { point, normal: Vec3::Y, object: 0, tolerance: 1e-6, pixel: [0; 2] };
        let (mut tile, mut sites, mut counter) = (TileEdges::default(), Sites::default(), Counter::default());
        edges.iter().for_each(|edge| tile.push(edge));
        // Half a step inside, so that no point lies on an edge.
        let grid = |i: u32| Vec2::new((i % 32) as f32, (i / 32) as f32) / 16.0 + (1.0 / 32.0 - 1.0);
        counter.set_points(&(0..1024).map(grid).collect::<Vec<_>>());
        let found = dispatch!(Level::new(), simd => {
            sites.place(&[(0, receiver); 20], Vec3::ZERO);
            sites.set_light(simd, &LIGHT);
            counter.set_receiver(simd, &sites, 17, &tile);
            let one = counter.visible(simd, 0, at_center, 0.0);
            counter.set_receivers(simd, &sites, 1, &tile);
            [one, counter.visible(simd, 3, at_center, 0.0)]
        });
        assert_eq!(found[0], found[1]);
        found[0]
    }

    /// The receiver at x under a half-plane that ends at 0: the line through the edge meets the light at −3x, so that the
    /// part right of it is seen, V = (1 + 3x)/2; both where the centre is seen and where it is not.
    #[test]
    fn a_half_plane_hides_what_lies_left_of_its_edge() {
        for x in [-0.3f32, -0.11, -0.05, 0.04, 0.21, 0.29] {
            let v = visible(Vec3::new(x, 0.0, 0.0), &[half_plane(0.0)], i32::from(x < 0.0));
            assert!((v - 0.5 * (1.0 + 3.0 * x)).abs() <= 1.0 / 32.0, "{x}: {v}");
        }
        assert_eq!(visible(Vec3::new(0.5, 0.0, 0.0), &[half_plane(0.0)], 0), 1.0);
        assert_eq!(visible(Vec3::new(-0.5, 0.0, 0.0), &[half_plane(0.0)], 1), 0.0);
    }

    /// Two layers are two: a second one over all of the light hides what the first lets through.
    #[test]
    fn a_layer_without_an_edge_in_reach_hides_all() {
        let point = Vec3::new(-0.1, 0.0, 0.0);
        assert_eq!(visible(point, &[half_plane(0.0)], 2), 0.0);
        // Two half-planes one over the other are as the larger.
        let both = visible(point, &[half_plane(0.0), half_plane(0.1)], 2);
        assert_eq!(both, visible(point, &[half_plane(0.1)], 1));
    }

    #[test]
    fn what_lies_below_the_receiver_or_behind_the_light_does_not_count() {
        let point = Vec3::new(0.1, 0.0, 0.0);
        let moved = |y: f32| {
            let mut edge = half_plane(0.0);
            edge.a.y += y;
            edge.b.y += y;
            edge
        };
        assert_eq!(visible(point, &[moved(-1.5)], 0), 1.0);
        assert_eq!(visible(point, &[moved(4.0)], 0), 1.0);
    }
}
