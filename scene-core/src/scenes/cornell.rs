//! The Cornell box: five walls, two blocks and a light in the ceiling, by the measured data of Cornell
//! University's Program of Computer Graphics, in metres.

use glam::Vec3;

use super::shapes::quad;
use super::spec::Values;
use super::{BuiltIn, Counts, Parameter, Stage, camera};
use crate::{Light, TriangleMesh};

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "cornell",
    summary: "the Cornell box: two blocks in a room under a rectangular light",
    parameters: &[Parameter::real("light", 1.0, [0.05, 3.5], "size of the light, relative to the original")],
    counts: Some(Counts { vertices: 36, triangles: 34, meshes: 7 }),
    build,
};

const WIDTH: f32 = 5.528;
const HEIGHT: f32 = 5.488;
const DEPTH: f32 = 5.592;

fn build(values: &Values<'_>, _time: f32) -> Stage {
    let size = values.real("light");
    let light = Light::Rect {
        // A millimetre below the ceiling, which would else cut it in two.
        center: Vec3::new(2.78, HEIGHT - 0.001, 2.795),
        half_u: Vec3::X * (0.65 * size),
        half_v: Vec3::Z * (0.525 * size),
    };
    let mut stage =
        Stage::new(camera(Vec3::new(2.78, 2.73, -8.0), Vec3::new(2.78, 2.73, 0.0), 39.3, 0.1), light);
    let middle = Vec3::new(WIDTH, HEIGHT, DEPTH) * 0.5;
    let (x, y, z) = (Vec3::X * middle.x, Vec3::Y * middle.y, Vec3::Z * middle.z);
    for (name, offset, u, v) in [
        ("floor", -y, z, x),
        ("ceiling", y, x, z),
        ("back wall", z, y, x),
        ("left wall", x, z, y),
        ("right wall", -x, y, z),
    ] {
        stage.add(name, quad(middle + offset, u, v));
    }
    // Corners of the blocks' tops in centimetres, counter-clockwise from above.
    let low = [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]];
    let high = [[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]];
    stage.add("short block", block(low, 1.65));
    stage.add("tall block", block(high, 3.30));
    stage
}

/// A block on the floor over four corners (x, z) in centimetres.
fn block(corners: [[f32; 2]; 4], height: f32) -> TriangleMesh {
    let positions =
        [0.0, height].iter().flat_map(|&y| corners.map(|[x, z]| Vec3::new(0.01 * x, y, 0.01 * z))).collect();
    let sides = (0..4).flat_map(|i| {
        let next = (i + 1) % 4;
        [[i, next, next + 4], [i, next + 4, i + 4]]
    });
    let ends = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]];
    TriangleMesh::new("", positions, sides.chain(ends).collect())
}
