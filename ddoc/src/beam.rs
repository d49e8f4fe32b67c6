//! Which edges may lie between a block of receivers and the light.
//!
//! A tile of the light's image holds receivers at many depths, and edges for all of them. A block of neighbours takes from
//! its tile's edges those that reach into its beam, the union of all rays from the box around the block through the light:
//! a receiver is then asked about edges that lie over the light, or nearly.
//!
//! # The planes
//! For a direction d across the beam's axis w the plane with the normal n = d + λ·w holds the beam on its inner side if no
//! way from a corner b of the box to a corner l of the light's hull leads outwards, n·(l − b) ≤ 0: λ is the least of
//! −d·(l − b)/(w·(l − b)), and the plane goes through the box's outermost corner. An edge whose ends both lie outside of one
//! plane meets no ray. What is left out could not have counted: it lies beside the light as every receiver of the block
//! sees it.
//!
//! # Rounding
//! λ is lowered by 2⁻¹⁶·(1 + λ²) and planes are moved outwards by 2⁻¹⁷ of the largest coordinate: products of two f32 and
//! their sums are good to 2⁻²² of their terms, here and where a receiver asks. Both terms of λ are a sum each, of terms as
//! long as the way, which is √(1 + λ²) times as long as it goes forwards, or more: their quotient is good to
//! 2⁻²²·(1 + |λ|)·√(1 + λ²), below 2⁻²¹·(1 + λ²), and to 2⁻²³·|λ| more where it is a product with the inverse.

use fearless_simd::{Simd, SimdBase, SimdMask, f32x16};
use glam::{Vec3, Vec4};
use scene_core::geometry::Aabb;
use scene_core::light::{LightHull, LightPoint};

use crate::lanes::LANES;
use crate::vectors::{dot, length, splat, sub};

/// λ is lowered by this times 1 + λ².
pub(crate) const TILT: f32 = 1.0 / 65_536.0;

/// Planes are moved outwards by this share of the largest coordinate.
pub(crate) const SHIFT: f32 = 1.0 / 131_072.0;

/// The planes around a beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// n·x + d > 0 outside, x from the origin of edges.
    pub planes: [Vec4; 5],
}

impl Beam {
    /// Over receivers in `bounds`, which is relative to `origin`. `None` where rays lead away from the light's middle, as
    /// around a receiver that stands beside its light: nothing is known of such a beam.
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, bounds: &Aabb, hull: &LightHull, origin: Vec3) -> Option<Self> {
        let middle = bounds.center();
        let lights = hull.corners();
        let way = |from: Vec3, to: LightPoint| match to {
            LightPoint::At(place) => (place - origin) - from,
            LightPoint::Towards(direction) => direction,
        };
        let sum: Vec3 = lights.iter().map(|&light| way(middle, light).normalize_or_zero()).sum();
        let axis = sum.try_normalize()?;
        let [u, v] = sides(lights, axis);
        // The corners of the box, each twice; all ways must lead forwards.
        let (mut x, mut y, mut z) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            x[i] = if i & 1 == 0 { bounds.min.x } else { bounds.max.x };
            y[i] = if i & 2 == 0 { bounds.min.y } else { bounds.max.y };
            z[i] = if i & 4 == 0 { bounds.min.z } else { bounds.max.z };
        }
        let corners = [
            f32x16::load_array_ref(simd, &x),
            f32x16::load_array_ref(simd, &y),
            f32x16::load_array_ref(simd, &z),
        ];
        let (most, least) = (f32::NEG_INFINITY, f32::INFINITY);
        let mut greatest = [f32x16::splat(simd, most), f32x16::splat(simd, most)];
        let mut smallest = [f32x16::splat(simd, least), f32x16::splat(simd, least)];
        for &light in lights {
            let way = match light {
                LightPoint::At(place) => sub(splat(simd, place - origin), corners),
                LightPoint::Towards(way) => splat(simd, way),
            };
            let forwards = dot(splat(simd, axis), way);
            // NaN leads nowhere.
            if forwards.simd_gt(length(way) * TILT).to_bitmask() != (1 << LANES) - 1 {
                return None;
            }
            let inverse = f32x16::splat(simd, 1.0) / forwards;
            let slopes = [dot(splat(simd, u), way) * inverse, dot(splat(simd, v), way) * inverse];
            greatest = [greatest[0].max(slopes[0]), greatest[1].max(slopes[1])];
            smallest = [smallest[0].min(slopes[0]), smallest[1].min(slopes[1])];
        }
        let directions = [u, -u, v, -v];
        let steepest = [
            greatest[0].reduce_max(),
            -smallest[0].reduce_min(),
            greatest[1].reduce_max(),
            -smallest[1].reduce_min(),
        ];
        let largest = bounds.magnitude().max(origin.abs().max_element());
        let plane = |normal: Vec3| {
            let normal = normal.normalize();
            let outermost = normal.dot(Vec3::select(normal.cmpgt(Vec3::ZERO), bounds.max, bounds.min));
            normal.extend(-(outermost + largest * SHIFT))
        };
        let mut planes = [plane(-axis); 5];
        for i in 0..4 {
            planes[i] =
                plane(directions[i] - axis * (steepest[i] + TILT * (1.0 + steepest[i] * steepest[i])));
        }
        planes.iter().all(|plane| plane.is_finite()).then_some(Self { planes })
    }
}

/// Two directions across `axis`: along the normals of the planes through the light's own sides where it has some.
fn sides(lights: &[LightPoint], axis: Vec3) -> [Vec3; 2] {
    let place = |light: LightPoint| match light {
        LightPoint::At(place) | LightPoint::Towards(place) => place,
    };
    if let [a, b, c, _] = *lights {
        let (a, b, c) = (place(a), place(b), place(c));
        let pair = [(c - b).cross(axis), (b - a).cross(axis)].map(|side| side.try_normalize());
        if let [Some(u), Some(v)] = pair {
            return [u, v];
        }
    }
    let (u, v) = axis.any_orthonormal_pair();
    [u, v]
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use scene_core::Light;
    use scene_core::light::sampling::{LightView, SampleKey, low_discrepancy};

    /// No ray from the box to the light leaves the beam; what lies beside, or behind the receivers, does.
    #[test]
    fn a_beam_holds_every_ray() {
        let origin = Vec3::new(0.5, -1.0, 0.25);
        let bounds = Aabb { min: Vec3::new(-0.1, 0.0, -0.2), max: Vec3::new(0.1, 0.3, 0.2) };
        let center = Vec3::new(1.0, 5.0, 2.0);
        let lights = [
            Light::Rect { center, half_u: Vec3::new(0.5, 0.1, 0.0), half_v: Vec3::new(0.0, 0.2, 0.7) },
            Light::Disk { center, normal: Vec3::new(0.1, -1.0, 0.2), radius: 0.4 },
            Light::Sphere { center, radius: 0.6 },
            Light::Directional { direction: -center, angular_radius: 0.2 },
        ];
        for light in lights {
            let hull = LightHull::of(&light).unwrap();
            let beam = dispatch!(Level::new(), simd => Beam::new(simd, &bounds, &hull, origin)).unwrap();
            let outside = |point: Vec3| beam.planes.iter().any(|plane| plane.dot(point.extend(1.0)) > 0.0);
            let mut points = [LightPoint::At(Vec3::ZERO); 64];
            for i in 0..27 {
                let at = Vec3::new((i % 3) as f32, (i / 3 % 3) as f32, (i / 9) as f32) * 0.5;
                let receiver = bounds.min + at * bounds.size();
                low_discrepancy(
                    &LightView::new(&light, receiver + origin),
                    SampleKey::new(1, i),
                    &mut points,
                );
                for point in points {
                    let (way, _) = point.ray_from(receiver + origin);
                    for share in [0.0, 0.1, 0.5, 1.0] {
                        assert!(!outside(receiver + way * share), "{light:?}, {receiver}, {way}");
                    }
                }
            }
            let (axis, _) = light.center().ray_from(bounds.center() + origin);
            let axis = axis.normalize();
            let (u, _) = axis.any_orthonormal_pair();
            for turn in [0.0f32, 1.0, 2.0, 3.0, 4.0, 5.0] {
                let across = glam::Quat::from_axis_angle(axis, turn) * u;
                assert!(outside(bounds.center() + axis + across * 1.5), "{light:?}, {turn}");
            }
            assert!(outside(bounds.center() - axis));
        }
    }

    #[test]
    fn around_its_light_there_is_none() {
        let hull = LightHull::of(&Light::Sphere { center: Vec3::ZERO, radius: 1.0 }).unwrap();
        let bounds = Aabb { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) };
        let beam = dispatch!(Level::new(), simd => Beam::new(simd, &bounds, &hull, Vec3::ZERO));
        assert_eq!(beam, None);
    }
}
