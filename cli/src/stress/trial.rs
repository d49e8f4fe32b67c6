//! The trials: scenes that are hard on numbers.

use glam::{Affine3A, Vec3};
use scene_core::geometry::{ObjectFlags, SceneError};
use scene_core::{Light, Scene, SceneSetup, TriangleMesh, scenes};

use super::change;
use crate::error::CliError;
use crate::scene_source::{SceneSourceError, View};

/// A scene with what it tries.
pub(crate) struct Trial {
    /// What it is.
    pub(crate) name: String,
    /// The trial whose image it must show; none where the image is another.
    pub(crate) same_as: Option<String>,
    pub(crate) view: View,
}

/// The trial that takes seconds to make.
const TEN_MILLION: &str = "ten million triangles";

/// Size of the pictures.
const SIZE: (u32, u32) = (96, 72);

/// Those with one of `names` in theirs, all if there are none, and the trials that they are held against.
///
/// # Errors
/// [`CliError::NoSuchCells`] if no trial and none of [`refusals`] has such a name.
pub(crate) fn chosen(quick: bool, names: &[String]) -> Result<Vec<Trial>, CliError> {
    let mut trials = all(quick, names)?;
    let wanted: Vec<_> = trials.iter().filter(|trial| is_named(&trial.name, names)).collect();
    if wanted.is_empty() && refusals(names).is_empty() {
        return Err(CliError::NoSuchCells { names: names.to_vec() });
    }
    let bases: Vec<_> = wanted.iter().filter_map(|trial| trial.same_as.clone()).collect();
    trials.retain(|trial| is_named(&trial.name, names) || bases.contains(&trial.name));
    Ok(trials)
}

/// Whether a trial is asked for.
fn is_named(trial: &str, names: &[String]) -> bool {
    names.is_empty() || names.iter().any(|name| trial.contains(name.as_str()))
}

/// All of them, but the large one only if it is asked for; with `quick` those of one scene and no large one.
fn all(quick: bool, names: &[String]) -> Result<Vec<Trial>, CliError> {
    let bases: &[&str] = if quick { &["quads"] } else { &["quads", "ball", "chess", "street"] };
    let mut trials = Vec::new();
    for base in bases {
        let mut setup = scenes::build(base, 0.0).map_err(SceneSourceError::from)?;
        setup.camera = setup.camera.with_size(SIZE.0, SIZE.1);
        same_image(base, &setup, &mut trials)?;
        lights(base, &setup, &mut trials);
        cameras(base, &setup, &mut trials);
    }
    geometry(&mut trials)?;
    if !quick && is_named(TEN_MILLION, names) {
        let mut forest = scenes::build("forest:triangles=10000000", 0.0).map_err(SceneSourceError::from)?;
        forest.camera = forest.camera.with_size(SIZE.0, SIZE.1);
        push(&mut trials, TEN_MILLION.to_owned(), None, forest);
    }
    Ok(trials)
}

fn push(trials: &mut Vec<Trial>, name: String, same_as: Option<&str>, setup: SceneSetup) {
    trials.push(Trial { name, same_as: same_as.map(str::to_owned), view: View { setup, light_index: 0 } });
}

/// Changes a mesh in place.
type Edit = fn(&mut TriangleMesh);

/// The scene as it is, then changes that must not show.
fn same_image(base: &str, setup: &SceneSetup, trials: &mut Vec<Trial>) -> Result<(), CliError> {
    let broken = |error: SceneError| CliError::Trial(error.to_string());
    push(trials, base.to_owned(), None, setup.clone());
    for scale in [1e-3, 1e-1, 1e2, 1e4] {
        let changed = change::similarity(setup, scale, Vec3::ZERO).map_err(broken)?;
        push(trials, format!("{base} x {scale:e}"), Some(base), changed);
    }
    let size = setup.scene.bounds().diagonal();
    for far in [1e2, 1e3, 1e4] {
        let changed =
            change::similarity(setup, 1.0, Vec3::new(1.0, 0.5, -1.0) * far * size).map_err(broken)?;
        push(trials, format!("{base} {far:e} sizes away"), Some(base), changed);
    }
    let edits: [(&str, Edit); 6] = [
        ("triangles twice", change::duplicated),
        ("half wound the other way", change::inverted),
        ("triangles without area", change::degenerate),
        ("needle triangles", change::needles),
        ("coplanar overlaps", change::overlapping),
        ("three faces at an edge", change::finned),
    ];
    for (what, edit) in edits {
        let changed = change::rebuilt(setup, |_, mesh| edit(mesh)).map_err(broken)?;
        push(trials, format!("{base}, {what}"), Some(base), changed);
    }
    Ok(())
}

/// Lights at every place that divides by zero somewhere.
fn lights(base: &str, setup: &SceneSetup, trials: &mut Vec<Trial>) {
    let (camera, size) = (&setup.camera, setup.scene.bounds().diagonal());
    let forward = camera.forward();
    let right = forward.cross(camera.up).normalize_or(Vec3::X);
    let middle = setup.scene.bounds().center();
    let sun = |degrees: f32, angular_radius| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Light::Directional { direction: Vec3::new(sin, -cos, 0.0), angular_radius }
    };
    let ball = |center, radius| Light::Sphere { center, radius };
    let first = setup.scene.positions().first().copied().unwrap_or(Vec3::ZERO);
    let triangle = setup.scene.triangles().len() / 2;
    let on_face = setup.scene.corners(triangle).iter().sum::<Vec3>() / 3.0;
    for (what, light) in [
        ("sun at 89 degrees", sun(89.0, 0.005)),
        ("sun at 89.9 degrees", sun(89.9, 0.005)),
        ("sun at 90 degrees", sun(90.0, 0.0)),
        ("light in the camera's plane", Light::Point { position: camera.eye + right * size }),
        ("light at the camera", Light::Point { position: camera.eye }),
        ("light behind the camera", ball(camera.eye - forward * size, 0.05 * size)),
        ("light along the view", Light::Directional { direction: forward, angular_radius: 0.0 }),
        ("light against the view", Light::Directional { direction: -forward, angular_radius: 0.01 }),
        ("light on a vertex", Light::Point { position: first }),
        ("light on a face", ball(on_face, 0.02 * size)),
        ("light among the casters", ball(middle, 0.02 * size)),
        ("light of no size", ball(middle + Vec3::Y * size, 1e-9 * size)),
        ("huge light", ball(middle + Vec3::Y * 200.0 * size, 100.0 * size)),
    ] {
        push(trials, format!("{base}, {what}"), None, SceneSetup { lights: vec![light], ..setup.clone() });
    }
}

/// Cameras that cut geometry, and images of one row and of one column.
fn cameras(base: &str, setup: &SceneSetup, trials: &mut Vec<Trial>) {
    let mut near = setup.clone();
    near.camera.near = 0.9 * (near.camera.target - near.camera.eye).length();
    near.camera.far = near.camera.far.max(4.0 * near.camera.near);
    push(trials, format!("{base}, near plane through geometry"), None, near);
    for (width, height) in [(1, 256), (16_384, 1), (1, 1)] {
        let camera = setup.camera.with_size(width, height);
        push(
            trials,
            format!("{base}, {width}x{height} pixels"),
            None,
            SceneSetup { camera, ..setup.clone() },
        );
    }
}

/// Geometry that is broken or hardly there.
fn geometry(trials: &mut Vec<Trial>) -> Result<(), CliError> {
    let broken = |error: SceneError| CliError::Trial(error.to_string());
    let mut base = scenes::build("ball", 0.0).map_err(SceneSourceError::from)?;
    base.camera = base.camera.with_size(SIZE.0, SIZE.1);
    push(trials, "nothing".to_owned(), None, SceneSetup { scene: Scene::new(), ..base.clone() });
    let with = |name: &str, corners: Vec<Vec3>| {
        let triangles = (0..corners.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mut scene = Scene::new();
        scene.add(
            &TriangleMesh::new(name, corners, triangles),
            Affine3A::IDENTITY,
            ObjectFlags::default(),
        )?;
        Ok(SceneSetup { scene, ..base.clone() })
    };
    let one = vec![Vec3::new(-1.0, 0.0, -1.0), Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, -1.0)];
    push(trials, "one triangle".to_owned(), None, with("triangle", one).map_err(broken)?);
    push(trials, "random triangles".to_owned(), None, with("soup", soup(300)).map_err(broken)?);
    let open = change::rebuilt(&base, |_, mesh| {
        let mut number = 0;
        mesh.triangles.retain(|_| {
            number += 1;
            number % 10 != 0
        });
    });
    push(trials, "every tenth triangle missing".to_owned(), None, open.map_err(broken)?);
    Ok(())
}

/// Meshes that no scene may take: what they are, and what the scene says to them; `None` if it took them. Those with one of `names`
/// in theirs, all if there are none.
pub(crate) fn refusals(names: &[String]) -> Vec<(&'static str, Option<String>)> {
    let corners = |third: Vec3| vec![Vec3::ZERO, Vec3::X, third];
    let say = |mesh: &TriangleMesh| {
        Scene::new()
            .add(mesh, Affine3A::IDENTITY, ObjectFlags::default())
            .err()
            .map(|error| error.to_string())
    };
    let mesh = |third, triangle| TriangleMesh::new("broken", corners(third), vec![triangle]);
    let mut said = vec![
        ("a corner that is not a number", say(&mesh(Vec3::new(0.0, f32::NAN, 0.0), [0, 1, 2]))),
        ("a corner at infinity", say(&mesh(Vec3::new(0.0, f32::INFINITY, 0.0), [0, 1, 2]))),
        ("a corner that is not there", say(&mesh(Vec3::Y, [0, 1, 3]))),
    ];
    said.retain(|(what, _)| is_named(what, names));
    said
}

/// Corners of `count` triangles in the cube around the origin: they cut each other, and no edge is shared. Weyl's
/// sequence by the square roots of primes: even, and the same everywhere.
fn soup(count: usize) -> Vec<Vec3> {
    let at = |i: usize| {
        let part = |root: f64| (i as f64 * root).fract() as f32 * 2.0 - 1.0;
        Vec3::new(part(2f64.sqrt()), part(3f64.sqrt()), part(5f64.sqrt()))
    };
    (1..=3 * count).map(at).collect()
}
