//! Object-space silhouettes: the edges whose shadows bound penumbrae, and how many layers each ends.
//!
//! # Multiplicity, seen from the receiver
//! Let p be a receiver and s a point of the light. The depth complexity n(p, s) is the number of faces that the line
//! from p to s meets. Turn every face f so that p sees it counter-clockwise; the boundary of all turned faces is the chain
//!
//! > Σ_e m(e)·e,  m(e) = Σ over faces f at e of sign(e, f)·side(f, p),
//!
//! with side(f, p) = ±1 for the side of f's plane that p lies on ([`scene_core::geometry::EdgeTopology`] has sign(e, f)
//! and shows why the chain is closed whatever the mesh). A turned face lies left of its boundary as p sees it; projected
//! from p onto the light, crossing a directed edge from its right to its left therefore *enters* m(e) faces:
//!
//! > n on the left − n on the right = m(e).
//!
//! So n(p, ·) changes at projections of edges with m(e) ≠ 0 alone, and each change is known. Nothing is chosen: flipped
//! windings, duplicate faces and open borders are counted by the same sum.
//!
//! # Which edges
//! If the projection of e passes over s, a point q of e lies between p and s, in the plane of each face at e. So p and s
//! lie on opposite sides of each of these planes, and m(e) seen from p is −m(e) seen from s: e is a silhouette for that
//! point of the light. An edge that is none for any point of the light bounds no penumbra: it is left out, by the
//! light's hull ([`scene_core::light::LightHull`]), which decides for all points at once.

use glam::{Vec3, Vec4};
use rayon::prelude::*;
use scene_core::Scene;
use scene_core::geometry::{EdgeTopology, Object, TopologyError, facing_of};
use scene_core::light::{LightHull, LightPoint};

/// An edge that may bound a penumbra.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Where it begins, from the [origin](Silhouettes::origin).
    pub a: Vec3,
    /// Where it ends.
    pub b: Vec3,
    /// Planes of two faces at it, n·x + d, x from the origin. The same numbers at each of a face's edges, so that they
    /// never disagree about a receiver.
    pub planes: [Vec4; 2],
    /// sign(e, f) of each; 0 for a face that is not there.
    pub signs: [f32; 2],
    /// m(e) as the light's centre sees it.
    pub from_center: i8,
    /// What is seen past the edge: it bounds a shadow only on receivers above which this point does not rise. NaN for an
    /// edge of an object, which always does.
    pub far: Vec3,
}

impl Edge {
    /// m(e) as seen from a point.
    #[inline(always)]
    pub fn multiplicity(&self, point: Vec3) -> f32 {
        let at = point.extend(1.0);
        let side = |i: usize| if self.planes[i].dot(at) >= 0.0 { self.signs[i] } else { -self.signs[i] };
        side(0) + side(1)
    }
}

/// The edges of a scene's casters that are silhouettes for some point of a light.
#[derive(Clone, Debug, Default)]
pub struct Silhouettes {
    /// What edges are relative to, world space: small numbers keep their digits.
    pub origin: Vec3,
    /// The edges.
    pub edges: Vec<Edge>,
    /// Edges of the casters that are silhouettes for no point of the light.
    pub left_out: u64,
}

/// Edges a task.
const CHUNK: usize = 1 << 13;

/// The silhouettes of the objects that `take` chooses, for any point within `hull` (all edges without one) and as
/// `center` sees them.
///
/// # Errors
/// More triangles than a topology takes.
pub fn silhouettes(
    scene: &Scene,
    origin: Vec3,
    hull: Option<&LightHull>,
    center: LightPoint,
    take: impl Fn(&Object) -> bool,
) -> Result<Silhouettes, TopologyError> {
    let topology = EdgeTopology::of_scene(scene, take)?;
    let faces = scene.triangles().len();
    let sides = |f: usize| hull.map_or(0, |hull| hull.facing(scene.corners(f)));
    let facings: Vec<[i8; 2]> =
        (0..faces).into_par_iter().map(|f| [sides(f), facing_of(scene.corners(f), center)]).collect();
    let starts: Vec<usize> = (0..topology.len()).step_by(CHUNK).collect();
    let parts: Vec<(Vec<Edge>, u64)> = starts
        .into_par_iter()
        .map(|start| {
            let (mut found, mut left_out) = (Vec::new(), 0);
            for edge in start..(start + CHUNK).min(topology.len()) {
                let incident = topology.faces(edge);
                let known = incident.iter().all(|f| facings[f.face() as usize][0] != 0);
                let sum: i32 =
                    incident.iter().map(|f| f.sign() * i32::from(facings[f.face() as usize][0])).sum();
                if known && sum == 0 {
                    left_out += 1;
                    continue;
                }
                let [a, b] = topology.vertices()[edge].map(|i| scene.positions()[i as usize] - origin);
                // Edges of more than two faces are several of two: m(e) is a sum.
                for pair in incident.chunks(2) {
                    let (mut planes, mut signs, mut from_center) = ([Vec4::ZERO; 2], [0.0; 2], 0);
                    for (i, f) in pair.iter().enumerate() {
                        planes[i] = plane(scene.corners(f.face() as usize), origin);
                        signs[i] = f.sign() as f32;
                        from_center += f.sign() as i8 * facings[f.face() as usize][1];
                    }
                    found.push(Edge { a, b, planes, signs, from_center, far: Vec3::NAN });
                }
            }
            (found, left_out)
        })
        .collect();
    let left_out = parts.iter().map(|part| part.1).sum();
    Ok(Silhouettes { origin, edges: parts.into_iter().flat_map(|part| part.0).collect(), left_out })
}

/// The plane of a triangle relative to `origin`: its unit normal, where it has one, and n·x + d = 0. Computed in f64, so
/// that its offset is good to the rounding of the result.
pub(crate) fn plane(corners: [Vec3; 3], origin: Vec3) -> Vec4 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3() - origin.as_dvec3());
    let normal = (b - a).cross(c - a).normalize_or_zero();
    normal.extend(-normal.dot(a)).as_vec4()
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene_core::{Light, scenes};

    /// Seen from a receiver, the chain of all edges that a light's hull leaves is closed where it matters: the count of
    /// layers between two points of the light is that of rays.
    #[test]
    fn multiplicity_flips_from_one_side_to_the_other() {
        let setup = scenes::build("edges", 0.0).expect("built in");
        let light = setup.lights[0];
        let Light::Rect { center, half_u, half_v } = light else { panic!("a rect") };
        let hull = LightHull::of(&light).expect("not a sun");
        let found =
            silhouettes(&setup.scene, Vec3::ZERO, Some(&hull), light.center(), |_| true).expect("few");
        assert!(found.left_out > 0 && found.edges.len() > 20);
        let mut silhouettes = 0;
        for edge in &found.edges {
            for (x, y) in [(0.0, 0.0), (-0.9, 0.3), (0.7, 0.8)] {
                let s = center + half_u * x + half_v * y;
                let q = edge.a.lerp(edge.b, 0.4);
                let beyond = q + (q - s) * 0.7;
                // A point of the light within rounding of a plane has no side.
                if edge.planes.iter().all(|plane| plane.dot(s.extend(1.0)).abs() > 1e-4) {
                    assert_eq!(edge.multiplicity(beyond), -edge.multiplicity(s));
                    silhouettes += usize::from(edge.multiplicity(s) != 0.0);
                }
            }
        }
        assert!(silhouettes > 60);
    }
}
