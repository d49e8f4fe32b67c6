#![doc = include_str!("../README.md")]

pub mod baked;
pub mod compression;
pub mod cpu;
pub mod crossings;
pub mod emission;
pub mod events;
pub mod functions;
#[cfg(feature = "gpu")]
pub mod gpu;
mod greedy;
pub mod grid;
pub mod layout;
pub mod maps;
pub mod nodes;
mod params;
pub mod surfaces;
mod technique;
mod tunnel;
pub mod walk;

use std::sync::Arc;

use glam::Vec3;
use gnomon_shadow_map::receiver_plane::plane_tolerance;
use scene_core::geometry::Object;
use scene_core::relevance;
use scene_core::{GBuffer, Light, Report, Scene, VisibilityImage};

use cpu::{Lookup, Window};
use functions::Functions;
use grid::PixelGrid;
pub use params::{ErrorMeasure, PdsmParams, Precision};
use surfaces::Surfaces;
pub use technique::Factory;

/// The technique: settings, from which any number of lights can be prepared.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pdsm {
    params: PdsmParams,
}

/// The functions of one light, borrowing the scene they were made from. They hold for any camera.
#[derive(Debug)]
pub struct PreparedPdsm<'a> {
    scene: &'a Scene,
    light: Light,
    windows: Arc<[Window]>,
    /// Windows over casters that have a PDSM of their own.
    moving: Arc<[Window]>,
    tolerance: f32,
    params: PdsmParams,
}

impl Pdsm {
    /// A technique with these settings.
    pub fn new(params: PdsmParams) -> Self {
        Self { params }
    }

    /// The maps' resolution and the PDSM's pixels on it.
    fn grid(&self) -> (u32, PixelGrid) {
        let size = self.params.pdsm_size.max(1);
        let ratio = self.params.map_size.div_ceil(size).max(1);
        (size * ratio, PixelGrid { size, ratio })
    }

    /// Builds the PDSM of `light`, all casters in one.
    pub fn prepare<'a>(&self, scene: &'a Scene, light: &Light) -> (PreparedPdsm<'a>, Report) {
        let mut report = Report::default();
        let (windows, tolerance) = self.windows(scene, light, |_| true, &mut report);
        let (light, moving) = (*light, Arc::default());
        (PreparedPdsm { scene, light, windows, moving, tolerance, params: self.params }, report)
    }

    /// Windows with functions over those casters of `scene` that are `meant`, and the tolerance of lookups.
    fn windows(
        &self,
        scene: &Scene,
        light: &Light,
        meant: impl Fn(&Object) -> bool,
        report: &mut Report,
    ) -> (Arc<[Window]>, f32) {
        let PdsmParams { views, seed, filter_radius, precision, only_surfaces, skip, .. } = self.params;
        let tolerance = plane_tolerance(scene.bounds(), light);
        let (map_size, grid) = self.grid();
        let (casters, (layouts, skipped)) = report.time("prepare.layout", |report| {
            let told = relevance::told_apart(scene, light, tolerance);
            report.skip("casters", told.backdrops.iter().filter(|object| meant(object)).count() as u64);
            let casters: Vec<_> = told.drawn.into_iter().filter(|object| meant(object)).collect();
            let layouts = layout::layouts(scene, &casters, light, views, map_size, seed);
            (casters, layouts)
        });
        report.skip("windows", skipped);
        let windows: Arc<[Window]> = layouts
            .into_iter()
            .map(|layout| {
                let (events, rows) = report
                    .time("prepare.events", |_| cpu::collect_events(scene, &casters, &layout, grid, skip));
                report.skip("map rows without casters", rows);
                let surfaces = only_surfaces.then(|| {
                    report.time("prepare.surfaces", |_| {
                        Surfaces::new(scene, &layout, grid, tolerance, filter_radius)
                    })
                });
                let functions = report.time("prepare.functions", |_| {
                    let views = layout.steps().len() as u32;
                    let functions = Functions::new(
                        grid.size,
                        &events,
                        views,
                        self.params.compression(),
                        surfaces.as_ref(),
                    );
                    if precision == Precision::Half { functions.into_packed() } else { functions }
                });
                report.skip("rays without a shadow", functions.empty_pixels());
                Window { layout, grid, functions }
            })
            .collect();
        report.bytes += windows.iter().map(|window| window.functions.bytes()).sum::<u64>();
        (windows, tolerance)
    }
}

impl PreparedPdsm<'_> {
    fn lookup(&self) -> Lookup<'_> {
        Lookup {
            scene: self.scene,
            light: &self.light,
            windows: &self.windows,
            moving: &self.moving,
            tolerance: self.tolerance,
            radius: self.radius(),
        }
    }

    /// Pixels that interpolation reaches: 0 for the nearest one.
    fn radius(&self) -> u32 {
        if self.params.bilinear { self.params.filter_radius.max(1) } else { 0 }
    }

    /// The windows, with their functions.
    pub fn windows(&self) -> &[Window] {
        &self.windows
    }

    /// Windows over the dynamic casters alone: none, but of functions that were [`baked`].
    pub fn moving_windows(&self) -> &[Window] {
        &self.moving
    }

    /// Bytes of all functions.
    pub fn bytes(&self) -> u64 {
        self.windows.iter().chain(self.moving.iter()).map(|window| window.functions.bytes()).sum()
    }

    /// Builds the PDSM of the dynamic casters, fitted to them: what a frame in which they moved costs. Its V is multiplied
    /// with that of the others, as if which part of the light is hidden had nothing to do with each other: exact where
    /// one of them is 0 or 1, and at least the sum of the shadows (section 5) where both are in penumbra.
    fn update_moving(&mut self) -> Report {
        let mut report = Report::default();
        let pdsm = Pdsm::new(self.params);
        (self.moving, _) = pdsm.windows(self.scene, &self.light, |object| object.flags.dynamic, &mut report);
        report.bytes = self.bytes();
        report
    }

    /// Fills `visibility`, which must have the G-buffer's size: V where a surface is seen, NaN elsewhere.
    pub fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Report {
        let mut report = Report::default();
        report.time("shade.lookup", |_| cpu::shade(&self.lookup(), gbuffer, visibility));
        report
    }

    /// V at free points; NaN for a point that is not finite, and everywhere for functions of surfaces only. The slices must be of equal length: what the
    /// longer one has more is left alone.
    pub fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Report {
        let mut report = Report::default();
        let lookup = self.lookup();
        if self.params.only_surfaces {
            visibility.fill(f32::NAN);
            return report;
        }
        report.time("shade.lookup", |_| {
            cpu::free_points(&lookup, points, visibility);
        });
        report
    }
}
