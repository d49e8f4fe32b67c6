//! Edges that can be silhouettes, and what lies left and right of them.

use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use scene_core::Scene;
use scene_core::geometry::{EdgeTopology, Incidence, facing_of};
use scene_core::light::LightPoint;

use crate::area_light::AreaLight;
use crate::casters::Casters;

/// How a face lies to the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaceSide {
    /// It does not take part.
    None,
    /// All of the light is on one side of its plane: its facing, +1 or −1.
    Fixed(i8),
    /// The light is on both sides of its plane, or so close to that that rounding hides it: asked from each receiver.
    Variable,
}

/// An edge with the faces before it that receivers count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CandidateEdge {
    /// Where it begins.
    pub a: Vec3,
    /// Where it ends.
    pub b: Vec3,
    /// What the faces whose side is fixed add to m(e), as receivers see it.
    pub fixed: i32,
    /// Its other faces, in [`Edges::variable`].
    first: u32,
    count: u32,
}

impl CandidateEdge {
    /// An edge whose faces all have a fixed side.
    pub fn fixed(a: Vec3, b: Vec3, fixed: i32) -> Self {
        Self { a, b, fixed, first: 0, count: 0 }
    }
}

/// Edges in the order of the topology.
#[derive(Clone, Debug, Default)]
pub struct Edges {
    /// The edges.
    pub candidates: Vec<CandidateEdge>,
    /// Faces that are asked from each receiver, with their direction at the edge.
    pub variable: Vec<Incidence>,
}

/// What rounding may do to n·w in f64, with n a product of two sides and w a way, relative to the product of the three
/// lengths: some twelve operations of 2⁻⁵³, below 2⁻⁴⁹. 2⁻⁴⁴ is more than thirty times that, and costs nothing: what it
/// leaves undecided is asked exactly.
const SLACK: f64 = 1.0 / 17_592_186_044_416.0;

/// The side of a face with these corners, as the light sees it.
pub fn side_of(light: &AreaLight, corners: [Vec3; 3]) -> FaceSide {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (u, v) = (b - a, c - a);
    let (n, way) = (u.cross(v), light.from_point(a));
    let height = n.dot(way);
    let size: f64 = DVec3::AXES.iter().map(|&axis| light.reach(axis)).sum();
    let rounding = SLACK * u.length() * v.length() * (way.length() + size);
    if height.abs() > light.reach(n) + rounding {
        FaceSide::Fixed(if height > 0.0 { 1 } else { -1 })
    } else {
        FaceSide::Variable
    }
}

/// Whether a face whose side is not fixed may touch the light, by the boxes around both.
pub fn may_touch(light: &AreaLight, corners: [Vec3; 3]) -> bool {
    let Some([low, high]) = light.bounds() else { return false };
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    // The light's samples are rounded to f32.
    let margin = low.abs().max(high.abs()) * f64::from(f32::EPSILON);
    a.max(b).max(c).cmpge(low - margin).all() && a.min(b).min(c).cmple(high + margin).all()
}

impl Edges {
    /// The edges that are silhouettes from some point of the light, as far as the sides of faces tell. Only edges with a
    /// face in `relevant` are kept.
    pub fn from_some_point(casters: &Casters<'_>, sides: &[FaceSide], relevant: &[Range<usize>]) -> Self {
        let (topology, scene) = (&casters.topology, casters.scene);
        Self::collect(casters.scene, topology, relevant, |edge, variable| {
            let faces = topology.faces(edge);
            let mut fixed = 0;
            for face in faces {
                match sides[face.face() as usize] {
                    FaceSide::None => {}
                    // The receiver is on the other side of the plane than the light.
                    FaceSide::Fixed(side) => fixed -= face.sign() * i32::from(side),
                    FaceSide::Variable => variable.push(*face),
                }
            }
            if variable.is_empty() {
                return (fixed != 0).then_some(fixed);
            }
            let cancels =
                matches!(variable[..], [a, b] if fixed == 0 && is_flat(scene, topology, edge, a, b));
            (!cancels).then_some(fixed)
        })
    }

    /// The silhouette that one point of the light sees, for faces turned by `facing`; 0 leaves a face out.
    pub fn from_one_point(casters: &Casters<'_>, facing: &[i8], relevant: &[Range<usize>]) -> Self {
        let topology = &casters.bodies().topology;
        Self::collect(casters.scene, topology, relevant, |edge, _| {
            let multiplicity = topology.multiplicity(edge, facing);
            (multiplicity != 0).then_some(-multiplicity)
        })
    }

    /// Asks `keep` for each edge, and takes those that have a face in `relevant`.
    fn collect(
        scene: &Scene,
        topology: &EdgeTopology,
        relevant: &[Range<usize>],
        keep: impl Fn(usize, &mut Vec<Incidence>) -> Option<i32> + Sync,
    ) -> Self {
        /// Edges a task.
        const CHUNK: usize = 1 << 13;
        let positions = scene.positions();
        let is_relevant = |face: &Incidence| {
            let face = face.face() as usize;
            let next = relevant.partition_point(|range| range.end <= face);
            relevant.get(next).is_some_and(|range| range.start <= face)
        };
        let starts: Vec<usize> = (0..topology.len()).step_by(CHUNK).collect();
        let parts: Vec<Self> = starts
            .into_par_iter()
            .map(|start| {
                let (mut part, mut own) = (Self::default(), Vec::new());
                for edge in start..(start + CHUNK).min(topology.len()) {
                    own.clear();
                    let Some(fixed) = keep(edge, &mut own) else { continue };
                    if topology.faces(edge).iter().any(is_relevant) {
                        let [a, b] = topology.vertices()[edge].map(|vertex| positions[vertex as usize]);
                        let (first, count) = (part.variable.len() as u32, own.len() as u32);
                        part.candidates.push(CandidateEdge { a, b, fixed, first, count });
                        part.variable.extend_from_slice(&own);
                    }
                }
                part
            })
            .collect();
        let mut all = Self::default();
        for mut part in parts {
            let before = all.variable.len() as u32;
            part.candidates.iter_mut().for_each(|edge| edge.first += before);
            all.candidates.append(&mut part.candidates);
            all.variable.append(&mut part.variable);
        }
        all
    }

    /// m(e) of an edge as seen from `origin`.
    #[inline(always)]
    pub fn multiplicity(&self, edge: &CandidateEdge, scene: &Scene, origin: Vec3) -> i32 {
        let mut sum = edge.fixed;
        for face in &self.variable[edge.first as usize..(edge.first + edge.count) as usize] {
            let facing = facing_of(scene.corners(face.face() as usize), LightPoint::At(origin));
            sum += face.sign() * i32::from(facing);
        }
        sum
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.candidates[..]) + size_of_val(&self.variable[..])
    }
}

/// Whether two faces lie in one plane on both sides of their edge, exactly: then they add up to 0 from everywhere.
pub(crate) fn is_flat(
    scene: &Scene,
    topology: &EdgeTopology,
    edge: usize,
    a: Incidence,
    b: Incidence,
) -> bool {
    let corners = [a, b].map(|face| scene.corners(face.face() as usize));
    let ends = topology.vertices()[edge].map(|vertex| scene.positions()[vertex as usize]);
    let Some(apex) = corners[1].into_iter().find(|corner| !ends.contains(corner)) else { return false };
    let normal = |[a, b, c]: [Vec3; 3]| (b - a).as_dvec3().cross((c - a).as_dvec3());
    let same_way = normal(corners[0]).dot(normal(corners[1])) > 0.0;
    facing_of(corners[0], LightPoint::At(apex)) == 0 && same_way == (a.sign() != b.sign())
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;
    use scene_core::geometry::ObjectFlags;
    use scene_core::{Light, TriangleMesh};

    use super::*;

    /// A square in two triangles at x from 0 to 1, y = 1, and one that goes down from its edge x = 1.
    fn scene() -> Scene {
        let positions = [(0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (1, 0, 0), (1, 0, 1)];
        let positions = positions.map(|(x, y, z)| Vec3::new(x as f32, y as f32, z as f32)).to_vec();
        let mut scene = Scene::new();
        let mesh = TriangleMesh::new("roof", positions, vec![[0, 2, 1], [0, 3, 2], [1, 2, 5], [1, 5, 4]]);
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        scene
    }

    fn edges(scene: &Scene, center: Vec3) -> Edges {
        let casters = Casters::new(scene).unwrap();
        let light = AreaLight::new(&Light::Sphere { center, radius: 0.5 }).unwrap();
        let sides = casters.for_faces(FaceSide::None, |t| side_of(&light, scene.corners(t)));
        Edges::from_some_point(&casters, &sides, std::slice::from_ref(&(0..4)))
    }

    #[test]
    fn only_edges_that_can_be_silhouettes_are_kept() {
        let scene = scene();
        // From above and the right all faces are seen from one side: the border is left, and no diagonal.
        let seen = edges(&scene, Vec3::new(6.0, 6.0, 0.5));
        assert_eq!(seen.candidates.len(), 6);
        assert!(seen.candidates.iter().all(|edge| edge.fixed.abs() == 1 && edge.count == 0));
        // From above and the left the roof's ridge is a silhouette, too, of two faces.
        let seen = edges(&scene, Vec3::new(-6.0, 6.0, 0.5));
        assert_eq!(seen.candidates.len(), 7);
        assert_eq!(seen.candidates.iter().filter(|edge| edge.fixed.abs() == 2).count(), 1);
        // From above the wall's plane the ridge depends on the receiver; the wall's diagonal cancels.
        let seen = edges(&scene, Vec3::new(1.0, 6.0, 0.5));
        assert_eq!(seen.candidates.len(), 7);
        assert_eq!(seen.variable.len(), 4);
        let ridge = seen.candidates.iter().find(|edge| edge.count > 0 && edge.fixed != 0).unwrap();
        let from = |x: f32| seen.multiplicity(ridge, &scene, Vec3::new(x, -3.0, 0.5));
        // Under the roof both of its faces are seen from within, beyond the wall one from outside.
        assert_eq!((from(0.5), from(1.5).abs()), (0, 2));
    }

    #[test]
    fn faces_near_the_light_are_told() {
        let light = AreaLight::new(&Light::Sphere { center: Vec3::ZERO, radius: 1.0 }).unwrap();
        let near = [Vec3::new(-5.0, 0.2, -5.0), Vec3::new(5.0, 0.2, -5.0), Vec3::new(0.0, 0.2, 9.0)];
        assert!(may_touch(&light, near) && side_of(&light, near) == FaceSide::Variable);
        assert!(!may_touch(&light, near.map(|p| p + Vec3::Y)));
        assert_eq!(side_of(&light, near.map(|p| p + Vec3::Y)), FaceSide::Fixed(1));
    }
}
