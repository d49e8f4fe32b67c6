//! A parametrisation of what a light sees: three linear forms on homogeneous world points, and the window of it that a
//! map covers.
//!
//! Whatever perspective a map is drawn in, a point's place in it is (x/w, y/w), and lines through the light must fall
//! on one place: x, y and w vanish at the light. So a perspective shadow map is a homography of the light's own image,
//! and two things follow that the paper does not use:
//!
//! * **w needs to be above 0 at the receivers only.** Along a ray from a point light it grows in proportion to the
//!   distance, and along parallel light it is constant: casters have the receiver's sign, behind the camera too.
//! * **Depth is free.** Any form that orders the points of a ray will do, and the light's own does, however the map is
//!   warped. Nothing is inverted for a light from behind, and no precision is lost beyond the infinity plane.

use glam::{DVec2, DVec3, DVec4, Mat4};
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::relevance::HalfSpace;

/// How far a window reaches beyond the receivers it is fitted to, as a share of its extent: rounding of the f32
/// matrix must not push one over the border (2⁻¹⁶ is 256 ulps).
pub(crate) const MARGIN: f64 = 1.0 / 65_536.0;

/// The nearest caster a point light's map holds, as a share of its receiver's distance: reversed floating-point
/// depth keeps its relative precision, so this may be as small as positions are exact (2⁻²⁰).
pub(crate) const NEAR_FRACTION: f64 = 1.0 / 1_048_576.0;

/// Three linear forms on homogeneous world points (x, y, z, 1) that vanish at the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warp {
    /// Times w: the place across.
    pub x: DVec4,
    /// Times w: the place along.
    pub y: DVec4,
    /// Above 0 at all receivers.
    pub w: DVec4,
}

/// The value of a form at a point.
#[inline]
pub(crate) fn at(form: DVec4, point: DVec3) -> f64 {
    form.truncate().dot(point) + form.w
}

impl Warp {
    /// The place of a point; meaningless where w is not above 0.
    #[inline]
    pub fn place(&self, point: DVec3) -> DVec2 {
        DVec2::new(at(self.x, point), at(self.y, point)) / at(self.w, point)
    }

    /// The planes on which place is `place`, not normalised: both hold the light. Their gradients, and the values of
    /// the forms at `point`.
    #[inline]
    fn planes(&self, place: DVec2, point: DVec3) -> ([DVec3; 2], DVec2) {
        let (a, b) = (self.x - self.w * place.x, self.y - self.w * place.y);
        ([a.truncate(), b.truncate()], DVec2::new(at(a, point), at(b, point)))
    }

    /// From `point` straight across the light's ray with direction `to_light` (any length) to the ray that falls on
    /// `place`; and the same way for one more unit of x and of y.
    #[inline]
    pub fn across(&self, place: DVec2, point: DVec3, to_light: DVec3) -> (DVec3, [DVec3; 2]) {
        let ([a, b], values) = self.planes(place, point);
        let (for_x, for_y) = (b.cross(to_light), to_light.cross(a));
        let scale = 1.0 / a.dot(for_x);
        let w = at(self.w, point);
        let to_ray = (for_x * values.x + for_y * values.y) * -scale;
        (to_ray, [for_x * (w * scale), for_y * (w * scale)])
    }
}

/// A rectangle of places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Lower corner.
    pub min: DVec2,
    /// Upper corner.
    pub max: DVec2,
}

impl Window {
    /// The window around nothing; [`with`](Self::with) grows it.
    pub const EMPTY: Self = Self { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY };

    /// Grown to hold a place. One that is not finite is ignored.
    #[inline]
    #[must_use]
    pub fn with(self, place: DVec2) -> Self {
        if place.is_finite() { Self { min: self.min.min(place), max: self.max.max(place) } } else { self }
    }

    /// The smallest window around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether it holds no place.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Grown by a margin for rounding, and by as much of its coordinates where it has no extent.
    #[must_use]
    pub fn widened(self) -> Self {
        let largest = self.min.abs().max(self.max.abs()).max_element().max(f64::from(f32::MIN_POSITIVE));
        let margin = (self.max - self.min).max(DVec2::splat(largest * MARGIN)) * MARGIN;
        let margin = margin.max(DVec2::splat(largest * MARGIN * MARGIN));
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// Grown by a share of its half extent, unless that is less than the margin it has.
    pub(crate) fn grown(self, share: f64) -> Self {
        if share <= MARGIN {
            return self;
        }
        let margin = (self.max - self.min) * (0.5 * share);
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// Places a texel of a map of `map_size` texels a side spans.
    pub fn texel(&self, map_size: u32) -> DVec2 {
        (self.max - self.min) / f64::from(map_size.max(1))
    }

    /// The forms of normalised device coordinates: −1 and 1 on the window's borders.
    pub(crate) fn fitted(&self, warp: &Warp) -> Warp {
        let half = (self.max - self.min) * 0.5;
        let middle = (self.max + self.min) * 0.5;
        let x = (warp.x - warp.w * middle.x) / half.x;
        let y = (warp.y - warp.w * middle.y) / half.y;
        Warp { x, y, w: warp.w }
    }
}

/// World to the map's clip space, x, y and w of `ndc` (a [`Window::fitted`] warp): reversed depth by the light's own
/// distance. `w` is the range of w over the receivers, `casters` the bounds of what is drawn.
///
/// Parallel light: depth is the place along the light in the casters' bounds, divided by w, which is constant along a
/// ray; it is scaled by the least w so that it stays in [0, 1]. A light at a place: a constant over w, which is
/// proportional to the distance along a ray.
pub(crate) fn clip_from_world(ndc: &Warp, light: LightPoint, w: [f64; 2], casters: Aabb) -> Mat4 {
    // Of the largest w is made 1: f32 holds every scale.
    let scale = 1.0 / w[1];
    let z = match light {
        LightPoint::At(_) => DVec4::new(0.0, 0.0, 0.0, w[0] * scale * NEAR_FRACTION),
        LightPoint::Towards(towards) => {
            let towards = towards.as_dvec3();
            let [low, range] = along(towards, casters);
            (towards / range).extend(-low / range) * (w[0] * scale)
        }
    };
    let rows = [ndc.x * scale, ndc.y * scale, z, ndc.w * scale].map(DVec4::as_vec4);
    Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose()
}

/// Where `casters` begin along the direction `towards` parallel light, and their extent along it, with a margin of 1/64 on both
/// sides: the far end must not be depth 0, which is "nothing".
pub(crate) fn along(towards: DVec3, casters: Aabb) -> [f64; 2] {
    let along = casters.corners().map(|corner| towards.dot(corner.as_dvec3()));
    let (low, high) =
        along.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &a| (l.min(a), h.max(a)));
    let margin = ((high - low) / 64.0).max(low.abs().max(high.abs()) * MARGIN).max(1e-30);
    [low - margin, high - low + 2.0 * margin]
}

/// The four sides of a map, as half-spaces: w ± x ≥ 0 and w ± y ≥ 0. A caster outside is in no texel.
pub(crate) fn sides(ndc: &Warp) -> Vec<HalfSpace> {
    let form = |form: DVec4| {
        let length = form.truncate().length();
        HalfSpace { normal: -form.truncate() / length, offset: form.w / length }
    };
    [ndc.w + ndc.x, ndc.w - ndc.x, ndc.w + ndc.y, ndc.w - ndc.y].map(form).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn across_leads_to_the_place_and_stays_off_the_ray() {
        let warp = Warp {
            x: DVec4::new(1.0, 0.1, 0.0, 0.3),
            y: DVec4::new(0.0, 0.2, 1.0, -0.1),
            w: DVec4::new(0.05, 0.0, 0.1, 2.0),
        };
        let (point, to_light) = (DVec3::new(0.3, -0.4, 0.9), DVec3::new(0.1, 1.0, -0.2));
        let place = warp.place(point) + DVec2::new(0.01, -0.02);
        let (to_ray, [x, y]) = warp.across(place, point, to_light);
        assert!(warp.place(point + to_ray).distance(place) < 1e-12);
        assert!([to_ray, x, y].iter().all(|v| v.dot(to_light).abs() < 1e-12));
        // A small step is a step of that many units.
        let step = warp.place(point + x * 1e-7) - warp.place(point);
        assert!((step * 1e7 - DVec2::X).length() < 0.02, "{step}");
    }

    #[test]
    fn windows_have_extent_and_hold_what_they_were_given() {
        let window = Window::EMPTY.with(DVec2::splat(3.0)).with(DVec2::NAN).widened();
        assert!(window.min.cmplt(DVec2::splat(3.0)).all() && window.max.cmpgt(DVec2::splat(3.0)).all());
        assert!(Window::EMPTY.is_empty() && Window::EMPTY.with(DVec2::INFINITY).is_empty());
    }
}
