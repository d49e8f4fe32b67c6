//! Scenes that show the artefacts which the paper leaves open.

use glam::{Affine3A, Vec3};
use scene_core::geometry::ObjectFlags;
use scene_core::{Camera, Light, Scene, TriangleMesh, scenes};

/// Over the middle of the ground.
pub(crate) const LIGHT: Light = Light::Rect {
    center: Vec3::new(0.0, 5.0, 0.0),
    half_u: Vec3::new(0.5, 0.0, 0.0),
    half_v: Vec3::new(0.0, 0.0, 0.5),
};

type Error = Box<dyn std::error::Error>;

fn square(center: Vec3, half: f32, turn: f32) -> TriangleMesh {
    let (sin, cos) = turn.sin_cos();
    let corner = |x: f32, z: f32| center + Vec3::new(x * cos - z * sin, 0.0, x * sin + z * cos) * half;
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    TriangleMesh::new("square", positions, vec![[0, 1, 2], [0, 2, 3]])
}

fn scene_of(meshes: &[TriangleMesh]) -> Result<Scene, Error> {
    let mut scene = Scene::new();
    for mesh in meshes {
        scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default())?;
    }
    Ok(scene)
}

/// Seen from above, in front of the light.
pub(crate) fn camera() -> Result<Camera, Error> {
    let mut camera = scenes::build("quads", 0.0)?.camera;
    (camera.width, camera.height) = (240, 180);
    Ok(camera)
}

/// Artefact 1: three squares over one another. The paper's nearest splat is the wrong one under the upper two.
pub(crate) fn layers() -> Result<Scene, Error> {
    scene_of(&[
        square(Vec3::ZERO, 4.0, 0.0),
        square(Vec3::new(0.1, 0.6, 0.0), 0.9, 0.1),
        square(Vec3::new(-0.3, 1.2, 0.2), 0.7, 0.5),
        square(Vec3::new(0.4, 1.8, -0.3), 0.5, 0.9),
    ])
}

/// Artefact 2: edges at slight angles to the texels. The paper's directions are multiples of 45° and a few between.
pub(crate) fn directions() -> Result<Scene, Error> {
    let squares = (0..5).map(|i| {
        let turn = 0.1 + 0.13 * i as f32;
        square(Vec3::new(i as f32 * 0.8 - 1.6, 1.0, 0.3 * i as f32 - 0.6), 0.33, turn)
    });
    scene_of(&std::iter::once(square(Vec3::ZERO, 4.0, 0.0)).chain(squares).collect::<Vec<_>>())
}
