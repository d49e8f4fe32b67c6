//! Where the light looks from and to: window coordinates that are fitted to the receivers.
//!
//! A window spans [−1, 1]² over the receivers of one view of the light: one parallel view for a direction, one
//! perspective view where the receivers lie within 60° of an axis, else the faces of a cube. With x and y goes the
//! *nearness* q: larger is nearer to the light, and over any plane q is affine in x and y (a distance for
//! parallel light, a reciprocal distance for a place).

use glam::{DVec2, DVec3, DVec4, Vec3};
use rayon::prelude::*;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;

/// 2⁻²⁴, the relative error of rounding to f32.
pub(super) const U: f64 = 1.0 / (1_u32 << 24) as f64;

/// Tangent of the half angle up to which one perspective view serves, 60°.
const MAX_TAN: f64 = 1.732;

/// How much closer to the light than the extent of it all a triangle may come before its window coordinates mean
/// nothing: 2⁻¹².
pub(super) const NEAREST: f64 = 1.0 / 4096.0;

/// Receivers a task takes.
const CHUNK: usize = 4096;

/// One view of the light.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    /// Across, upwards, and along the view: away from a place, towards a direction.
    axes: [DVec3; 3],
    origin: DVec3,
    center: DVec2,
    scale: DVec2,
    central: bool,
    /// The largest difference of two coordinates of casters, receivers and light, in scene units.
    pub(super) reach: f64,
}

/// What is behind a triangle's window coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shift {
    /// How far rounding may move a corner against a receiver, in window units.
    pub(super) window: f64,
    /// How far it may move a nearness.
    pub(super) nearness: f64,
}

impl Frame {
    /// x·w, y·w, q·w and w of a point in world space; w is the distance along the axis of a perspective view, 1 in a
    /// parallel one.
    #[inline(always)]
    pub(super) fn homogeneous(&self, point: Vec3) -> DVec4 {
        let p = point.as_dvec3() - self.origin;
        let [x, y, z] = [self.axes[0].dot(p), self.axes[1].dot(p), self.axes[2].dot(p)];
        let (w, nearness) = if self.central { (z, self.reach * NEAREST) } else { (1.0, z / self.reach) };
        DVec4::new(
            (x - self.center.x * w) * self.scale.x,
            (y - self.center.y * w) * self.scale.y,
            nearness,
            w,
        )
    }

    /// Whether a point at this w is too near to the light's plane, or behind it, to have window coordinates.
    #[inline(always)]
    pub(super) fn is_too_near(&self, w: f64) -> bool {
        w < self.reach * NEAREST
    }

    /// A margin around the frustum that no rounding crosses, to add to x·w: 2⁻²⁰ of the extent, sixteen roundings.
    pub(super) fn margin(&self) -> f64 {
        self.scale.max_element() * self.reach * (16.0 * U)
    }

    /// What rounding may do to a triangle whose corners have a nearness of at most `nearest` and window coordinates
    /// of at most `farthest`.
    ///
    /// The exact test rounds the corners and the light's place relative to the receiver, each coordinate by U/2 of a
    /// difference of at most `reach` D: the test's corners are off by √3·U·D against its receiver and the light by as
    /// much, in world space and with some to spare. A displacement of ε at the distance w moves a tangent t by at most
    /// ε(1 + |t|)/w. A corner moves by both, a receiver (which is behind the triangle, or it does not matter) by the
    /// light's: 3√3·U·D < 6·U·D in all. Every point of the triangle moves by no more than its corners may.
    pub(super) fn shift(&self, nearest: f64, farthest: f64) -> Shift {
        let (scale, moved) = (self.scale.max_element(), 6.0 * U * self.reach);
        if !self.central {
            return Shift { window: moved * scale, nearness: 6.0 * U };
        }
        let over_w = nearest / (self.reach * NEAREST);
        let tangent = self.center.abs().max_element() + farthest / self.scale.min_element();
        // Half as much again: w itself moves by less than a thousandth where it is not too near.
        Shift {
            window: 1.5 * moved * scale * (1.0 + tangent) * over_w,
            nearness: 1.5 * moved * over_w * nearest,
        }
    }
}

/// A view with the receivers that it holds, as indices.
pub(super) struct View {
    pub(super) frame: Frame,
    pub(super) receivers: Vec<u32>,
}

/// Bounds in the plane.
#[derive(Clone, Copy)]
struct Span {
    min: DVec2,
    max: DVec2,
}

impl Span {
    const EMPTY: Self = Self { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY };

    fn with(self, p: DVec2) -> Self {
        Self { min: self.min.min(p), max: self.max.max(p) }
    }

    fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }
}

/// The views of `light` that hold those of `receivers` that `ids` names; `casters` bounds what may lie between.
pub(super) fn views(light: LightPoint, receivers: &[Vec3], ids: Vec<u32>, casters: Aabb) -> Vec<View> {
    let bounds = ids
        .par_chunks(CHUNK)
        .map(|ids| Aabb::from_points(ids.iter().map(|&id| receivers[id as usize])))
        .reduce(|| Aabb::EMPTY, Aabb::union);
    if bounds.is_empty() || casters.is_empty() {
        return Vec::new();
    }
    let mut all = bounds.union(casters);
    if let LightPoint::At(place) = light {
        all = all.with_point(place);
    }
    let reach = (all.max.as_dvec3() - all.min.as_dvec3()).max_element().max(f64::from(f32::MIN_POSITIVE));
    match light {
        LightPoint::Towards(direction) => {
            let axis = direction.as_dvec3().normalize_or(DVec3::Y);
            let (x, y) = axis.any_orthonormal_pair();
            let axes = [x, y, axis];
            let origin = bounds.center().as_dvec3();
            let span = span(receivers, &ids, |p| {
                let p = p.as_dvec3() - origin;
                DVec2::new(x.dot(p), y.dot(p))
            });
            vec![View { frame: fitted(axes, origin, span, false, reach), receivers: ids }]
        }
        LightPoint::At(place) => {
            let origin = place.as_dvec3();
            let axis = (bounds.center().as_dvec3() - origin).normalize_or(DVec3::NEG_Y);
            let (x, y) = axis.any_orthonormal_pair();
            let axes = [x, y, axis];
            let ahead = span(receivers, &ids, |p| tangents(axes, p.as_dvec3() - origin));
            if ahead.min.abs().max(ahead.max.abs()).max_element() <= MAX_TAN {
                return vec![View { frame: fitted(axes, origin, ahead, true, reach), receivers: ids }];
            }
            let mut faces = [const { Vec::new() }; 6];
            for id in ids {
                faces[face_of(receivers[id as usize].as_dvec3() - origin)].push(id);
            }
            let faces = faces.into_iter().enumerate().filter(|(_, ids)| !ids.is_empty());
            faces
                .map(|(face, ids)| {
                    let axis = DVec3::AXES[face / 2] * if face % 2 == 0 { 1.0 } else { -1.0 };
                    let (x, y) = axis.any_orthonormal_pair();
                    let axes = [x, y, axis];
                    let span = span(receivers, &ids, |p| tangents(axes, p.as_dvec3() - origin));
                    View { frame: fitted(axes, origin, span, true, reach), receivers: ids }
                })
                .collect()
        }
    }
}

/// The cube's face that a vector from its middle goes through: twice its axis, one more on the negative side.
fn face_of(v: DVec3) -> usize {
    let a = v.abs();
    let axis = if a.x >= a.y.max(a.z) { 0 } else { 1 + usize::from(a.z > a.y) };
    2 * axis + usize::from(v[axis] < 0.0)
}

/// Tangents of a vector against the third axis; infinite where it does not go along it.
fn tangents(axes: [DVec3; 3], v: DVec3) -> DVec2 {
    let w = axes[2].dot(v);
    if w > 0.0 { DVec2::new(axes[0].dot(v), axes[1].dot(v)) / w } else { DVec2::INFINITY }
}

fn span(receivers: &[Vec3], ids: &[u32], project: impl Fn(Vec3) -> DVec2 + Sync) -> Span {
    ids.par_chunks(CHUNK)
        .map(|ids| ids.iter().fold(Span::EMPTY, |span, &id| span.with(project(receivers[id as usize]))))
        .reduce(|| Span::EMPTY, Span::union)
}

/// The frame whose window is `span`. A window is not made narrower than 2⁻¹⁰ (of a tangent, or of the extent): where
/// all receivers are one point it still has a size, and rounding stays small within it.
fn fitted(axes: [DVec3; 3], origin: DVec3, span: Span, central: bool, reach: f64) -> Frame {
    let least = if central { 1.0 } else { reach } / 1024.0;
    let half = ((span.max - span.min) * 0.5).max(DVec2::splat(least));
    let center = (span.max + span.min) * 0.5;
    Frame { axes, origin, center, scale: half.recip(), central, reach }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(frame: &Frame, point: Vec3) -> DVec3 {
        let p = frame.homogeneous(point);
        p.truncate() / p.w
    }

    #[test]
    fn receivers_fill_the_window_and_what_is_before_them_is_nearer() {
        let receivers = [Vec3::new(-1.0, 0.0, 2.0), Vec3::new(3.0, 0.0, -2.0), Vec3::new(0.0, 0.5, 0.0)];
        let casters = Aabb { min: Vec3::splat(-3.0), max: Vec3::splat(3.0) };
        for light in [LightPoint::At(Vec3::new(1.0, 8.0, 0.5)), LightPoint::Towards(Vec3::new(0.6, 0.8, 0.0))]
        {
            let views = views(light, &receivers, vec![0, 1, 2], casters);
            assert_eq!(views.len(), 1);
            let frame = &views[0].frame;
            for p in receivers {
                let at = window(frame, p);
                assert!(at.truncate().abs().max_element() < 1.0 + 1e-9, "{at}");
                let (to_light, _) = light.ray_from(p);
                let nearer = window(frame, p + to_light * 0.25);
                assert!(nearer.z > at.z && nearer.truncate().distance(at.truncate()) < 1e-6);
            }
        }
    }

    #[test]
    fn a_light_among_receivers_gets_the_faces_that_see_some() {
        let receivers = [Vec3::X, Vec3::NEG_X, Vec3::new(0.1, -2.0, 0.3), Vec3::new(0.2, -1.0, 0.0)];
        let casters = Aabb { min: Vec3::NEG_ONE, max: Vec3::ONE };
        let views = views(LightPoint::At(Vec3::ZERO), &receivers, vec![0, 1, 2, 3], casters);
        let held: Vec<_> = views.iter().map(|v| v.receivers.clone()).collect();
        assert_eq!(held, [vec![0], vec![1], vec![2, 3]]);
    }

    #[test]
    fn nothing_to_see_no_views() {
        let casters = Aabb { min: Vec3::NEG_ONE, max: Vec3::ONE };
        assert!(views(LightPoint::At(Vec3::Y), &[], Vec::new(), casters).is_empty());
        assert!(views(LightPoint::At(Vec3::Y), &[Vec3::X], vec![0], Aabb::EMPTY).is_empty());
    }
}
