//! A ball over a slab under a small rectangle: the Ball scene of Cherry and Kooima's "Multi-pass Gaussian
//! Contact-hardening Soft Shadows" (table 1: 880 vertices, 1,752 triangles, 2 meshes). Its shadow softens as the ball rises.

use std::f32::consts::TAU;

use glam::Vec3;

use super::shapes::{cuboid, sphere};
use super::spec::Values;
use super::stage::turned;
use super::{BuiltIn, Counts, Parameter, Stage, camera};
use crate::Light;

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "ball",
    summary: "a ball that bounces over a slab: its penumbra grows with its height",
    parameters: &[
        Parameter::real("height", 0.6, [0.0, 3.0], "gap between ball and slab at time 0, in metres"),
        Parameter::real("light", 0.35, [0.01, 2.0], "half the side of the square light, in metres"),
    ],
    // 29 rings of 30 vertices and two poles, and a box.
    counts: Some(Counts { vertices: 880, triangles: 1752, meshes: 2 }),
    build,
};

const RADIUS: f32 = 0.5;
/// Seconds from one touch of the slab to the next.
const BOUNCE: f32 = 1.6;

fn build(values: &Values<'_>, time: f32) -> Stage {
    let half = values.real("light");
    // Aslant, so that the shadow is drawn out and its soft end lies apart from its hard one.
    let center = Vec3::new(-3.0, 4.0, 0.6);
    let u = Vec3::Z * half;
    let light = Light::Rect { center, half_u: u, half_v: u.cross(center.normalize()) };
    let mut stage =
        Stage::new(camera(Vec3::new(1.2, 3.6, 5.4), Vec3::new(0.62, 0.45, 0.0), 35.0, 0.1), light);
    stage.add("slab", cuboid(Vec3::new(-3.0, -0.1, -3.0), Vec3::new(3.0, 0.0, 3.0)));
    let gap = values.real("height") * (TAU * 0.5 * time / BOUNCE).cos().abs();
    stage.moving("ball", sphere(Vec3::ZERO, RADIUS, 30, 29), turned(0.0, Vec3::Y * (RADIUS + gap)));
    stage
}
