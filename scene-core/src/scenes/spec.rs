//! What a spec may set, and its reading.

use thiserror::Error;

use crate::geometry::SceneError;

/// A number that a spec can set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// The key.
    pub name: &'static str,
    /// What it does, with its unit.
    pub doc: &'static str,
    /// Its value unless set.
    pub default: f64,
    /// The smallest value allowed.
    pub min: f64,
    /// The largest value allowed.
    pub max: f64,
    /// Whether only whole numbers are allowed.
    pub whole: bool,
}

impl Parameter {
    /// A real number.
    pub(super) const fn real(
        name: &'static str,
        default: f64,
        [min, max]: [f64; 2],
        doc: &'static str,
    ) -> Self {
        Self { name, doc, default, min, max, whole: false }
    }

    /// A whole number.
    pub(super) const fn whole(
        name: &'static str,
        default: u32,
        [min, max]: [u32; 2],
        doc: &'static str,
    ) -> Self {
        Self { name, doc, default: default as f64, min: min as f64, max: max as f64, whole: true }
    }

    /// The seed that most scenes have.
    pub(super) const SEED: Self = Self::whole("seed", 1, [0, u32::MAX], "chooses another scene of the kind");
}

/// Why a spec names no scene.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SceneSpecError {
    /// No built-in scene has this name.
    #[error("there is no built-in scene '{name}'; there are: {known}")]
    UnknownScene {
        /// The name given.
        name: String,
        /// The names there are.
        known: String,
    },
    /// The scene has no such parameter.
    #[error("scene '{scene}' has no parameter '{key}'; {known}")]
    UnknownKey {
        /// The scene.
        scene: String,
        /// The key given.
        key: String,
        /// The keys there are, for people.
        known: String,
    },
    /// A setting is not of the form key=value.
    #[error("'{setting}' is not of the form key=value (a spec is name:key=value,key=value)")]
    NotASetting {
        /// What was given.
        setting: String,
    },
    /// A key is given twice.
    #[error("parameter '{key}' of scene '{scene}' is set twice")]
    SetTwice {
        /// The scene.
        scene: String,
        /// The key.
        key: String,
    },
    /// A value is not a number of the right kind, or out of range.
    #[error("parameter '{key}' of scene '{scene}' is '{value}': it must be a {kind} from {min} to {max}")]
    BadValue {
        /// The scene.
        scene: String,
        /// The key.
        key: String,
        /// The value given.
        value: String,
        /// "number" or "whole number".
        kind: &'static str,
        /// The smallest value allowed.
        min: f64,
        /// The largest value allowed.
        max: f64,
    },
    /// A time that is NaN or infinite.
    #[error("the time is {0}: it must be a finite number of seconds")]
    Time(f32),
    /// The geometry was refused.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

/// The values of a scene's parameters: defaults, overridden by a spec.
pub(super) struct Values<'a> {
    parameters: &'a [Parameter],
    values: Vec<f64>,
}

impl<'a> Values<'a> {
    pub(super) fn parse(
        scene: &str,
        parameters: &'a [Parameter],
        settings: &str,
    ) -> Result<Self, SceneSpecError> {
        let mut set: Vec<Option<f64>> = vec![None; parameters.len()];
        for setting in settings.split(',').map(str::trim).filter(|s| !s.is_empty()) {
            let Some((key, value)) = setting.split_once('=') else {
                return Err(SceneSpecError::NotASetting { setting: setting.to_owned() });
            };
            let (key, value) = (key.trim(), value.trim());
            let Some(index) = parameters.iter().position(|p| p.name == key) else {
                return Err(unknown_key(scene, key, parameters));
            };
            if set[index].is_some() {
                return Err(SceneSpecError::SetTwice { scene: scene.to_owned(), key: key.to_owned() });
            }
            set[index] = Some(parameters[index].read(scene, value)?);
        }
        let values = parameters.iter().zip(set).map(|(p, value)| value.unwrap_or(p.default)).collect();
        Ok(Self { parameters, values })
    }

    /// # Panics
    /// If the scene declares no such parameter, which every scene's own tests would show.
    fn get(&self, name: &str) -> f64 {
        let index = self.parameters.iter().position(|p| p.name == name);
        self.values[index.unwrap_or_else(|| panic!("the scene declares no parameter '{name}'"))]
    }

    pub(super) fn real(&self, name: &str) -> f32 {
        self.get(name) as f32
    }

    pub(super) fn whole(&self, name: &str) -> u32 {
        self.get(name) as u32
    }
}

impl Parameter {
    fn read(&self, scene: &str, value: &str) -> Result<f64, SceneSpecError> {
        let number = value
            .parse()
            .ok()
            .filter(|&x: &f64| (self.min..=self.max).contains(&x) && (!self.whole || x.fract() == 0.0));
        number.ok_or_else(|| SceneSpecError::BadValue {
            scene: scene.to_owned(),
            key: self.name.to_owned(),
            value: value.to_owned(),
            kind: if self.whole { "whole number" } else { "number" },
            min: self.min,
            max: self.max,
        })
    }
}

fn unknown_key(scene: &str, key: &str, parameters: &[Parameter]) -> SceneSpecError {
    let known = if parameters.is_empty() {
        "it has none".to_owned()
    } else {
        let names = parameters.iter().map(|p| format!("{} ({} to {})", p.name, p.min, p.max));
        format!("it has: {}", names.collect::<Vec<_>>().join(", "))
    };
    SceneSpecError::UnknownKey { scene: scene.to_owned(), key: key.to_owned(), known }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMETERS: &[Parameter] = &[
        Parameter::real("size", 1.5, [0.5, 4.0], "a size"),
        Parameter::whole("count", 3, [1, 9], "a count"),
    ];

    fn parse(settings: &str) -> Result<(f32, u32), String> {
        let values = Values::parse("s", PARAMETERS, settings).map_err(|e| e.to_string())?;
        Ok((values.real("size"), values.whole("count")))
    }

    #[test]
    fn defaults_and_settings() {
        assert_eq!(parse(""), Ok((1.5, 3)));
        assert_eq!(parse(" count = 9 , size=0.5,"), Ok((0.5, 9)));
    }

    #[test]
    fn faults_say_what_there_is() {
        for (settings, expected) in [
            ("speed=3", "scene 's' has no parameter 'speed'; it has: size (0.5 to 4), count (1 to 9)"),
            ("size", "'size' is not of the form key=value (a spec is name:key=value,key=value)"),
            ("size=1,size=1", "parameter 'size' of scene 's' is set twice"),
            ("size=5", "parameter 'size' of scene 's' is '5': it must be a number from 0.5 to 4"),
            ("size=NaN", "parameter 'size' of scene 's' is 'NaN': it must be a number from 0.5 to 4"),
            ("count=2.5", "parameter 'count' of scene 's' is '2.5': it must be a whole number from 1 to 9"),
        ] {
            assert_eq!(parse(settings).unwrap_err(), expected);
        }
    }
}
