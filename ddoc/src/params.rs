//! Settings and the quality ladder.

use scene_core::technique::{Params, Preset, Setting, SettingKind};
use serde::{Deserialize, Serialize};

/// Where splats come from and what they do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// Object-space silhouettes, every layer: inner and outer penumbrae from the light's true size. The most accurate.
    #[default]
    Ddoc,
    /// Edges found in one shadow map, their directions fitted below the texel. Knows no geometry; one layer.
    ImageEdges,
    /// As published: one splat a texel, its direction from the texels around, as wide as on the far surface, the splat
    /// with the nearest centre is used. Shows the two artefacts that the paper reports.
    Paper,
    /// Outer penumbrae only, the splat nearest to the light is used: Chan and Durand 2003.
    Smoothies,
    /// Outer penumbrae only, the darkest splat is used: Wyman and Hansen 2003.
    PenumbraMap,
}

impl Variant {
    /// Every variant, in the order of the tables.
    pub const ALL: [Self; 5] =
        [Self::Ddoc, Self::ImageEdges, Self::Paper, Self::Smoothies, Self::PenumbraMap];

    const NAMES: &'static [&'static str] = &["ddoc", "image-edges", "paper", "smoothies", "penumbra-map"];

    /// The name in settings and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ddoc => "ddoc",
            Self::ImageEdges => "image-edges",
            Self::Paper => "paper",
            Self::Smoothies => "smoothies",
            Self::PenumbraMap => "penumbra-map",
        }
    }
}

/// Settings of [`Ddoc`](crate::Ddoc).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DdocParams {
    /// Where splats come from and what they do.
    pub variant: Variant,
    /// Texels a side of the map, 1 to 16,384. `ddoc` takes from it how many layers lie over a receiver, and the outlines
    /// of cut-out masks: it changes little else. All other variants are as sharp as the map.
    pub map_size: u32,
    /// Points of the light that V is counted at, 1 to 1,024. V has as many steps; cost grows in proportion where
    /// penumbrae are.
    pub taps: u32,
    /// What the points of the light are drawn from.
    pub seed: u32,
    /// Leave out what cannot change the image. Off only to measure.
    pub skip: bool,
}

impl DdocParams {
    const DEFAULT: Self = Self { variant: Variant::Ddoc, map_size: 1024, taps: 64, seed: 0, skip: true };
}

impl Default for DdocParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

const fn setting(name: &'static str, kind: SettingKind, unit: &'static str, doc: &'static str) -> Setting {
    Setting { name, kind, unit, doc }
}

impl Params for DdocParams {
    const TECHNIQUE: &'static str = "ddoc";

    const SETTINGS: &'static [Setting] = &[
        setting(
            "variant",
            SettingKind::Choice(Variant::NAMES),
            "",
            "where splats come from: silhouettes of objects, edges of the map, the paper's texels; or outer penumbrae only",
        ),
        setting(
            "map_size",
            SettingKind::Int { min: 1, max: 16_384 },
            "texels a side",
            "resolution of the map that layers are counted in",
        ),
        setting(
            "taps",
            SettingKind::Int { min: 1, max: 1024 },
            "points of the light",
            "points that V is counted at",
        ),
        setting(
            "seed",
            SettingKind::Int { min: 0, max: u32::MAX as u64 },
            "",
            "what the points are drawn from",
        ),
        setting("skip", SettingKind::Bool, "", "leave out what cannot change the image"),
    ];

    const PRESETS: &'static [Preset<Self>] = &[
        Preset { name: "low", params: Self { map_size: 512, taps: 16, ..Self::DEFAULT } },
        Preset { name: "medium", params: Self { taps: 32, ..Self::DEFAULT } },
        Preset { name: "high", params: Self::DEFAULT },
        Preset { name: "ultra", params: Self { map_size: 2048, taps: 256, ..Self::DEFAULT } },
        Preset { name: "image-edges", params: Self { variant: Variant::ImageEdges, ..Self::DEFAULT } },
        Preset { name: "paper", params: Self { variant: Variant::Paper, ..Self::DEFAULT } },
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_matches_the_struct() {
        assert_eq!(DdocParams::check_metadata(), Ok(()));
    }

    #[test]
    fn variants_have_the_names_that_are_listed() {
        assert!(Variant::ALL.map(Variant::name).iter().eq(Variant::NAMES));
        for variant in Variant::ALL {
            let set = [("variant".to_owned(), variant.name().to_owned())];
            assert_eq!(DdocParams::from_overrides(None, &set).unwrap().variant, variant);
        }
    }

    #[test]
    fn overrides_are_checked() {
        let set = |key: &str, value: &str| {
            DdocParams::from_overrides(Some("low"), &[(key.to_owned(), value.to_owned())])
        };
        assert_eq!(set("taps", "7").unwrap().taps, 7);
        for (key, value) in [("taps", "0"), ("taps", "1025"), ("map_size", "0"), ("variant", "none")] {
            assert!(set(key, value).is_err(), "{key}={value}");
        }
    }
}
