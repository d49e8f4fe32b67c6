//! A few points around a whole light, as one receiver sees it.
//!
//! Their convex hull holds every sample of the light, however it was rounded, so what is proved for the hull is
//! proved for all samples.
//!
//! # Margin
//!
//! With u = 2⁻²⁴ and M the largest coordinate of scene, receiver and light, a sample lies within 16 u M of its ideal place
//! (sums of three products on flat lights, about ten roundings relative to the radius on a sphere). Its offset from the
//! ray's origin is rounded by √3 u M, and so is that of the outline. All lie within 20 u M; 64 u M = 2⁻¹⁸ M is left around the
//! light, in all directions. Directions of a distant light are of unit length, and M is 1.

use glam::{DVec3, Vec3};

use crate::Light;
use crate::bvh::OUTLINE;
use crate::light::LightPoint;

/// 2⁻¹⁸: see the module's derivation.
const MARGIN: f64 = 1.0 / (1_u32 << 18) as f64;

/// Sides of the polygon around a round light: two such make the hull.
const SIDES: usize = OUTLINE / 2;

/// Beyond this tangent of its half angle a light is too wide for a hull of so few points.
const WIDEST: f64 = 4.0;

/// Points whose hull holds a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightOutline {
    points: [LightPoint; OUTLINE],
    count: usize,
    /// What is left around the light.
    margin: f64,
}

impl LightOutline {
    /// The outline of an extended light from `receiver`; `magnitude` is the largest coordinate of the scene.
    /// `None` for a light without extent, one that is too wide, and for input that is not finite.
    pub(super) fn new(light: &Light, receiver: Vec3, magnitude: f32) -> Option<Self> {
        let largest = receiver.abs().max_element().max(magnitude);
        let margin_of = |reach: Vec3| f64::from(reach.max_element().max(largest)) * MARGIN;
        let mut outline = Self { points: [LightPoint::At(receiver); OUTLINE], count: OUTLINE, margin: 0.0 };
        match *light {
            Light::Rect { center, half_u, half_v } => {
                let margin = margin_of(center.abs() + half_u.abs() + half_v.abs());
                let [u, v] = [half_u, half_v].map(|axis| axis.as_dvec3());
                let across = u.cross(v);
                let narrowest = across.length() / u.length().max(v.length());
                let wider = 1.0 + margin / narrowest;
                let up = across.normalize() * margin;
                outline.margin = margin;
                outline.count = 8;
                for (corner, point) in outline.points[..8].iter_mut().enumerate() {
                    let sign = |bit: usize| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
                    let offset = u * (wider * sign(0)) + v * (wider * sign(1)) + up * sign(2);
                    *point = LightPoint::At((center.as_dvec3() + offset).as_vec3());
                }
            }
            Light::Disk { center, normal, radius } => {
                let margin = margin_of(center.abs() + Vec3::splat(radius));
                let up = normal.as_dvec3().try_normalize()?;
                let radius = f64::from(radius) + margin;
                let center = center.as_dvec3();
                outline.margin = margin;
                outline.drum(up, (center - up * margin, radius), (center + up * margin, radius));
            }
            Light::Sphere { center, radius } => {
                let margin = margin_of(center.abs() + Vec3::splat(radius));
                let (radius, offset) = (f64::from(radius) + margin, center.as_dvec3() - receiver.as_dvec3());
                let distance = offset.length();
                // Samples lie on the cap that the receiver sees: within the cone of tangents, past the nearest
                // point and before the circle where the tangents touch.
                let tangent = radius / ((distance - radius) * (distance + radius)).sqrt();
                if !(distance > radius + 4.0 * margin && tangent < WIDEST) {
                    return None;
                }
                let axis = offset / distance;
                let near = distance - radius - margin;
                let far = distance - radius * (radius / distance) + 4.0 * margin;
                let ring = |depth: f64| (receiver.as_dvec3() + axis * depth, depth * tangent + margin);
                outline.margin = margin;
                outline.drum(axis, ring(near), ring(far));
            }
            Light::Directional { direction, angular_radius } if angular_radius > 0.0 => {
                let axis = (-direction.as_dvec3()).try_normalize()?;
                let tangent = (f64::from(angular_radius) + MARGIN).tan();
                if !(0.0..WIDEST).contains(&tangent) {
                    return None;
                }
                outline.margin = MARGIN;
                outline.count = SIDES;
                for (point, corner) in outline.points.iter_mut().zip(polygon(axis, tangent)) {
                    *point = LightPoint::Towards((axis + corner).as_vec3());
                }
            }
            Light::Directional { .. } | Light::Point { .. } | Light::Spot { .. } => return None,
        }
        outline.margin.is_finite().then_some(outline)
    }

    /// An outline that holds for all receivers no farther from 0 than `receiver` or `magnitude`: of a sphere, the cube
    /// around it.
    pub(crate) fn of_all(light: &Light, receiver: Vec3, magnitude: f32) -> Option<Self> {
        let Light::Sphere { center, radius } = *light else {
            return Self::new(light, receiver, magnitude);
        };
        let (half_u, half_v) = (Vec3::X * radius, Vec3::Y * radius);
        let mut cube = Self::new(&Light::Rect { center, half_u, half_v }, receiver, magnitude)?;
        for (corner, point) in cube.points[..8].iter_mut().enumerate() {
            let sign = if corner & 4 == 4 { 1.0 } else { -1.0 };
            if let LightPoint::At(place) = point {
                place.z += sign * radius;
            }
        }
        Some(cube)
    }

    /// Two polygons around circles, given by middle and radius.
    fn drum(&mut self, axis: DVec3, near: (DVec3, f64), far: (DVec3, f64)) {
        let (lower, upper) = self.points.split_at_mut(SIDES);
        for (points, (center, radius)) in [(lower, near), (upper, far)] {
            for (point, corner) in points.iter_mut().zip(polygon(axis, radius)) {
                *point = LightPoint::At((center + corner).as_vec3());
            }
        }
    }

    pub(crate) fn points(&self) -> &[LightPoint] {
        &self.points[..self.count]
    }

    /// What is left around the light: a length, or a sine for a distant one. More than heights that are computed in
    /// f32 from samples are off by.
    pub(crate) fn margin(&self) -> f64 {
        self.margin
    }

    /// The least and the largest height of the light above the plane through `position`, and a bound of the error
    /// of heights that are computed in f32 from samples.
    pub(crate) fn heights(&self, position: Vec3, normal: Vec3) -> (f64, f64, f64) {
        let normal = normal.as_dvec3();
        let heights = self.points().iter().map(|point| match *point {
            LightPoint::At(at) => normal.dot(at.as_dvec3() - position.as_dvec3()),
            LightPoint::Towards(direction) => normal.dot(direction.as_dvec3()),
        });
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        // Difference, three products and their sum: 2 √3 M (1 + 3) u < 14 u M.
        (low, high, self.margin)
    }
}

/// The corners of a regular polygon around the circle of `radius` about `axis`, as offsets from its middle.
fn polygon(axis: DVec3, radius: f64) -> [DVec3; SIDES] {
    let (u, v) = axis.any_orthonormal_pair();
    let half = std::f64::consts::PI / SIDES as f64;
    let radius = radius / half.cos();
    std::array::from_fn(|i| {
        let (sin, cos) = (2.0 * half * i as f64).sin_cos();
        (u * cos + v * sin) * radius
    })
}
