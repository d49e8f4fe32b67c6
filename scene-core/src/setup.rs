//! A scene with a camera and its lights: what a scene file describes and a picture needs.

use crate::{Camera, Light, Scene};

/// Everything a picture needs.
#[derive(Clone, Debug)]
pub struct SceneSetup {
    /// For headings and file names.
    pub name: String,
    /// The geometry.
    pub scene: Scene,
    /// Where it is seen from.
    pub camera: Camera,
    /// At least one light. Visibility is a property of one light: commands take the first unless told.
    pub lights: Vec<Light>,
    /// What was repaired or chosen while loading, one sentence each, for the user.
    pub notes: Vec<String>,
}
