//! Which faces count as a layer before the light, in meshes as they are: for the variants that add layers up.
//!
//! A closed body is one layer: of its faces only those turned to the light count. A sheet is one from either side. To tell
//! them apart, a mesh need be neither clean nor wound one way:
//!
//! 1. Of faces that are there twice, one counts.
//! 2. Sides that end at other vertices than their neighbour's are cut ([`seams`](crate::seams)).
//! 3. A face with a side of its own is part of no body: it is a sheet, and so are those that only it closed.
//! 4. A sheet that lies on another face hides nothing more.
//! 5. What is left closes. Neighbours across an edge of two faces are turned alike, whichever way they are wound; most
//!    keep their winding. Where more than two faces meet and do not cancel, or no winding serves (a Klein bottle), all faces
//!    count, as sheets.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use scene_core::geometry::{Aabb, EdgeTopology, weld};

use crate::casters::Casters;
use crate::seams::{close_seams, magnitude, rounding};

/// How a face counts as a layer. The numbers are those of the shader.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum FaceKind {
    /// Never.
    #[default]
    Nothing = 0,
    /// From both sides.
    Sheet = 1,
    /// Where its front is turned to the light: part of a closed body.
    Shell = 2,
    /// Where its back is: part of a closed body, most of which is wound the other way.
    TurnedShell = 3,
}

impl FaceKind {
    /// The facing of a face that counts, else 0.
    pub fn counts(self, facing: i8) -> i8 {
        match self {
            Self::Nothing => 0,
            Self::Sheet => facing,
            Self::Shell => facing.max(0),
            Self::TurnedShell => facing.min(0),
        }
    }
}

/// The surfaces of a scene's casters. Independent of light and camera.
#[derive(Clone, Debug)]
pub struct Bodies {
    /// How each of [`Scene::triangles`](scene_core::Scene::triangles) counts.
    pub kinds: Vec<FaceKind>,
    /// Edges of the faces that count, cut at seams.
    pub topology: EdgeTopology,
}

impl Bodies {
    /// The surfaces of `casters` that have no mask.
    pub fn new(casters: &Casters<'_>) -> Self {
        let mut kinds = surfaces(casters);
        let topology = close_seams(casters.scene.positions(), &casters.topology, |face| {
            kinds[face as usize] != FaceKind::Nothing
        });
        peel(&topology, &mut kinds);
        let covered: Vec<usize> =
            (0..kinds.len()).into_par_iter().filter(|&face| lies_on_another(casters, &kinds, face)).collect();
        turn(&topology, &mut kinds);
        covered.into_iter().for_each(|face| kinds[face] = FaceKind::Nothing);
        Self { kinds, topology }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.kinds[..]) + self.topology.bytes()
    }
}

/// Each face once, for shells; others for nothing.
fn surfaces(casters: &Casters<'_>) -> Vec<FaceKind> {
    let scene = casters.scene;
    let mut kinds = casters.for_faces(FaceKind::Nothing, |_| FaceKind::Shell);
    // Of the same corners in the same winding. A face and its back are a body without volume, one layer as it is.
    let representative = weld(scene.positions()).representative;
    let mut named: Vec<([u32; 3], u32)> = (0..kinds.len())
        .into_par_iter()
        .filter(|&face| kinds[face] != FaceKind::Nothing)
        .map(|face| {
            let [a, b, c] = scene.triangles()[face].map(|vertex| representative[vertex as usize]);
            let least = a.min(b).min(c);
            let from_least = if least == a {
                [a, b, c]
            } else if least == b {
                [b, c, a]
            } else {
                [c, a, b]
            };
            (from_least, face as u32)
        })
        .collect();
    named.par_sort_unstable();
    for pair in named.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        kinds[pair[1].1 as usize] = FaceKind::Nothing;
    }
    kinds
}

/// Makes sheets of the shells that have a side of their own, until no shell has one.
fn peel(topology: &EdgeTopology, kinds: &mut [FaceKind]) {
    let is_shell = |kinds: &[FaceKind], face: u32| kinds[face as usize] == FaceKind::Shell;
    let sides = SidesOfFaces::new(topology, kinds.len());
    let mut shells: Vec<u32> = (0..topology.len())
        .map(|edge| topology.faces(edge).iter().filter(|f| is_shell(kinds, f.face())).count() as u32)
        .collect();
    let mut loose: Vec<usize> = (0..topology.len()).filter(|&edge| shells[edge] == 1).collect();
    while let Some(edge) = loose.pop() {
        let Some(face) = topology.faces(edge).iter().map(|f| f.face()).find(|&f| is_shell(kinds, f)) else {
            continue;
        };
        kinds[face as usize] = FaceKind::Sheet;
        for &edge in sides.of(face as usize) {
            shells[edge as usize] -= 1;
            if shells[edge as usize] == 1 {
                loose.push(edge as usize);
            }
        }
    }
}

/// The edges of each face, in compressed rows.
struct SidesOfFaces {
    first: Vec<u32>,
    edges: Vec<u32>,
}

impl SidesOfFaces {
    fn new(topology: &EdgeTopology, faces: usize) -> Self {
        let mut first = vec![0_u32; faces + 1];
        let incidences =
            || (0..topology.len()).flat_map(|edge| topology.faces(edge).iter().map(move |f| (edge, f)));
        incidences().for_each(|(_, face)| first[face.face() as usize + 1] += 1);
        let mut sum = 0;
        for first in &mut first {
            sum += *first;
            *first = sum;
        }
        let mut cursor = first.clone();
        let mut edges = vec![0; sum as usize];
        for (edge, face) in incidences() {
            let cursor = &mut cursor[face.face() as usize];
            edges[*cursor as usize] = edge as u32;
            *cursor += 1;
        }
        Self { first, edges }
    }

    fn of(&self, face: usize) -> &[u32] {
        &self.edges[self.first[face] as usize..self.first[face + 1] as usize]
    }
}

/// Whether a sheet's corners all lie on one other face, up to rounding. Of two that lie on each other the smaller does,
/// or the later.
fn lies_on_another(casters: &Casters<'_>, kinds: &[FaceKind], face: usize) -> bool {
    if kinds[face] != FaceKind::Sheet {
        return false;
    }
    let corners = casters.scene.corners(face);
    let slack = rounding(magnitude(&corners));
    let (low, high) =
        corners[1..].iter().fold((corners[0], corners[0]), |(low, high), &c| (low.min(c), high.max(c)));
    // Whoever holds a face that this one lies on holds this one, too.
    let holds = |bounds: Aabb| {
        let [low, high, min, max] = [low, high, bounds.min, bounds.max].map(Vec3::as_dvec3);
        (low + slack).cmpge(min).all() && (high - slack).cmple(max).all()
    };
    let size = |face: usize| {
        let [a, b, c] = casters.scene.corners(face).map(Vec3::as_dvec3);
        ((b - a).cross(c - a).length(), std::cmp::Reverse(face))
    };
    let own = size(face);
    let found = std::cell::Cell::new(false);
    casters.tree.visit(
        |bounds| !found.get() && holds(bounds),
        |other| {
            let other = other as usize;
            let counts = other != face && kinds[other] != FaceKind::Nothing;
            if counts && (kinds[other] == FaceKind::Shell || size(other) > own) {
                let around = casters.scene.corners(other).map(Vec3::as_dvec3);
                found
                    .set(found.get() || corners.iter().all(|corner| is_on(around, corner.as_dvec3(), slack)));
            }
        },
    );
    found.get()
}

/// Whether a point is on a triangle, or off it by no more than `slack` across and at each side.
fn is_on([a, b, c]: [DVec3; 3], point: DVec3, slack: f64) -> bool {
    let normal = (b - a).cross(c - a);
    normal.dot(point - a).abs() <= slack * normal.length()
        && [(a, b), (b, c), (c, a)].into_iter().all(|(from, to)| {
            let inward = normal.cross(to - from);
            inward.dot(point - from) >= -slack * inward.length()
        })
}

/// Turns neighbouring shells alike, and makes sheets of those that do not cancel.
fn turn(topology: &EdgeTopology, kinds: &mut [FaceKind]) {
    let mut parts = Parts::new(kinds.len());
    let shells =
        |edge: usize| topology.faces(edge).iter().filter(|f| kinds[f.face() as usize] == FaceKind::Shell);
    for edge in 0..topology.len() {
        let mut two = shells(edge);
        if let (Some(a), Some(b), None) = (two.next(), two.next(), two.next()) {
            parts.join(a.face(), b.face(), a.sign() == b.sign());
        }
    }
    // Whether a face is turned against the first of its part; of the faces of a part, how many are.
    let turned: Vec<(u32, bool)> = (0..kinds.len() as u32).map(|face| parts.root(face)).collect();
    let mut balance = vec![0_i32; kinds.len()];
    for &(root, is_turned) in &turned {
        balance[root as usize] += if is_turned { -1 } else { 1 };
    }
    let is_turned = |face: u32| {
        let (root, is_turned) = turned[face as usize];
        is_turned != (balance[root as usize] < 0)
    };
    let mut is_open = parts.contradicts.clone();
    for edge in 0..topology.len() {
        let sum: i32 = shells(edge).map(|f| if is_turned(f.face()) { -f.sign() } else { f.sign() }).sum();
        if sum != 0 {
            shells(edge).for_each(|face| is_open[turned[face.face() as usize].0 as usize] = true);
        }
    }
    for face in 0..kinds.len() {
        if kinds[face] == FaceKind::Shell {
            let is_open = is_open[turned[face].0 as usize];
            kinds[face] = match is_turned(face as u32) {
                _ if is_open => FaceKind::Sheet,
                true => FaceKind::TurnedShell,
                false => FaceKind::Shell,
            };
        }
    }
}

/// Disjoint sets of faces, each turned like its root or against it.
struct Parts {
    above: Vec<(u32, bool)>,
    /// Of a root: two ways through its part turn a face differently.
    contradicts: Vec<bool>,
}

impl Parts {
    fn new(faces: usize) -> Self {
        Self { above: (0..faces as u32).map(|face| (face, false)).collect(), contradicts: vec![false; faces] }
    }

    /// The first face of the part, and whether `face` is turned against it.
    fn root(&mut self, face: u32) -> (u32, bool) {
        let (mut at, mut turned) = (face, false);
        while self.above[at as usize].0 != at {
            let (parent, against) = self.above[at as usize];
            let (grandparent, parent_against) = self.above[parent as usize];
            self.above[at as usize] = (grandparent, against != parent_against);
            turned ^= against != parent_against;
            at = grandparent;
        }
        (at, turned)
    }

    fn join(&mut self, a: u32, b: u32, against: bool) {
        let ((a, a_turned), (b, b_turned)) = (self.root(a), self.root(b));
        let against = against != (a_turned != b_turned);
        if a == b {
            self.contradicts[a as usize] |= against;
        } else {
            let (root, other) = (a.min(b), a.max(b));
            self.above[other as usize] = (root, against);
            self.contradicts[root as usize] |= self.contradicts[other as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;
    use scene_core::geometry::ObjectFlags;
    use scene_core::{Scene, TriangleMesh};

    use super::*;

    const BODY: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

    fn kinds(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<FaceKind> {
        let mut scene = Scene::new();
        let mesh = TriangleMesh::new("part", positions.to_vec(), triangles.to_vec());
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        Bodies::new(&Casters::new(&scene).unwrap()).kinds
    }

    fn corners() -> Vec<Vec3> {
        vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z]
    }

    #[test]
    fn closed_bodies_are_told_from_sheets() {
        assert_eq!(kinds(&corners(), &BODY), [FaceKind::Shell; 4]);
        assert_eq!(kinds(&corners(), &BODY[..3]), [FaceKind::Sheet; 3]);
        let flipped = [[0, 1, 2], BODY[1], BODY[2], BODY[3]];
        let turned = [FaceKind::TurnedShell, FaceKind::Shell, FaceKind::Shell, FaceKind::Shell];
        assert_eq!(kinds(&corners(), &flipped), turned);
        let twice = kinds(&corners(), &[BODY, BODY].concat());
        assert_eq!(twice, [[FaceKind::Shell; 4], [FaceKind::Nothing; 4]].concat());
    }

    #[test]
    fn a_flap_on_a_body_is_a_sheet_and_the_body_stays_closed() {
        let positions = [corners(), vec![Vec3::new(0.5, 0.0, -1.0)]].concat();
        let kinds = kinds(&positions, &[&BODY[..], &[[0, 1, 4]]].concat());
        assert_eq!(kinds, [&[FaceKind::Shell; 4][..], &[FaceKind::Sheet]].concat());
    }

    #[test]
    fn a_body_with_a_cut_side_is_closed() {
        // The side of 0 and 1 is cut for one of its faces.
        let positions = [corners(), vec![Vec3::ZERO.lerp(Vec3::X, 0.3)]].concat();
        let cut = [[0, 2, 4], [4, 2, 1], BODY[1], BODY[2], BODY[3]];
        assert_eq!(kinds(&positions, &cut), [FaceKind::Shell; 5]);
    }

    #[test]
    fn what_lies_on_a_face_hides_nothing_more() {
        let [a, b, c] = [Vec3::new(0.2, 0.2, 0.0), Vec3::new(0.4, 0.2, 0.0), Vec3::new(0.2, 0.4, 0.0)];
        let patched = |height: f32| {
            let positions = [corners(), [a, b, c].map(|p| p + Vec3::Z * height).to_vec()].concat();
            kinds(&positions, &[&BODY[..], &[[4, 5, 6]]].concat())[4]
        };
        assert_eq!(patched(0.0), FaceKind::Nothing);
        assert_eq!(patched(1e-8), FaceKind::Nothing);
        assert_eq!(patched(-1e-3), FaceKind::Sheet);
        // Two sheets on each other: one counts.
        let two = kinds(&[corners(), corners()].concat(), &[[0, 1, 2], [4, 6, 5]]);
        assert_eq!(
            two.iter().filter(|kind| **kind == FaceKind::Nothing).count(),
            0,
            "face and back are a body"
        );
        let shrunk = [corners(), corners().iter().map(|p| *p * 0.9).collect()].concat();
        assert_eq!(kinds(&shrunk, &[[0, 1, 2], [4, 6, 5]]), [FaceKind::Sheet, FaceKind::Nothing]);
    }

    #[test]
    fn a_strip_with_one_side_is_no_body() {
        // A projective plane in six vertices: closed, with no winding that serves.
        let plane = [
            [0, 1, 2],
            [0, 2, 3],
            [0, 3, 4],
            [0, 4, 5],
            [0, 5, 1],
            [1, 2, 4],
            [2, 3, 5],
            [3, 4, 1],
            [4, 5, 2],
            [5, 1, 3],
        ];
        let positions: Vec<Vec3> =
            (0..6).map(|i| Vec3::new((i * i % 7) as f32, (i * i * i % 5) as f32, i as f32)).collect();
        assert_eq!(kinds(&positions, &plane), [FaceKind::Sheet; 10]);
    }
}
