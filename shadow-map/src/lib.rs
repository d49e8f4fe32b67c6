#![doc = include_str!("../README.md")]

pub mod cpu;
pub mod light_views;
mod params;
pub mod receiver_plane;
mod technique;
pub mod view_casters;

use glam::Vec3;
use rayon::prelude::*;
use scene_core::geometry::Object;
use scene_core::relevance::{self, Backdrops, CasterChunks, RelevantCasters};
use scene_core::{Camera, GBuffer, Light, Report, Scene, VisibilityImage};

use cpu::{Lookup, ShadowMapView};
use light_views::LightView;
pub use params::{ShadowMapParams, Variant};
pub use technique::Factory;

/// The technique: settings, from which any number of lights can be prepared.
#[derive(Clone, Copy, Debug, Default)]
pub struct ShadowMap {
    params: ShadowMapParams,
}

/// The maps of one light, borrowing the scene they were made from.
#[derive(Debug)]
pub struct PreparedShadowMap<'a> {
    scene: &'a Scene,
    light: Light,
    maps: Vec<ShadowMapView>,
    backdrops: Vec<&'a Object>,
    tolerance: f32,
}

impl ShadowMap {
    /// A technique with these settings.
    pub fn new(params: ShadowMapParams) -> Self {
        Self { params }
    }

    /// Draws the maps of `light`. They hold for any camera.
    pub fn prepare<'a>(&self, scene: &'a Scene, light: &Light) -> (PreparedShadowMap<'a>, Report) {
        self.prepare_with(scene, light, |_, _, _| None)
    }

    /// Draws into the maps of `light` only what can be looked up for surfaces that `camera` sees: they hold for this
    /// camera alone, and for free points only where it sees them. Every pixel is as from
    /// [`prepare`](Self::prepare), bit for bit. `chunks` must be of `scene`; they are kept from frame to frame.
    ///
    /// With `skip` off it is [`prepare`](Self::prepare).
    pub fn prepare_for_view<'a>(
        &self,
        scene: &'a Scene,
        light: &Light,
        camera: &Camera,
        chunks: &CasterChunks,
    ) -> (PreparedShadowMap<'a>, Report) {
        self.prepare_with(scene, light, |casters, views, report| {
            self.params.skip.then(|| {
                report.time("prepare.relevance", |report| {
                    let map_size = self.params.map_size;
                    let region = view_casters::looked_up(scene, light, camera, views, map_size);
                    let kept = relevance::relevant_casters(scene, &region, chunks, |id| {
                        let object = &scene.objects()[id as usize];
                        !casters.backdrops.iter().any(|backdrop| std::ptr::eq(*backdrop, object))
                    });
                    kept.book(report);
                    kept
                })
            })
        })
    }

    fn prepare_with<'a>(
        &self,
        scene: &'a Scene,
        light: &Light,
        choose: impl FnOnce(&Backdrops<'a>, &[LightView], &mut Report) -> Option<RelevantCasters>,
    ) -> (PreparedShadowMap<'a>, Report) {
        let mut report = Report::default();
        let tolerance = receiver_plane::plane_tolerance(scene.bounds(), light);
        let (casters, views) = report.time("prepare.views", |_| {
            let casters = relevance::told_apart(scene, light, tolerance);
            let views = light_views::light_views(scene, light, &casters.drawn, self.params.skip);
            (casters, views)
        });
        report.skip("casters", casters.backdrops.len() as u64);
        report.skip("faces", views.skipped_faces);
        let chosen = choose(&casters, &views.views, &mut report);
        let ranges = match chosen {
            Some(chosen) => chosen.ranges,
            None => casters.drawn.iter().map(|object| object.triangles.clone()).collect(),
        };
        let maps = report
            .time("prepare.maps", |_| cpu::render_maps(scene, &ranges, &views.views, self.params.map_size));
        let texels = u64::from(self.params.map_size) * u64::from(self.params.map_size);
        // A depth and a triangle index a texel.
        report.bytes = maps.len() as u64 * texels * 8;
        let backdrops = casters.backdrops;
        (PreparedShadowMap { scene, light: *light, maps, backdrops, tolerance }, report)
    }
}

impl PreparedShadowMap<'_> {
    fn lookup(&self) -> Lookup<'_> {
        Lookup {
            scene: self.scene,
            light: &self.light,
            maps: &self.maps,
            backdrops: &self.backdrops,
            tolerance: self.tolerance,
        }
    }

    /// The maps, one a view.
    pub fn maps(&self) -> &[ShadowMapView] {
        &self.maps
    }

    /// Fills `visibility`, which must have the G-buffer's size: V where a surface is seen, NaN elsewhere.
    pub fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Report {
        let mut report = Report::default();
        report.time("shade.lookup", |_| cpu::shade_hard(&self.lookup(), gbuffer, visibility));
        report
    }

    /// V at free points; NaN for a point that is not finite. The slices must be of equal length: what the
    /// longer one has more is left alone.
    pub fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Report {
        let mut report = Report::default();
        let lookup = self.lookup();
        report.time("shade.lookup", |_| {
            visibility.par_iter_mut().zip(points).for_each(|(v, &point)| *v = lookup.hard_at(point));
        });
        report
    }
}
