//! A cylinder on the floor beside a light nearly as large: a shadow that is hard at the foot and gone at the top.

use glam::Vec3;

use super::shapes::{cuboid, rod};
use super::spec::Values;
use super::{BuiltIn, Parameter, Stage, camera};
use crate::Light;

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "cylinder",
    summary: "a standing and a lying cylinder under a disk light: shadows hard at the foot, soft at the top",
    parameters: &[
        Parameter::whole("sides", 96, [3, 4096], "sides of a cylinder"),
        Parameter::real("height", 1.6, [0.1, 2.5], "height of the standing cylinder, in metres"),
        Parameter::real("light", 0.5, [0.01, 2.0], "radius of the light, in metres"),
    ],
    counts: None,
    build,
};

fn build(values: &Values<'_>, _time: f32) -> Stage {
    let center = Vec3::new(-2.6, 4.4, 1.6);
    let light = Light::Disk { center, normal: Vec3::Y * 0.5 - center, radius: values.real("light") };
    let mut stage =
        Stage::new(camera(Vec3::new(0.9, 3.4, 5.2), Vec3::new(0.6, 0.55, -0.1), 33.0, 0.1), light);
    stage.add("floor", cuboid(Vec3::new(-3.5, -0.1, -3.5), Vec3::new(3.5, 0.0, 3.5)));
    let sides = values.whole("sides");
    let foot = Vec3::new(-0.3, 0.0, -0.4);
    stage.add("standing cylinder", rod(foot, foot + Vec3::Y * values.real("height"), 0.28, sides));
    // It lies on one of its edges, whatever their number: the lowest vertex touches the floor.
    let radius = 0.22;
    let mut lying = rod(Vec3::new(0.1, 0.0, 1.0), Vec3::new(1.3, 0.0, 0.75), radius, sides);
    let drop = lying.bounds().min.y;
    for position in &mut lying.positions {
        position.y -= drop;
    }
    stage.add("lying cylinder", lying);
    stage
}
