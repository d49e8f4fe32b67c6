//! Settings.

use scene_core::technique::{Params, Preset, Setting, SettingKind};
use serde::{Deserialize, Serialize};

/// How the part of the light that an edge hides is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// Between the front and the back plane of the one wedge that holds the pixel: no projection. Smooth, right for one
    /// straight edge, an estimate elsewhere. Akenine-Möller and Assarsson 2002; Szabó, 7.4.
    Interpolated,
    /// The area of the light behind each edge of the silhouette that the light's middle sees. Right where no shadows of
    /// several casters overlap and the silhouette does not change over the light. Assarsson and Akenine-Möller 2003;
    /// Szabó, 7.7.
    Coverage,
    /// How many faces lie before each of the light's samples, by all edges that are silhouettes for some point of the
    /// light. The same as shadow rays to the same samples. Laine et al. 2005.
    #[default]
    Exact,
}

/// Settings of [`PenumbraWedges`](crate::PenumbraWedges).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WedgeParams {
    /// How the part of the light that an edge hides is found.
    pub variant: Variant,
    /// Samples of the light, for `exact`; the others know no samples but where a caster touches the light.
    pub views: u32,
    /// What the samples are drawn from.
    pub seed: u64,
    /// Trace the samples of tiles in which more than [`crate::cpu::EDGES_A_RAY`] edges a sample would have to be
    /// looked at, which costs more; for `exact`. Off only to measure.
    pub rays: bool,
    /// Leave out what cannot change the image: casters outside the region that matters, wedges that no tile of pixels is
    /// in, and pixels outside of a wedge.
    pub skip: bool,
}

impl WedgeParams {
    const EXACT: Self = Self { variant: Variant::Exact, views: 256, seed: 0, rays: true, skip: true };
}

impl Default for WedgeParams {
    fn default() -> Self {
        Self::EXACT
    }
}

impl Params for WedgeParams {
    const TECHNIQUE: &'static str = "penumbra-wedges";

    const SETTINGS: &'static [Setting] = &[
        Setting {
            name: "variant",
            kind: SettingKind::Choice(&["interpolated", "coverage", "exact"]),
            unit: "",
            doc: "what an edge hides of the light: interpolated within its wedge, coverage by area, exact by samples",
        },
        Setting {
            name: "views",
            kind: SettingKind::Int { min: 1, max: 4096 },
            unit: "samples",
            doc: "samples of the light, for exact",
        },
        Setting {
            name: "seed",
            kind: SettingKind::Int { min: 0, max: u64::MAX },
            unit: "",
            doc: "what the samples are drawn from",
        },
        Setting {
            name: "rays",
            kind: SettingKind::Bool,
            unit: "",
            doc: "trace the samples of tiles that have too many edges to count, for exact",
        },
        Setting {
            name: "skip",
            kind: SettingKind::Bool,
            unit: "",
            doc: "leave out what cannot change the image",
        },
    ];

    const PRESETS: &'static [Preset<Self>] = &[
        Preset { name: "interpolated", params: Self { variant: Variant::Interpolated, ..Self::EXACT } },
        Preset { name: "coverage", params: Self { variant: Variant::Coverage, ..Self::EXACT } },
        Preset { name: "exact-64", params: Self { views: 64, ..Self::EXACT } },
        Preset { name: "exact-256", params: Self::EXACT },
        Preset { name: "exact-1024", params: Self { views: 1024, ..Self::EXACT } },
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_matches_the_struct() {
        assert_eq!(WedgeParams::check_metadata(), Ok(()));
    }

    #[test]
    fn overrides_reach_every_field_and_are_checked() {
        let set =
            |key: &str, value: &str| WedgeParams::from_overrides(None, &[(key.to_owned(), value.to_owned())]);
        assert_eq!(set("variant", "coverage").unwrap().variant, Variant::Coverage);
        assert_eq!(set("views", "64").unwrap().views, 64);
        assert_eq!(set("seed", "7").unwrap().seed, 7);
        assert!(!set("rays", "false").unwrap().rays);
        assert!(!set("skip", "false").unwrap().skip);
        for (key, value) in [("views", "0"), ("variant", "soft"), ("skip", "1"), ("map_size", "1")] {
            assert!(set(key, value).is_err(), "{key}={value}");
        }
    }
}
