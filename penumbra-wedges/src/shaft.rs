//! The shaft of a tile: half-spaces that hold what the tile sees and the light. An edge beyond one of them lies between none of
//! the tile's receivers and the light: the wedges' planes, asked from the receivers' end, where one box can answer for many
//! edges.
//!
//! Fourteen planes touch both, each across one direction around the way to the light; two lie behind the receivers and
//! behind the light.

use std::ops::Range;

use glam::DVec3;

use crate::area_light::{AreaLight, LightShape};
use crate::edges::CandidateEdge;

/// Half-spaces.
pub(crate) const PLANES: usize = 16;

/// Those that touch both.
pub(crate) const AROUND: usize = 14;

/// Halvings of the angle by which a plane leans between box and light. Any angle bounds the shaft; after sixteen the plane is
/// within 2⁻¹⁵ of the one that touches both.
const HALVINGS: usize = 16;

/// What rounding may do to a product of a normal and a way, relative to the way: some ten operations of 2⁻⁵³; 2⁻⁴⁴ is fifty
/// times that.
const SLACK: f64 = 1.0 / 17_592_186_044_416.0;

/// Half-spaces n·(x − center) ≤ limit.
#[derive(Clone, Debug)]
pub struct Shaft {
    center: DVec3,
    normals: [DVec3; PLANES],
    limits: [f64; PLANES],
}

impl Shaft {
    /// The shaft between a box and the light.
    pub fn new(light: &AreaLight, center: DVec3, half: DVec3) -> Self {
        let way = light.from_point(center);
        let axis = way.normalize_or(DVec3::Y);
        let (x, y) = axis.any_orthonormal_pair();
        let of_box = |n: DVec3| n.abs().dot(half);
        let of_light = |n: DVec3| n.dot(way) + light.reach(n);
        let mut shaft = Self { center, normals: [DVec3::ZERO; PLANES], limits: [0.0; PLANES] };
        for plane in 0..PLANES {
            let angle = std::f64::consts::TAU * plane as f64 / AROUND as f64;
            let across = x * angle.cos() + y * angle.sin();
            let (n, limit) = match (plane, light.shape) {
                (14, LightShape::Cone { .. }) => (-axis, of_box(axis)),
                (14, _) => (-axis, of_box(axis).max(of_light(-axis))),
                (15, LightShape::Cone { .. }) => (axis, f64::INFINITY),
                (15, _) => (axis, of_box(axis).max(of_light(axis))),
                // All directions to the light are below the plane.
                (_, LightShape::Cone { angle, .. }) if angle < std::f64::consts::FRAC_PI_2 => {
                    let n = across * angle.cos() - axis * angle.sin();
                    (n, of_box(n))
                }
                (_, LightShape::Cone { .. }) => (across, f64::INFINITY),
                _ => {
                    // Leaning back the box reaches farther along n, leaning forward the light does.
                    let (mut back, mut ahead) = (-std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2);
                    let mut n = across;
                    for _ in 0..HALVINGS {
                        let lean: f64 = 0.5 * (back + ahead);
                        n = across * lean.cos() + axis * lean.sin();
                        if of_box(n) > of_light(n) { back = lean } else { ahead = lean }
                    }
                    (n, of_box(n).max(of_light(n)))
                }
            };
            let size = half.element_sum() + way.abs().element_sum();
            shaft.normals[plane] = n;
            shaft.limits[plane] = limit + SLACK * size;
        }
        shaft
    }

    /// Whether a box, by its middle and half size, lies beyond one of the planes.
    #[inline(always)]
    pub fn misses(&self, center: DVec3, half: DVec3) -> bool {
        let way = center - self.center;
        let slack = SLACK * (way.abs().element_sum() + half.element_sum());
        let mut beyond = false;
        for (n, limit) in self.normals.iter().zip(&self.limits) {
            beyond |= n.dot(way) - n.abs().dot(half) > limit + slack;
        }
        beyond
    }
}

/// Edges of a group, and groups of a larger one.
const GROUP: usize = 32;

/// Boxes around runs of edges, and around runs of these.
#[derive(Clone, Debug, Default)]
pub struct EdgeGroups {
    groups: Vec<[DVec3; 2]>,
    larger: Vec<[DVec3; 2]>,
}

/// Middle and half size of the box around some.
fn around(boxes: impl Iterator<Item = [DVec3; 2]>) -> [DVec3; 2] {
    let (low, high) = boxes.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), [center, half]| {
        (low.min(center - half), high.max(center + half))
    });
    [(low + high) * 0.5, (high - low) * 0.5]
}

impl EdgeGroups {
    /// The boxes of edges.
    pub fn new(edges: &[CandidateEdge]) -> Self {
        let of_edge = |edge: &CandidateEdge| {
            let (a, b) = (edge.a.as_dvec3(), edge.b.as_dvec3());
            [(a + b) * 0.5, (b - a).abs() * 0.5]
        };
        let groups: Vec<_> = edges.chunks(GROUP).map(|group| around(group.iter().map(of_edge))).collect();
        let larger = groups.chunks(GROUP).map(|group| around(group.iter().copied())).collect();
        Self { groups, larger }
    }

    /// The groups of `edges` edges that the shaft does not miss, in order.
    #[inline(always)]
    pub fn not_missed<'a>(
        &'a self,
        shaft: &'a Shaft,
        edges: usize,
    ) -> impl Iterator<Item = Range<usize>> + 'a {
        let is_missed = |[center, half]: [DVec3; 2]| shaft.misses(center, half);
        let larger = (0..self.larger.len()).filter(move |&index| !is_missed(self.larger[index]));
        larger
            .flat_map(|index| index * GROUP..((index + 1) * GROUP).min(self.groups.len()))
            .filter(move |&group| !is_missed(self.groups[group]))
            .map(move |group| group * GROUP..((group + 1) * GROUP).min(edges))
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.groups[..]) + size_of_val(&self.larger[..])
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;
    use scene_core::Light;

    use super::*;

    proptest! {
        /// What lies on the way from a receiver of the box to a point of the light is missed by no shaft.
        #[test]
        fn ways_to_the_light_are_inside(
            place in prop::array::uniform3(-3.0_f64..3.0),
            half in prop::array::uniform3(0.0_f64..1.0),
            at in prop::array::uniform3(-1.0_f64..1.0),
            (u, v) in (-0.7_f64..0.7, -0.7_f64..0.7),
            t in 0.0_f64..1.0,
        ) {
            let (place, half) = (DVec3::from_array(place), DVec3::from_array(half));
            let center = Vec3::new(0.5, 2.0, -0.5);
            for light in [
                Light::Rect { center, half_u: Vec3::new(0.5, 0.1, 0.0), half_v: Vec3::new(0.0, 0.2, 0.4) },
                Light::Disk { center, normal: Vec3::new(0.2, -1.0, 0.1), radius: 0.5 },
                Light::Sphere { center, radius: 0.5 },
                Light::Directional { direction: center, angular_radius: 0.3 },
            ] {
                let area = AreaLight::new(&light).expect("extended");
                let shaft = Shaft::new(&area, place, half);
                let receiver = place + half * DVec3::from_array(at);
                let way = match area.shape {
                    LightShape::Rect { center, half: [x, y] } | LightShape::Disk { center, half: [x, y] } => {
                        center + x * u + y * v - receiver
                    }
                    LightShape::Ball { center, radius } => {
                        center + DVec3::new(u, v, 0.1 * u) * radius * 0.9 - receiver
                    }
                    LightShape::Cone { axis, angle } => {
                        let (x, y) = axis.any_orthonormal_pair();
                        axis + (x * u + y * v) * angle.tan()
                    }
                };
                let point = receiver + way * t;
                prop_assert!(!shaft.misses(point, DVec3::ZERO), "{light:?} {receiver} {point}");
                prop_assert!(!shaft.misses(point + 0.5, DVec3::splat(0.500_001)));
            }
        }
    }

    #[test]
    fn what_is_beside_behind_or_beyond_is_missed() {
        let light = Light::Sphere { center: Vec3::Y * 6.0, radius: 0.5 };
        let shaft = Shaft::new(&AreaLight::new(&light).expect("extended"), DVec3::ZERO, DVec3::splat(0.5));
        for outside in [DVec3::new(1.0, 3.0, 0.0), DVec3::new(0.0, -1.0, 0.0), DVec3::new(0.0, 7.0, 0.0)] {
            assert!(shaft.misses(outside, DVec3::splat(0.1)), "{outside}");
            assert!(!shaft.misses(outside, DVec3::splat(1.0)), "{outside}");
        }
    }
}
