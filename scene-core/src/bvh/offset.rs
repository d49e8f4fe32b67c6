//! Where a shadow ray may start without meeting the surface it starts from.

use glam::Vec3;

/// 2⁻²¹, the share of the largest coordinate by which a shadow ray's origin is lifted: see [`shadow_origin`].
const LIFT: f32 = 1.0 / (1_u32 << 21) as f32;

/// The origin of a shadow ray from the surface at `position`: lifted along `normal_to_camera`, the unit normal
/// on the side that is seen, by 2⁻²¹ of the largest coordinate involved.
///
/// `magnitude` is the largest absolute coordinate that took part in finding the position: that of the scene's
/// bounds and of the camera do ([`Aabb::magnitude`](crate::geometry::Aabb::magnitude)). The position's own
/// coordinates are added to it here.
///
/// # Derivation
///
/// With u = 2⁻²⁴ and M the largest coordinate, what can put the origin below the surface as the ray sees it:
/// * the position: computed as eye + t·direction or by weights of the corners, each of its three coordinates
///   is off by 1 u M from the last rounding and at most 2 u M from the sums before it, so by √3 · 3 u M < 5.2 u M
///   across the plane at worst, and by less than 3 u M if the normal lies along an axis;
/// * the normal's direction does not matter to the first order, as the lift is along it;
/// * lifting: one rounding a coordinate, √3 · ½ u · M < 0.9 u M;
/// * the ray: corners relative to the origin are rounded once, by u/2 of a difference of at most 2 M, √3 u M < 1.8 u M
///   across the plane; what follows is exact ([`Bvh`](super::Bvh)).
///
/// The sum, 7.9 u M, is less than 8 u M = 2⁻²¹ M: one metre in two thousand kilometres, or half a millimetre at
/// one kilometre from the origin. A gap as wide as the lift opens where a caster touches its receiver.
///
/// NaN goes through. For an infinite coordinate or magnitude the result is not finite and sees no shadow.
#[inline]
#[must_use]
pub fn shadow_origin(position: Vec3, normal_to_camera: Vec3, magnitude: f32) -> Vec3 {
    let largest = position.abs().max_element().max(magnitude);
    position + normal_to_camera * (largest * LIFT)
}
