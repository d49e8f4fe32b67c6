//! What is held against each other: techniques in every variant and preset, and ray tracing itself.
//!
//! Ray tracing with a few samples is a row like any other: a technique that is slower than it at its own error has no
//! claim on that scene.

use std::rc::Rc;

use scene_core::technique::ShadowTechnique;

use crate::error::CliError;
use crate::techniques::{find, label, named, variant_of, variants, with_seed};

/// Samples a pixel of the rows of ray tracing; a light with extent takes two at least.
const RAYS: [u32; 5] = [1, 4, 16, 64, 256];

/// One of them.
#[derive(Clone)]
pub(crate) struct Contender {
    /// Name, preset and variant: differs from every other's.
    pub(crate) label: String,
    /// None for the defaults.
    pub(crate) preset: Option<&'static str>,
    /// Whether these are the technique's settings untouched: the rows of the cost sweeps.
    pub(crate) is_default: bool,
    pub(crate) kind: Kind,
}

/// What does the work.
#[derive(Clone)]
pub(crate) enum Kind {
    /// A technique with settings.
    Technique(Rc<dyn ShadowTechnique>),
    /// Ray tracing, with or without the proofs that leave rays out.
    Rays { samples: u32, skip: bool },
}

/// Every technique in `names` (none: all there are), in every preset and variant that go together, then ray tracing.
pub(crate) fn all(names: &[String], seed: u64) -> Result<Vec<Contender>, CliError> {
    let mut contenders: Vec<Contender> = Vec::new();
    for factory in named(names)? {
        // Two ways to the same settings are one contender.
        let mut seen = std::collections::BTreeSet::new();
        let default = factory.create(None, &with_seed(factory, &[], seed))?;
        let (default, default_variant) = (default.settings(), variant_of(default.as_ref()));
        for preset in std::iter::once(None).chain(factory.presets().into_iter().map(Some)) {
            let own = variant_of(factory.create(preset, &with_seed(factory, &[], seed))?.as_ref());
            // A preset that chooses a variant is for that one.
            let is_bound = preset.is_some() && own != default_variant;
            let choices: Vec<Option<&str>> = match variants(factory) {
                variants if !is_bound && !variants.is_empty() => variants.iter().copied().map(Some).collect(),
                _ => vec![None],
            };
            for variant in choices {
                let overrides: Vec<(String, String)> =
                    variant.map(|variant| ("variant".to_owned(), variant.to_owned())).into_iter().collect();
                let technique = factory.create(preset, &with_seed(factory, &overrides, seed))?;
                let settings = technique.settings();
                if !seen.insert(settings.to_string()) {
                    continue;
                }
                contenders.push(Contender {
                    label: label(factory.name(), preset, &variant_of(technique.as_ref())),
                    preset,
                    is_default: settings == default,
                    kind: Kind::Technique(Rc::from(technique)),
                });
            }
        }
    }
    contenders.extend(rays());
    Ok(contenders)
}

/// Ray tracing plain, then with skipping.
fn rays() -> impl Iterator<Item = Contender> {
    [false, true].into_iter().flat_map(|skip| {
        RAYS.into_iter().map(move |samples| Contender {
            label: format!("{} {}", super::front::RAYS, rays_variant(samples, skip)),
            preset: None,
            is_default: samples == 64,
            kind: Kind::Rays { samples, skip },
        })
    })
}

/// What a row of ray tracing is called behind its technique.
pub(crate) fn rays_variant(samples: u32, skip: bool) -> String {
    format!("{samples}{}", if skip { SKIPPING } else { "" })
}

/// The end of the name of rows that leave proved rays out.
pub(crate) const SKIPPING: &str = " skipping";

impl Contender {
    /// The contender with another `map_size`, if it has maps.
    pub(crate) fn with_map_size(&self, map_size: u32, seed: u64) -> Result<Option<Self>, CliError> {
        let Kind::Technique(technique) = &self.kind else { return Ok(None) };
        let factory = find(technique.name())?;
        if !factory.settings().iter().any(|setting| setting.name == "map_size") {
            return Ok(None);
        }
        let overrides = with_seed(factory, &[("map_size".to_owned(), map_size.to_string())], seed);
        let technique = factory.create(self.preset, &overrides)?;
        Ok(Some(Self { kind: Kind::Technique(Rc::from(technique)), ..self.clone() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_differ_and_each_technique_has_one_default() {
        let contenders = all(&[], 0).unwrap();
        let labels: std::collections::BTreeSet<_> = contenders.iter().map(|c| &c.label).collect();
        assert_eq!(labels.len(), contenders.len());
        for factory in crate::techniques::all() {
            let own = |c: &&Contender| matches!(&c.kind, Kind::Technique(t) if t.name() == factory.name());
            assert_eq!(contenders.iter().filter(own).filter(|c| c.is_default).count(), 1);
        }
        assert_eq!(contenders.iter().filter(|c| matches!(c.kind, Kind::Rays { .. })).count(), 2 * RAYS.len());
    }
}
