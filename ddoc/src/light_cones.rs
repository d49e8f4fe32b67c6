//! Sixteen cones of lines to a light at a time: twin of [`LightCone`] and [`LightAxes`], bit for bit.

use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16};
use glam::Vec3;
use gnomon_shadow_map::light_cone::{LightAxes, LightCone};
use scene_core::Light;

use crate::vectors::{Vec3x16, cross, divide, dot, length, scale, splat, sub};

/// The cones over a light from sixteen receivers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightCones<S: Simd> {
    /// Rows of the matrix that turns a point, counted from the receiver, into (a, b, t).
    pub(crate) rows: [Vec3x16<S>; 3],
    /// Which receivers have a cone.
    pub(crate) there: mask32x16<S>,
    /// Where (u, v, w) is right-handed.
    pub(crate) right_handed: mask32x16<S>,
    /// [`LightCone::height`].
    pub(crate) height: f32x16<S>,
}

impl<S: Simd> LightCones<S> {
    /// The cones over `light` from `receivers`.
    #[inline(always)]
    pub(crate) fn new(simd: S, light: &Light, receivers: Vec3x16<S>) -> Self {
        let nothing = f32x16::splat(simd, 0.0);
        let Some(Axes { u, v, w, height, mut there }) = Axes::new(simd, light, receivers) else {
            let none = mask32x16::splat(simd, false);
            return Self { rows: [[nothing; 3]; 3], there: none, right_handed: none, height: nothing };
        };
        let (unit_u, unit_v, unit_w) = (unit(simd, u), unit(simd, v), unit(simd, w));
        let volume = dot(cross(unit_u, unit_v), unit_w);
        // NaN is not above it.
        there &= volume.abs().simd_ge(LightCone::FLATTEST);
        let rows = [
            divide(divide(cross(unit_v, unit_w), volume), length(u)),
            divide(divide(cross(unit_w, unit_u), volume), length(v)),
            divide(divide(cross(unit_u, unit_v), volume), length(w)),
        ];
        for part in rows.as_flattened() {
            there &= part.abs().simd_le(f32::MAX);
        }
        let right_handed = dot(cross(u, v), w).simd_gt(nothing);
        Self { rows, there, right_handed, height }
    }
}

/// [`LightAxes`] of sixteen receivers.
struct Axes<S: Simd> {
    u: Vec3x16<S>,
    v: Vec3x16<S>,
    w: Vec3x16<S>,
    height: f32x16<S>,
    there: mask32x16<S>,
}

impl<S: Simd> Axes<S> {
    #[inline(always)]
    fn new(simd: S, light: &Light, receivers: Vec3x16<S>) -> Option<Self> {
        if let Light::Sphere { center, radius } = *light {
            let one = f32x16::splat(simd, 1.0);
            let w = sub(splat(simd, center), receivers);
            let distance = length(w);
            let (u, v) = orthonormal_pair(simd, divide(w, distance));
            let sine = radius / distance;
            let cosine = ((one - sine) * (one + sine)).sqrt();
            let height = sine * sine / (one + cosine);
            let there = distance.simd_gt(radius);
            let radius = sine / cosine * distance;
            return Some(Self { u: scale(u, radius), v: scale(v, radius), w, height, there });
        }
        // From everywhere the half axes are the same.
        let axes = LightAxes::new(light, Vec3::ZERO)?;
        let w = match *light {
            Light::Rect { center, .. } | Light::Disk { center, .. } => sub(splat(simd, center), receivers),
            _ => splat(simd, axes.w),
        };
        let height = f32x16::splat(simd, axes.height);
        Some(Self {
            u: splat(simd, axes.u),
            v: splat(simd, axes.v),
            w,
            height,
            there: mask32x16::splat(simd, true),
        })
    }
}

/// `Vec3::normalize_or_zero`.
#[inline(always)]
fn unit<S: Simd>(simd: S, a: Vec3x16<S>) -> Vec3x16<S> {
    let (nothing, inverse) = (f32x16::splat(simd, 0.0), 1.0 / length(a));
    let is_there = inverse.simd_le(f32::MAX) & inverse.simd_gt(nothing);
    scale(a, is_there.select(inverse, nothing))
}

/// `Vec3::any_orthonormal_pair`.
#[inline(always)]
fn orthonormal_pair<S: Simd>(simd: S, [x, y, z]: Vec3x16<S>) -> (Vec3x16<S>, Vec3x16<S>) {
    let one = f32x16::splat(simd, 1.0);
    let sign = one.copysign(z);
    let a = -one / (sign + z);
    let b = x * y * a;
    ([one + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y])
}

/// A height with eight bits of its fraction. Points of the light lie off their places by less than the 256th part of the height then, in radii
/// of the light, and neighbours under a sphere have the same ones.
#[inline(always)]
pub(crate) fn coarse(height: f32) -> f32 {
    const LEFT_OUT: u32 = (1 << 15) - 1;
    f32::from_bits((height.to_bits() + LEFT_OUT / 2) & !LEFT_OUT)
}

/// `LightCone::share` of sixteen points of the light as a receiver with this `height` sees it.
#[inline(always)]
pub(crate) fn share<S: Simd>(simd: S, height: f32, [x, y]: [f32x16<S>; 2]) -> [f32x16<S>; 2] {
    if height == 0.0 {
        return [x, y];
    }
    let (one, two) = (f32x16::splat(simd, 1.0), f32x16::splat(simd, 2.0));
    let lower = (x * x + y * y) * height;
    let (inner, outer) = (one - lower, one - height);
    let ratio = (two - lower) / (two - height) * (outer / inner) * (outer / inner);
    // As f32::max: 0 for NaN.
    let is_positive = ratio.simd_gt(0.0);
    let root = is_positive.select(ratio, f32x16::splat(simd, 0.0)).sqrt();
    [x * root, y * root]
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use glam::Vec2;

    use crate::lanes::LANES;

    /// Places all around the lights, in them, beside them and in their planes.
    fn receivers() -> [Vec3; LANES] {
        std::array::from_fn(|i| {
            let at = Vec3::new((i % 4) as f32, (i / 4 % 2) as f32, (i / 8) as f32);
            at * Vec3::new(0.7, 2.5, 1.9) - Vec3::new(0.3, 0.0, 0.8)
        })
    }

    #[test]
    fn sixteen_cones_are_those_of_each() {
        let center = Vec3::new(0.4, 2.5, 1.1);
        let lights = [
            Light::Rect { center, half_u: Vec3::new(0.5, 0.1, 0.0), half_v: Vec3::new(0.0, 0.0, 0.7) },
            Light::Rect { center, half_u: Vec3::X, half_v: Vec3::ZERO },
            Light::Disk { center, normal: Vec3::NEG_Y, radius: 0.4 },
            Light::Sphere { center, radius: 1.2 },
            Light::Directional { direction: Vec3::new(1.0, -5.0, 2.0), angular_radius: 0.2 },
            Light::Directional { direction: Vec3::ZERO, angular_radius: 0.2 },
            Light::Point { position: center },
        ];
        let (mut found, mut missing) = (0, 0);
        for light in lights {
            let receivers = receivers();
            let axis = |axis: usize| receivers.map(|receiver| receiver[axis]);
            let (rows, there, right_handed, height) = dispatch!(Level::new(), simd => {
                let place = |axis_of: [f32; LANES]| f32x16::load_array_ref(simd, &axis_of);
                let cones = LightCones::new(simd, &light, [place(axis(0)), place(axis(1)), place(axis(2))]);
                let rows = cones.rows.map(|row| row.map(|part| part.to_array()));
                (rows, cones.there.to_bitmask(), cones.right_handed.to_bitmask(), cones.height.to_array())
            });
            for (lane, receiver) in receivers.into_iter().enumerate() {
                let cone = LightCone::new(&light, receiver);
                assert_eq!(there >> lane & 1 == 1, cone.is_some(), "{light:?}, {receiver}");
                let Some(cone) = cone else {
                    missing += 1;
                    continue;
                };
                found += 1;
                for (row, parts) in rows.iter().enumerate() {
                    assert_eq!(cone.light_from_receiver().row(row), Vec3::from_array(parts.map(|p| p[lane])));
                }
                assert_eq!(right_handed >> lane & 1 == 1, cone.u.cross(cone.v).dot(cone.w) > 0.0);
                assert_eq!(height[lane], cone.height());
            }
        }
        assert!(found > 50 && missing > 40, "{found}, {missing}");
    }

    #[test]
    fn sixteen_points_are_those_of_each() {
        let sun = Light::Directional { direction: Vec3::NEG_Y, angular_radius: 1.2 };
        for light in [sun, Light::Disk { center: Vec3::Y, normal: Vec3::Y, radius: 1.0 }] {
            let cone = LightCone::new(&light, Vec3::ZERO).unwrap();
            let points: [Vec2; LANES] = std::array::from_fn(|i| Vec2::from_angle(i as f32) * i as f32 / 15.0);
            let [xs, ys] = dispatch!(Level::new(), simd => {
                let (x, y) = (points.map(|point| point.x), points.map(|point| point.y));
                let (x, y) = (f32x16::load_array_ref(simd, &x), f32x16::load_array_ref(simd, &y));
                share(simd, cone.height(), [x, y]).map(|part| part.to_array())
            });
            for (lane, point) in points.into_iter().enumerate() {
                assert_eq!(cone.share(point), Vec2::new(xs[lane], ys[lane]));
            }
        }
    }

    /// Points move by less than is said, and heights of which that is true are many.
    #[test]
    fn coarse_heights_move_points_a_little() {
        for i in 1..=100 {
            let height = (i as f32 / 100.0).powi(3) * 0.9;
            assert!((coarse(height) - height).abs() <= height / 512.0);
            for r in [0.1f32, 0.5, 0.8, 1.0] {
                let of = |height: f32| {
                    let light =
                        Light::Directional { direction: Vec3::NEG_Y, angular_radius: (1.0 - height).acos() };
                    LightCone::new(&light, Vec3::ZERO).unwrap().share(Vec2::new(r, 0.0)).x
                };
                assert!((of(coarse(height)) - of(height)).abs() < height / 256.0 + 1e-6, "{height}, {r}");
            }
        }
        assert_eq!(coarse(0.0), 0.0);
    }
}
