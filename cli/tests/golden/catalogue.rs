//! What there is to compare: every variant of every technique, on every backend that it has.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Pixels of a picture. Small, so that all of them together take seconds and stay in a few KiB each; large enough that
/// one pixel is less than the share that may differ.
pub(crate) const SIZE: (u32, u32) = (128, 96);

/// The kind of light in a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SceneLight {
    Rect,
    Sphere,
    Sun,
    Spot,
}

/// Scenes, in the order in which they are asked whether a variant takes their light.
const SCENES: [(&str, SceneLight); 4] = [
    ("ball", SceneLight::Rect),
    ("knot", SceneLight::Sphere),
    ("pool", SceneLight::Sun),
    ("chess", SceneLight::Spot),
];

impl SceneLight {
    /// The capability it asks for.
    fn capability(self) -> &'static str {
        match self {
            Self::Rect => "rect_light",
            Self::Sphere => "sphere_light",
            Self::Sun => "sun",
            Self::Spot => "spot_light",
        }
    }

    /// The kind in reports.
    pub(crate) fn kind(self) -> &'static str {
        match self {
            Self::Rect => "rect",
            Self::Sphere => "sphere",
            Self::Sun => "directional",
            Self::Spot => "spot",
        }
    }

    /// Whether it throws penumbrae.
    pub(crate) fn is_extended(self) -> bool {
        self != Self::Spot
    }
}

/// One picture to make and to compare.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) technique: String,
    pub(crate) variant: String,
    /// Whether the technique has a setting `variant`.
    pub(crate) has_setting: bool,
    pub(crate) backend: &'static str,
    pub(crate) scene: &'static str,
    pub(crate) light: SceneLight,
}

impl Case {
    /// The trial's name.
    pub(crate) fn name(&self) -> String {
        format!("{}::{}::{}::{}", self.technique, self.variant, self.scene, self.backend)
    }

    /// The golden picture's file, the same for every backend.
    pub(crate) fn picture(&self, folder: &Path) -> PathBuf {
        folder.join(&self.technique).join(format!("{}-{}.png", self.variant, self.scene))
    }
}

/// Every case there is.
///
/// # Panics
/// If the command does not say what there is, or a variant takes no scene's light.
pub(crate) fn cases() -> Vec<Case> {
    let list = gnomon(&["techniques", "--json"]).expect("the command lists techniques");
    let cases = cases_of(&list);
    assert!(!cases.is_empty(), "no technique was found");
    cases
}

/// The cases of a list of techniques as the command prints it.
pub(crate) fn cases_of(list: &Value) -> Vec<Case> {
    let text = |value: &Value| value.as_str().expect("a name").to_owned();
    let items = |value: &Value| value.as_array().expect("a list").clone();
    let mut cases = Vec::new();
    for technique in items(&list["techniques"]) {
        let name = text(&technique["name"]);
        let has_setting = items(&technique["settings"]).iter().any(|setting| setting["name"] == "variant");
        for variant in items(&technique["variants"]) {
            let takes = &variant["takes"];
            let scenes = scenes(takes);
            assert!(!scenes.is_empty(), "{name} {variant}: takes the light of no scene in the table");
            let on_gpu = (takes["gpu"]["support"] != "unsupported").then_some("gpu");
            for (scene, light) in scenes {
                for backend in std::iter::once("cpu").chain(on_gpu) {
                    let (technique, variant) = (name.clone(), text(&variant["name"]));
                    cases.push(Case { technique, variant, has_setting, backend, scene, light });
                }
            }
        }
    }
    cases
}

/// The scenes of a variant: one with an extended light, because most variants answer to its extent, and one without,
/// each where the variant takes it. Of the extended lights it is the first that is taken exactly, else the first that is
/// taken at all.
fn scenes(takes: &Value) -> Vec<(&'static str, SceneLight)> {
    let with = |is_extended: bool, supports: &[&str]| {
        SCENES.into_iter().find(|(_, light)| {
            let support = takes[light.capability()]["support"].as_str();
            light.is_extended() == is_extended && support.is_some_and(|support| supports.contains(&support))
        })
    };
    let extended = with(true, &["exact"]).or_else(|| with(true, &["approximate"]));
    extended.into_iter().chain(with(false, &["exact", "approximate"])).collect()
}

/// Pictures below `folder` that belong to no case.
pub(crate) fn left_over(cases: &[Case], folder: &Path) -> Vec<PathBuf> {
    let known: BTreeSet<PathBuf> = cases.iter().map(|case| case.picture(folder)).collect();
    let entries = |folder: &Path| -> Vec<PathBuf> {
        fs::read_dir(folder).map(|e| e.flatten().map(|e| e.path()).collect()).unwrap_or_default()
    };
    let (folders, mut files): (Vec<_>, Vec<_>) = entries(folder).into_iter().partition(|path| path.is_dir());
    files.extend(folders.iter().flat_map(|folder| entries(folder)));
    files.retain(|file| !known.contains(file));
    files.sort();
    files
}

/// Runs the command; what it prints as JSON.
pub(crate) fn gnomon(arguments: &[&str]) -> Result<Value, String> {
    let output = Command::new(env!("CARGO_BIN_EXE_gnomon"))
        .args(arguments)
        .output()
        .map_err(|error| format!("cannot run the command: {error}"))?;
    if !output.status.success() {
        return Err(format!("gnomon {}: {}", arguments.join(" "), String::from_utf8_lossy(&output.stderr)));
    }
    serde_json::from_slice(&output.stdout).map_err(|error| error.to_string())
}
