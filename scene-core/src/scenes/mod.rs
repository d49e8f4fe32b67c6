//! Built-in procedural scenes: something to look at and to measure on a machine that has no files.
//!
//! A scene is named by a *spec*, `name` or `name:key=value,key=value`; its keys, ranges and defaults are in
//! [`all`]. Scenes are deterministic: the same spec and time give the same bytes on every machine and thread
//! count (up to the last bits of the platform's sine). Lengths are metres; `time` is in seconds and moves what
//! moves.

mod ball;
mod chess;
mod cornell;
mod cylinder;
mod edges;
mod fence;
mod forest;
mod knot;
mod layers;
mod log_cabin;
mod park;
mod plants;
mod pool;
mod quads;
mod random;
mod shapes;
mod spec;
mod stage;
mod street;

use glam::Vec3;

use crate::{Camera, SceneSetup};

use spec::Values;
pub use spec::{Parameter, SceneSpecError};
use stage::Stage;

/// Sizes that a scene keeps at its default parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// Vertices of all meshes.
    pub vertices: usize,
    /// Triangles of all meshes.
    pub triangles: usize,
    /// Meshes, which are objects of the scene.
    pub meshes: usize,
}

/// A scene that comes with the crate.
#[derive(Debug)]
pub struct BuiltIn {
    /// What a spec calls it.
    pub name: &'static str,
    /// One line about what it shows.
    pub summary: &'static str,
    /// What a spec can set.
    pub parameters: &'static [Parameter],
    /// Its sizes at the defaults, where they are promised.
    pub counts: Option<Counts>,
    build: fn(&Values<'_>, f32) -> Stage,
}

/// Every built-in scene, in the order of their introduction.
pub fn all() -> &'static [BuiltIn] {
    ALL
}

static ALL: &[BuiltIn] = &[
    cornell::SCENE,
    quads::SCENE,
    cylinder::SCENE,
    ball::SCENE,
    chess::SCENE,
    fence::SCENE,
    log_cabin::SCENE,
    pool::SCENE,
    street::SCENE,
    park::SCENE,
    forest::SCENE,
    knot::SCENE,
    layers::SCENE,
    edges::SCENE,
];

/// Builds the scene that `spec` names, as it is `time` seconds after its start.
///
/// # Errors
/// An unknown name or key, a value that is not a number or out of its range, a time that is not finite; each
/// says what there is.
pub fn build(spec: &str, time: f32) -> Result<SceneSetup, SceneSpecError> {
    if !time.is_finite() {
        return Err(SceneSpecError::Time(time));
    }
    let (name, settings) = spec.split_once(':').unwrap_or((spec, ""));
    let name = name.trim();
    let built_in = all().iter().find(|scene| scene.name == name).ok_or_else(|| {
        let known = all().iter().map(|scene| scene.name).collect::<Vec<_>>().join(", ");
        SceneSpecError::UnknownScene { name: name.to_owned(), known }
    })?;
    let values = Values::parse(name, built_in.parameters, settings)?;
    (built_in.build)(&values, time).into_setup(spec.trim())
}

/// A square picture of 512 pixels a side. The far plane is at infinity; `near` is a distance in metres.
fn camera(eye: Vec3, target: Vec3, fov_y_deg: f32, near: f32) -> Camera {
    let fov_y = fov_y_deg.to_radians();
    Camera { eye, target, up: Vec3::Y, fov_y, near, far: f32::INFINITY, width: 512, height: 512 }
}
