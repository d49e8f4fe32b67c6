#![doc = include_str!("../README.md")]

pub mod compression;
pub mod cpu;
pub mod crossings;
pub mod emission;
pub mod events;
pub mod functions;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod grid;
pub mod layout;
mod params;
mod technique;
pub mod walk;

use glam::Vec3;
use gnomon_shadow_map::receiver_plane::plane_tolerance;
use rayon::prelude::*;
use scene_core::relevance;
use scene_core::{GBuffer, Light, Report, Scene, VisibilityImage};

use cpu::{Lookup, Window};
use functions::Functions;
use grid::PixelGrid;
pub use params::PdsmParams;
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
    windows: Vec<Window>,
    tolerance: f32,
    bilinear: bool,
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

    /// Builds the PDSM of `light`.
    pub fn prepare<'a>(&self, scene: &'a Scene, light: &Light) -> (PreparedPdsm<'a>, Report) {
        let mut report = Report::default();
        let PdsmParams { views, max_error, seed, bilinear, skip, .. } = self.params;
        let tolerance = plane_tolerance(scene.bounds(), light);
        let (map_size, grid) = self.grid();
        let (casters, (layouts, skipped)) = report.time("prepare.layout", |_| {
            let casters = relevance::told_apart(scene, light, tolerance);
            let layouts = layout::layouts(scene, &casters.drawn, light, views, map_size, seed);
            (casters, layouts)
        });
        report.skip("casters", casters.backdrops.len() as u64);
        report.skip("windows", skipped);
        let ranges: Vec<_> = casters.drawn.iter().map(|object| object.triangles.clone()).collect();
        let windows: Vec<Window> = layouts
            .into_iter()
            .map(|layout| {
                let (events, rows) = report
                    .time("prepare.events", |_| cpu::collect_events(scene, &ranges, &layout, grid, skip));
                report.skip("map rows without casters", rows);
                let functions = report.time("prepare.functions", |_| {
                    Functions::new(grid.size, &events, layout.steps().len() as u32, max_error)
                });
                report.skip("rays without a shadow", functions.empty_pixels());
                Window { layout, grid, functions }
            })
            .collect();
        report.bytes = windows.iter().map(|window| window.functions.bytes()).sum();
        (PreparedPdsm { scene, light: *light, windows, tolerance, bilinear }, report)
    }
}

impl PreparedPdsm<'_> {
    fn lookup(&self) -> Lookup<'_> {
        Lookup {
            scene: self.scene,
            light: &self.light,
            windows: &self.windows,
            tolerance: self.tolerance,
            bilinear: self.bilinear,
        }
    }

    /// The windows, with their functions.
    pub fn windows(&self) -> &[Window] {
        &self.windows
    }

    /// Fills `visibility`, which must have the G-buffer's size: V where a surface is seen, NaN elsewhere.
    pub fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Report {
        let mut report = Report::default();
        report.time("shade.lookup", |_| cpu::shade(&self.lookup(), gbuffer, visibility));
        report
    }

    /// V at free points; NaN for a point that is not finite. The slices must be of equal length: what the
    /// longer one has more is left alone.
    pub fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Report {
        let mut report = Report::default();
        let lookup = self.lookup();
        report.time("shade.lookup", |_| {
            visibility.par_iter_mut().zip(points).for_each(|(v, &point)| *v = lookup.free(point));
        });
        report
    }
}
