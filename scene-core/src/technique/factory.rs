//! Techniques from settings given as text: what the command line, tests and benchmarks ask of a technique crate.

use super::{Params, Setting, SettingsError, ShadowTechnique};

/// How the command line and tests make a technique from settings: one value per technique crate.
///
/// A crate implements [`TechniqueFromParams`] and has this for it.
pub trait TechniqueFactory: Send + Sync {
    /// The technique's name.
    fn name(&self) -> &'static str;
    /// One line: what it is.
    fn summary(&self) -> &'static str;
    /// Every setting with unit, range and default.
    fn settings(&self) -> &'static [Setting];
    /// Names of the quality ladder, fastest first.
    fn presets(&self) -> Vec<&'static str>;
    /// A technique from a preset (or the defaults) with `overrides` (`key`, value as text) applied on top.
    ///
    /// # Errors
    /// Unknown preset or key, a value of the wrong type or out of range.
    fn create(
        &self,
        preset: Option<&str>,
        overrides: &[(String, String)],
    ) -> Result<Box<dyn ShadowTechnique>, SettingsError>;
}

/// What a technique crate says of itself to get a [`TechniqueFactory`].
pub trait TechniqueFromParams: Send + Sync {
    /// Its settings; they carry its name, too.
    type Params: Params;
    /// One line: what it is.
    const SUMMARY: &'static str;

    /// The technique with these settings.
    fn make(params: Self::Params) -> Box<dyn ShadowTechnique>;
}

impl<T: TechniqueFromParams> TechniqueFactory for T {
    fn name(&self) -> &'static str {
        T::Params::TECHNIQUE
    }

    fn summary(&self) -> &'static str {
        T::SUMMARY
    }

    fn settings(&self) -> &'static [Setting] {
        T::Params::SETTINGS
    }

    fn presets(&self) -> Vec<&'static str> {
        T::Params::PRESETS.iter().map(|preset| preset.name).collect()
    }

    fn create(
        &self,
        preset: Option<&str>,
        overrides: &[(String, String)],
    ) -> Result<Box<dyn ShadowTechnique>, SettingsError> {
        T::Params::from_overrides(preset, overrides).map(T::make)
    }
}
