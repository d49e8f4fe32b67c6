//! What a scene is built on: objects as they are added, the camera and the light.

use glam::{Affine3A, Vec3};

use super::SceneSpecError;
use crate::geometry::{ObjectFlags, SceneError};
use crate::{Camera, Light, Scene, SceneSetup, TriangleMesh};

/// A scene in the making. The first object that is refused is remembered, so that builders read as a list
/// of things.
pub(super) struct Stage {
    scene: Scene,
    camera: Camera,
    light: Light,
    fault: Option<SceneError>,
}

impl Stage {
    pub(super) fn new(camera: Camera, light: Light) -> Self {
        Self { scene: Scene::new(), camera, light, fault: None }
    }

    /// Adds a mesh that is in world space already.
    pub(super) fn add(&mut self, name: &str, mesh: TriangleMesh) {
        self.place(name, mesh, Affine3A::IDENTITY);
    }

    /// Adds a mesh under a transformation.
    pub(super) fn place(&mut self, name: &str, mut mesh: TriangleMesh, world_from_mesh: Affine3A) {
        mesh.name = name.to_owned();
        self.instance(&mesh, world_from_mesh, ObjectFlags::default());
    }

    /// Adds a thing that moves with time.
    pub(super) fn moving(&mut self, name: &str, mut mesh: TriangleMesh, world_from_mesh: Affine3A) {
        mesh.name = name.to_owned();
        self.instance(&mesh, world_from_mesh, ObjectFlags { dynamic: true, ..Default::default() });
    }

    /// Adds one of many instances of a mesh.
    pub(super) fn instance(&mut self, mesh: &TriangleMesh, world_from_mesh: Affine3A, flags: ObjectFlags) {
        if self.fault.is_none() {
            self.fault = self.scene.add(mesh, world_from_mesh, flags).err();
        }
    }

    pub(super) fn into_setup(self, name: &str) -> Result<SceneSetup, SceneSpecError> {
        match self.fault {
            Some(fault) => Err(fault.into()),
            None => Ok(SceneSetup {
                name: name.to_owned(),
                scene: self.scene,
                camera: self.camera,
                lights: vec![self.light],
                notes: Vec::new(),
            }),
        }
    }
}

/// Moves by `offset` after turning by `angle` radians about the y axis.
pub(super) fn turned(angle: f32, offset: Vec3) -> Affine3A {
    Affine3A::from_translation(offset) * Affine3A::from_rotation_y(angle)
}
