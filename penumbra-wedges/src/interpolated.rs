//! `interpolated`: light between the planes of the wedge that holds the receiver. Szabó, 7.4; Akenine-Möller and
//! Assarsson 2002.
//!
//! Around the border of the hard shadow of the light's middle, wedges stand side by side, parted by *side planes* that
//! neighbours share: through the vertex, the light's middle, and the mean of the neighbours' normals. A receiver belongs
//! to the edge between whose side planes it lies. The line through it along the edge meets these planes tₗ and tᵣ away;
//! there the visible share of the light is Sₗ and Sᵣ, and in between it is
//!
//! > s = tᵣ/(tᵣ + tₗ)·Sᵣ + tₗ/(tᵣ + tₗ)·Sₗ, with the weights the other way round,
//!
//! so that s is Sₗ where tₗ is 0: as printed, each weight stands beside the wrong end.
//!
//! On a side plane S rises linearly from the back to the front plane of the wedge, 0 to 1: with the vertex v, the light's
//! middle O and the plane's own normal N, the ray from a point x of the plane through v passes O at the distance
//! `(x − v)·N·|v − O| / ((x − v)·(v − O)/|v − O|)`, and S = (1 + distance / radius) / 2, the radius being the light's reach along N.
//! Both neighbours find the same S there, so V is continuous (C⁰). A receiver of the hard shadow (S < ½) has one layer less by
//! S, one outside has one more by 1 − S: `V = 1 − layers + Σ m·(S or S − 1)`.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::area_light::{AreaLight, LightShape};
use crate::edges::CandidateEdge;
use crate::exact::{Exact, Work};
use crate::layers::layers_before;
use crate::receiver::Receiver;
use crate::wedge::Wedge;
use crate::wedges::FromMiddle;

/// A side plane of a wedge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// The plane's normal, towards the edge's middle, of any length.
    inward: DVec3,
    /// The unit vector N in the plane that leads out of the hard shadow of a silhouette that runs with the edge.
    outward: DVec3,
}

impl Side {
    /// The side planes of all edges of a silhouette, at their beginning and their end.
    pub fn of_edges(light: &AreaLight, edges: &[CandidateEdge]) -> Vec<[Self; 2]> {
        // The edges at each vertex, turned so that all of them have a positive m.
        let mut at_vertex: HashMap<[u32; 3], Vec<(usize, DVec3)>> = HashMap::new();
        for (index, edge) in edges.iter().enumerate() {
            let normal = outward_normal(light, edge);
            for vertex in [edge.a, edge.b] {
                at_vertex.entry(key(vertex)).or_default().push((index, normal));
            }
        }
        edges
            .par_iter()
            .enumerate()
            .map(|(index, edge)| {
                [(edge.a, edge.b), (edge.b, edge.a)].map(|(vertex, other)| {
                    let own = outward_normal(light, edge);
                    // With more or fewer than one neighbour the wedge ends across its edge.
                    let neighbour = match at_vertex.get(&key(vertex)).map(Vec::as_slice) {
                        Some([a, b]) => {
                            if a.0 == index {
                                b.1
                            } else {
                                a.1
                            }
                        }
                        _ => own,
                    };
                    let away = -light.from_point(vertex.as_dvec3());
                    let mean = (own + neighbour).try_normalize().unwrap_or(own);
                    // Across the way to the light: both normals are, and so is their mean.
                    let inward = away.cross(mean);
                    let along = (other - vertex).as_dvec3();
                    let inward = if inward.dot(along) < 0.0 { -inward } else { inward };
                    Self { inward, outward: mean }
                })
            })
            .collect()
    }
}

/// The half-spaces outside of which `share` is certain: the side planes, and a front and a back plane that hold whatever
/// lies between those of either end.
///
/// Let ê be the edge's direction, N the normal of the plane of edge and light's middle, m the unit vector in it across ê, away
/// from the light, and h the distance of the light's middle from the edge's line. At the vertex v, w = v − O has w·m = h.
/// Light on the side plane is between 0 and 1 for x − v = s·ŵ + τ·Nᵥ with |τ| < R·s/|w|, R the light's reach, Nᵥ the plane's own
/// normal across w. Hence y = (x − v)·m ≥ s·(h − R·|Nᵥ·m|)/|w| and |(x − v)·N| ≤ |τ|. Neither changes along ê, so that a
/// receiver has y ≥ 0 and |z| ≤ y·R/(h − R·|Nᵥ·m|) with the Nᵥ of one of the ends. Where the divisor is not positive there
/// are side planes only.
pub fn wedge_of(light: &AreaLight, edge: &CandidateEdge, sides: &[Side; 2]) -> Wedge {
    let (a, b) = (edge.a.as_dvec3(), edge.b.as_dvec3());
    let mut planes = vec![(sides[0].inward, a), (sides[1].inward, b)];
    let along = (b - a).normalize_or_zero();
    let away = -light.from_point(a);
    let across = away - along * away.dot(along);
    let (h, m) = (across.length(), across.normalize_or_zero());
    let normal = along.cross(m);
    let reach = sides.iter().map(|side| reach_of(light, side)).fold(0.0, f64::max);
    let lean = sides.iter().map(|side| side.outward.dot(m).abs()).fold(0.0, f64::max);
    let least = h - reach * lean;
    if least > 0.0 {
        let slope = m * (reach / least);
        planes.extend([(m, a), (slope + normal, a), (slope - normal, a)]);
    }
    Wedge::of_planes(planes)
}

/// How far the light reaches along a side plane's normal, in units of the distance for a light at infinity.
#[inline]
fn reach_of(light: &AreaLight, side: &Side) -> f64 {
    match light.shape {
        LightShape::Cone { angle, .. } => angle.tan(),
        _ => light.reach(side.outward),
    }
}

/// Two zeros are one place.
fn key(vertex: Vec3) -> [u32; 3] {
    (vertex + 0.0).to_array().map(f32::to_bits)
}

/// The unit normal of the plane of light and edge, out of the hard shadow.
fn outward_normal(light: &AreaLight, edge: &CandidateEdge) -> DVec3 {
    let (a, b) = (edge.a.as_dvec3(), edge.b.as_dvec3());
    // (a − L) × (b − a) points out where the multiplicity seen from the light is positive; receivers see −m.
    let normal = (-light.from_point(a)).cross(b - a);
    (if edge.fixed > 0 { -normal } else { normal }).normalize_or_zero()
}

/// What is asked for V.
#[derive(Clone, Copy, Debug)]
pub struct Interpolated<'a> {
    /// Scene, tree, edges and wedges.
    pub all: Exact<'a>,
    /// Layers and side planes.
    pub middle: &'a FromMiddle,
}

impl Interpolated<'_> {
    /// V of a receiver before clamping, by those of `edges` that are in question.
    #[inline(always)]
    pub fn unclamped(&self, receiver: &Receiver, edges: &[u32], work: &mut Work) -> f64 {
        work.asked += 1;
        let Exact { scene, tree, wedges, skip } = self.all;
        let place = receiver.place();
        let (mut sum, mut inside) = (0.0, false);
        work.pairs += edges.len() as u64;
        for &index in edges {
            if skip && !wedges.wedges[index as usize].holds(place) {
                continue;
            }
            work.inside += 1;
            let edge = &wedges.edges.candidates[index as usize];
            if let Some(share) = share(&wedges.light, edge, &self.middle.sides[index as usize], place) {
                inside = true;
                let layers = f64::from(edge.fixed.abs());
                sum += layers * if share < 0.5 { share } else { share - 1.0 };
            }
        }
        work.penumbra += u64::from(inside);
        let center = wedges.light.center();
        work.rays += 1;
        let layers = if inside {
            layers_before(scene, tree, &self.middle.facing, receiver.origin, center)
        } else {
            i32::from(tree.is_occluded(receiver.origin, center))
        };
        1.0 - f64::from(layers) + sum
    }
}

/// s at a place in the wedge; `None` outside.
#[inline]
fn share(light: &AreaLight, edge: &CandidateEdge, sides: &[Side; 2], place: DVec3) -> Option<f64> {
    let ends = [edge.a, edge.b].map(Vec3::as_dvec3);
    let along = ends[1] - ends[0];
    let mut distances = [0.0; 2];
    let mut shares = [0.0; 2];
    for (i, (side, vertex)) in sides.iter().zip(ends).enumerate() {
        let way = if i == 0 { along } else { -along };
        let (height, slope) = (side.inward.dot(place - vertex), side.inward.dot(way));
        if height < 0.0 || slope <= 0.0 {
            return None;
        }
        distances[i] = height / slope;
        let from_vertex = place - way * distances[i] - vertex;
        let away = -light.from_point(vertex);
        let behind = from_vertex.dot(away);
        if behind <= 0.0 {
            return None;
        }
        let offset = from_vertex.dot(side.outward) * away.length_squared() / behind;
        shares[i] = ((1.0 + offset / reach_of(light, side)) * 0.5).clamp(0.0, 1.0);
    }
    let [left, right] = distances;
    let sum = left + right;
    let share = if sum > 0.0 { (right * shares[0] + left * shares[1]) / sum } else { shares[0] };
    (share > 0.0 && share < 1.0).then_some(share)
}

#[cfg(test)]
mod tests {
    use scene_core::Light;

    use super::*;

    fn edge(a: [f32; 3], b: [f32; 3]) -> CandidateEdge {
        CandidateEdge::fixed(Vec3::from(a), Vec3::from(b), -1)
    }

    #[test]
    fn light_rises_linearly_across_a_straight_edge() {
        let light = AreaLight::new(&Light::Sphere { center: Vec3::Y * 2.0, radius: 0.5 }).unwrap();
        let edges = [edge([-9.0, 1.0, 0.0], [9.0, 1.0, 0.0])];
        let sides = Side::of_edges(&light, &edges);
        let at = |z: f64| share(&light, &edges[0], &sides[0], DVec3::new(0.3, 0.0, z));
        // One unit below the edge, which is one unit below the light, z is mirrored.
        for z in [-0.45, -0.2, 0.0, 0.1, 0.4] {
            let share = at(z).unwrap();
            let expected = [0.5 + z, 0.5 - z];
            assert!(expected.iter().any(|e| (share - e).abs() < 1e-12), "{z}: {share}");
        }
        assert!(at(0.51).is_none() && at(-0.51).is_none());
        assert_eq!(share(&light, &edges[0], &sides[0], DVec3::new(0.0, 1.5, 0.0)), None, "before the edge");
    }

    #[test]
    fn neighbours_agree_on_their_common_plane() {
        let light = AreaLight::new(&Light::Sphere { center: Vec3::Y * 3.0, radius: 0.6 }).unwrap();
        let edges = [edge([-2.0, 1.0, 1.0], [0.0, 1.0, 0.0]), edge([0.0, 1.0, 0.0], [1.0, 1.1, 1.5])];
        let sides = Side::of_edges(&light, &edges);
        let side = sides[0][1];
        assert!(side.inward.cross(sides[1][0].inward).length() < 1e-12, "one plane");
        for (s, t) in [(0.5, 0.1), (1.0, -0.2), (1.3, 0.0)] {
            let vertex = DVec3::Y;
            let away = -light.from_point(vertex);
            let on = vertex + away * s + side.outward * t;
            let shares = [0, 1].map(|i| {
                let inside = on + sides[i][1 - i].inward.normalize() * 1e-9;
                share(&light, &edges[i], &sides[i], inside).unwrap()
            });
            assert!((shares[0] - shares[1]).abs() < 1e-6, "{s} {t}: {shares:?}");
        }
    }
}
