#![doc = include_str!("../README.md")]

pub mod cpu;
pub mod distance_map;
pub mod footprint;
pub mod kernel;
pub mod multi_pass;
pub mod paper;
mod params;
pub mod physical;
pub mod shadow_pyramid;
pub mod smoothing;
mod technique;

use std::sync::Arc;

use gnomon_shadow_map::light_maps::LightMaps;
use gnomon_shadow_map::{ShadowMapParams, Variant as MapVariant};
use scene_core::technique::{PreparedShadow, ShadowQuery, ShadowTechnique, TechniqueError};
use scene_core::{Camera, GBuffer, Light, Report, VisibilityImage};

use kernel::Kernel;
use paper::Paper;
pub use params::{Blocker, ContactHardeningParams, Scaling, Variant};
use physical::Physical;
use shadow_pyramid::ShadowPyramid;
pub use technique::Factory;

/// The technique: settings and where hard shadows come from.
#[derive(Clone, Default)]
pub struct ContactHardening {
    params: ContactHardeningParams,
    source: Option<Arc<dyn ShadowTechnique>>,
}

/// A light, prepared; holds for any camera if the source does.
pub struct PreparedContactHardening<'a> {
    params: ContactHardeningParams,
    maps: LightMaps<'a>,
    kernel: Kernel,
    source: Option<Box<dyn PreparedShadow + 'a>>,
}

impl ContactHardening {
    /// A technique with these settings. Hard shadows come from its own map, as `shadow-map` draws them.
    pub fn new(params: ContactHardeningParams) -> Self {
        Self { params, source: None }
    }

    /// The same on top of any other technique's hard shadows; V below one half counts as shadowed. Blockers are still
    /// found in the own map, which no technique has to hold.
    #[must_use]
    pub fn on_top_of(self, source: Arc<dyn ShadowTechnique>) -> Self {
        Self { source: Some(source), ..self }
    }

    /// Pass 1: draws the map, and prepares the source.
    ///
    /// # Errors
    /// Those of the source.
    pub fn prepare<'a>(
        &self,
        query: &ShadowQuery<'a>,
    ) -> Result<(PreparedContactHardening<'a>, Report), TechniqueError> {
        let params = self.params;
        let mut report = Report::default();
        let settings = ShadowMapParams {
            variant: MapVariant::Pcf,
            map_size: params.map_size,
            skip: params.skip,
            ..Default::default()
        };
        let maps = LightMaps::draw(query.scene, query.light, &settings, &mut report, |_, _, _| None);
        let source = match &self.source {
            Some(source) => {
                let (prepared, rest) = source.prepare(query)?;
                let bytes = report.bytes;
                report.merge(&rest);
                report.bytes = bytes + rest.bytes;
                Some(prepared)
            }
            None => None,
        };
        let kernel = match params.scaling {
            Scaling::Physical => {
                let is_round = !matches!(query.light, Light::Rect { .. });
                Kernel::of_light(params.variant, is_round, params.taps, params.seed)
            }
            Scaling::Paper => Kernel::gaussian(params.taps, params.seed),
        };
        Ok((PreparedContactHardening { params, maps, kernel, source }, report))
    }
}

impl PreparedContactHardening<'_> {
    /// Whether the preparation holds for any camera.
    pub fn survives_camera(&self) -> bool {
        self.source.as_ref().is_none_or(|source| source.survives_camera())
    }

    /// Passes 2 to 5: fills `visibility` for a G-buffer that `camera` sees; V where a surface is, NaN elsewhere.
    /// Only eye, axes and field of view of `camera` matter, the size is the G-buffer's.
    ///
    /// # Errors
    /// If the images differ in size; those of the source.
    pub fn shade(
        &self,
        camera: &Camera,
        gbuffer: &GBuffer,
        visibility: &mut VisibilityImage,
    ) -> Result<Report, TechniqueError> {
        let pixels = gbuffer.pixel_count();
        TechniqueError::check_output(pixels, visibility.values.len())?;
        let mut report = Report::default();
        if pixels == 0 {
            return Ok(report);
        }
        let hard = match &self.source {
            Some(source) => {
                let mut hard = VisibilityImage::new(gbuffer.width, gbuffer.height);
                report.merge(&source.shade(gbuffer, &mut hard)?);
                Some(hard)
            }
            None => None,
        };
        let mut map = report.time("shade.distance", |_| {
            distance_map::distance_map(&self.maps, gbuffer, hard.as_ref(), visibility)
        });
        match self.params.scaling {
            Scaling::Physical => {
                let pyramid = report.time("shade.pyramid", |_| ShadowPyramid::new(&map));
                let physical = Physical {
                    params: &self.params,
                    maps: &self.maps,
                    gbuffer,
                    distance: &map,
                    pyramid: &pyramid,
                    kernel: &self.kernel,
                    clip_from_world: camera.with_size(gbuffer.width, gbuffer.height).projection_from_world(),
                };
                report.time("shade.filter", |report| cpu::filter(&physical, visibility, report));
            }
            Scaling::Paper => report.time("shade.filter", |report| {
                let paper = Paper { params: &self.params, gbuffer, kernel: &self.kernel };
                paper.scale(&self.maps.light, &mut map);
                cpu::filter_as_published(&paper, &mut map, visibility, report);
            }),
        }
        Ok(report)
    }
}
