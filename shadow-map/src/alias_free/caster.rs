//! A triangle as the window sees it: three edges and a plane, and how far rounding lets one trust them.
//!
//! # What is certain
//! The exact test ([`scene_core::bvh::blocks`]) rounds corners relative to the receiver, so what it tests is a
//! triangle whose points, the receiver and the light are each moved by a little ([`Frame::shift`]). Let τ be more
//! than all of these together with the rounding of the numbers below.
//! * A receiver on the outer side of an edge's line by more than τ is outside: all of the triangle is on the line's
//!   other side, and moving does not bring them together.
//! * A receiver on the inner side of all three by more than τ is inside: its disk of radius τ is within the triangle,
//!   and no border moves across it.
//! * Of the plane, the nearness at the receiver is off by its slope times τ, and by what nearness itself is off.
//!
//! All else is doubt, and doubt is asked of the exact test.

use glam::{DVec3, DVec4, Vec3};

use super::frame::{Frame, U};

/// Window coordinates beyond which a corner is clipped: more would lose digits.
const GUARD: f64 = 16.0;

/// Where the frustum is cut: far enough outside the window that no rounding reaches in.
const CUT: f64 = 2.0;

/// Corners a clipped triangle has at most: one more for each of four planes.
const MAX_CORNERS: usize = 8;

/// A triangle, or a piece of one, over the window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Caster {
    /// Per edge a, b, c of a·x + b·y + c, positive inside, with |a| + |b| = 1: a distance.
    pub(super) edges: [[f32; 3]; 3],
    /// Likewise the nearness of its plane.
    pub(super) plane: [f32; 3],
    /// The largest nearness of a corner.
    pub(super) nearest: f32,
    /// How far from an edge one must be to be sure of the side.
    pub(super) tau: f32,
    /// How far from the plane.
    pub(super) plane_tau: f32,
    /// Bounds in the window, τ included.
    pub(super) min: [f32; 2],
    /// Their other end.
    pub(super) max: [f32; 2],
}

impl Caster {
    /// What may be anywhere: every receiver must ask the exact test.
    const UNKNOWN: Self = Self {
        edges: [[0.0; 3]; 3],
        plane: [0.0; 3],
        nearest: f32::INFINITY,
        tau: f32::INFINITY,
        plane_tau: f32::INFINITY,
        // Finite, as an empty box lies at infinity.
        min: [-f32::MAX; 2],
        max: [f32::MAX; 2],
    };

    /// A triangle by its corners' window coordinates and nearness.
    fn new(frame: &Frame, corners: [DVec3; 3]) -> Self {
        // Rounded first: differences of f32 are exact in f64, and so is the sign of the area.
        let [p0, p1, p2] = corners.map(|p| p.as_vec3().as_dvec3());
        let (min, max) = (p0.min(p1).min(p2), p0.max(p1).max(p2));
        let farthest = min.truncate().abs().max(max.truncate().abs()).max_element();
        let shift = frame.shift(max.z, farthest);
        // Twice: corners and receiver are rounded to f32. Then eight roundings of sums and products of at most 1.
        let tau = shift.window + U * (12.0 + 4.0 * farthest);
        let (u, v) = (p1 - p0, p2 - p0);
        let area = u.x * v.y - v.x * u.y;
        let turn = area.signum();
        let mut perimeter = 0.0;
        let mut edges = [[0.0; 3]; 3];
        for (edge, (from, to)) in edges.iter_mut().zip([(p0, p1), (p1, p2), (p2, p0)]) {
            let (a, b) = ((from.y - to.y) * turn, (to.x - from.x) * turn);
            let length = a.abs() + b.abs();
            perimeter += length;
            // Without an area there is no inner side, without a length no line.
            if area != 0.0 && length > 0.0 {
                let (a, b) = (a / length, b / length);
                *edge = [a as f32, b as f32, -(a * from.x + b * from.y) as f32];
            }
        }
        // Twice the area is the inscribed circle's radius times the perimeter. Where it is too small to be sure of
        // the inside, the plane decides nothing but that its nearest corner is not exceeded.
        let needle = area.abs() <= 0.25 * tau * perimeter;
        let nearness = max.z.abs().max(min.z.abs());
        let off = shift.nearness + 4.0 * U * nearness;
        let (plane, plane_tau) = if needle {
            ([0.0, 0.0, max.z], off)
        } else {
            let a = (u.z * v.y - v.z * u.y) / area;
            let b = (u.x * v.z - v.x * u.z) / area;
            let c = p0.z - a * p0.x - b * p0.y;
            let slope = a.abs() + b.abs();
            // Coefficients, products and sums are rounded: four times U of each term.
            ([a, b, c], slope * tau + off + 4.0 * U * (c.abs() + slope))
        };
        // Outwards, as bounds are rounded too.
        let grown = tau * (1.0 + 4.0 * U);
        Self {
            edges,
            plane: plane.map(|x| x as f32),
            nearest: (max.z as f32).next_up(),
            tau: (tau as f32).next_up(),
            plane_tau: (plane_tau as f32).next_up(),
            min: [(min.x - grown) as f32, (min.y - grown) as f32].map(f32::next_down),
            max: [(max.x + grown) as f32, (max.y + grown) as f32].map(f32::next_up),
        }
    }
}

/// Hands on what the window sees of a triangle: nothing, all of it, or pieces.
#[inline(always)]
pub(super) fn seen(frame: &Frame, corners: [Vec3; 3], mut emit: impl FnMut(Caster)) {
    let corners = corners.map(|corner| frame.homogeneous(corner));
    let margin = frame.margin();
    let outside = |side: fn(DVec4) -> f64| corners.iter().all(|&p| side(p) > CUT * p.w + margin);
    if outside(|p| p.x) || outside(|p| -p.x) || outside(|p| p.y) || outside(|p| -p.y) {
        return;
    }
    let fits = |p: &DVec4| !frame.is_too_near(p.w) && p.x.abs().max(p.y.abs()) <= GUARD * p.w;
    if corners.iter().all(fits) {
        emit(Caster::new(frame, corners.map(|p| p.truncate() / p.w)));
    } else {
        pieces(frame, corners, emit);
    }
}

/// A triangle that reaches far out of the window or behind the light: cut to the frustum, as a fan. What comes too
/// near to the light is unknown as a whole.
#[cold]
fn pieces(frame: &Frame, corners: [DVec4; 3], mut emit: impl FnMut(Caster)) {
    if !corners.iter().all(|p| p.is_finite()) {
        return emit(Caster::UNKNOWN);
    }
    let margin = frame.margin();
    let mut polygon = [DVec4::ZERO; MAX_CORNERS];
    polygon[..3].copy_from_slice(&corners);
    let mut count = 3;
    for side in [DVec4::X, DVec4::NEG_X, DVec4::Y, DVec4::NEG_Y] {
        let inside = |p: DVec4| CUT * p.w + margin - side.dot(p);
        let (before, mut kept) = (polygon, 0);
        for i in 0..count {
            let (a, b) = (before[i], before[(i + 1) % count]);
            let (da, db) = (inside(a), inside(b));
            let mut keep = |p| {
                if let Some(slot) = polygon.get_mut(kept) {
                    *slot = p;
                    kept += 1;
                }
            };
            if da >= 0.0 {
                keep(a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                keep(a + (b - a) * (da / (da - db)));
            }
        }
        count = kept.min(MAX_CORNERS);
    }
    let polygon = &polygon[..count];
    if polygon.iter().any(|p| frame.is_too_near(p.w)) {
        return emit(Caster::UNKNOWN);
    }
    let at = |i: usize| polygon[i].truncate() / polygon[i].w;
    for i in 1..count.saturating_sub(1) {
        emit(Caster::new(frame, [at(0), at(i), at(i + 1)]));
    }
}

#[cfg(test)]
mod tests {
    use scene_core::geometry::Aabb;
    use scene_core::light::LightPoint;

    use super::super::frame::views;
    use super::*;

    fn frame(light: LightPoint) -> Frame {
        let receivers = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 0.0, 1.0)];
        let casters = Aabb { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) };
        views(light, &receivers, vec![0, 1], casters).remove(0).frame
    }

    fn of(frame: &Frame, corners: [Vec3; 3]) -> Vec<Caster> {
        let mut casters = Vec::new();
        seen(frame, corners, |caster| casters.push(caster));
        casters
    }

    #[test]
    fn edges_are_distances_to_the_inner_side() {
        let frame = frame(LightPoint::At(Vec3::new(0.2, 4.0, 0.1)));
        let corners = [Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.5, 1.0, 0.0), Vec3::new(0.0, 1.5, 0.5)];
        for corners in [corners, [corners[1], corners[0], corners[2]]] {
            let caster = of(&frame, corners)[0];
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            let p = frame.homogeneous(middle);
            let p = (p.truncate() / p.w).as_vec3();
            for [a, b, c] in caster.edges {
                assert!((a.abs() + b.abs() - 1.0).abs() < 1e-6);
                assert!(a * p.x + b * p.y + c > caster.tau);
            }
            let [a, b, c] = caster.plane;
            assert!((a * p.x + b * p.y + c - p.z).abs() < caster.plane_tau);
            assert!(caster.tau < 1e-5 && caster.plane_tau < 1e-4 * caster.nearest);
        }
    }

    #[test]
    fn what_the_window_does_not_see_is_dropped_and_what_surrounds_the_light_is_cut() {
        let frame = frame(LightPoint::At(Vec3::new(0.0, 4.0, 0.0)));
        let beside = [Vec3::new(9.0, 0.0, 0.0), Vec3::new(9.0, 0.0, 1.0), Vec3::new(9.0, 1.0, 0.0)];
        assert!(of(&frame, beside).is_empty());
        let behind = beside.map(|p| p - Vec3::X * 9.0 + Vec3::Y * 6.0);
        assert!(of(&frame, behind).is_empty());
        // A plane through the view that also passes behind the light.
        let slanted = [Vec3::new(-9.0, 1.0, -9.0), Vec3::new(9.0, 1.0, -9.0), Vec3::new(0.0, 2.0, 40.0)];
        let pieces = of(&frame, slanted);
        assert!(!pieces.is_empty() && pieces.iter().all(|piece| piece.tau < 1e-3));
        // Next to the light itself.
        let light = Vec3::new(0.0, 4.0, 0.0);
        let touching =
            [light - Vec3::Y * 1e-6, light + Vec3::new(1.0, -1.0, 0.0), light + Vec3::new(0.0, -1.0, 1.0)];
        assert_eq!(of(&frame, touching)[0].tau, f32::INFINITY);
    }

    #[test]
    fn a_line_has_no_inside() {
        let frame = frame(LightPoint::Towards(Vec3::Y));
        let caster = of(&frame, [Vec3::ZERO, Vec3::Y, Vec3::new(0.0, 0.5, 0.0)])[0];
        assert_eq!(caster.edges, [[0.0; 3]; 3]);
        assert_eq!(caster.plane[..2], [0.0; 2]);
    }
}
