//! Scene files: meshes, a camera and lights in TOML or JSON.
//!
//! | field | meaning | if missing |
//! | --- | --- | --- |
//! | `name` | a heading | the file's name |
//! | `meshes` | paths relative to the file, or tables | an error |
//! | `meshes[i].file` | the path | an error |
//! | `.scale` | a factor, or three | 1 |
//! | `.rotate` | `[x, y, z]`: degrees about the fixed x axis, then y, then z; or a quaternion `[x, y, z, w]` | none |
//! | `.translate` | a vector; a mesh is scaled, then rotated, then translated | none |
//! | `.casts`, `.receives`, `.dynamic`, `.points` | [`ObjectFlags`] | true, true, false, false |
//! | `camera.eye`, `.target` | points | chosen by [`framing`]; the middle of the geometry |
//! | `camera.up` | a direction; decides which axis is up where things are chosen | +y |
//! | `camera.fov_y_deg` | vertical field of view in degrees | 40 |
//! | `camera.near`, `.far` | clip distances | a hundredth of the way to the target; infinite |
//! | `camera.width`, `.height` | pixels | 512 |
//! | `light` or `lights` | a table or several | chosen by [`framing`] |
//! | `planar_receivers` | names of objects whose flat faces show planar shadows, and no others do | found by their area |
//!
//! | `kind` | fields |
//! | --- | --- |
//! | `rect` | `center`, `half_u`, `half_v` |
//! | `disk` | `center`, `normal`, `radius` |
//! | `sphere` | `center`, `radius` |
//! | `directional` | `direction` (the way light travels), `angular_radius_deg` (0) |
//! | `point` | `position` |
//! | `spot` | `position`, `direction`, `outer_deg`, `inner_deg` (= outer) |
//!
//! Objects have the names that their mesh file gives them, a made-up ground is `ground`; a name that several have stands for all.
//! A key that is not listed is an error. Cameras and lights inside a mesh file are not used. With neither
//! camera nor light, the scene gets a ground too, like a bare mesh.

mod convert;
mod schema;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::Vec3;

use self::schema::SceneFile;
use super::parts::MeshFile;
use super::{LoadError, LoadOptions, Progress, UpAxis, file, framing};
use crate::geometry::ObjectFlags;
use crate::light::LightError;
use crate::{Scene, SceneSetup};

/// Reads a scene file and the meshes it names.
pub(super) fn load(path: &Path, options: &LoadOptions<'_>) -> Result<SceneSetup, LoadError> {
    let scene_file = parse(path, options)?;
    let element_fault =
        |element: String, message: String| LoadError::Element { path: path.to_owned(), element, message };
    if scene_file.meshes.is_empty() {
        return Err(element_fault("meshes".to_owned(), "there are none: a scene needs one".to_owned()));
    }
    if scene_file.light.is_some() && !scene_file.lights.is_empty() {
        let message = "there are 'light' and 'lights': give one of them".to_owned();
        return Err(element_fault("lights".to_owned(), message));
    }
    // Lights and places first: they cost nothing, and a fault in them should not wait for the meshes.
    let mut lights = Vec::new();
    for (index, entry) in scene_file.light.iter().chain(&scene_file.lights).enumerate() {
        let name = if scene_file.light.is_some() { "light".to_owned() } else { format!("lights[{index}]") };
        let light = convert::light(entry)
            .map_err(|(field, message)| element_fault(format!("{name}.{field}"), message))?;
        // The light's own messages say "light.radius"; here there may be several.
        let at_light = |fault: LightError| fault.to_string().replace("light.", &format!("{name}."));
        light
            .validate()
            .map_err(|fault| LoadError::File { path: path.to_owned(), message: at_light(fault) })?;
        lights.push(light);
    }
    let (scene, mut notes) = load_meshes(path, &scene_file, options)?;

    let camera_entry = scene_file.camera.unwrap_or_default();
    let up = camera_entry.up.map_or(options.up, |up| UpAxis::nearest_to(Vec3::from_array(up)));
    let unframed =
        |fault: framing::FramingError| LoadError::File { path: path.to_owned(), message: fault.to_string() };
    let camera = match scene_file.camera {
        None => None,
        Some(entry) => {
            let camera = convert::camera(&entry, &scene, up).map_err(unframed)?;
            camera
                .validate()
                .map_err(|fault| LoadError::File { path: path.to_owned(), message: fault.to_string() })?;
            if entry.eye.is_none() {
                notes.push("camera.eye was chosen by the size of the scene".to_owned());
            }
            Some(camera)
        }
    };
    let mut setup = SceneSetup {
        name: scene_file.name.unwrap_or_else(|| file::stem(path)),
        scene,
        camera: framing::UNFRAMED,
        lights,
        notes,
    };
    framing::complete(&mut setup, camera, up).map_err(unframed)?;
    // Last, so that a ground which was made up can be named.
    if let Some(names) = &scene_file.planar_receivers {
        mark_planar(&mut setup.scene, names).map_err(|(element, message)| element_fault(element, message))?;
    }
    Ok(setup)
}

/// Marks the named objects as flat receivers. A fault is an element of the file and a sentence.
fn mark_planar(scene: &mut Scene, names: &[String]) -> Result<(), (String, String)> {
    /// Names that a message lists.
    const LISTED: usize = 8;
    let element = |index: usize| format!("planar_receivers[{index}]");
    if names.is_empty() {
        let message = "there are none: name some, or leave the field out to have them found".to_owned();
        return Err(("planar_receivers".to_owned(), message));
    }
    for (index, name) in names.iter().enumerate() {
        if scene.mark_planar(name) == 0 {
            let mut known: Vec<_> =
                scene.objects().iter().map(|object| format!("'{}'", object.name)).collect();
            known.sort();
            known.dedup();
            let rest = known.len().saturating_sub(LISTED);
            known.truncate(LISTED);
            let rest = if rest > 0 { format!(" and {rest} more") } else { String::new() };
            let message = format!("there is no object '{name}': there are {}{rest}", known.join(", "));
            return Err((element(index), message));
        }
        if scene.objects().iter().all(|object| object.name != *name || !object.flags.receives) {
            return Err((element(index), format!("'{name}' does not receive shadows")));
        }
    }
    Ok(())
}

/// Reads every mesh file once and places its instances.
fn load_meshes(
    path: &Path,
    scene_file: &SceneFile,
    options: &LoadOptions<'_>,
) -> Result<(Scene, Vec<String>), LoadError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut placed = Vec::new();
    for (index, entry) in scene_file.meshes.iter().enumerate() {
        let table = &entry.0;
        let world_from_mesh = convert::world_from_mesh(table).map_err(|(field, message)| {
            let element = format!("meshes[{index}].{field}");
            LoadError::Element { path: path.to_owned(), element, message }
        })?;
        placed.push((folder.join(&table.file), world_from_mesh));
    }
    let mut files: HashMap<&PathBuf, MeshFile> = HashMap::new();
    let (mut scene, mut notes) = (Scene::new(), Vec::new());
    for (index, (mesh_path, world_from_mesh)) in placed.iter().enumerate() {
        let table = &scene_file.meshes[index].0;
        let within = |source| LoadError::Within {
            path: path.to_owned(),
            element: format!("meshes[{index}]"),
            source: Box::new(source),
        };
        if !files.contains_key(mesh_path) {
            if let Some(progress) = options.progress {
                progress(Progress { path: mesh_path, done: index, total: placed.len() });
            }
            let loaded = MeshFile::load(mesh_path, options).map_err(within)?;
            notes.extend(loaded.notes.iter().cloned());
            if loaded.camera.is_some() || !loaded.lights.is_empty() {
                notes.push(format!("{}: its cameras and lights are not used", file::name(mesh_path)));
            }
            files.insert(mesh_path, loaded);
        }
        let flags = ObjectFlags {
            casts: table.casts.unwrap_or(true),
            receives: table.receives.unwrap_or(true),
            dynamic: table.dynamic.unwrap_or(false),
            points: table.points.unwrap_or(false),
            planar: false,
        };
        files[mesh_path].add_to(&mut scene, *world_from_mesh, flags, mesh_path, options).map_err(within)?;
    }
    Ok((scene, notes))
}

fn parse(path: &Path, options: &LoadOptions<'_>) -> Result<SceneFile, LoadError> {
    let bytes = file::read(path, &options.limits)?;
    let syntax = |line, column, message| LoadError::Syntax { path: path.to_owned(), line, column, message };
    let text = std::str::from_utf8(&bytes).map_err(|error| {
        let (line, column) = place(&String::from_utf8_lossy(&bytes[..error.valid_up_to()]));
        syntax(line, column, "this is not UTF-8 text".to_owned())
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if file::extension(path) == "json" {
        let mut deserializer = serde_json::Deserializer::from_str(text);
        let scene = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
            let (field, error) = (error.path().to_string(), error.into_inner());
            syntax(error.line(), error.column(), json_message(&field, &error))
        })?;
        deserializer
            .end()
            .map_err(|error| syntax(error.line(), error.column(), json_message(".", &error)))?;
        return Ok(scene);
    }
    let toml_fault = |field: &str, error: &toml::de::Error| {
        let (line, column) = place(error.span().and_then(|span| text.get(..span.start)).unwrap_or_default());
        syntax(line, column, with_field(field, error.message()))
    };
    let deserializer = toml::Deserializer::parse(text).map_err(|error| toml_fault(".", &error))?;
    serde_path_to_error::deserialize(deserializer).map_err(|error| {
        let field = error.path().to_string();
        toml_fault(&field, error.inner())
    })
}

/// Line and column, from 1, of what follows `text`.
fn place(text: &str) -> (usize, usize) {
    let line_start = text.rfind('\n').map_or(0, |feed| feed + 1);
    (1 + text.matches('\n').count(), 1 + text[line_start..].chars().count())
}

/// A JSON error without its place, which is given apart, and with the field.
pub(super) fn json_message(field: &str, error: &serde_json::Error) -> String {
    let text = error.to_string();
    let message = text.split_once(" at line ").map_or(text.as_str(), |(message, _)| message);
    with_field(field, message)
}

/// `message` behind the field's name; "." stands for the whole file and "?" for what is unknown.
fn with_field(field: &str, message: &str) -> String {
    match field.trim_end_matches('?').trim_end_matches('.') {
        "" => message.to_owned(),
        field => format!("{field}: {message}"),
    }
}
