//! Settings.

use scene_core::technique::{Params, Preset, Setting, SettingKind};
use serde::{Deserialize, Serialize};

/// Which algorithm runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// Casters projected onto each planar receiver. Surfaces that are not flat stay without shadows; a shadow's
    /// outline is right to 1/256 pixel. Cost: one drawing of the casters a receiver. Blinn 1988; Szabó, 5.1.
    Planar,
    /// Shadow volumes, exact on every surface. Cost grows with the silhouettes seen from the light and the length of
    /// the shadows' outlines in the image. Crow 1977; Everitt and Kilgard 2002.
    #[default]
    Volumes,
}

/// From where `volumes` counts the faces before a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Count {
    /// From the eye, which is taken to be in no volume and to have no caster before its near plane. Wrong where one
    /// of both does not hold. Needs no caps.
    ZPass,
    /// From infinity. Always right; pays for the caps of all casters. On the GPU the same as [`Count::Auto`].
    ZFail,
    /// Each caster as it needs it: from the eye if no part of it lies in the pyramid of light and near rectangle,
    /// else from infinity. Always right. On the GPU all are counted from the eye, whose own count is taken first.
    #[default]
    Auto,
}

/// Settings of [`StencilVolumes`](crate::StencilVolumes).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VolumeParams {
    /// The algorithm.
    pub variant: Variant,
    /// From where faces are counted; of no meaning for `planar`.
    pub count: Count,
    /// Trace a shadow ray for each pixel of a tile where more than [`crate::volumes::DENSE`] sides would have to be
    /// counted, which costs more, and for all pixels if there are more silhouette edges than [`crate::volumes::most_edges`]; no
    /// pixel changes. Off only to measure.
    pub rays: bool,
    /// Leave out what cannot change the image: all that [`Skips`](crate::Skips) lists, or nothing of it; and receivers of
    /// `planar` that nobody sees.
    pub skip: bool,
}

impl Default for VolumeParams {
    fn default() -> Self {
        Self { variant: Variant::Volumes, count: Count::Auto, rays: true, skip: true }
    }
}

impl Params for VolumeParams {
    const TECHNIQUE: &'static str = "stencil-volumes";

    const SETTINGS: &'static [Setting] = &[
        Setting {
            name: "variant",
            kind: SettingKind::Choice(&["planar", "volumes"]),
            unit: "",
            doc: "the algorithm: planar projects casters onto flat receivers, volumes is exact everywhere",
        },
        Setting {
            name: "count",
            kind: SettingKind::Choice(&["z-pass", "z-fail", "auto"]),
            unit: "",
            doc: "from where volumes counts: z-pass is wrong with the eye in a volume, auto chooses per caster",
        },
        Setting {
            name: "rays",
            kind: SettingKind::Bool,
            unit: "",
            doc: "trace the pixels of tiles that have too many sides to count",
        },
        Setting {
            name: "skip",
            kind: SettingKind::Bool,
            unit: "",
            doc: "leave out what cannot change the image",
        },
    ];

    const PRESETS: &'static [Preset<Self>] = &[Preset {
        name: "exact",
        params: Self { variant: Variant::Volumes, count: Count::Auto, rays: true, skip: true },
    }];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_matches_the_struct() {
        assert_eq!(VolumeParams::check_metadata(), Ok(()));
    }

    #[test]
    fn overrides_reach_every_field_and_are_checked() {
        let set = |key: &str, value: &str| {
            VolumeParams::from_overrides(None, &[(key.to_owned(), value.to_owned())])
        };
        assert_eq!(set("variant", "planar").unwrap().variant, Variant::Planar);
        assert_eq!(set("count", "z-fail").unwrap().count, Count::ZFail);
        assert!(!set("skip", "false").unwrap().skip);
        assert!(!set("rays", "false").unwrap().rays);
        for (key, value) in [("count", "zpass"), ("variant", "soft"), ("skip", "1"), ("map_size", "1")] {
            assert!(set(key, value).is_err(), "{key}={value}");
        }
    }
}
