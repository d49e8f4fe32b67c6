//! Settings and the quality ladder.

use scene_core::technique::{Params, Preset, Setting, SettingKind};
use serde::{Deserialize, Serialize};

use crate::compression::{Compression, Segments};
use crate::error_bound::ErrorBound;

/// How numbers of the functions are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// 32 bits each.
    #[default]
    Full,
    /// 16 bits each: V to 1/65,535, and depth to 1/131,070 of the range of a window's nodes.
    Half,
}

/// What an error is measured by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ErrorMeasure {
    /// V itself.
    #[default]
    Visibility,
    /// What a display shows of it: less is allowed in the dark.
    Display,
}

/// Settings of [`Pdsm`](crate::Pdsm).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PdsmParams {
    /// Shadow maps, one from each of as many points of the light: V has that many levels, and noise falls with their
    /// number. Construction time is in proportion. A light without extent takes one.
    pub views: u32,
    /// Texels a side of each shadow map. Rounded up to a multiple of `pdsm_size`.
    pub map_size: u32,
    /// Pixels a side of the PDSM. What is between its pixels is interpolated. For a light without extent it has one for each texel of its
    /// only map.
    pub pdsm_size: u32,
    /// Parts of what the camera sees, by distance, that may have a window of their own beside the scene's: each takes all maps
    /// again, where they make texels at least half as long. 0 makes one PDSM for any camera, as presets do.
    pub cascades: u32,
    /// How far the compressed V may be from that of the maps; below 1/(2·`views`) compression saves little.
    pub max_error: f32,
    /// What `max_error` is measured by: V, or a picture's values, which show errors in the dark most
    /// ([`ErrorBound`](crate::error_bound::ErrorBound)).
    pub error_measure: ErrorMeasure,
    /// Which segments the functions consist of: `fewest` takes longer to build and gives shorter ones, as files should hold.
    pub segments: Segments,
    /// Interpolate between the four nearest pixels; off reads the nearest one, at a little more than half the cost.
    pub bilinear: bool,
    /// Pixels from which interpolation reaches a point, along each axis: 1 is bilinear, more soften shadows further, at a
    /// cost of 4·`filter_radius`² pixels.
    pub filter_radius: u32,
    /// Bits of the functions' numbers: `half` takes half the memory and adds 1/65,535 to the error of V, and that of
    /// reading earlier by 1/131,070 of the functions' depth range.
    pub precision: Precision,
    /// Keep V at the scene's surfaces alone: fewer nodes, no free points and no objects that move.
    pub only_surfaces: bool,
    /// Leave out what cannot change the image: rows of maps in which no caster is, and reading functions that start behind what
    /// asks. Off only to measure.
    pub skip: bool,
    /// The same seed gives the same samples of the light.
    pub seed: u64,
}

impl PdsmParams {
    const fn with(views: u32, size: u32, max_error: f32) -> Self {
        Self {
            views,
            map_size: size,
            pdsm_size: size,
            cascades: 0,
            max_error,
            error_measure: ErrorMeasure::Visibility,
            segments: Segments::Greedy,
            bilinear: true,
            filter_radius: 1,
            precision: Precision::Full,
            only_surfaces: false,
            skip: true,
            seed: 0,
        }
    }
}

impl PdsmParams {
    pub(crate) fn compression(&self) -> Compression {
        let of_display = self.error_measure == ErrorMeasure::Display;
        Compression { bound: ErrorBound { largest: self.max_error, of_display }, segments: self.segments }
    }
}

impl Default for PdsmParams {
    fn default() -> Self {
        Self { cascades: 3, ..Self::with(64, 512, 0.01) }
    }
}

impl Params for PdsmParams {
    const TECHNIQUE: &'static str = "pdsm";

    const SETTINGS: &'static [Setting] = &[
        Setting {
            name: "views",
            kind: SettingKind::Int { min: 1, max: 4096 },
            unit: "maps",
            doc: "shadow maps, one from each of as many points of the light",
        },
        Setting {
            name: "map_size",
            kind: SettingKind::Int { min: 1, max: 8192 },
            unit: "texels a side",
            doc: "resolution of each map, rounded up to a multiple of pdsm_size",
        },
        Setting {
            name: "pdsm_size",
            kind: SettingKind::Int { min: 1, max: 4096 },
            unit: "pixels a side",
            doc: "resolution of the PDSM",
        },
        Setting {
            name: "cascades",
            kind: SettingKind::Int { min: 0, max: 4 },
            unit: "windows",
            doc: "windows fitted to what the camera sees, where they are finer; 0 builds for any camera",
        },
        Setting {
            name: "max_error",
            kind: SettingKind::Float { min: 0.0, max: 0.5 },
            unit: "V",
            doc: "how far compression may move V",
        },
        Setting {
            name: "error_measure",
            kind: SettingKind::Choice(&["visibility", "display"]),
            unit: "",
            doc: "what max_error bounds: V, or what a display shows of it",
        },
        Setting {
            name: "segments",
            kind: SettingKind::Choice(&["greedy", "fewest"]),
            unit: "",
            doc: "greedy is built faster; fewest is smaller and looked up faster",
        },
        Setting {
            name: "bilinear",
            kind: SettingKind::Bool,
            unit: "",
            doc: "interpolate between the four nearest pixels",
        },
        Setting {
            name: "filter_radius",
            kind: SettingKind::Int { min: 1, max: 16 },
            unit: "pixels",
            doc: "how far interpolation reaches; 1 is bilinear, more is softer",
        },
        Setting {
            name: "precision",
            kind: SettingKind::Choice(&["full", "half"]),
            unit: "",
            doc: "32 or 16 bits for each number of the functions",
        },
        Setting {
            name: "only_surfaces",
            kind: SettingKind::Bool,
            unit: "",
            doc: "keep V at the scene's surfaces alone: no free points, nothing that moves",
        },
        Setting {
            name: "skip",
            kind: SettingKind::Bool,
            unit: "",
            doc: "leave out what cannot change the image",
        },
        Setting {
            name: "seed",
            kind: SettingKind::Int { min: 0, max: u64::MAX },
            unit: "",
            doc: "the same seed gives the same samples of the light",
        },
    ];

    const PRESETS: &'static [Preset<Self>] = &[
        Preset { name: "low", params: Self::with(16, 256, 0.04) },
        Preset { name: "medium", params: Self::with(64, 512, 0.01) },
        // From 1/`views` on lines pass the steps of single maps: a fifth less time to look up than at half of that, for a
        // fiftieth more error.
        Preset { name: "high", params: Self::with(144, 768, 0.01) },
        Preset { name: "ultra", params: Self::with(256, 1024, 0.005) },
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_matches_the_struct() {
        assert_eq!(PdsmParams::check_metadata(), Ok(()));
    }

    #[test]
    fn overrides_are_checked() {
        let set = |key: &str, value: &str| {
            PdsmParams::from_overrides(Some("low"), &[(key.to_owned(), value.to_owned())])
        };
        assert_eq!(set("views", "9").unwrap().views, 9);
        for (key, value) in [("views", "0"), ("max_error", "0.9"), ("max_error", "NaN"), ("map_size", "9000")]
        {
            assert!(set(key, value).is_err(), "{key}={value}");
        }
    }
}
