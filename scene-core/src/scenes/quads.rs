//! Squares at several heights over a plane under a square light: every penumbra has a closed form.

use glam::Vec3;

use super::shapes::{ground, quad};
use super::spec::Values;
use super::{BuiltIn, Counts, Parameter, Stage, camera};
use crate::Light;

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "quads",
    summary: "squares at several heights over a plane under a square light",
    parameters: &[
        Parameter::whole("squares", 4, [1, 64], "squares, in rows of growing height"),
        Parameter::real("lowest", 0.05, [0.0, 2.0], "height of the lowest square, in metres"),
        Parameter::real("highest", 1.6, [0.0, 3.0], "height of the highest square, in metres"),
        Parameter::real("light", 0.5, [0.01, 3.0], "half the side of the light, in metres"),
    ],
    counts: Some(Counts { vertices: 20, triangles: 10, meshes: 5 }),
    build,
};

fn build(values: &Values<'_>, _time: f32) -> Stage {
    let squares = values.whole("squares");
    let half = values.real("light");
    let light = Light::Rect { center: Vec3::Y * 5.0, half_u: Vec3::X * half, half_v: Vec3::Z * half };
    let mut stage =
        Stage::new(camera(Vec3::new(-3.4, 5.6, 5.4), Vec3::new(-0.05, 0.5, 0.1), 36.0, 0.1), light);
    stage.add("plane", ground(4.0));
    // As square an arrangement as the number allows, within ±1.5 m.
    let columns = (f64::from(squares).sqrt().ceil() as u32).max(1);
    let rows = squares.div_ceil(columns);
    let spacing = 3.0 / columns as f32;
    let (low, high) = (values.real("lowest"), values.real("highest"));
    for i in 0..squares {
        let (column, row) = (i % columns, i / columns);
        let offset = |k: u32, n: u32| (k as f32 - (n as f32 - 1.0) * 0.5) * spacing;
        let share = if squares > 1 { i as f32 / (squares - 1) as f32 } else { 0.5 };
        let center = Vec3::new(offset(column, columns), low + (high - low) * share, offset(row, rows));
        let side = spacing * 0.3;
        stage.add(&format!("square {}", i + 1), quad(center, Vec3::Z * side, Vec3::X * side));
    }
    stage
}
