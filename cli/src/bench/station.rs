//! Where contenders meet: a scene at a size under a light, alone or as a point of a cost curve.

use clap::ValueEnum;
use scene_core::Light;
use serde::{Deserialize, Serialize};

use crate::args::SceneArgs;
use crate::console::Console;
use crate::error::CliError;
use crate::scene_source::{self, View};

/// What a cost curve is drawn over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Axis {
    /// Triangles of `forest`, 1,000 to 10,000,000
    Triangles,
    /// Pixels a side of the image
    Image,
    /// Texels a side of a map
    Map,
    /// The light's size, times what the scene says
    Light,
}

impl Axis {
    /// Its label on a chart.
    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Image => "pixels a side of the image",
            Self::Map => "texels a side of the map",
            Self::Light => "size of the light, times the scene's",
        }
    }

    /// Where it is measured.
    fn values(self) -> &'static [f64] {
        match self {
            Self::Triangles => &[1e3, 1e4, 1e5, 1e6, 1e7],
            Self::Image => &[128.0, 256.0, 512.0, 1024.0, 2048.0],
            Self::Map => &[256.0, 512.0, 1024.0, 2048.0, 4096.0],
            Self::Light => &[0.125, 0.25, 0.5, 1.0, 2.0, 4.0],
        }
    }
}

/// A point of a cost curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Point {
    pub(crate) axis: Axis,
    pub(crate) value: f64,
}

/// One of them.
#[derive(Clone, Debug)]
pub(crate) struct Station {
    /// As on the command line.
    pub(crate) scene: String,
    pub(crate) size: (u32, u32),
    /// None: the scene as it is.
    pub(crate) point: Option<Point>,
}

/// The scenes as they are, then the cost curves: over triangles with `forest`, over the rest with the first scene.
pub(crate) fn all(scenes: &[String], size: (u32, u32), axes: &[Axis]) -> Vec<Station> {
    let plain =
        scenes.iter().map(|scene| Station { scene: scene.clone(), size, point: None }).collect::<Vec<_>>();
    let first = scenes.first().map_or("ball", String::as_str);
    let curves = axes.iter().flat_map(|&axis| {
        axis.values().iter().map(move |&value| {
            let side = value as u32;
            Station {
                scene: if axis == Axis::Triangles {
                    format!("forest:triangles={side}")
                } else {
                    first.to_owned()
                },
                size: if axis == Axis::Image { (side, side) } else { size },
                point: Some(Point { axis, value }),
            }
        })
    });
    let curves: Vec<Station> = curves.collect();
    plain.into_iter().chain(curves).collect()
}

impl Station {
    /// Loads it.
    pub(crate) fn view(&self, light: usize, seed: u64, console: &Console) -> Result<View, CliError> {
        let args = SceneArgs { scene: self.scene.clone(), size: Some(self.size), light, time: None, seed };
        let mut view = scene_source::view(&args, console)?;
        if let Some(Point { axis: Axis::Light, value }) = self.point {
            let light = &mut view.setup.lights[view.light_index];
            *light = scaled(*light, value as f32);
        }
        Ok(view)
    }

    /// The texels a side that maps get here; none: the settings' own.
    pub(crate) fn map_size(&self) -> Option<u32> {
        self.point.filter(|point| point.axis == Axis::Map).map(|point| point.value as u32)
    }

    /// A name for keys and messages.
    pub(crate) fn name(&self) -> String {
        let (width, height) = self.size;
        let point = self.point.map_or(String::new(), |Point { axis, value }| format!(" {axis:?}={value}"));
        format!("{} {width}x{height}{point}", self.scene)
    }
}

/// The light with its extent times `factor`, its middle where it was; a light without extent as it is.
fn scaled(light: Light, factor: f32) -> Light {
    /// Beyond a quarter turn the sun would reach below its own horizon.
    const WIDEST: f32 = std::f32::consts::FRAC_PI_2;
    match light {
        Light::Directional { direction, angular_radius } => {
            Light::Directional { direction, angular_radius: (angular_radius * factor).min(WIDEST) }
        }
        Light::Sphere { center, radius } => Light::Sphere { center, radius: radius * factor },
        Light::Disk { center, normal, radius } => Light::Disk { center, normal, radius: radius * factor },
        Light::Rect { center, half_u, half_v } => {
            Light::Rect { center, half_u: half_u * factor, half_v: half_v * factor }
        }
        light @ (Light::Point { .. } | Light::Spot { .. }) => light,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_follow_the_scenes() {
        let stations = all(&["ball".into(), "quads".into()], (64, 48), &[Axis::Image, Axis::Triangles]);
        assert_eq!(stations.len(), 2 + 5 + 5);
        assert!(stations[..2].iter().all(|s| s.point.is_none() && s.size == (64, 48)));
        assert_eq!(stations[2].size, (128, 128));
        assert_eq!(stations[7].scene, "forest:triangles=1000");
        let names: std::collections::BTreeSet<_> = stations.iter().map(Station::name).collect();
        assert_eq!(names.len(), stations.len());
    }

    #[test]
    fn forests_of_the_curve_can_be_built() {
        let forest = scene_core::scenes::all().iter().find(|scene| scene.name == "forest").unwrap();
        let triangles = forest.parameters.iter().find(|parameter| parameter.name == "triangles").unwrap();
        for &value in Axis::Triangles.values() {
            assert!((triangles.min..=triangles.max).contains(&value), "{value}");
        }
    }
}
