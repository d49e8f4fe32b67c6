//! Settings and the quality ladder.

use scene_core::technique::{Params, Preset, Setting, SettingKind};
use serde::{Deserialize, Serialize};

/// Which shadow map algorithm runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// One comparison a pixel: V is 0 or 1. Exact up to the map's resolution for lights without extent; an
    /// extended light is taken for its centre. Cost: one map, one texel a pixel. Williams 1978.
    #[default]
    Hard,
}

impl Variant {
    /// Every variant, in the order of the tables.
    pub const ALL: [Self; 1] = [Self::Hard];

    /// The names, in the same order.
    const NAMES: &'static [&'static str] = &["hard"];

    /// Whether it runs on a GPU, too.
    pub fn has_gpu_path(self) -> bool {
        matches!(self, Self::Hard)
    }

    /// The name in settings and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hard => "hard",
        }
    }
}

/// Settings of [`ShadowMap`](crate::ShadowMap).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ShadowMapParams {
    /// The algorithm.
    pub variant: Variant,
    /// Texels a side of each map, 1 to 16,384. Error falls in proportion; memory is 8 bytes a texel and view.
    pub map_size: u32,
    /// Leave out what cannot change the image: views without casters or receivers. Off only to measure.
    pub skip: bool,
    /// Draw into the maps only what can be looked up from the query's camera. The maps then hold for that camera
    /// alone, and for points that it can see; their fit does not change, nor does any pixel. Needs `skip`. Worth
    /// it where the maps are drawn anew for every frame of a scene much larger than the view.
    pub view_dependent: bool,
}

impl ShadowMapParams {
    /// The settings that presets are told apart from.
    const DEFAULT: Self = Self { variant: Variant::Hard, map_size: 1024, skip: true, view_dependent: false };
}

impl Default for ShadowMapParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl Params for ShadowMapParams {
    const TECHNIQUE: &'static str = "shadow-map";

    const SETTINGS: &'static [Setting] = &[
        Setting {
            name: "variant",
            kind: SettingKind::Choice(Variant::NAMES),
            unit: "",
            doc: "the algorithm: hard compares one texel a pixel",
        },
        Setting {
            name: "map_size",
            kind: SettingKind::Int { min: 1, max: 16_384 },
            unit: "texels a side",
            doc: "resolution of each map",
        },
        Setting {
            name: "skip",
            kind: SettingKind::Bool,
            unit: "",
            doc: "leave out what cannot change the image",
        },
        Setting {
            name: "view_dependent",
            kind: SettingKind::Bool,
            unit: "",
            doc: "draw only casters that the camera's view needs; the maps then hold for that camera alone",
        },
    ];

    // A ladder for each variant; rungs are named after it, those of `hard` after nothing.
    const PRESETS: &'static [Preset<Self>] = &[
        Preset { name: "low", params: Self { map_size: 512, ..Self::DEFAULT } },
        Preset { name: "medium", params: Self { map_size: 1024, ..Self::DEFAULT } },
        Preset { name: "high", params: Self { map_size: 2048, ..Self::DEFAULT } },
        Preset { name: "ultra", params: Self { map_size: 4096, ..Self::DEFAULT } },
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_matches_the_struct() {
        assert_eq!(ShadowMapParams::check_metadata(), Ok(()));
    }

    #[test]
    fn variants_have_the_names_that_are_listed() {
        assert!(Variant::ALL.map(Variant::name).iter().eq(Variant::NAMES));
        for variant in Variant::ALL {
            let set = [("variant".to_owned(), variant.name().to_owned())];
            assert_eq!(ShadowMapParams::from_overrides(None, &set).unwrap().variant, variant);
        }
    }

    #[test]
    fn overrides_reach_every_field_and_are_checked() {
        let set = |key: &str, value: &str| {
            ShadowMapParams::from_overrides(Some("low"), &[(key.to_owned(), value.to_owned())])
        };
        assert_eq!(set("map_size", "64").unwrap().map_size, 64);
        assert!(!set("skip", "false").unwrap().skip);
        assert!(set("view_dependent", "true").unwrap().view_dependent);
        for (key, value) in [("map_size", "0"), ("map_size", "big"), ("variant", "soft"), ("size", "1")] {
            assert!(set(key, value).is_err(), "{key}={value}");
        }
        assert!(ShadowMapParams::from_overrides(Some("none"), &[]).is_err());
    }
}
