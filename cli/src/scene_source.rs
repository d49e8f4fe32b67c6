//! From the words of the command line to a scene: a scene file, a mesh or a built-in scene.

use std::path::Path;

use scene_core::io::LoadError;
use scene_core::scenes::{self, SceneSpecError};
use scene_core::{Light, SceneSetup, io};
use thiserror::Error;

use crate::args::SceneArgs;
use crate::console::Console;
use crate::error::CliError;

/// Why there is no scene.
#[derive(Debug, Error)]
pub(crate) enum SceneSourceError {
    /// A file could not be loaded. The message names it.
    #[error(transparent)]
    File(#[from] LoadError),
    /// A built-in scene could not be built.
    #[error(transparent)]
    BuiltIn(#[from] SceneSpecError),
    /// Neither a file nor a built-in scene.
    #[error("'{name}' is neither a file nor a built-in scene: built in are {}", built_ins.join(", "))]
    Unknown { name: String, built_ins: Vec<&'static str> },
    /// Nothing moves in a file.
    #[error("--time moves what moves in a built-in scene: '{file}' is a file")]
    TimeOfFile { file: String },
}

/// A scene with the camera and the light that a command looks at.
#[derive(Clone, Debug)]
pub(crate) struct View {
    pub(crate) setup: SceneSetup,
    pub(crate) light_index: usize,
}

impl View {
    /// The light whose visibility is asked for.
    pub(crate) fn light(&self) -> &Light {
        &self.setup.lights[self.light_index]
    }
}

/// Loads what `args` ask for, and tells the user what was repaired or chosen on the way.
pub(crate) fn view(args: &SceneArgs, console: &Console) -> Result<View, CliError> {
    let mut setup = {
        let _working = console.working(format!("loading {}", args.scene));
        load(&args.scene, args.time)?
    };
    for note in &setup.notes {
        console.note(&format!("note: {note}"));
    }
    if args.light >= setup.lights.len() {
        return Err(CliError::NoSuchLight {
            scene: setup.name,
            index: args.light,
            lights: setup.lights.len(),
        });
    }
    if let Some((width, height)) = args.size {
        setup.camera = setup.camera.with_size(width, height);
        setup.camera.validate()?;
    }
    Ok(View { setup, light_index: args.light })
}

/// The scenes that are named; every built-in one where none is.
pub(crate) fn or_built_in(names: &[String]) -> Vec<String> {
    if names.is_empty() {
        return scenes::all().iter().map(|scene| scene.name.to_owned()).collect();
    }
    names.to_vec()
}

fn load(scene: &str, time: Option<f32>) -> Result<SceneSetup, SceneSourceError> {
    if is_built_in(scene.split_once(':').map_or(scene, |(name, _)| name).trim()) {
        return Ok(scenes::build(scene, time.unwrap_or(0.0))?);
    }
    let path = Path::new(scene);
    if !path.exists() && path.extension().is_none() && path.components().count() < 2 {
        let built_ins = scenes::all().iter().map(|scene| scene.name).collect();
        return Err(SceneSourceError::Unknown { name: scene.to_owned(), built_ins });
    }
    if time.is_some() {
        return Err(SceneSourceError::TimeOfFile { file: scene.to_owned() });
    }
    Ok(io::load_setup(path)?)
}

fn is_built_in(name: &str) -> bool {
    scenes::all().iter().any(|scene| scene.name == name)
}
