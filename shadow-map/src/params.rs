//! Settings and the quality ladder.

use scene_core::technique::{Params, Preset, Setting, SettingKind};
use serde::{Deserialize, Serialize};

/// Which shadow map algorithm runs. Costs are per pixel, beside one drawing of the casters a view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// One comparison a pixel: V is 0 or 1. Exact up to the map's resolution for lights without extent; an
    /// extended light is taken for its centre. Cost: one texel. Williams 1978.
    #[default]
    Hard,
    /// Percentage-closer filtering: shadow edges without jags, blurred by as many texels everywhere. For lights of
    /// little extent. Cost: (`filter` + 1)² texels, or `taps`. Reeves, Salesin, Cook 1987.
    Pcf,
    /// As `pcf`, with the caster's object id beside its depth: no object shadows itself, so convex objects need
    /// no more questions. Loses all self-shadowing. Cost: as `pcf`, fewer reads a texel. Hourcade, Nicolas 1985.
    ObjectId,
    /// Percentage-closer soft shadows: penumbrae from the light's true size and shape, hard at the contact, wide far
    /// from it. The choice for area lights where one map must do. Cost: up to 2·`taps` texels where a shadow's edge
    /// may be, a handful elsewhere. Fernando 2005.
    Pcss,
    /// Moment shadow maps: blurred once, then one lookup a pixel however wide the blur. Leaks light where shadows lie
    /// over each other. Cost: four texels of 16 bytes. Peters and Klein 2015; with `moments` = 2, variance shadow
    /// maps, Donnelly and Lauritzen 2006.
    Moments,
    /// `hard` with a map for each of several ranges of depth, fitted to what is seen. For a sun over a large scene;
    /// lights at a place are shaded as by `hard`. Cost: one drawing a cascade. Lauritzen, Salvi, Lefohn 2010.
    Cascaded,
    /// `hard` maps from `views` points of the light, averaged: converges to V. For references and stills. Cost: `views`
    /// drawings, as many texels a pixel. Heckbert, Herf 1997.
    MultiView,
    /// The hard shadow at the very points that the camera sees: no resolution, equal to one shadow ray a pixel. Cost:
    /// one drawing over the pixels. Aila, Laine 2004; Johnson et al. 2005.
    AliasFree,
}

impl Variant {
    /// Every variant, in the order of the tables.
    pub const ALL: [Self; 8] = [
        Self::Hard,
        Self::Pcf,
        Self::ObjectId,
        Self::Pcss,
        Self::Moments,
        Self::Cascaded,
        Self::MultiView,
        Self::AliasFree,
    ];

    /// The names, in the same order.
    const NAMES: &'static [&'static str] =
        &["hard", "pcf", "object-id", "pcss", "moments", "cascaded", "multi-view", "alias-free"];

    /// The name in settings and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hard => "hard",
            Self::Pcf => "pcf",
            Self::ObjectId => "object-id",
            Self::Pcss => "pcss",
            Self::Moments => "moments",
            Self::Cascaded => "cascaded",
            Self::MultiView => "multi-view",
            Self::AliasFree => "alias-free",
        }
    }
}

/// Which texels around a receiver a filter asks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// All in a square, weighed by the area they share with it: smooth, cost grows with the square of the side.
    #[default]
    Grid,
    /// `taps` in a circle, turned by a random angle a pixel: cost is fixed, V is noisy.
    PoissonDisk,
}

/// Settings of [`ShadowMap`](crate::ShadowMap).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ShadowMapParams {
    /// The algorithm.
    pub variant: Variant,
    /// Texels a side of each map, 1 to 16,384. Error falls in proportion; memory is 8 bytes a texel and view.
    pub map_size: u32,
    /// Which texels `pcf` and `object-id` ask.
    pub kernel: Kernel,
    /// Width of the filter of `pcf`, `object-id` and `moments` in texels, 1 to 64. Blur grows in proportion.
    pub filter: u32,
    /// Texels asked a pixel where they are a choice, 1 to 1,024: noise falls, cost grows in proportion.
    pub taps: u32,
    /// Powers of the depth that `moments` keeps: 4, or 2 (3 is as 2), which leak more light.
    pub moments: u32,
    /// V up to which `moments` takes light for leaked, 0 to 0.99; above, V is stretched to reach 1. Darkens penumbrae.
    pub light_bleeding: f32,
    /// Ranges of depth that `cascaded` splits what is seen into, 1 to 8.
    pub cascades: u32,
    /// Points of an extended light that `multi-view` draws a map from, 1 to 65,536; error falls about as its inverse
    /// square root or faster, time grows in proportion.
    pub views: u32,
    /// What random numbers are drawn from.
    pub seed: u32,
    /// Leave out what cannot change the image: views without casters or receivers. Off only to measure.
    pub skip: bool,
    /// Draw into the maps only what can be looked up from the query's camera. The maps then hold for that camera
    /// alone, and for points that it can see; their fit does not change, nor does any pixel. Needs `skip`. Worth
    /// it where the maps are drawn anew for every frame of a scene much larger than the view.
    pub view_dependent: bool,
}

/// Texels beside its own that a hard lookup reads: [`LightMaps::meets_beside`](crate::light_maps::LightMaps::meets_beside)
/// asks the next ones, whose centres are up to one and a half away from the receiver, one more than its own's.
pub(crate) const HARD_REACH: f64 = 1.0;

impl ShadowMapParams {
    /// The settings that presets are told apart from.
    const DEFAULT: Self = Self {
        variant: Variant::Hard,
        map_size: 1024,
        kernel: Kernel::Grid,
        filter: 5,
        taps: 64,
        moments: 4,
        light_bleeding: 0.0,
        cascades: 4,
        views: 64,
        seed: 0,
        skip: true,
        view_dependent: false,
    };

    const PCF: Self = Self { variant: Variant::Pcf, ..Self::DEFAULT };
    const PCSS: Self = Self { variant: Variant::Pcss, ..Self::DEFAULT };
    const MOMENTS: Self = Self { variant: Variant::Moments, ..Self::DEFAULT };
    const OBJECT_ID: Self = Self { variant: Variant::ObjectId, ..Self::DEFAULT };

    /// Whether cube faces without casters may be left out: a filter looks from them into those beside.
    pub(crate) fn skips_faces(&self) -> bool {
        self.skip
            && !matches!(self.variant, Variant::Pcf | Variant::ObjectId | Variant::Pcss | Variant::Moments)
    }
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
            doc: "the algorithm: hard asks one texel, pcf and object-id average many, pcss as many as the penumbra is wide",
        },
        Setting {
            name: "map_size",
            kind: SettingKind::Int { min: 1, max: 16_384 },
            unit: "texels a side",
            doc: "resolution of each map",
        },
        Setting {
            name: "kernel",
            kind: SettingKind::Choice(&["grid", "poisson-disk"]),
            unit: "",
            doc: "texels asked by pcf and object-id: all of a square, or some of a circle at random",
        },
        Setting {
            name: "filter",
            kind: SettingKind::Int { min: 1, max: 64 },
            unit: "texels",
            doc: "width of the filter of pcf, object-id and moments",
        },
        Setting {
            name: "taps",
            kind: SettingKind::Int { min: 1, max: 1024 },
            unit: "texels a pixel",
            doc: "texels asked where they are chosen at random",
        },
        Setting {
            name: "moments",
            kind: SettingKind::Int { min: 2, max: 4 },
            unit: "",
            doc: "powers of the depth that moments keeps: 2 or 4, and 3 is as 2",
        },
        Setting {
            name: "light_bleeding",
            kind: SettingKind::Float { min: 0.0, max: 0.99 },
            unit: "V",
            doc: "V up to which moments takes light for leaked",
        },
        Setting {
            name: "cascades",
            kind: SettingKind::Int { min: 1, max: crate::cascades::MAX_CASCADES as u64 },
            unit: "maps",
            doc: "ranges of depth that cascaded splits what is seen into",
        },
        Setting {
            name: "views",
            kind: SettingKind::Int { min: 1, max: 65_536 },
            unit: "points of the light",
            doc: "how many maps multi-view averages",
        },
        Setting {
            name: "seed",
            kind: SettingKind::Int { min: 0, max: u32::MAX as u64 },
            unit: "",
            doc: "what random numbers are drawn from",
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
        Preset { name: "pcf-low", params: Self { map_size: 512, filter: 3, ..Self::PCF } },
        Preset { name: "pcf-medium", params: Self::PCF },
        Preset { name: "pcf-high", params: Self { map_size: 2048, filter: 9, ..Self::PCF } },
        Preset { name: "pcss-low", params: Self { map_size: 512, taps: 16, ..Self::PCSS } },
        Preset { name: "pcss-medium", params: Self::PCSS },
        Preset { name: "pcss-high", params: Self { map_size: 2048, taps: 256, ..Self::PCSS } },
        Preset { name: "moments-low", params: Self { map_size: 512, filter: 3, ..Self::MOMENTS } },
        Preset { name: "moments-medium", params: Self::MOMENTS },
        Preset { name: "moments-high", params: Self { map_size: 2048, filter: 9, ..Self::MOMENTS } },
        Preset { name: "object-id-low", params: Self { map_size: 512, filter: 3, ..Self::OBJECT_ID } },
        Preset { name: "object-id-medium", params: Self::OBJECT_ID },
        Preset { name: "object-id-high", params: Self { map_size: 2048, filter: 9, ..Self::OBJECT_ID } },
        Preset {
            name: "cascaded-low",
            params: Self { variant: Variant::Cascaded, cascades: 2, map_size: 512, ..Self::DEFAULT },
        },
        Preset { name: "cascaded", params: Self { variant: Variant::Cascaded, ..Self::DEFAULT } },
        Preset {
            name: "cascaded-high",
            params: Self { variant: Variant::Cascaded, map_size: 2048, ..Self::DEFAULT },
        },
        Preset {
            name: "multi-view-low",
            params: Self { variant: Variant::MultiView, views: 16, map_size: 512, ..Self::DEFAULT },
        },
        Preset { name: "multi-view", params: Self { variant: Variant::MultiView, ..Self::DEFAULT } },
        Preset {
            name: "multi-view-high",
            params: Self { variant: Variant::MultiView, views: 256, ..Self::DEFAULT },
        },
        Preset { name: "alias-free", params: Self { variant: Variant::AliasFree, ..Self::DEFAULT } },
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
