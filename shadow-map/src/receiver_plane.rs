//! The comparison: does the surface stored in a texel shadow the receiver? No bias that anyone must tune.
//!
//! A texel stands for an area, so comparing its one depth with a receiver elsewhere in that area is wrong
//! by as much as surfaces slope: the acne that biases hide. Two questions need no bias, because each is asked
//! at one point where both surfaces are known:
//!
//! 1. *Does the stored point lie above the receiver's plane?* The point `q` at the texel's centre is exact. If
//!    it is on or below the tangent plane of the receiver, nothing in this texel rises above the receiver's
//!    surface: a plane never shadows itself, at any slope, nor does a convex surface.
//! 2. *Does the receiver lie behind the stored triangle's plane?* A triangle shadows only what is behind its
//!    plane as seen from the light. A lit wall beside the receiver is not behind itself: concave corners.
//!
//! Both hold for every true shadow that the texel's centre is in, and for some neighbours on a rugged surface
//! too: the rim of a pit lies above its wall, the wall behind the rim's plane, and still the wall may see the
//! light. So a third question follows where it matters:
//!
//! 3. *Is the stored point near the receiver*, nearer than a surface rises within a texel? Then the stored
//!    triangle is asked outright, by the receiver's own ray, and if that misses it those in the eight texels around:
//!    where a caster's triangles are about as small as texels, the one before the receiver may be stored beside.
//!
//! What is lost is a caster that is nearer to its receiver than that and smaller than a texel: a contact gap of
//! at most a texel's diagonal times 1 + tan θ along the light. Casters larger than a texel leave no gap.
//!
//! # Tolerance
//! The first two are signed distances to a plane, and differ from the true ones by rounding only: positions
//! from the G-buffer, the map's depth and the dot product each carry a few units in the last place of the
//! largest coordinate in play. See [`plane_tolerance`]. The first adds what the rasteriser's snapping moves a
//! stored point across the light's ray, 2⁻⁹ texel ([`scene_core::raster::DEPTH_POSITION_ERROR`]).

use glam::Vec3;
use scene_core::Light;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;

/// Distance from a plane, in scene units, below which a point counts as on it, for receivers anywhere within
/// `bounds`. Add [`view_tolerance`] for a receiver that a camera found.
///
/// With u = 2⁻²⁴ and m the largest absolute coordinate of scene and light: a map's point is projected,
/// interpolated and unprojected, off by ≤ 12·u·m along the light's ray; subtracting the anchor and the dot
/// product of three terms with a unit normal that is itself rounded add ≤ 4√3·u·2m. Together below
/// 32·u·m = 2⁻¹⁹·m.
pub fn plane_tolerance(bounds: Aabb, light: &Light) -> f32 {
    let place = match light.center() {
        LightPoint::At(place) => place.abs().max_element(),
        LightPoint::Towards(_) => 0.0,
    };
    bounds.magnitude().max(place) * (1.0 / 524_288.0)
}

/// What a G-buffer position adds to [`plane_tolerance`]: it is `eye + t·d` for a ray of length ≤ 2·`depth`
/// (up to 120° across the picture), off by ≤ 6·u times the larger of the eye's coordinates and that length.
/// The eye's coordinates are within the receiver's plus the length, hence 6·u·4·`depth` < 2⁻¹⁹·`depth`; the
/// receiver's own share is in [`plane_tolerance`].
#[inline]
pub fn view_tolerance(depth: f32) -> f32 {
    depth * (1.0 / 524_288.0)
}

/// Question 1: whether the stored point `stored` lies above the receiver's tangent plane by more than
/// `tolerance`. `normal` is the receiver's unit normal on the side that the light shines on.
#[inline]
pub fn rises_above(stored: Vec3, receiver: Vec3, normal: Vec3, tolerance: f32) -> bool {
    normal.dot(stored - receiver) > tolerance
}

/// Question 2: whether `receiver` lies behind the plane of the triangle `corners`, seen from the light, by
/// more than `tolerance`. A degenerate triangle has no plane and hides nothing; a triangle seen edge-on hides
/// nothing either.
#[inline]
pub fn is_behind(corners: [Vec3; 3], receiver: Vec3, light: LightPoint, tolerance: f32) -> bool {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let length = normal.length();
    let (to_light, _) = light.ray_from(a);
    let side = normal.dot(to_light);
    let height = normal.dot(receiver - a);
    // height / length is the signed distance; its sign is turned to the light's side.
    length > 0.0
        && if side > 0.0 { -height > tolerance * length } else { side < 0.0 && height > tolerance * length }
}

/// Question 3 for one receiver: what may be a neighbour of it on one surface, being nearer along the light's ray than a surface
/// rises within a texel. The receiver's own slope against the light is tan θ; its neighbours are given twice that and, where the
/// receiver faces the light, twice 45°, over the half diagonal that lies between a receiver and its texel's centre: a diagonal times
/// 1 + tan θ.
#[derive(Clone, Copy, Debug)]
pub struct NearSurface {
    to_light: Vec3,
    /// 1 + tan θ.
    slope: f32,
}

impl NearSurface {
    /// Around `receiver` with the unit `normal`, for a light at, or towards, `light`.
    #[inline]
    pub fn new(receiver: Vec3, normal: Vec3, light: LightPoint) -> Self {
        let (to_light, _) = light.ray_from(receiver);
        let to_light = to_light.normalize_or_zero();
        let cos = normal.dot(to_light).max(f32::MIN_POSITIVE);
        Self { to_light, slope: 1.0 + (1.0 - cos * cos).max(0.0).sqrt() / cos }
    }

    /// Whether it may hold what is stored so far `from_receiver` in a texel of diagonal `texel`.
    #[inline]
    pub fn holds(&self, from_receiver: Vec3, texel: f32) -> bool {
        from_receiver.dot(self.to_light) <= texel * self.slope
    }
}

/// [`NearSurface`] for one question: whether it holds `stored`, in a texel of diagonal `texel`.
#[inline]
pub fn is_near(stored: Vec3, receiver: Vec3, normal: Vec3, light: LightPoint, texel: f32) -> bool {
    NearSurface::new(receiver, normal, light).holds(stored - receiver, texel)
}

/// Whether the line from `point` towards the light passes between the corners, by the signs of the volumes it
/// spans with the edges. Where the triangle lies along the line is not asked.
#[inline]
pub fn meets(corners: [Vec3; 3], point: Vec3, light: LightPoint) -> bool {
    let sides = edge_volumes(corners, point, light);
    sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side <= 0.0)
}

/// The signed volumes that the line from `point` towards the light spans with the edges, from corner i to corner i + 1: all of the
/// sign of their sum, which is the triangle's side that the light sees, where the line passes between the corners. Of two
/// triangles that share an edge one has the negative of the other's.
#[inline]
pub fn edge_volumes(corners: [Vec3; 3], point: Vec3, light: LightPoint) -> [f32; 3] {
    let (direction, _) = light.ray_from(point);
    let [a, b, c] = corners.map(|corner| corner - point);
    [a.cross(b), b.cross(c), c.cross(a)].map(|normal| normal.dot(direction))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Z];

    #[test]
    fn behind_is_told_from_the_lights_side() {
        let above = LightPoint::At(Vec3::new(0.2, 5.0, 0.2));
        let below = LightPoint::Towards(Vec3::NEG_Y);
        let under = Vec3::new(0.2, -0.1, 0.2);
        assert!(is_behind(CORNERS, under, above, 1e-6));
        assert!(!is_behind(CORNERS, under, below, 1e-6));
        assert!(is_behind(CORNERS, -under, below, 1e-6));
        // On the plane, or edge-on: not behind.
        assert!(!is_behind(CORNERS, Vec3::new(9.0, 0.0, 9.0), above, 1e-6));
        assert!(!is_behind(CORNERS, under, LightPoint::Towards(Vec3::X), 1e-6));
    }

    #[test]
    fn near_grows_with_the_slope() {
        let light = LightPoint::Towards(Vec3::Y);
        let slope = Vec3::new(2.0, 1.0, 0.0).normalize();
        let rise = |height: f32, normal: Vec3| is_near(Vec3::Y * height, Vec3::ZERO, normal, light, 0.1);
        assert!(rise(0.099, Vec3::Y) && !rise(0.11, Vec3::Y));
        assert!(rise(0.299, slope) && !rise(0.31, slope));
    }

    #[test]
    fn a_line_meets_what_it_passes_through() {
        let light = LightPoint::At(Vec3::new(0.2, 5.0, 0.2));
        assert!(meets(CORNERS, Vec3::new(0.2, -1.0, 0.2), light));
        assert!(!meets(CORNERS, Vec3::new(2.0, -1.0, 0.2), light));
    }

    #[test]
    fn degenerate_triangles_hide_nothing() {
        let light = LightPoint::At(Vec3::Y);
        assert!(!is_behind([Vec3::ZERO; 3], Vec3::NEG_Y, light, 1e-6));
        assert!(!is_behind([Vec3::ZERO, Vec3::X, Vec3::X * 2.0], Vec3::NEG_Y, light, 1e-6));
    }

    #[test]
    fn a_plane_does_not_rise_above_itself() {
        let normal = Vec3::new(0.6, 0.8, 0.0);
        let along = Vec3::new(0.8, -0.6, 0.0) * 7.0;
        assert!(!rises_above(along, Vec3::ZERO, normal, 1e-5));
        assert!(rises_above(along + normal * 1e-3, Vec3::ZERO, normal, 1e-5));
    }
}
