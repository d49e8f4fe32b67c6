//! The techniques of this build, and how the command line names them.

use scene_core::technique::{SettingKind, ShadowTechnique, TechniqueFactory};

use crate::error::CliError;
use crate::source::OnAnySource;

/// Every technique, in the order of the tables.
pub(crate) fn all() -> [&'static dyn TechniqueFactory; 7] {
    [
        &gnomon_shadow_map::Factory,
        &gnomon_psm::Factory,
        &gnomon_stencil_volumes::Factory,
        &gnomon_penumbra_wedges::Factory,
        &gnomon_pdsm::Factory,
        &gnomon_ddoc::Factory,
        &OnAnySource(&gnomon_contact_hardening::Factory),
    ]
}

/// The technique called `name`.
pub(crate) fn find(name: &str) -> Result<&'static dyn TechniqueFactory, CliError> {
    all().into_iter().find(|technique| technique.name() == name).ok_or_else(|| CliError::NoSuchTechnique {
        name: name.to_owned(),
        known: all().iter().map(|technique| technique.name()).collect(),
    })
}

/// Those called by `names`; all of them where none is named.
pub(crate) fn named(names: &[String]) -> Result<Vec<&'static dyn TechniqueFactory>, CliError> {
    if names.is_empty() {
        return Ok(all().to_vec());
    }
    names.iter().map(|name| find(name.trim())).collect()
}

/// What a technique with a preset and in a variant is called in tables.
pub(crate) fn label(technique: &str, preset: Option<&str>, variant: &str) -> String {
    let preset = preset.map_or_else(String::new, |preset| format!("@{preset}"));
    format!("{technique}{preset} {variant}")
}

/// `overrides` and, if the technique draws random numbers and they do not say so already, `seed`.
pub(crate) fn with_seed(
    technique: &dyn TechniqueFactory,
    overrides: &[(String, String)],
    seed: u64,
) -> Vec<(String, String)> {
    let mut overrides = overrides.to_vec();
    let takes_seed = technique.settings().iter().any(|setting| setting.name == "seed");
    if takes_seed && !overrides.iter().any(|(key, _)| key == "seed") {
        overrides.push(("seed".to_owned(), seed.to_string()));
    }
    overrides
}

/// The variant that a technique's settings name; a technique with a single one has no such setting.
pub(crate) fn variant_of(technique: &dyn ShadowTechnique) -> String {
    technique.settings().get("variant").and_then(|v| v.as_str()).unwrap_or("default").to_owned()
}

/// What `compare` runs: techniques in words of the command line, made.
///
/// No words mean every technique. A word is `name` or `name@preset`. Each is run in the variant that its settings
/// name, or, with `every_variant`, in all of them.
pub(crate) fn chosen(words: &[String], every_variant: bool, seed: u64) -> Result<Vec<Chosen>, CliError> {
    let all: Vec<String>;
    let words = if words.is_empty() {
        all = self::all().iter().map(|technique| technique.name().to_owned()).collect();
        &all
    } else {
        words
    };
    let mut chosen: Vec<Chosen> = Vec::new();
    for word in words.iter().map(|word| word.trim()).filter(|word| !word.is_empty()) {
        let (name, preset) = word.split_once('@').map_or((word, None), |(name, preset)| (name, Some(preset)));
        let factory = find(name)?;
        let make = |overrides: &[(String, String)]| {
            let technique = factory.create(preset, &with_seed(factory, overrides, seed))?;
            let label = format!("{word} {}", variant_of(technique.as_ref()));
            Ok::<_, CliError>(Chosen { label, technique })
        };
        if every_variant && !variants(factory).is_empty() {
            for variant in variants(factory) {
                chosen.push(make(&[("variant".to_owned(), (*variant).to_owned())])?);
            }
        } else {
            chosen.push(make(&[])?);
        }
    }
    // The same thing named twice is run once.
    let mut seen = std::collections::BTreeSet::new();
    chosen.retain(|c| seen.insert(c.label.clone()));
    if chosen.is_empty() { Err(CliError::NoTechniques) } else { Ok(chosen) }
}

/// A technique with settings, and a name for it that differs from the others'.
pub(crate) struct Chosen {
    /// Name, preset and variant.
    pub(crate) label: String,
    /// Ready to prepare.
    pub(crate) technique: Box<dyn ShadowTechnique>,
}

/// The variants of a technique; none if it has a single one.
pub(crate) fn variants(factory: &dyn TechniqueFactory) -> &'static [&'static str] {
    factory
        .settings()
        .iter()
        .find_map(|setting| match setting.kind {
            SettingKind::Choice(variants) if setting.name == "variant" => Some(variants),
            _ => None,
        })
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_technique_runs_once_and_in_every_variant_if_asked() {
        let labels = |words: &[&str], every_variant| -> Vec<String> {
            let words: Vec<String> = words.iter().map(|&word| word.to_owned()).collect();
            let chosen = chosen(&words, every_variant, 0).unwrap();
            chosen.into_iter().map(|chosen| chosen.label).collect()
        };
        assert_eq!(labels(&[], false).len(), all().len());
        let count = |factory: &&dyn TechniqueFactory| variants(*factory).len().max(1);
        assert_eq!(labels(&[], true).len(), all().iter().map(count).sum::<usize>());
        for factory in all() {
            let default = factory.create(None, &[]).unwrap();
            let label = format!("{} {}", factory.name(), variant_of(default.as_ref()));
            assert_eq!(labels(&[factory.name()], false), std::slice::from_ref(&label));
            assert!(labels(&[factory.name()], true).contains(&label));
        }
    }
}
