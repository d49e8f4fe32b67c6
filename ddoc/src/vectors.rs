//! Sixteen vectors of space at a time, a coordinate each, by glam's sums in glam's order: what is asked of one and of sixteen has
//! the same answer.
//!
//! All of it is inlined into callers, which are compiled for what vectors the machine has; a closure would not be.

use fearless_simd::{Simd, SimdBase, SimdFloat, f32x16};
use glam::Vec3;

/// x, y and z.
pub(crate) type Vec3x16<S> = [f32x16<S>; 3];

/// The same vector sixteen times.
#[inline(always)]
pub(crate) fn splat<S: Simd>(simd: S, v: Vec3) -> Vec3x16<S> {
    [f32x16::splat(simd, v.x), f32x16::splat(simd, v.y), f32x16::splat(simd, v.z)]
}

/// a − b.
#[inline(always)]
pub(crate) fn sub<S: Simd>(a: Vec3x16<S>, b: Vec3x16<S>) -> Vec3x16<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a·factor.
#[inline(always)]
pub(crate) fn scale<S: Simd>(a: Vec3x16<S>, factor: f32x16<S>) -> Vec3x16<S> {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

/// a/divisor.
#[inline(always)]
pub(crate) fn divide<S: Simd>(a: Vec3x16<S>, divisor: f32x16<S>) -> Vec3x16<S> {
    [a[0] / divisor, a[1] / divisor, a[2] / divisor]
}

/// a·b.
#[inline(always)]
pub(crate) fn dot<S: Simd>(a: Vec3x16<S>, b: Vec3x16<S>) -> f32x16<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
#[inline(always)]
pub(crate) fn cross<S: Simd>(a: Vec3x16<S>, b: Vec3x16<S>) -> Vec3x16<S> {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

/// |a|.
#[inline(always)]
pub(crate) fn length<S: Simd>(a: Vec3x16<S>) -> f32x16<S> {
    dot(a, a).sqrt()
}
