//! A park: trees with real leaves around a lawn, benches and lamps, under a large area light, as an overcast
//! gap in the sky would be.

use glam::{Vec2, Vec3};

use super::plants::{Tree, broadleaf, bush, grass};
use super::random::Random;
use super::shapes::{block, ground, lathe, merged, rod, sphere};
use super::spec::Values;
use super::stage::turned;
use super::{BuiltIn, Parameter, Stage, camera};
use crate::geometry::ObjectFlags;
use crate::{Light, TriangleMesh};

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "park",
    summary: "trees with real leaves around a lawn under an area light",
    parameters: &[
        Parameter::whole("leaves", 12_000, [0, 1_000_000], "leaves a tree, of two triangles each"),
        Parameter::real("light", 2.0, [0.05, 8.0], "half the side of the square light, in metres"),
        Parameter::SEED,
    ],
    counts: None,
    build,
};

/// Places of the trees, heights in metres, and which of the three kinds grows there.
const TREES: [([f32; 2], f32, usize); 7] = [
    ([-7.5, -8.0], 8.5, 0),
    ([-1.0, -10.5], 9.5, 1),
    ([6.5, -8.5], 8.0, 2),
    ([-8.8, 0.5], 7.0, 1),
    ([8.6, -1.0], 7.4, 0),
    ([-3.6, -2.2], 5.6, 2),
    ([3.2, -3.6], 6.4, 1),
];

fn build(values: &Values<'_>, _time: f32) -> Stage {
    let (half, seed) = (values.real("light"), values.whole("seed"));
    let center = Vec3::new(-7.0, 19.0, 6.0);
    let u = Vec3::Z.cross(center).normalize() * half;
    let light = Light::Rect { center, half_u: u, half_v: u.cross(center.normalize()) };
    let mut stage =
        Stage::new(camera(Vec3::new(1.5, 6.6, 20.0), Vec3::new(0.0, 3.4, -2.0), 43.0, 0.5), light);
    stage.add("lawn", ground(22.0));
    // A finger's height over the lawn, so that neither hides the other.
    let path = block(Vec3::new(0.0, 0.01, 4.2), Vec3::new(44.0, 0.04, 2.2));
    stage.add("path", path);

    let kinds: [TriangleMesh; 3] = std::array::from_fn(|i| {
        let tree = Tree {
            height: 8.0,
            radius: 0.26,
            bare: [0.3, 0.36, 0.26][i],
            leaves: values.whole("leaves"),
            leaf: 0.17,
        };
        broadleaf(tree, &mut Random::new(seed, i as u32))
    });
    let mut random = Random::new(seed, 100);
    for (i, ([x, z], height, kind)) in TREES.into_iter().enumerate() {
        let mut tree = kinds[kind].clone();
        tree.name = format!("tree {}", i + 1);
        let place = turned(random.angle(), Vec3::new(x, -0.05, z))
            * glam::Affine3A::from_scale(Vec3::splat(height / 8.0));
        stage.instance(&tree, place, ObjectFlags::default());
    }
    for (i, [x, z]) in [[-5.4, 1.4], [5.6, 1.6], [0.2, -6.4], [9.6, 2.2]].into_iter().enumerate() {
        let shrub = bush(1.1, 900, 0.13, &mut Random::new(seed, 200 + i as u32));
        stage.place(&format!("bush {}", i + 1), shrub, turned(0.0, Vec3::new(x, 0.0, z)));
    }
    let tufts = (0..26).map(|i| {
        let spot = random.square();
        // Behind the path or before it.
        let z = if i % 2 == 0 { 2.0 - 7.0 * spot.y.abs() } else { 6.2 + 4.0 * spot.y.abs() };
        grass(0.5, 0.28, 60, &mut random).transformed(turned(0.0, Vec3::new(spot.x * 8.5, 0.0, z)))
    });
    let tufts = merged(tufts);
    stage.add("grass", tufts);
    for (i, (x, turn)) in [(-2.6, 0.06), (3.0, -0.05)].into_iter().enumerate() {
        stage.place(&format!("bench {}", i + 1), bench(), turned(turn, Vec3::new(x, 0.0, 2.3)));
    }
    for (i, x) in [-7.0, 0.2, 7.2].into_iter().enumerate() {
        stage.place(&format!("lamp {}", i + 1), lamp(), turned(0.0, Vec3::new(x, 0.0, 2.6)));
    }
    stage
}

/// Slats on two iron sides; it looks along z.
fn bench() -> TriangleMesh {
    let seat = (0..4).map(|i| block(Vec3::new(0.0, 0.45, 0.12 * i as f32), Vec3::new(1.8, 0.035, 0.09)));
    let back = (0..3).map(|i| {
        let up = 0.13 * i as f32;
        block(Vec3::new(0.0, 0.58 + up, -0.11 - 0.25 * up), Vec3::new(1.8, 0.09, 0.03))
    });
    let sides = [-0.75, 0.75].into_iter().flat_map(|x| {
        [
            rod(Vec3::new(x, 0.0, 0.38), Vec3::new(x, 0.43, 0.36), 0.025, 8),
            rod(Vec3::new(x, 0.0, -0.04), Vec3::new(x, 0.92, -0.21), 0.025, 8),
            block(Vec3::new(x, 0.415, 0.16), Vec3::new(0.05, 0.035, 0.5)),
        ]
    });
    merged(seat.chain(back).chain(sides))
}

fn lamp() -> TriangleMesh {
    let profile = [
        [0.12, 0.0],
        [0.12, 0.2],
        [0.06, 0.3],
        [0.045, 0.5],
        [0.035, 3.0],
        [0.14, 3.05],
        [0.14, 3.09],
        [0.0, 3.09],
    ];
    merged([lathe(&profile.map(Vec2::from_array), 16), sphere(Vec3::Y * 3.28, 0.2, 20, 11)])
}
