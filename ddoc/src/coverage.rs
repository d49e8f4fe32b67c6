//! Step 4: V of a receiver from the edges around it.
//!
//! From the receiver p every edge is projected onto the light, in the coordinates (a, b, t) of
//! [`LightCone`]: a point of the light is (a/t, b/t). The number of faces before the light's
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

use fearless_simd::{Simd, SimdBase, SimdMask, f32x16, mask32x16};
use glam::{Mat3, Vec2, Vec3};
use gnomon_shadow_map::light_cone::LightCone;
use gnomon_shadow_map::light_maps::Receiver;
use scene_core::light::LightPoint;

use crate::lanes::LANES;
use crate::tile_edges::{TileEdges, cross, dot};

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
    light_from_receiver: Mat3,
    /// o.
    orientation: f32,
    /// Whether nothing lies behind the light.
    is_parallel: bool,
}

impl Site {
    /// Of a receiver at `point`.
    pub fn new(point: Vec3, normal: Vec3, tolerance: f32, cone: &LightCone, is_parallel: bool) -> Self {
        let right_handed = cone.u.cross(cone.v).dot(cone.w) > 0.0;
        Self {
            point,
            normal,
            tolerance,
            light_from_receiver: cone.light_from_receiver(),
            orientation: if right_handed { -1.0 } else { 1.0 },
            is_parallel,
        }
    }

    /// Under a light without extent, which has no cone: b and a are two directions across the way to its centre, t is along
    /// it.
    pub fn without_cone(receiver: &Receiver, origin: Vec3, center: LightPoint) -> Self {
        let (to_center, _) = center.ray_from(receiver.point);
        let w = to_center.normalize_or(receiver.normal);
        let (u, v) = w.any_orthonormal_pair();
        Self {
            point: receiver.point - origin,
            normal: receiver.normal,
            tolerance: receiver.tolerance,
            light_from_receiver: Mat3::from_cols(u, v, w).transpose(),
            orientation: -1.0,
            is_parallel: true,
        }
    }

    /// (a, b, t) of a point.
    #[inline]
    pub(crate) fn locate(&self, point: Vec3) -> Vec3 {
        self.light_from_receiver * (point - self.point)
    }

    /// (a, b, t) of a vector of points, counted from the receiver.
    #[inline(always)]
    pub(crate) fn locate_vector<S: Simd>(&self, from_receiver: [f32x16<S>; 3]) -> [f32x16<S>; 3] {
        let rows = self.light_from_receiver.transpose();
        [dot(rows.x_axis, from_receiver), dot(rows.y_axis, from_receiver), dot(rows.z_axis, from_receiver)]
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

/// Points of the light and what is counted at them; memory that is kept from receiver to receiver.
#[derive(Debug, Default)]
pub struct Counter {
    /// The points' a and b.
    xs: Vec<f32>,
    ys: Vec<f32>,
    /// The edges that may lie over the light of the receiver at hand.
    crossings: Vec<Crossing>,
}

impl Counter {
    /// Takes the points of the light for the receivers to come.
    #[inline(always)]
    pub fn set_points(&mut self, points: impl ExactSizeIterator<Item = Vec2>) {
        let count = points.len();
        let padded = count.next_multiple_of(LANES);
        self.xs.resize(padded, 0.0);
        self.ys.resize(padded, 0.0);
        for ((x, y), point) in self.xs.iter_mut().zip(&mut self.ys).zip(points) {
            (*x, *y) = (point.x, point.y);
        }
        if count > 0 {
            // Copies of the last point: they change no least count.
            let (x, y) = (self.xs[count - 1], self.ys[count - 1]);
            self.xs[count..].fill(x);
            self.ys[count..].fill(y);
        }
    }

    /// Finds the edges that may lie over the light of a receiver: m(e) ≠ 0, not below its plane, and not beside the square
    /// around the light (all tests are linear, so they are asked of the ends). Returns by how many faces they may change
    /// the count at most.
    #[inline(always)]
    pub fn set_receiver<S: Simd>(&mut self, simd: S, site: &Site, edges: &TileEdges) -> f32 {
        self.crossings.clear();
        let mut most = 0.0;
        for vector in 0..edges.vectors() {
            most += find_crossings(simd, site, edges, vector, &mut self.crossings);
        }
        most
    }

    /// The share of the first `taps` points before which no face lies, if `at_center` lie before the centre.
    ///
    /// Counts below 0 would be a contradiction: `at_center` was found too small, and is raised.
    #[inline(always)]
    pub fn visible<S: Simd>(&mut self, simd: S, at_center: i32, taps: usize) -> f32 {
        let raised = at_center as f32;
        // Without a contradiction −at_center is the count of clear points; with one the least count is.
        let (mut least, mut of_least, mut clear) = (0.0f32, 0u32, 0u32);
        for first in (0..taps).step_by(LANES) {
            let counts = self.count(simd, first);
            let valid = (1u64 << (taps - first).min(LANES)) - 1;
            let found = counts.reduce_min();
            if found < least {
                (least, of_least) = (found, 0);
            }
            of_least += (counts.simd_eq(least).to_bitmask() & valid).count_ones();
            clear += (counts.simd_eq(-raised).to_bitmask() & valid).count_ones();
        }
        let seen = if -least > raised { of_least } else { clear };
        seen as f32 / taps as f32
    }

    /// n(s) − n(c) of a vector of points.
    #[inline(always)]
    fn count<S: Simd>(&self, simd: S, first: usize) -> f32x16<S> {
        let x = f32x16::from_slice(simd, &self.xs[first..first + LANES]);
        let y = f32x16::from_slice(simd, &self.ys[first..first + LANES]);
        let (nothing, mut counts) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 0.0));
        for &Crossing { ends: [a, b], line, step, center_left } in &self.crossings {
            let sides = (x * a[1] - y * a[0]).simd_lt(0.0) ^ (x * b[1] - y * b[0]).simd_lt(0.0);
            let left = (x * line[0] + y * line[1] + line[2]).simd_gt(0.0);
            let crossed = sides & (left ^ mask32x16::splat(simd, center_left));
            counts += fearless_simd::Select::select(crossed, f32x16::splat(simd, step), nothing);
        }
        counts
    }
}

/// [`Counter::set_receiver`] of one vector of edges; cuts them as [`Site::cut`] does.
///
/// Sums are in the order of [`Site::locate`] and [`center_is_left`], of which faces ask the same.
#[inline(always)]
fn find_crossings<S: Simd>(
    simd: S,
    site: &Site,
    edges: &TileEdges,
    vector: usize,
    found: &mut Vec<Crossing>,
) -> f32 {
    let Site { point, normal, tolerance, orientation, is_parallel, .. } = *site;
    let (from, to) = (edges.from(simd, vector, 0, point), edges.from(simd, vector, 3, point));
    let heights = [dot(normal, from) - tolerance, dot(normal, to) - tolerance];
    let (mut a, mut b) = (site.locate_vector(from), site.locate_vector(to));
    let multiplicity = edges.multiplicity(simd, vector, point);
    let dead = beside([a[0], a[2]], [b[0], b[2]])
        | beside([a[1], a[2]], [b[1], b[2]])
        | multiplicity.simd_eq(0.0).to_bitmask();
    let mut there = !dead & edges.valid(vector);
    if edges.has_far() {
        let far = edges.from(simd, vector, 16, point);
        // NaN does not rise.
        there &= !dot(normal, far).simd_gt(tolerance).to_bitmask();
    }
    if there == 0 {
        return 0.0;
    }
    let [x, y, z] = cross(a, b);
    let center_left = is_left([x, y, z]);
    there &= keep(heights, &mut a, &mut b);
    there &= keep([a[2], b[2]], &mut a, &mut b);
    if !is_parallel {
        there &= keep([1.0 - a[2], 1.0 - b[2]], &mut a, &mut b);
    }
    if there == 0 {
        return 0.0;
    }
    let [x, y, z] = cross(a, b);
    let line = [x.to_array(), y.to_array(), z.to_array()];
    let (a, b) = ([a[0].to_array(), a[1].to_array()], [b[0].to_array(), b[1].to_array()]);
    let multiplicity = multiplicity.to_array();
    let mut most = 0.0;
    while there != 0 {
        let lane = there.trailing_zeros() as usize % LANES;
        there &= there - 1;
        let center_left = center_left >> lane & 1 == 1;
        let step = multiplicity[lane] * orientation * if center_left { -1.0 } else { 1.0 };
        most += step.abs();
        let ends = [[a[0][lane], a[1][lane]], [b[0][lane], b[1][lane]]];
        found.push(Crossing { ends, line: line.map(|line| line[lane]), step, center_left });
    }
    most
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
            *a = fearless_simd::Select::select(below[0], cut, *a);
            *b = fearless_simd::Select::select(below[1], cut, *b);
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

    fn visible(point: Vec3, edges: &[Edge], at_center: i32) -> f32 {
        let cone = LightCone::new(&LIGHT, point).unwrap();
        let site = Site::new(point, Vec3::Y, 1e-6, &cone, false);
        let mut tile = TileEdges::default();
        edges.iter().for_each(|edge| tile.push(edge));
        let mut counter = Counter::default();
        // Half a step inside, so that no point lies on an edge.
        let grid = |i: u32| Vec2::new((i % 32) as f32, (i / 32) as f32) / 16.0 + (1.0 / 32.0 - 1.0);
        counter.set_points((0..1024).map(grid));
        dispatch!(Level::new(), simd => {
            counter.set_receiver(simd, &site, &tile);
            counter.visible(simd, at_center, 1024)
        })
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
