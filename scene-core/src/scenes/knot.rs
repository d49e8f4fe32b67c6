//! A torus knot: a closed curved mesh that shadows itself, as finely tessellated as asked.

use std::f32::consts::TAU;

use glam::Vec3;

use super::shapes::{ground, loop_tube};
use super::spec::Values;
use super::stage::turned;
use super::{BuiltIn, Parameter, Stage, camera};
use crate::Light;

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "knot",
    summary: "a turning torus knot over a plane under a sphere light; its tessellation is a parameter",
    parameters: &[
        Parameter::whole("sides", 48, [3, 2048], "sides of the tube; it has 16 times as many rings"),
        Parameter::whole("p", 2, [1, 12], "turns about the axis"),
        Parameter::whole("q", 3, [1, 12], "turns about the core"),
        Parameter::real("light", 0.5, [0.01, 2.0], "radius of the light, in metres"),
    ],
    counts: None,
    build,
};

/// Seconds a turn.
const PERIOD: f32 = 12.0;

fn build(values: &Values<'_>, time: f32) -> Stage {
    let light = Light::Sphere { center: Vec3::new(-2.4, 4.8, 1.8), radius: values.real("light") };
    let mut stage =
        Stage::new(camera(Vec3::new(0.6, 3.0, 5.4), Vec3::new(0.15, 0.75, 0.0), 38.0, 0.1), light);
    stage.add("plane", ground(5.0));

    let (p, q) = (values.whole("p") as f32, values.whole("q") as f32);
    let curve = |s: f32| {
        let (a, b) = (TAU * p * s, TAU * q * s);
        let around = 0.8 + 0.36 * b.cos();
        Vec3::new(around * a.cos(), 0.52 * b.sin(), around * a.sin())
    };
    let sides = values.whole("sides");
    // Strands come closer as they get more.
    let radius = 0.17 * (6.0 / (p * q).max(6.0)).sqrt();
    let mut knot = loop_tube(curve, radius, 16 * sides, sides);
    // It stands on the plane: turning about the vertical leaves its lowest point where it is.
    let foot = knot.bounds().min.y;
    for position in &mut knot.positions {
        position.y -= foot;
    }
    stage.moving("knot", knot, turned(TAU * (time / PERIOD).rem_euclid(1.0), Vec3::ZERO));
    stage
}
