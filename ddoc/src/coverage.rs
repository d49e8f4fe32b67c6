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

use fearless_simd::Simd;
use glam::{Mat3, Vec2, Vec3};
use gnomon_shadow_map::light_cone::LightCone;
use gnomon_shadow_map::light_maps::Receiver;
use scene_core::light::LightPoint;

use crate::tile_edges::{LANES, TileEdges};

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

/// Edges of one vector, cut, in (a, b, t).
#[derive(Clone, Copy, Debug)]
struct Crossings {
    /// (a, b) of both ends.
    a: [[f32; LANES]; 2],
    b: [[f32; LANES]; 2],
    /// a × b.
    line: [[f32; LANES]; 3],
    /// What crossing one on the way from the centre adds; 0 for an edge that does not lie over the light.
    step: [f32; LANES],
    /// Whether the centre lies left of it.
    center_left: [bool; LANES],
}

/// Points of the light and what is counted at them; memory that is kept from receiver to receiver.
#[derive(Debug, Default)]
pub struct Counter {
    /// The points' a and b.
    xs: Vec<f32>,
    ys: Vec<f32>,
    /// n(s) − n(c).
    counts: Vec<f32>,
    /// The edges as the light's points are asked about them.
    crossings: Vec<Crossings>,
    /// Edges that were cut and counted for the last receiver.
    pub counted: u32,
}

impl Counter {
    /// Takes the points of the light for the receivers to come.
    pub fn set_points(&mut self, points: impl Iterator<Item = Vec2>) {
        self.xs.clear();
        self.ys.clear();
        for point in points {
            self.xs.push(point.x);
            self.ys.push(point.y);
        }
        let padded = self.xs.len().next_multiple_of(LANES);
        // Copies of the last point: they change no least count.
        let last = (self.xs.last().copied().unwrap_or(0.0), self.ys.last().copied().unwrap_or(0.0));
        self.xs.resize(padded, last.0);
        self.ys.resize(padded, last.1);
    }

    /// The share of the first `taps` points before which no face lies, if `at_center` lie before the centre.
    ///
    /// Counts below 0 would be a contradiction: `at_center` was found too small, and is raised.
    #[inline(always)]
    pub fn visible<S: Simd>(
        &mut self,
        simd: S,
        site: &Site,
        edges: &TileEdges,
        at_center: i32,
        taps: usize,
    ) -> f32 {
        self.count(simd, site, edges);
        let least = self.counts.iter().copied().fold(0.0, f32::min);
        let clear = -(at_center as f32).max(-least);
        let seen = self.counts[..taps].iter().map(|&count| u32::from(count == clear)).sum::<u32>();
        seen as f32 / taps as f32
    }

    #[inline(always)]
    fn count<S: Simd>(&mut self, _simd: S, site: &Site, edges: &TileEdges) {
        self.counts.clear();
        self.counts.resize(self.xs.len(), 0.0);
        self.counted = 0;
        self.crossings.clear();
        for first in (0..edges.len()).step_by(LANES) {
            self.crossings.push(crossings(site, edges, first));
        }
        for crossings in &self.crossings {
            for lane in 0..LANES {
                let step = crossings.step[lane];
                if step == 0.0 {
                    continue;
                }
                self.counted += 1;
                let [[ax, ay], [bx, by]] =
                    [&crossings.a, &crossings.b].map(|end| [end[0][lane], end[1][lane]]);
                let [line_x, line_y, line_z] = [0, 1, 2].map(|i| crossings.line[i][lane]);
                let center_left = crossings.center_left[lane];
                let taps = self.xs.chunks_exact(LANES).zip(self.ys.chunks_exact(LANES));
                for ((xs, ys), counts) in taps.zip(self.counts.chunks_exact_mut(LANES)) {
                    for ((&x, &y), count) in xs.iter().zip(ys).zip(counts) {
                        let sides = ((x * ay - y * ax) < 0.0) != ((x * by - y * bx) < 0.0);
                        let left = (line_x * x + line_y * y + line_z) > 0.0;
                        let crossed = sides & (left != center_left);
                        *count += if crossed { step } else { 0.0 };
                    }
                }
            }
        }
    }
}

/// Finds of one vector of edges those that may lie over the light: m(e) ≠ 0, not below the receiver's plane, and not beside
/// the square around the light (all tests are linear, so they are asked of the ends); and cuts them as [`Site::cut`] does.
///
/// Sums are in the order of [`Site::locate`] and [`center_is_left`], of which faces ask the same.
#[inline(always)]
fn crossings(site: &Site, edges: &TileEdges, first: usize) -> Crossings {
    let Site { point, normal, tolerance, orientation, is_parallel, .. } = *site;
    let m = site.light_from_receiver.transpose();
    let part = |i: usize| edges.part(i, first);
    let [ax, ay, az, bx, by, bz] = [0, 1, 2, 3, 4, 5].map(part);
    let [px, py, pz, pd, qx, qy, qz, qd] = [6, 7, 8, 9, 10, 11, 12, 13].map(part);
    let (p_sign, q_sign) = (part(14), part(15));
    let mut all = Crossings {
        a: [[0.0; LANES]; 2],
        b: [[0.0; LANES]; 2],
        line: [[0.0; LANES]; 3],
        step: [0.0; LANES],
        center_left: [false; LANES],
    };
    let mut counts = [false; LANES];
    for lane in 0..LANES {
        let from = [ax[lane] - point.x, ay[lane] - point.y, az[lane] - point.z];
        let to = [bx[lane] - point.x, by[lane] - point.y, bz[lane] - point.z];
        let heights = [dot(normal, from) - tolerance, dot(normal, to) - tolerance];
        let mut a = [dot(m.x_axis, from), dot(m.y_axis, from), dot(m.z_axis, from)];
        let mut b = [dot(m.x_axis, to), dot(m.y_axis, to), dot(m.z_axis, to)];
        let beside = ((a[0] > a[2]) & (b[0] > b[2]))
            | ((-a[0] > a[2]) & (-b[0] > b[2]))
            | ((a[1] > a[2]) & (b[1] > b[2]))
            | ((-a[1] > a[2]) & (-b[1] > b[2]));
        let mut there = !beside;
        let [x, y, z] = cross(a, b);
        let center_left = (z > 0.0) | ((z == 0.0) & ((x > 0.0) | ((x == 0.0) & (y > 0.0))));
        there &= keep(heights, &mut a, &mut b);
        there &= keep([a[2], b[2]], &mut a, &mut b);
        let before = [1.0 - a[2], 1.0 - b[2]];
        there &= keep(if is_parallel { [1.0; 2] } else { before }, &mut a, &mut b);
        for i in 0..2 {
            (all.a[i][lane], all.b[i][lane]) = (a[i], b[i]);
        }
        for (all, line) in all.line.iter_mut().zip(cross(a, b)) {
            all[lane] = line;
        }
        (all.center_left[lane], counts[lane]) = (center_left, there);
    }
    for lane in 0..LANES {
        let side = |x: f32, y: f32, z: f32, d: f32, sign: f32| {
            let at = x * point.x + y * point.y + z * point.z + d;
            if at >= 0.0 { sign } else { -sign }
        };
        let multiplicity = side(px[lane], py[lane], pz[lane], pd[lane], p_sign[lane])
            + side(qx[lane], qy[lane], qz[lane], qd[lane], q_sign[lane]);
        let step = multiplicity * orientation * if all.center_left[lane] { -1.0 } else { 1.0 };
        all.step[lane] = if counts[lane] { step } else { 0.0 };
    }
    if edges.has_far() {
        let [fx, fy, fz] = [16, 17, 18].map(part);
        for lane in 0..LANES {
            let far = [fx[lane] - point.x, fy[lane] - point.y, fz[lane] - point.z];
            // NaN does not rise.
            let rises = dot(normal, far) > tolerance;
            all.step[lane] = if rises { 0.0 } else { all.step[lane] };
        }
    }
    all
}

#[inline(always)]
fn dot(axis: Vec3, v: [f32; 3]) -> f32 {
    axis.x * v[0] + axis.y * v[1] + axis.z * v[2]
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

/// Cuts off where `by` is not above 0; false if nothing is left.
#[inline(always)]
fn keep(by: [f32; 2], a: &mut [f32; 3], b: &mut [f32; 3]) -> bool {
    let below = by.map(|by| by <= 0.0);
    let share = by[0] / (by[0] - by[1]);
    for (a, b) in a.iter_mut().zip(b) {
        let cut = *a + (*b - *a) * share;
        *a = if below[0] { cut } else { *a };
        *b = if below[1] { cut } else { *b };
    }
    !(below[0] & below[1])
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
        tile.pad();
        let mut counter = Counter::default();
        // Half a step inside, so that no point lies on an edge.
        let grid = |i: u32| Vec2::new((i % 32) as f32, (i / 32) as f32) / 16.0 + (1.0 / 32.0 - 1.0);
        counter.set_points((0..1024).map(grid));
        dispatch!(Level::new(), simd => counter.visible(simd, &site, &tile, at_center, 1024))
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
