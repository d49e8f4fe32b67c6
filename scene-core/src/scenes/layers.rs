//! A tower of slatted shelves under a rectangle: at the floor many layers of casters lie over one another.

use glam::Vec3;

use super::shapes::{block, cuboid, merged};
use super::spec::Values;
use super::{BuiltIn, Parameter, Stage, camera};
use crate::Light;

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "layers",
    summary: "a tower of slatted shelves: many layers of casters over one another",
    parameters: &[
        Parameter::whole("layers", 6, [1, 64], "shelves of the tower"),
        Parameter::whole("slats", 9, [2, 256], "slats of a shelf"),
        Parameter::real("light", 0.5, [0.01, 2.0], "half the side of the light, in metres"),
    ],
    counts: None,
    build,
};

/// Half the side of a shelf, in metres.
const HALF: f32 = 1.0;
const TOP: f32 = 2.4;

fn build(values: &Values<'_>, _time: f32) -> Stage {
    let half = values.real("light");
    let light =
        Light::Rect { center: Vec3::new(-0.9, 6.0, 0.5), half_u: Vec3::X * half, half_v: Vec3::Z * half };
    let mut stage = Stage::new(camera(Vec3::new(3.0, 3.6, 5.4), Vec3::new(0.3, 0.8, -0.1), 40.0, 0.1), light);
    stage.add("floor", cuboid(Vec3::new(-4.0, -0.1, -4.0), Vec3::new(4.0, 0.0, 4.0)));
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let posts = corners.map(|(x, z)| {
        let center = Vec3::new(x * HALF, TOP * 0.5, z * HALF);
        block(center, Vec3::new(0.07, TOP, 0.07))
    });
    stage.add("posts", merged(posts));

    let (layers, slats) = (values.whole("layers"), values.whole("slats"));
    // The lowest shelf is as far from the floor as the shelves are from each other.
    let gap = TOP / layers as f32;
    let width = HALF / slats as f32;
    let thickness = 0.03f32.min(gap * 0.3);
    for layer in 0..layers {
        // Two bearers from post to post carry the slats; every second shelf is turned.
        let top = gap * (layer + 1) as f32 - thickness;
        let turn = |v: Vec3| if layer % 2 == 0 { v } else { Vec3::new(v.z, v.y, v.x) };
        let bearer = |side: f32| {
            let size = Vec3::new(2.0 * HALF, thickness, 0.05);
            block(turn(Vec3::new(0.0, top - thickness * 0.5, side * HALF)), turn(size))
        };
        let slat = |i: u32| {
            let x = HALF * (2.0 * (i as f32 + 0.5) / slats as f32 - 1.0);
            let size = Vec3::new(width, thickness, 2.0 * HALF + 0.12);
            block(turn(Vec3::new(x, top + thickness * 0.5, 0.0)), turn(size))
        };
        let parts = [-1.0, 1.0].map(bearer).into_iter().chain((0..slats).map(slat));
        stage.add(&format!("shelf {}", layer + 1), merged(parts));
    }
    stage
}
