//! The techniques of this build, and how the command line names them.

use scene_core::technique::{SettingKind, ShadowTechnique, TechniqueFactory};

use crate::error::CliError;

/// Every technique, in the order of the tables.
pub(crate) fn all() -> [&'static dyn TechniqueFactory; 1] {
    [&gnomon_shadow_map::Factory]
}

/// The technique called `name`.
pub(crate) fn find(name: &str) -> Result<&'static dyn TechniqueFactory, CliError> {
    all().into_iter().find(|technique| technique.name() == name).ok_or_else(|| CliError::NoSuchTechnique {
        name: name.to_owned(),
        known: all().iter().map(|technique| technique.name()).collect(),
    })
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
/// No words mean every technique in each of its variants, otherwise at its defaults. A word is `name` (every
/// variant) or `name@preset` (that preset).
pub(crate) fn chosen(words: &[String], seed: u64) -> Result<Vec<Chosen>, CliError> {
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
        let new = match variants(factory) {
            Some(variants) if preset.is_none() => variants
                .iter()
                .map(|variant| make(&[("variant".to_owned(), (*variant).to_owned())]))
                .collect::<Result<Vec<_>, _>>()?,
            _ => vec![make(&[])?],
        };
        chosen.extend(new);
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

fn variants(factory: &dyn TechniqueFactory) -> Option<&'static [&'static str]> {
    factory.settings().iter().find(|setting| setting.name == "variant").and_then(|setting| {
        match setting.kind {
            SettingKind::Choice(variants) => Some(variants),
            _ => None,
        }
    })
}
