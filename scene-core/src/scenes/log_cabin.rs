//! A log cabin with wooden poles beside it: the Log Cabin scene of Cherry and Kooima's "Multi-pass Gaussian
//! Contact-hardening Soft Shadows" (table 1: 1,407 vertices, 2,630 triangles, 13 meshes).
//!
//! Its 46 parts are closed, so the counts hold: 33 logs of 36 vertices, 3 poles of 33, 2 rails of 30, 8 boxes …

use glam::{Vec2, Vec3};

use super::shapes::{block, cuboid, hull, lathe, merged, rod};
use super::spec::Values;
use super::{BuiltIn, Counts, Parameter, Stage, camera};
use crate::{Light, TriangleMesh};

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "log-cabin",
    summary: "a log cabin and a hitching rail: logs that shadow each other, poles with long shadows",
    parameters: &[Parameter::real("light", 0.9, [0.01, 4.0], "radius of the light, in metres")],
    counts: Some(Counts { vertices: 1407, triangles: 2630, meshes: 13 }),
    build,
};

/// Half the lengths of the walls' axes, in metres.
const X: f32 = 2.2;
const Z: f32 = 1.7;
/// Radius of a log.
const R: f32 = 0.16;
const ROWS: u32 = 7;
/// How far logs reach beyond the corner.
const OVERHANG: f32 = 0.3;
const DOOR: f32 = 0.5;

fn build(values: &Values<'_>, _time: f32) -> Stage {
    let light = Light::Sphere { center: Vec3::new(-6.5, 8.5, 5.5), radius: values.real("light") };
    let mut stage = Stage::new(camera(Vec3::new(4.4, 4.6, 11.0), Vec3::new(0.3, 1.4, 0.6), 37.0, 0.1), light);
    stage.add("ground", cuboid(Vec3::new(-9.0, -0.2, -8.0), Vec3::new(9.0, 0.0, 7.0)));

    // Logs of crossing walls interlock half a log apart in height.
    let along_x = |row: u32, z: f32, from: f32, to: f32| {
        let y = R * (2 * row + 1) as f32;
        rod(Vec3::new(from, y, z), Vec3::new(to, y, z), R, 18)
    };
    let end = X + OVERHANG;
    stage.add("back wall", merged((0..ROWS).map(|row| along_x(row, -Z, -end, end))));
    let front = (0..ROWS).flat_map(|row| {
        let opening = row < ROWS - 2;
        let left = along_x(row, Z, -end, if opening { -DOOR } else { end });
        let right = opening.then(|| along_x(row, Z, DOOR, end));
        std::iter::once(left).chain(right)
    });
    stage.add("front wall", merged(front));
    for (name, x) in [("left wall", -X), ("right wall", X)] {
        let end = Z + OVERHANG;
        let log = |row: u32| {
            let y = R * (2 * row + 2) as f32;
            rod(Vec3::new(x, y, -end), Vec3::new(x, y, end), R, 18)
        };
        stage.add(name, merged((0..ROWS).map(log)));
    }

    // The side walls end half a log above the front and back ones; gables and roof stand on them.
    let eaves = R * (2 * ROWS + 1) as f32;
    let (ridge, reach) = (eaves + 1.25, Z + 0.55);
    let gable =
        |x: f32| {
            let (low, high) = (Vec3::new(x - 0.08, eaves - 0.05, 0.0), Vec3::new(x + 0.08, ridge, 0.0));
            let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
            hull_of(&[low.x, high.x].map(|x| {
                [corner(x, low.y, -Z - 0.1), corner(x, low.y, Z + 0.1), corner(x, high.y - 0.03, 0.0)]
            }))
        };
    stage.add("gables", merged([gable(-X), gable(X)]));
    // The slabs rest on the gables' slopes and meet at the ridge.
    let slope = (ridge - eaves) / (Z + 0.1);
    let slab = |side: f32| {
        let edge = |x: f32, z: f32, lift: f32| Vec3::new(x, ridge - slope * z.abs() + lift, z * side);
        let x = X + 0.5;
        hull_of(
            &[-x, x]
                .map(|x| [edge(x, 0.0, 0.0), edge(x, 0.0, 0.14), edge(x, reach, 0.0), edge(x, reach, 0.14)]),
        )
    };
    stage.add("roof", merged([slab(-1.0), slab(1.0)]));
    stage.add("door", cuboid(Vec3::new(-DOOR, 0.0, Z - 0.06), Vec3::new(DOOR, R * 10.0, Z + 0.02)));
    let stack = Vec3::new(-1.1, 0.0, -0.8);
    stage.add(
        "chimney",
        merged([
            block(stack + Vec3::Y * 3.0, Vec3::new(0.6, 2.2, 0.6)),
            block(stack + Vec3::Y * 4.16, Vec3::new(0.76, 0.12, 0.76)),
        ]),
    );

    let pole = |x: f32| {
        let profile = [Vec2::new(0.09, 0.0), Vec2::new(0.09, 1.25), Vec2::new(0.0, 1.4)];
        lathe(&profile, 16).transformed(glam::Affine3A::from_translation(Vec3::new(x, 0.0, 4.0)))
    };
    for (name, x) in [("left pole", -0.6), ("middle pole", 1.0), ("right pole", 2.6)] {
        stage.add(name, pole(x));
    }
    let rail = |y: f32| rod(Vec3::new(-0.8, y, 4.1), Vec3::new(2.8, y, 4.1), 0.05, 15);
    stage.add("rails", merged([0.55, 1.05].map(rail)));
    stage
}

fn hull_of<const N: usize>(ends: &[[Vec3; N]; 2]) -> TriangleMesh {
    hull(ends.as_flattened())
}
