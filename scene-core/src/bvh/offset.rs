//! Where a shadow ray may start without meeting the surface it starts from.

use glam::Vec3;

/// 2⁻²¹, the share of the largest coordinate by which a shadow ray's origin is lifted: see [`shadow_origin`].
pub(crate) const LIFT: f32 = 1.0 / (1_u32 << 21) as f32;

/// The origin of a shadow ray from the surface at `position`: lifted along `normal_to_camera`, the unit normal
/// on the side that is seen, by 2⁻²¹ of the largest coordinate involved.
///
/// `magnitude` is the largest absolute coordinate that took part in finding the position: that of the scene's
/// bounds and of the camera do ([`Aabb::magnitude`](crate::geometry::Aabb::magnitude)). The position's own
/// coordinates are added to it here.
///
/// # Derivation
///
/// With u = 2⁻²⁴, so that rounding to f32 moves a number x by at most u |x|, and M the largest coordinate. What moves
/// each of three coordinates by e moves a point by at most √3 e along the normal. These can put the origin below the
/// surface as the ray sees it:
/// * the position: found in f64 and rounded once, as the [G-buffer](crate::GBuffer) of the rasteriser has it,
///   √3 u M < 1.8 u M;
/// * lifting: one rounding a coordinate, √3 u M < 1.8 u M; what the length of the normal lacks of 1 is a few u of the lift;
/// * the ray: corners relative to the origin are rounded once, differences of at most 2 M by 2 u M, √3 · 2 u M < 3.5 u M;
///   the plane at the origin moves by a mean of its corners. What follows is exact ([`Bvh`](super::Bvh)).
///
/// The sum, 4 √3 u M < 7 u M, is less than 8 u M = 2⁻²¹ M: one metre in two thousand kilometres, or half a millimetre at
/// one kilometre from the origin. A gap as wide as the lift opens where a caster touches its receiver.
///
/// A position computed in f32, as eye + t·direction or by weights of the corners, is off by up to 3 u M a coordinate;
/// then the sum is 6 √3 u M < 10.4 u M, above the lift, if all roundings go the same way on a surface that faces a
/// diagonal and whose triangles span the scene. Where the corners of the triangle are within M / 2 of the position,
/// their part is a quarter, and the sum, 4.5 √3 u M < 7.8 u M, is below the lift again.
///
/// NaN goes through. For an infinite coordinate or magnitude the result is not finite and sees no shadow.
#[inline]
#[must_use]
pub fn shadow_origin(position: Vec3, normal_to_camera: Vec3, magnitude: f32) -> Vec3 {
    let largest = position.abs().max_element().max(magnitude);
    position + normal_to_camera * (largest * LIFT)
}
