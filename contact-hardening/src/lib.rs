#![doc = include_str!("../README.md")]

pub mod cpu;
pub mod distance_map;
pub mod footprint;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod kernel;
pub mod look_up;
pub mod multi_pass;
pub mod paper;
mod params;
pub mod physical;
pub mod shadow_pyramid;
mod show;
pub mod smoothing;
mod technique;

use std::sync::Arc;

use gnomon_shadow_map::filter_maps::FilterMaps;
use gnomon_shadow_map::light_maps::LightMaps;
use gnomon_shadow_map::{ShadowMapParams, Variant as MapVariant};
use scene_core::technique::{PreparedShadow, ShadowQuery, ShadowTechnique, TechniqueError};
use scene_core::{Camera, GBuffer, Report, VisibilityImage};

use kernel::Kernel;
use look_up::LookUps;
use paper::Paper;
pub use params::{Blocker, ContactHardeningParams, GaussianKernel, Scaling, Show, Variant};
use physical::Physical;
use shadow_pyramid::ShadowPyramid;
pub use technique::Factory;

/// The technique: settings and where hard shadows come from.
#[derive(Clone, Default)]
pub struct ContactHardening {
    params: ContactHardeningParams,
    source: Option<Source>,
}

/// Where hard shadows come from, if not from the own map.
#[derive(Clone)]
struct Source {
    name: String,
    technique: Arc<dyn ShadowTechnique>,
}

/// A light, prepared; holds for any camera if the source does.
pub struct PreparedContactHardening<'a> {
    params: ContactHardeningParams,
    look_ups: LookUps<'a>,
    kernel: Kernel,
    source: Option<Box<dyn PreparedShadow + 'a>>,
}

impl ContactHardening {
    /// A technique with these settings. Hard shadows come from its own map, as `shadow-map` draws them.
    pub fn new(params: ContactHardeningParams) -> Self {
        Self { params, source: None }
    }

    /// The same on top of any other technique's hard shadows; V below one half counts as shadowed. Blockers are still
    /// found in the own map, which no technique has to hold. Reports call the source `name`.
    #[must_use]
    pub fn on_top_of(self, name: impl Into<String>, source: Arc<dyn ShadowTechnique>) -> Self {
        Self { source: Some(Source { name: name.into(), technique: source }), ..self }
    }

    /// What reports call the source of hard shadows: `own` for the own map.
    pub fn source_name(&self) -> &str {
        self.source.as_ref().map_or("own", |source| &source.name)
    }

    /// Pass 1: draws the map, and prepares the source.
    ///
    /// # Errors
    /// Those of the source.
    pub fn prepare<'a>(
        &self,
        query: &ShadowQuery<'a>,
    ) -> Result<(PreparedContactHardening<'a>, Report), TechniqueError> {
        let mut report = Report::default();
        let settings = ShadowMapParams {
            variant: MapVariant::Pcf,
            map_size: self.params.map_size,
            skip: self.params.skip,
            ..Default::default()
        };
        let maps = LightMaps::draw_near(query.scene, query.light, &settings, &mut report);
        let (prepared, rest) = self.prepare_with(maps, query)?;
        let bytes = report.bytes + rest.bytes;
        report.merge(&rest);
        report.bytes = bytes;
        Ok((prepared, report))
    }

    /// The same with maps of the query's light that are drawn already, for whatever technique; their size and not
    /// `map_size` counts.
    ///
    /// # Errors
    /// Those of the source.
    pub fn prepare_with<'a>(
        &self,
        maps: LightMaps<'a>,
        query: &ShadowQuery<'a>,
    ) -> Result<(PreparedContactHardening<'a>, Report), TechniqueError> {
        let params = self.params;
        let mut report = Report::default();
        let filter = FilterMaps::new(maps, params.skip, &mut report);
        let look_ups = report.time("prepare.tiles", |_| LookUps::new(filter));
        report.bytes += look_ups.bytes();
        let source = match &self.source {
            Some(source) => {
                let (prepared, rest) = source.technique.prepare(query)?;
                let bytes = report.bytes;
                report.merge(&rest);
                report.bytes = bytes + rest.bytes;
                Some(prepared)
            }
            None => None,
        };
        let kernel = params.kernel_for(query.light);
        Ok((PreparedContactHardening { params, look_ups, kernel, source }, report))
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
        // Where the scene lies far from zero, its own coordinates: see `Origin`.
        let maps = self.look_ups.maps();
        let (gbuffer, camera) = (maps.origin.gbuffer(gbuffer), maps.origin.camera(camera));
        let gbuffer = gbuffer.as_ref();
        let mut map = report
            .time("shade.distance", |_| distance_map::distance_map(maps, gbuffer, hard.as_ref(), visibility));
        if self.params.show == Show::Distance {
            show::distance(&map, visibility);
            return Ok(report);
        }
        match self.params.scaling {
            Scaling::Physical => {
                let pyramid = report.time("shade.pyramid", |_| ShadowPyramid::new(&map));
                let physical = Physical {
                    params: &self.params,
                    maps,
                    look_ups: &self.look_ups,
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
                paper.scale(&maps.light, &mut map);
                cpu::filter_as_published(&paper, &mut map, visibility, report);
            }),
        }
        if self.params.show == Show::Penumbra {
            show::penumbra(visibility);
        }
        Ok(report)
    }
}
