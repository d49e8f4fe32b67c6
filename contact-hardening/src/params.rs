//! Settings and the quality ladder.

use scene_core::technique::{Params, Preset, Setting, SettingKind};
use serde::{Deserialize, Serialize};

/// How the hard shadow is blurred. The names are those of section 3.2 of the paper.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// One pass, every point of the kernel weighs the same: with `physical` scaling, the light itself. The most
    /// accurate.
    #[default]
    Pcf,
    /// One pass with Gaussian weights. Rounder penumbrae, longer tails.
    Gaussian,
    /// Several Gaussian passes, as many as the blocker's distance asks for: smooth with few points.
    MultiPass,
}

impl Variant {
    /// Every variant, in the order of the tables.
    pub const ALL: [Self; 3] = [Self::Pcf, Self::Gaussian, Self::MultiPass];

    const NAMES: &'static [&'static str] = &["pcf", "gaussian", "multi-pass"];

    /// The name in settings and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pcf => "pcf",
            Self::Gaussian => "gaussian",
            Self::MultiPass => "multi-pass",
        }
    }
}

/// What the blur's width follows from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// The light's true size and shape, by the penumbra formula (section 6). Nothing to tune.
    #[default]
    Physical,
    /// D = distance^`distance_power` · `distance_multiplier` pixels (section 3), whatever the light.
    Paper,
}

/// Which blocker's distance counts where several overlap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Blocker {
    /// Each point of the light is asked at several distances between the nearest and the farthest blocker.
    #[default]
    Each,
    /// Their mean distance.
    Average,
    /// The one nearest to the receiver.
    Minimum,
}

/// How the Gaussian of `paper` scaling is sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GaussianKernel {
    /// By `taps` Poisson points, whatever its width.
    #[default]
    PoissonDisk,
    /// By every pixel of a row, then of a column.
    Separable,
}

/// What is written for a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Show {
    /// V.
    #[default]
    Visibility,
    /// The distance map of pass 2: D over the greatest in the image where a pixel is shadowed, 1 elsewhere.
    Distance,
    /// Penumbrae as dark gradients around grey umbrae, as in figures 4 and 5 of the paper: 2·V − 1 in the outer
    /// half, ½ − V in the inner one.
    Penumbra,
}

/// Settings of [`ContactHardening`](crate::ContactHardening).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ContactHardeningParams {
    /// The blur.
    pub variant: Variant,
    /// What its width follows from.
    pub scaling: Scaling,
    /// Texels a side of the map that blockers are found in, 1 to 16,384.
    pub map_size: u32,
    /// Points of the kernel, 1 to 64. Noise falls, cost grows in proportion.
    pub taps: u32,
    /// Most passes of `multi-pass`, 1 to 64.
    pub passes: u32,
    /// Which blocker counts, with `physical` scaling; `multi-pass` takes `each` for `average`.
    pub blocker: Blocker,
    /// Points that lie on another surface than the pixel's do not count. Off is the paper.
    pub geometry: bool,
    /// Where penumbrae are many pixels wide, neighbouring pixels are averaged, each of which drew its points at random:
    /// `pcf` and `gaussian` with `physical` scaling. Off is the paper.
    pub smooth: bool,
    /// Points that the image cannot answer (hidden, outside, or nearer to each other than pixels are) are looked up
    /// in the map, with `physical` scaling. Off is the paper. `multi-pass` never does.
    pub fill: bool,
    /// Casters that are closed surfaces are solid: what lies behind the side that the light's centre sees blocks, too, with
    /// `physical` scaling. Off is the paper.
    pub solids: bool,
    /// How the Gaussian of `paper` scaling is sampled.
    pub kernel: GaussianKernel,
    /// Widest kernel with `paper` scaling, pixels, 1 to 255.
    pub kernel_size: u32,
    /// `multi-pass` with `paper` scaling starts with 3 pixels and widens to `kernel_size`.
    pub widening: bool,
    /// Width of the Gaussian that dilates D with `paper` scaling (pass 3), pixels, 0 to 255; 0 leaves it out.
    pub dilate: u32,
    /// Power of the distance with `paper` scaling (`D_p`), 0 to 8.
    pub distance_power: f32,
    /// Factor of the distance with `paper` scaling (`D_m`), pixels, 0 to 1,000,000.
    pub distance_multiplier: f32,
    /// What is written for a pixel.
    pub show: Show,
    /// What random numbers are drawn from.
    pub seed: u32,
    /// Leave out what cannot change the image. Off only to measure.
    pub skip: bool,
}

impl ContactHardeningParams {
    const DEFAULT: Self = Self {
        variant: Variant::Pcf,
        scaling: Scaling::Physical,
        map_size: 2048,
        taps: 64,
        passes: 10,
        blocker: Blocker::Each,
        geometry: true,
        smooth: true,
        fill: true,
        solids: true,
        kernel: GaussianKernel::PoissonDisk,
        kernel_size: 19,
        widening: true,
        dilate: 0,
        distance_power: 1.0,
        distance_multiplier: 20.0,
        show: Show::Visibility,
        seed: 0,
        skip: true,
    };

    const GAUSSIAN: Self = Self { variant: Variant::Gaussian, ..Self::DEFAULT };
    const MULTI_PASS: Self = Self { variant: Variant::MultiPass, taps: 20, ..Self::DEFAULT };
    /// As published: nothing that the paper does not have.
    const PAPER: Self = Self {
        variant: Variant::MultiPass,
        scaling: Scaling::Paper,
        taps: 20,
        geometry: false,
        fill: false,
        solids: false,
        ..Self::DEFAULT
    };
}

impl ContactHardeningParams {
    /// The kernel's width in pixels in a pass of `multi-pass` with `paper` scaling.
    pub fn pass_size(&self, pass: u32) -> f32 {
        let (most, passes) = (self.kernel_size as f32, self.passes);
        let first = most.min(3.0);
        if self.widening && passes > 1 {
            first + (most - first) * pass as f32 / (passes - 1) as f32
        } else {
            most
        }
    }
}

impl Default for ContactHardeningParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

const fn setting(name: &'static str, kind: SettingKind, unit: &'static str, doc: &'static str) -> Setting {
    Setting { name, kind, unit, doc }
}

impl Params for ContactHardeningParams {
    const TECHNIQUE: &'static str = "contact-hardening";

    const SETTINGS: &'static [Setting] = &[
        setting(
            "variant",
            SettingKind::Choice(Variant::NAMES),
            "",
            "the blur: equal weights, Gaussian ones, or several Gaussian passes",
        ),
        setting(
            "scaling",
            SettingKind::Choice(&["physical", "paper"]),
            "",
            "the blur's width: by the light's true size, or by distance_power and distance_multiplier",
        ),
        setting(
            "map_size",
            SettingKind::Int { min: 1, max: 16_384 },
            "texels a side",
            "resolution of the map that blockers are found in",
        ),
        setting(
            "taps",
            SettingKind::Int { min: 1, max: 64 },
            "points a pixel and pass",
            "points of the kernel",
        ),
        setting("passes", SettingKind::Int { min: 1, max: 64 }, "", "most passes of multi-pass"),
        setting(
            "blocker",
            SettingKind::Choice(&["each", "average", "minimum"]),
            "",
            "which blocker counts where several overlap, with physical scaling",
        ),
        setting(
            "geometry",
            SettingKind::Bool,
            "",
            "points on another surface than the pixel's do not count; false is the paper",
        ),
        setting(
            "smooth",
            SettingKind::Bool,
            "",
            "average neighbouring pixels where penumbrae are wide, with physical scaling; false is the paper",
        ),
        setting(
            "fill",
            SettingKind::Bool,
            "",
            "look up in the map what the image cannot answer, with physical scaling; false is the paper",
        ),
        setting(
            "solids",
            SettingKind::Bool,
            "",
            "closed casters block behind the side that is seen, too, with physical scaling; false is the paper",
        ),
        setting(
            "kernel",
            SettingKind::Choice(&["poisson-disk", "separable"]),
            "",
            "the Gaussian of paper scaling: points of a disk, or every pixel of a row and then of a column",
        ),
        setting(
            "kernel_size",
            SettingKind::Int { min: 1, max: 255 },
            "pixels",
            "widest kernel with paper scaling",
        ),
        setting(
            "widening",
            SettingKind::Bool,
            "",
            "multi-pass with paper scaling widens its kernel from 3 pixels to kernel_size",
        ),
        setting(
            "dilate",
            SettingKind::Int { min: 0, max: 255 },
            "pixels",
            "width of the Gaussian that dilates D with paper scaling; 0 leaves it out",
        ),
        setting(
            "distance_power",
            SettingKind::Float { min: 0.0, max: 8.0 },
            "",
            "power of the blocker's distance with paper scaling",
        ),
        setting(
            "distance_multiplier",
            SettingKind::Float { min: 0.0, max: 1e6 },
            "pixels",
            "factor of the blocker's distance, in scene units, with paper scaling",
        ),
        setting(
            "show",
            SettingKind::Choice(&["visibility", "distance", "penumbra"]),
            "",
            "write V, the distance map of pass 2, or where penumbra and umbra are",
        ),
        setting(
            "seed",
            SettingKind::Int { min: 0, max: u32::MAX as u64 },
            "",
            "what random numbers are drawn from",
        ),
        setting("skip", SettingKind::Bool, "", "leave out what cannot change the image"),
    ];

    const PRESETS: &'static [Preset<Self>] = &[
        Preset { name: "low", params: Self { map_size: 1024, taps: 16, ..Self::DEFAULT } },
        Preset { name: "medium", params: Self { map_size: 1024, taps: 32, ..Self::DEFAULT } },
        Preset { name: "high", params: Self::DEFAULT },
        Preset { name: "gaussian-low", params: Self { map_size: 1024, taps: 16, ..Self::GAUSSIAN } },
        Preset { name: "gaussian-high", params: Self::GAUSSIAN },
        Preset { name: "multi-pass-low", params: Self { map_size: 1024, passes: 4, ..Self::MULTI_PASS } },
        Preset { name: "multi-pass-high", params: Self::MULTI_PASS },
        Preset { name: "paper", params: Self::PAPER },
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_matches_the_struct() {
        assert_eq!(ContactHardeningParams::check_metadata(), Ok(()));
    }

    #[test]
    fn variants_have_the_names_that_are_listed() {
        assert!(Variant::ALL.map(Variant::name).iter().eq(Variant::NAMES));
    }

    #[test]
    fn overrides_are_checked() {
        let set = |key: &str, value: &str| {
            ContactHardeningParams::from_overrides(Some("low"), &[(key.to_owned(), value.to_owned())])
        };
        assert_eq!(set("variant", "multi-pass").unwrap().variant, Variant::MultiPass);
        assert_eq!(set("scaling", "paper").unwrap().scaling, Scaling::Paper);
        for (key, value) in [("taps", "0"), ("taps", "65"), ("kernel_size", "256"), ("blocker", "none")] {
            assert!(set(key, value).is_err(), "{key}={value}");
        }
    }
}
