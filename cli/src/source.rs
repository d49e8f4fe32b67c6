//! The setting `source` of contact-hardening: which technique's hard shadows are blurred. The crate takes any technique;
//! which ones have a name is the command's matter.

use std::sync::{Arc, LazyLock};

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, Factory};
use scene_core::technique::{Params, Setting, SettingKind, SettingsError, ShadowTechnique, TechniqueFactory};

/// Names of sources: first what suits the light, then the technique's own map.
const NAMES: [&str; 7] = ["auto", "own", "uniform", "alias-free", "cascaded", "psm", "volumes"];

/// What each but the first two is: a technique and its variant, `None` for its default.
const SOURCES: [(&dyn TechniqueFactory, Option<&str>); NAMES.len() - 2] = [
    (&gnomon_shadow_map::Factory, Some("hard")),
    (&gnomon_shadow_map::Factory, Some("alias-free")),
    (&gnomon_shadow_map::Factory, Some("cascaded")),
    (&gnomon_psm::Factory, None),
    (&gnomon_stencil_volumes::Factory, None),
];

static SETTINGS: LazyLock<Vec<Setting>> = LazyLock::new(|| {
    let source = Setting {
        name: "source",
        kind: SettingKind::Choice(&NAMES),
        unit: "",
        doc: "whose hard shadows are blurred: exact ones with physical scaling and else the own map's, always those, \
              or another technique's of the same map_size",
    };
    ContactHardeningParams::SETTINGS.iter().copied().chain([source]).collect()
});

/// Contact-hardening with the setting `source`.
pub(crate) struct OnAnySource(pub(crate) &'static Factory);

impl TechniqueFactory for OnAnySource {
    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn summary(&self) -> &'static str {
        self.0.summary()
    }

    fn settings(&self) -> &'static [Setting] {
        &SETTINGS
    }

    fn presets(&self) -> Vec<&'static str> {
        self.0.presets()
    }

    fn create(
        &self,
        preset: Option<&str>,
        overrides: &[(String, String)],
    ) -> Result<Box<dyn ShadowTechnique>, SettingsError> {
        let (sources, own): (Vec<_>, Vec<_>) =
            overrides.iter().cloned().partition(|(key, _)| key == "source");
        let params = ContactHardeningParams::from_overrides(preset, &own)?;
        let technique = ContactHardening::new(params);
        // The last word counts, as everywhere.
        let Some((key, name)) = sources.last() else { return Ok(Box::new(technique)) };
        let place = NAMES.iter().position(|known| known == name).ok_or_else(|| SettingsError::BadValue {
            technique: self.name(),
            key: key.clone(),
            value: name.clone(),
            expected: SettingKind::Choice(&NAMES).expected(),
        })?;
        let Some((factory, variant)) = place.checked_sub(2).and_then(|place| SOURCES.get(place)) else {
            return Ok(Box::new(if name == "own" { technique.on_own_map() } else { technique }));
        };
        let mut settings: Vec<_> =
            variant.iter().map(|variant| ("variant".to_owned(), (*variant).to_owned())).collect();
        if factory.settings().iter().any(|setting| setting.name == "map_size") {
            settings.push(("map_size".to_owned(), params.map_size.to_string()));
        }
        let source: Arc<dyn ShadowTechnique> = factory.create(None, &settings)?.into();
        Ok(Box::new(technique.on_top_of(name.clone(), source)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACTORY: OnAnySource = OnAnySource(&Factory);

    fn create(source: &str) -> Result<Box<dyn ShadowTechnique>, SettingsError> {
        FACTORY.create(Some("low"), &[("source".to_owned(), source.to_owned())])
    }

    #[test]
    fn every_source_is_made_and_told() {
        for name in NAMES {
            assert_eq!(create(name).unwrap().settings()["source"], name);
        }
        assert_eq!(FACTORY.create(None, &[]).unwrap().settings()["source"], "auto");
    }

    #[test]
    fn an_unknown_source_is_told_with_what_is_known() {
        let error = create("moon").err().unwrap().to_string();
        assert!(error.contains("moon") && error.contains("psm"), "{error}");
    }
}
