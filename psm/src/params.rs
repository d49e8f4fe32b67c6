//! Settings and the quality ladder.

use scene_core::technique::{Params, Preset, Setting, SettingKind};
use serde::{Deserialize, Serialize};

/// How the texels of the map are spread over what is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// By the homography that promises the least error in this frame, over what casters may shadow; evenly unless that gains enough.
    #[default]
    Auto,
    /// Perspective shadow maps with the paper's virtual camera. Stamminger and Drettakis 2002.
    Psm,
    /// Light space perspective shadow maps with optimal n. Wimmer, Scherzer, Purgathofer 2004.
    Lispsm,
    /// Evenly, as the light sees; fitted to the same receivers as the others. What they are measured by.
    Uniform,
}

impl Variant {
    /// Every variant, in the order of the tables.
    pub const ALL: [Self; 4] = [Self::Auto, Self::Psm, Self::Lispsm, Self::Uniform];

    const NAMES: &'static [&'static str] = &["auto", "psm", "lispsm", "uniform"];

    /// The name in settings and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Psm => "psm",
            Self::Lispsm => "lispsm",
            Self::Uniform => "uniform",
        }
    }
}

/// What of the map a receiver is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lookup {
    /// The surfaces that the texels around it show, followed to its own ray: outlines of shadows are the mesh's.
    #[default]
    Surface,
    /// The texel that it falls into, as in the paper: outlines have the texels' steps.
    Texel,
}

/// What is written for a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Show {
    /// V.
    #[default]
    Visibility,
    /// 1/d, at most 1, in place of V where a map is looked up: 1 where a texel is no larger than a pixel, 0.1 where it
    /// is ten pixels wide.
    Texels,
}

/// Settings of [`Psm`](crate::Psm).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PsmParams {
    /// How texels are spread.
    pub variant: Variant,
    /// Texels a side of each map, 1 to 16,384. Error falls in proportion; memory is 4 bytes a texel and map.
    pub map_size: u32,
    /// What a receiver is compared with.
    pub lookup: Lookup,
    /// What is written for a pixel.
    pub show: Show,
    /// Leave out casters that lie beside a map. Off only to measure.
    pub skip: bool,
}

impl PsmParams {
    const DEFAULT: Self = Self {
        variant: Variant::Auto,
        map_size: 1024,
        lookup: Lookup::Surface,
        show: Show::Visibility,
        skip: true,
    };
}

impl Default for PsmParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl Params for PsmParams {
    const TECHNIQUE: &'static str = "psm";

    const SETTINGS: &'static [Setting] = &[
        Setting {
            name: "variant",
            kind: SettingKind::Choice(Variant::NAMES),
            unit: "",
            doc: "how texels are spread: in post-perspective space, by a perspective of the light's, evenly, or the best of these",
        },
        Setting {
            name: "map_size",
            kind: SettingKind::Int { min: 1, max: 16_384 },
            unit: "texels a side",
            doc: "resolution of each map",
        },
        Setting {
            name: "lookup",
            kind: SettingKind::Choice(&["surface", "texel"]),
            unit: "",
            doc: "compare a receiver with the surfaces that the texels around it show, followed to its own ray, or with one texel",
        },
        Setting {
            name: "show",
            kind: SettingKind::Choice(&["visibility", "texels"]),
            unit: "",
            doc: "write V, or 1 over the width of a texel in pixels: where the resolution goes",
        },
        Setting {
            name: "skip",
            kind: SettingKind::Bool,
            unit: "",
            doc: "leave out what cannot change the image",
        },
    ];

    const PRESETS: &'static [Preset<Self>] = &[
        Preset { name: "low", params: Self { map_size: 512, ..Self::DEFAULT } },
        Preset { name: "medium", params: Self::DEFAULT },
        Preset { name: "high", params: Self { map_size: 2048, ..Self::DEFAULT } },
        Preset { name: "ultra", params: Self { map_size: 4096, ..Self::DEFAULT } },
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_matches_the_struct() {
        assert_eq!(PsmParams::check_metadata(), Ok(()));
    }

    #[test]
    fn variants_have_the_names_that_are_listed() {
        assert!(Variant::ALL.map(Variant::name).iter().eq(Variant::NAMES));
        for variant in Variant::ALL {
            let set = [("variant".to_owned(), variant.name().to_owned())];
            assert_eq!(PsmParams::from_overrides(None, &set).unwrap().variant, variant);
        }
        for (key, value) in [("map_size", "0"), ("variant", "soft"), ("show", "all"), ("size", "1")] {
            assert!(PsmParams::from_overrides(None, &[(key.to_owned(), value.to_owned())]).is_err(), "{key}");
        }
    }
}
