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
    const fn with_map_size(map_size: u32) -> Self {
        Self { variant: Variant::Hard, map_size, skip: true, view_dependent: false }
    }
}

impl Default for ShadowMapParams {
    fn default() -> Self {
        Self::with_map_size(1024)
    }
}

impl Params for ShadowMapParams {
    const TECHNIQUE: &'static str = "shadow-map";

    const SETTINGS: &'static [Setting] = &[
        Setting {
            name: "variant",
            kind: SettingKind::Choice(&["hard"]),
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

    const PRESETS: &'static [Preset<Self>] = &[
        Preset { name: "low", params: Self::with_map_size(512) },
        Preset { name: "medium", params: Self::with_map_size(1024) },
        Preset { name: "high", params: Self::with_map_size(2048) },
        Preset { name: "ultra", params: Self::with_map_size(4096) },
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
