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
//! For the point where the line through p along the edge meets the plane that comes to −w·c / (N·c), with w = v − O and
//! c = (p − v) × (b − a): that point is p − v − e·(n·(p − v))/(n·e) with n = w × N and e along the edge, whose products with N and w are w·c and
//! −|w|²·N·c over n·e. Nothing cancels in it, and w·c, like c, is the same from both ends.
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
    /// 1 if `inward` is (vertex − O) × N, −1 if it is the other way round.
    turn: f64,
}

impl Side {
    /// The side planes of all edges of a silhouette, at their beginning and their end.
    pub fn of_edges(light: &AreaLight, edges: &[CandidateEdge]) -> Vec<[Self; 2]> {
        // The edges at each vertex, turned so that all of them have a positive m.
        let mut at_vertex: HashMap<[u32; 3], Vec<usize>> = HashMap::new();
        for (index, edge) in edges.iter().enumerate() {
            for vertex in [edge.a, edge.b] {
                at_vertex.entry(key(vertex)).or_default().push(index);
            }
        }
        edges
            .par_iter()
            .enumerate()
            .map(|(index, edge)| {
                [(edge.a, edge.b), (edge.b, edge.a)].map(|(vertex, other)| {
                    let away = -light.from_point(vertex.as_dvec3());
                    // With more or fewer than one neighbour the wedge ends across its edge.
                    let mean = match at_vertex.get(&key(vertex)).map(Vec::as_slice) {
                        Some(&[a, b]) => mean_normal(light, [edge, &edges[a + b - index]], vertex),
                        _ => outward_normal(light, edge),
                    };
                    // Across the way to the light: both normals are, and so is their mean.
                    let inward = away.cross(mean);
                    let along = (other - vertex).as_dvec3();
                    let turn = if inward.dot(along) < 0.0 { -1.0 } else { 1.0 };
                    Self { inward: inward * turn, outward: mean, turn }
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

/// The unit vector between the outward normals of two edges that meet at a vertex; that of the first where it has none.
///
/// Where an outline turns back on itself, as the light sees it, the normals p and q are all but opposite, and rounding rules their sum.
/// All three are across the way w from the light, so that p + q, as long as it is not 0, is along (p − q) × w, which is long there;
/// turned to p's side: ((p − q) × w)·p = −w·(p × q). With x and y the edges from the vertex, p is along ±x × w and q along ±y × w,
/// and (x × w) × (y × w) = w·(w·(x × y)): what decides is one determinant of given coordinates.
fn mean_normal(light: &AreaLight, edges: [&CandidateEdge; 2], vertex: Vec3) -> DVec3 {
    let [p, q] = edges.map(|edge| outward_normal(light, edge));
    if p.dot(q) >= 0.0 {
        return (p + q).try_normalize().unwrap_or(p);
    }
    let away = -light.from_point(vertex.as_dvec3());
    // Whether x × w leads out of the hard shadow: as receivers see it, edge × w does where the multiplicity is positive.
    let leads_out = edges.map(|edge| (edge.fixed > 0) == (edge.a == vertex));
    let [x, y] =
        edges.map(|edge| (if edge.a == vertex { edge.b } else { edge.a }).as_dvec3() - vertex.as_dvec3());
    let volume = away.dot(x.cross(y));
    if volume == 0.0 {
        return p;
    }
    let is_turned = (volume < 0.0) == (leads_out[0] == leads_out[1]);
    let across = (p - q).cross(away);
    (if is_turned { across } else { -across }).try_normalize().unwrap_or(p)
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
                // A triangle blocks at its border, too: the very middle is in the hard shadow.
                let layers = f64::from(edge.fixed.abs());
                sum += layers * if share <= 0.5 { share } else { share - 1.0 };
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
    let across = (place - ends[0]).cross(along);
    // The same from both ends: they differ by `along`.
    let height_over_edge = -light.from_point(ends[0]).dot(across);
    let mut distances = [0.0; 2];
    let mut shares = [0.0; 2];
    for (i, (side, vertex)) in sides.iter().zip(ends).enumerate() {
        let slope = side.inward.dot(if i == 0 { along } else { -along });
        let height = side.inward.dot(place - vertex);
        let lean = side.outward.dot(across);
        // What is not behind the vertex as the light sees it is in no shadow of the edge.
        let behind = if i == 0 { -lean * side.turn } else { lean * side.turn };
        if height < 0.0 || slope <= 0.0 || behind <= 0.0 {
            return None;
        }
        distances[i] = height / slope;
        let offset = -height_over_edge / lean;
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

    #[test]
    fn an_outline_that_turns_back_has_a_mean_normal() {
        for light in [
            Light::Sphere { center: Vec3::Y * 3.0, radius: 0.6 },
            Light::Directional { direction: Vec3::new(0.1, -1.0, 0.0), angular_radius: 0.1 },
        ] {
            let light = AreaLight::new(&light).unwrap();
            let vertex = Vec3::new(0.25, 0.5, -0.125);
            let away = -light.from_point(vertex.as_dvec3());
            for (way, turn) in [(1.0, 0.5), (1.0, -1e-3), (-1.0, 0.7), (-1.0, 1e-6), (1.0, 1e-6)] {
                let ends = [Vec3::X + Vec3::Y * 0.3, Vec3::new(way, 0.25, turn)].map(|way| vertex + way);
                for bits in 0..16 {
                    let [p, q] = [0, 1].map(|i| {
                        let fixed = if bits >> i & 1 == 1 { 1 } else { -1 };
                        let [a, b] =
                            if bits >> (i + 2) & 1 == 1 { [vertex, ends[i]] } else { [ends[i], vertex] };
                        CandidateEdge::fixed(a, b, fixed)
                    });
                    let mean = mean_normal(&light, [&p, &q], vertex);
                    let same = mean_normal(&light, [&q, &p], vertex);
                    assert!((mean - same).length() < 1e-12, "{mean} {same}: both sides of a plane are one");
                    assert!(
                        (mean.length() - 1.0).abs() < 1e-12 && mean.dot(away).abs() < 1e-12 * away.length()
                    );
                    let sum = outward_normal(&light, &p) + outward_normal(&light, &q);
                    // Rounding of the sum is 2⁻⁵² of 1, and it is no shorter than 10⁻⁷.
                    assert!((mean - sum.normalize()).length() < 1e-8, "{way} {turn} {bits}: {mean} {sum}");
                }
            }
            // All the way back: each edge ends across itself.
            let edge = CandidateEdge::fixed(vertex, vertex + Vec3::X, 1);
            let back = CandidateEdge::fixed(vertex + Vec3::X * 2.0, vertex, 1);
            assert_eq!(mean_normal(&light, [&edge, &back], vertex), outward_normal(&light, &edge));
        }
    }
}
