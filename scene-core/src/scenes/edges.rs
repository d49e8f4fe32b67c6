//! Regular solids close under a light larger than they are: which edges are silhouettes differs from one
//! point of the light to the next.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use super::shapes::{cuboid, hull};
use super::spec::Values;
use super::stage::turned;
use super::{BuiltIn, Parameter, Stage, camera};
use crate::Light;

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "edges",
    summary: "turning regular solids close under a large light: silhouettes that change over the light",
    parameters: &[
        Parameter::real("light", 1.1, [0.05, 3.0], "half the side of the square light, in metres"),
        Parameter::real("distance", 2.6, [1.5, 20.0], "height of the light over the floor, in metres"),
    ],
    counts: None,
    build,
};

/// Seconds a turn.
const PERIOD: f32 = 16.0;
/// Distance of the corners from the middle of a solid, in metres.
const RADIUS: f32 = 0.5;

fn build(values: &Values<'_>, time: f32) -> Stage {
    let half = values.real("light");
    let light = Light::Rect {
        center: Vec3::new(-0.6, values.real("distance"), 0.2),
        half_u: Vec3::X * half,
        half_v: Vec3::Z * half,
    };
    let mut stage = Stage::new(camera(Vec3::new(0.0, 3.9, 4.9), Vec3::new(0.0, 0.12, 0.1), 36.0, 0.1), light);
    stage.add("floor", cuboid(Vec3::new(-3.0, -0.1, -3.0), Vec3::new(3.0, 0.0, 3.0)));
    let solids = [
        ("tetrahedron", tetrahedron(), [-1.15, -0.75]),
        ("cube", cube(), [0.0, -0.95]),
        ("octahedron", octahedron(), [1.2, -0.75]),
        ("dodecahedron", dodecahedron(), [-0.7, 0.6]),
        ("icosahedron", icosahedron(), [0.75, 0.65]),
    ];
    for (i, (name, corners, [x, z])) in solids.into_iter().enumerate() {
        let mut solid = hull(&corners.iter().map(|c| c.normalize() * RADIUS).collect::<Vec<_>>());
        // It lies on its first face: turn that face's normal down, then lift the solid onto the floor.
        let [a, b, c] = solid.triangles[0].map(|v| solid.positions[v as usize]);
        let down = Quat::from_rotation_arc((b - a).cross(c - a).normalize(), Vec3::NEG_Y);
        for position in &mut solid.positions {
            *position = down * *position;
        }
        let foot = solid.bounds().min.y;
        for position in &mut solid.positions {
            position.y -= foot;
        }
        let turn = TAU * ((time / PERIOD).rem_euclid(1.0) + 0.13 * i as f32);
        stage.moving(name, solid, turned(turn, Vec3::new(x, 0.0, z)));
    }
    stage
}

fn tetrahedron() -> Vec<Vec3> {
    [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(Vec3::from_array).to_vec()
}

fn cube() -> Vec<Vec3> {
    cuboid(Vec3::NEG_ONE, Vec3::ONE).positions
}

fn octahedron() -> Vec<Vec3> {
    [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]).collect()
}

/// The cyclic permutations of (0, ±a, ±b).
fn golden(a: f32, b: f32) -> impl Iterator<Item = Vec3> {
    [(a, b), (a, -b), (-a, b), (-a, -b)]
        .into_iter()
        .flat_map(|(a, b)| [Vec3::new(0.0, a, b), Vec3::new(b, 0.0, a), Vec3::new(a, b, 0.0)])
}

fn icosahedron() -> Vec<Vec3> {
    let phi = (1.0 + 5f32.sqrt()) * 0.5;
    golden(1.0, phi).collect()
}

fn dodecahedron() -> Vec<Vec3> {
    let phi = (1.0 + 5f32.sqrt()) * 0.5;
    cube().into_iter().chain(golden(1.0 / phi, phi)).collect()
}
