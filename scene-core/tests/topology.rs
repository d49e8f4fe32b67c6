//! Edge topology and silhouettes on meshes that are and are not surfaces.

use std::collections::HashMap;

use gnomon_scene_core as scene_core;

use glam::{Affine3A, Vec3};
use proptest::prelude::*;
use scene_core::geometry::{
    EdgeStatistics, EdgeTopology, ObjectFlags, Scene, TopologyError, TriangleMesh, facing,
};
use scene_core::light::LightPoint;

/// The unit cube, counter-clockwise seen from outside, every face with vertices of its own.
fn cube() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for upper in [false, true] {
            let base = positions.len() as u32;
            for corner in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
                let mut p = [0.0; 3];
                p[axis] = f32::from(u8::from(upper));
                p[(axis + 1) % 3] = corner[0];
                p[(axis + 2) % 3] = corner[1];
                positions.push(Vec3::from_array(p));
            }
            for t in [[0, 1, 2], [0, 2, 3]] {
                let [a, b, c] = t.map(|i: u32| i + base);
                triangles.push(if upper { [a, b, c] } else { [a, c, b] });
            }
        }
    }
    (positions, triangles)
}

fn topology(positions: &[Vec3], triangles: &[[u32; 3]]) -> EdgeTopology {
    EdgeTopology::new(positions, triangles).unwrap()
}

/// Silhouette edges by their ends, turned so that the multiplicity is positive.
fn silhouette(positions: &[Vec3], triangles: &[[u32; 3]], light: LightPoint) -> Vec<([Vec3; 2], i32)> {
    let edges = topology(positions, triangles);
    let facing = facing(positions, triangles, light);
    let ends = |e: usize| edges.vertices()[e].map(|v| positions[v as usize]);
    edges
        .silhouette(&facing)
        .map(|s| {
            let [a, b] = ends(s.edge as usize);
            if s.multiplicity > 0 { ([a, b], s.multiplicity) } else { ([b, a], -s.multiplicity) }
        })
        .collect()
}

const ABOVE: LightPoint = LightPoint::At(Vec3::new(0.4, 9.0, 0.3));

#[test]
fn cube_is_closed_and_its_silhouette_is_a_loop_around_the_lit_face() {
    let (p, t) = cube();
    let statistics = topology(&p, &t).statistics();
    assert_eq!(statistics, EdgeStatistics { edges: 18, ..Default::default() });
    let silhouette = silhouette(&p, &t, ABOVE);
    assert_eq!(silhouette.len(), 4);
    for ([a, b], multiplicity) in silhouette {
        assert_eq!(multiplicity, 2);
        assert_eq!((a.y, b.y), (1.0, 1.0));
        // Counter-clockwise about the face seen from above: the middle lies on the left.
        assert!((b - a).cross(Vec3::new(0.5, 1.0, 0.5) - a).y > 0.0);
    }
}

#[test]
fn a_far_corner_shows_three_faces_and_a_hexagon() {
    let (p, t) = cube();
    for light in [LightPoint::Towards(Vec3::new(1.0, 2.0, 3.0)), LightPoint::At(Vec3::splat(50.0))] {
        let silhouette = silhouette(&p, &t, light);
        assert_eq!(silhouette.len(), 6);
        assert!(
            silhouette
                .iter()
                .all(|&(ends, m)| m == 2 && !ends.contains(&Vec3::ONE) && !ends.contains(&Vec3::ZERO))
        );
    }
}

#[test]
fn open_box_has_a_boundary_that_counts_once() {
    let (p, mut t) = cube();
    t.retain(|t| t.iter().any(|&i| p[i as usize].y < 1.0));
    let edges = topology(&p, &t);
    assert_eq!(edges.statistics(), EdgeStatistics { edges: 17, boundary: 4, ..Default::default() });
    // From above only the inside of the floor is turned away: it is one layer all round.
    let chain = silhouette(&p, &t, ABOVE);
    assert!(!chain.is_empty());
    let layers: i32 = chain.iter().filter(|(ends, _)| ends.iter().all(|e| e.y == 0.0)).map(|c| c.1).sum();
    let rim: i32 = chain.iter().filter(|(ends, _)| ends.iter().all(|e| e.y == 1.0)).map(|c| c.1).sum();
    // Walls are seen from inside, as the floor is: no silhouette along the floor, one layer at the rim.
    assert_eq!((layers, rim), (0, 4));
}

#[test]
fn moebius_strip_runs_against_itself_somewhere() {
    // A strip of n quads closed with half a twist: one edge must be flipped whichever way it is wound.
    let n = 8u32;
    let p: Vec<Vec3> = (0..n)
        .flat_map(|i| {
            let turn = std::f32::consts::TAU * i as f32 / n as f32;
            let (spin, around) = (turn * 0.5, Vec3::new(turn.cos(), 0.0, turn.sin()));
            let across = around * (0.3 * spin.cos()) + Vec3::Y * (0.3 * spin.sin());
            [around - across, around + across]
        })
        .collect();
    let quad = |i: u32| {
        let (a, b) = (2 * i, 2 * i + 1);
        let (c, d) = if i + 1 < n { (a + 2, b + 2) } else { (1, 0) };
        [[a, c, b], [b, c, d]]
    };
    let t: Vec<_> = (0..n).flat_map(quad).collect();
    let statistics = topology(&p, &t).statistics();
    assert_eq!((statistics.edges, statistics.boundary), (4 * n as usize, 2 * n as usize));
    assert_eq!((statistics.flipped, statistics.non_manifold), (1, 0));
    assert_closed(&p, &t, LightPoint::At(Vec3::new(0.3, 4.0, 0.1)));
}

#[test]
fn duplicate_faces_count_as_often_as_they_are_there() {
    let p = [Vec3::ZERO, Vec3::X, Vec3::Z];
    for copies in 1..4 {
        let t = vec![[0u32, 1, 2]; copies];
        let chain = silhouette(&p, &t, ABOVE);
        assert_eq!(chain.len(), 3);
        assert!(chain.iter().all(|c| c.1 == copies as i32));
    }
    // A face and its reverse are two layers, not none.
    let chain = silhouette(&p, &[[0, 1, 2], [2, 1, 0]], ABOVE);
    assert!(chain.len() == 3 && chain.iter().all(|c| c.1 == 2));
}

#[test]
fn a_flipped_face_leaves_no_inner_edge() {
    let p = [Vec3::ZERO, Vec3::X, Vec3::Z, Vec3::new(1.0, 0.0, 1.0)];
    for t in [[[0, 2, 1], [1, 2, 3]], [[0, 2, 1], [1, 3, 2]], [[0, 1, 2], [1, 2, 3]]] {
        let chain = silhouette(&p, &t, ABOVE);
        assert_eq!(chain.len(), 4, "{t:?}");
        assert!(chain.iter().all(|c| c.1 == 1));
    }
    assert_eq!(topology(&p, &[[0, 2, 1], [1, 3, 2]]).statistics().flipped, 1);
}

#[test]
fn t_junction_keeps_the_long_edge_and_both_halves() {
    // The square's lower side is one edge of one triangle and two edges of the two below it.
    let p = [
        Vec3::ZERO,
        Vec3::X * 2.0,
        Vec3::new(1.0, 0.0, 1.0),
        Vec3::X,
        Vec3::new(0.5, 0.0, -1.0),
        Vec3::new(1.5, 0.0, -1.0),
    ];
    let t = [[0, 2, 1], [0, 3, 4], [3, 1, 5]];
    let chain = silhouette(&p, &t, ABOVE);
    assert_eq!(chain.len(), 9);
    let along_x: f32 = chain
        .iter()
        .filter(|(e, _)| e.iter().all(|v| v.z == 0.0))
        .map(|(e, m)| (e[1] - e[0]).x * *m as f32)
        .sum();
    // As vectors the long edge and its halves cancel, so the volume stays closed.
    assert_eq!(along_x, 0.0);
}

#[test]
fn three_faces_at_an_edge_are_non_manifold() {
    let p = [Vec3::ZERO, Vec3::Y, Vec3::X, Vec3::Z, Vec3::NEG_X];
    let t = [[0, 1, 2], [0, 1, 3], [1, 0, 4]];
    assert_eq!(topology(&p, &t).statistics().non_manifold, 1);
    assert_closed(&p, &t, LightPoint::At(Vec3::new(3.0, 1.0, 2.0)));
}

#[test]
fn empty_degenerate_and_broken_input() {
    assert!(topology(&[], &[]).is_empty());
    assert!(topology(&[Vec3::ONE], &[]).is_empty());
    // Vertices 1 and 2 are one after welding.
    let edges = topology(&[Vec3::ZERO, Vec3::X, Vec3::X], &[[0, 1, 2]]);
    assert_eq!(edges.statistics(), EdgeStatistics { degenerate: 1, ..Default::default() });
    assert_eq!(
        EdgeTopology::new(&[Vec3::ZERO], &[[0, 0, 0], [0, 7, 0]]).unwrap_err(),
        TopologyError::IndexOutOfRange { triangle: 1, index: 7, vertices: 1 }
    );
}

#[test]
fn of_scene_takes_what_is_chosen_and_keeps_its_indices() {
    let (positions, triangles) = cube();
    let mesh = TriangleMesh::new("cube", positions, triangles);
    let mut scene = Scene::new();
    for (casts, x) in [(false, 0.0), (true, 5.0)] {
        let flags = ObjectFlags { casts, ..Default::default() };
        scene.add(&mesh, Affine3A::from_translation(Vec3::X * x), flags).unwrap();
    }
    let edges = EdgeTopology::of_scene(&scene, |object| object.flags.casts).unwrap();
    assert_eq!(edges.statistics(), EdgeStatistics { edges: 18, ..Default::default() });
    assert!((0..edges.len()).all(|e| edges.faces(e).iter().all(|f| f.face() >= 12)));
    let facing = facing(scene.positions(), scene.triangles(), ABOVE);
    assert!(edges.silhouette(&facing).count() >= 4);
}

/// What goes out of each vertex, net, must be nothing.
fn assert_closed(positions: &[Vec3], triangles: &[[u32; 3]], light: LightPoint) {
    let edges = topology(positions, triangles);
    let facing = facing(positions, triangles, light);
    assert!(is_closed(&edges, &facing));
}

fn is_closed(edges: &EdgeTopology, facing: &[i8]) -> bool {
    let mut net: HashMap<u32, i32> = HashMap::new();
    for s in edges.silhouette(facing) {
        let [from, to] = edges.vertices()[s.edge as usize];
        *net.entry(from).or_default() += s.multiplicity;
        *net.entry(to).or_default() -= s.multiplicity;
    }
    net.values().all(|&n| n == 0)
}

fn soup() -> impl Strategy<Value = (Vec<Vec3>, Vec<[u32; 3]>)> {
    // Few places for many corners: shared, duplicate, flipped, degenerate faces and doubled vertices.
    let point = prop::array::uniform3(0u8..3).prop_map(|p| Vec3::from_array(p.map(f32::from)));
    prop::collection::vec(point, 1..24).prop_flat_map(|points| {
        let n = points.len() as u32;
        (Just(points), prop::collection::vec(prop::array::uniform3(0..n), 0..120))
    })
}

proptest! {
    #[test]
    fn silhouettes_of_any_soup_are_closed(
        (positions, triangles) in soup(),
        light in prop::array::uniform3(-3.0f32..6.0),
        at_infinity in any::<bool>(),
    ) {
        let light = Vec3::from_array(light);
        let light = if at_infinity { LightPoint::Towards(light) } else { LightPoint::At(light) };
        let edges = topology(&positions, &triangles);
        prop_assert!(is_closed(&edges, &facing(&positions, &triangles, light)));
    }

    #[test]
    fn any_facing_closes_too(
        (positions, triangles) in soup(),
        signs in prop::collection::vec(-1i8..=1, 120),
    ) {
        let edges = topology(&positions, &triangles);
        prop_assert!(is_closed(&edges, &signs[..triangles.len()]));
    }

    #[test]
    fn edges_equal_a_plain_map((positions, triangles) in soup()) {
        let edges = topology(&positions, &triangles);
        let first = |i: u32| positions.iter().position(|&p| p == positions[i as usize]).unwrap() as u32;
        let mut expected: HashMap<[u32; 2], Vec<(u32, i32)>> = HashMap::new();
        for (face, t) in triangles.iter().enumerate() {
            let [a, b, c] = t.map(first);
            if a != b && b != c && c != a {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    let sign = if from < to { 1 } else { -1 };
                    expected.entry([from.min(to), from.max(to)]).or_default().push((face as u32, sign));
                }
            }
        }
        prop_assert_eq!(edges.len(), expected.len());
        for (edge, ends) in edges.vertices().iter().enumerate() {
            let faces: Vec<_> = edges.faces(edge).iter().map(|f| (f.face(), f.sign())).collect();
            prop_assert_eq!(&faces, &expected[ends]);
        }
    }

    #[test]
    fn edges_given_side_by_side_are_the_same((positions, triangles) in soup()) {
        let edges = topology(&positions, &triangles);
        let directed = (0..edges.len()).rev().flat_map(|edge| {
            let [a, b] = edges.vertices()[edge];
            edges.faces(edge).iter().map(move |f| (if f.sign() > 0 { [a, b] } else { [b, a] }, f.face()))
        });
        let again = EdgeTopology::of_sides(directed.collect());
        prop_assert_eq!(again.vertices(), edges.vertices());
        for edge in 0..edges.len() {
            prop_assert_eq!(again.faces(edge), edges.faces(edge));
        }
    }

    #[test]
    fn large_meshes_are_cut_into_the_same_tasks(side in 100usize..180) {
        // More corners than one task takes: a grid with its known number of edges.
        let positions: Vec<Vec3> =
            (0..side * side).map(|i| Vec3::new((i % side) as f32, 0.0, (i / side) as f32)).collect();
        let triangles: Vec<[u32; 3]> = (0..side - 1)
            .flat_map(|y| (0..side - 1).map(move |x| (y * side + x) as u32))
            .flat_map(|a| [[a, a + side as u32, a + 1], [a + 1, a + side as u32, a + side as u32 + 1]])
            .collect();
        let n = side - 1;
        let statistics = topology(&positions, &triangles).statistics();
        let expected = EdgeStatistics { edges: 3 * n * n + 2 * n, boundary: 4 * n, ..Default::default() };
        prop_assert_eq!(statistics, expected);
    }
}
