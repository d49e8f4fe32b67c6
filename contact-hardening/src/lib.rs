#![doc = include_str!("../README.md")]

pub mod backs;
pub mod cpu;
pub mod distance_map;
pub mod filter;
pub mod footprint;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod kernel;
pub mod look_up;
pub mod multi_pass;
pub mod paper;
mod params;
pub mod physical;
pub mod search;
pub mod shadow_pyramid;
mod show;
pub mod smoothing;
pub mod solids;
mod technique;

use std::sync::Arc;

use gnomon_shadow_map::filter_maps::FilterMaps;
use gnomon_shadow_map::light_maps::LightMaps;
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant as MapVariant};
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
    source: Source,
}

/// Where hard shadows come from.
#[derive(Clone, Default)]
enum Source {
    /// With `physical` scaling exact ones: see [`ContactHardening::new`]. Else from the own map.
    #[default]
    Auto,
    /// From the map that blockers are found in.
    OwnMap,
    /// From another technique.
    Technique { name: String, technique: Arc<dyn ShadowTechnique> },
}

/// A light, prepared; holds for any camera if the source does.
pub struct PreparedContactHardening<'a> {
    params: ContactHardeningParams,
    look_ups: LookUps<'a>,
    kernel: Kernel,
    fine: Kernel,
    source: Option<Box<dyn PreparedShadow + 'a>>,
}

impl ContactHardening {
    /// A technique with these settings.
    ///
    /// With `physical` scaling hard shadows are shadow-map's `alias-free` ones, exact at every pixel: near a contact, and everywhere
    /// under a sun, penumbrae are narrower than a texel of any map. With `paper` scaling they come from the
    /// [own map](Self::on_own_map).
    pub fn new(params: ContactHardeningParams) -> Self {
        Self { params, source: Source::Auto }
    }

    /// The same with the hard shadows of the own map, whatever the light.
    #[must_use]
    pub fn on_own_map(self) -> Self {
        Self { source: Source::OwnMap, ..self }
    }

    /// The same on top of any other technique's hard shadows; V below one half counts as shadowed. Blockers are still
    /// found in the own map, which no technique has to hold. Reports call the source `name`.
    #[must_use]
    pub fn on_top_of(self, name: impl Into<String>, source: Arc<dyn ShadowTechnique>) -> Self {
        Self { source: Source::Technique { name: name.into(), technique: source }, ..self }
    }

    /// What reports call the source of hard shadows: `auto`, `own` for the own map, or a technique's name.
    pub fn source_name(&self) -> &str {
        match &self.source {
            Source::Auto => "auto",
            Source::OwnMap => "own",
            Source::Technique { name, .. } => name,
        }
    }

    /// The technique whose hard shadows are blurred; `None` for the own map's.
    fn source(&self) -> Option<Arc<dyn ShadowTechnique>> {
        match &self.source {
            Source::Auto if self.params.scaling == Scaling::Physical => {
                let params = ShadowMapParams {
                    variant: MapVariant::AliasFree,
                    skip: self.params.skip,
                    ..Default::default()
                };
                Some(Arc::new(ShadowMap::new(params)))
            }
            Source::Auto | Source::OwnMap => None,
            Source::Technique { technique, .. } => Some(technique.clone()),
        }
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
        report.merge_beside(&rest);
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
        let asked = u64::from(query.camera.width) * u64::from(query.camera.height) * u64::from(params.taps);
        let look_ups = report.time("prepare.tiles", |_| LookUps::new(filter, asked));
        let look_ups = if params.solids && params.scaling == Scaling::Physical {
            report.time("prepare.backs", |_| look_ups.with_backs())
        } else {
            look_ups
        };
        report.bytes += look_ups.bytes();
        let source = match self.source() {
            Some(source) => {
                let (prepared, rest) = source.prepare(query)?;
                report.merge_beside(&rest);
                Some(prepared)
            }
            None => None,
        };
        let kernel = params.kernel_for(query.light);
        let fine = params.fine_kernel_for(query.light);
        Ok((PreparedContactHardening { params, look_ups, kernel, fine, source }, report))
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
                    fine: &self.fine,
                    clip_from_world: camera.with_size(gbuffer.width, gbuffer.height).projection_from_world(),
                    has_source: hard.is_some(),
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
