//! Settings with names, units, ranges and defaults, reachable as `key=value`.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use thiserror::Error;

/// The type and range of a setting.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SettingKind {
    /// `true` or `false`.
    Bool,
    /// A whole number in a closed range.
    Int {
        /// Smallest value.
        min: u64,
        /// Largest value.
        max: u64,
    },
    /// A number in a closed range.
    Float {
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// One of these words.
    Choice(&'static [&'static str]),
}

/// One field of a settings struct.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Setting {
    /// The field's name, the `key` of `key=value`.
    pub name: &'static str,
    /// Type and range.
    pub kind: SettingKind,
    /// What the number counts or measures: "texels", "pixels", "radians"; empty where there is no unit.
    pub unit: &'static str,
    /// What it does, one sentence.
    pub doc: &'static str,
}

/// A named rung of a technique's quality ladder.
#[derive(Clone, Copy, Debug)]
pub struct Preset<P: 'static> {
    /// The name on the command line.
    pub name: &'static str,
    /// The settings.
    pub params: P,
}

/// Why settings were refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SettingsError {
    /// There is no such setting.
    #[error("{technique} has no setting '{key}': it has {}", known.join(", "))]
    UnknownKey {
        /// The technique.
        technique: &'static str,
        /// What was asked for.
        key: String,
        /// What there is.
        known: Vec<&'static str>,
    },
    /// There is no such preset.
    #[error("{technique} has no preset '{preset}': it has {}", known.join(", "))]
    UnknownPreset {
        /// The technique.
        technique: &'static str,
        /// What was asked for.
        preset: String,
        /// What there is.
        known: Vec<&'static str>,
    },
    /// The value is not of the setting's type or outside its range.
    #[error("{technique}: {key}={value} is not {expected}")]
    BadValue {
        /// The technique.
        technique: &'static str,
        /// The setting.
        key: String,
        /// The value given.
        value: String,
        /// What it takes.
        expected: String,
    },
}

impl SettingKind {
    /// What values it takes, for people.
    pub fn expected(&self) -> String {
        match self {
            Self::Bool => "true or false".to_owned(),
            Self::Int { min, max } => format!("a whole number from {min} to {max}"),
            Self::Float { min, max } => format!("a number from {min} to {max}"),
            Self::Choice(words) => format!("one of {}", words.join(", ")),
        }
    }

    /// Reads a value from text; `None` if it is of another type or out of range.
    fn parse(&self, text: &str) -> Option<Value> {
        match *self {
            Self::Bool => text.parse::<bool>().ok().map(Value::from),
            Self::Int { min, max } => {
                text.parse::<u64>().ok().filter(|v| (min..=max).contains(v)).map(Value::from)
            }
            Self::Float { min, max } => {
                text.parse::<f64>().ok().filter(|v| (min..=max).contains(v)).map(Value::from)
            }
            Self::Choice(words) => words.contains(&text).then(|| Value::from(text)),
        }
    }
}

/// A technique's settings: a plain struct that serde can read and write, with a description of each field.
///
/// Serialised, the struct must be an object whose keys are the names in [`Params::SETTINGS`], no more and no
/// fewer (tested in each technique crate by [`Params::check_metadata`]).
pub trait Params: Serialize + DeserializeOwned + Default + Clone + Copy + Send + Sync + 'static {
    /// The technique's name.
    const TECHNIQUE: &'static str;
    /// Every field.
    const SETTINGS: &'static [Setting];
    /// The quality ladder, fastest first.
    const PRESETS: &'static [Preset<Self>];

    /// The settings as JSON.
    fn to_json(&self) -> Value {
        serde_json::to_value(self).unwrap_or(Value::Null)
    }

    /// The preset's settings (or the defaults) with `overrides` on top.
    ///
    /// # Errors
    /// Unknown preset or key, a value of another type or out of range.
    fn from_overrides(preset: Option<&str>, overrides: &[(String, String)]) -> Result<Self, SettingsError> {
        let technique = Self::TECHNIQUE;
        let base = match preset {
            None => Self::default(),
            Some(name) => {
                Self::PRESETS.iter().find(|p| p.name == name).map(|p| p.params).ok_or_else(|| {
                    SettingsError::UnknownPreset {
                        technique,
                        preset: name.to_owned(),
                        known: Self::PRESETS.iter().map(|p| p.name).collect(),
                    }
                })?
            }
        };
        let mut json = base.to_json();
        for (key, text) in overrides {
            let setting = Self::SETTINGS.iter().find(|s| s.name == key).ok_or_else(|| {
                let known = Self::SETTINGS.iter().map(|s| s.name).collect();
                SettingsError::UnknownKey { technique, key: key.clone(), known }
            })?;
            let bad = || SettingsError::BadValue {
                technique,
                key: key.clone(),
                value: text.clone(),
                expected: setting.kind.expected(),
            };
            json[setting.name] = setting.kind.parse(text).ok_or_else(bad)?;
        }
        serde_json::from_value(json).map_err(|error| SettingsError::BadValue {
            technique,
            key: "settings".to_owned(),
            value: String::new(),
            expected: error.to_string(),
        })
    }

    /// Checks that [`Params::SETTINGS`] describes exactly the struct's fields and that the defaults and every
    /// preset lie within the stated ranges.
    ///
    /// # Errors
    /// A sentence about the first difference.
    fn check_metadata() -> Result<(), String> {
        let named = std::iter::once(("the defaults", Self::default()))
            .chain(Self::PRESETS.iter().map(|p| (p.name, p.params)));
        for (name, params) in named {
            let json = params.to_json();
            let fields = json.as_object().ok_or("settings are not an object")?;
            if fields.len() != Self::SETTINGS.len() {
                return Err(format!("{} fields, {} described", fields.len(), Self::SETTINGS.len()));
            }
            for setting in Self::SETTINGS {
                let value = fields.get(setting.name).ok_or(format!("no field {}", setting.name))?;
                let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                if setting.kind.parse(&text).is_none() {
                    let expected = setting.kind.expected();
                    return Err(format!("{name}: {}={text} is not {expected}", setting.name));
                }
            }
        }
        Ok(())
    }
}
