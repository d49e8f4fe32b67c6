#![doc = include_str!("../README.md")]

pub mod bounds;
mod casters;
pub mod cpu;
pub mod crossing;
mod error;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod masked;
pub mod outline;
mod params;
pub mod planar;
pub mod receivers;
pub mod runs;
pub mod silhouette;
mod skips;
mod technique;
pub mod volumes;

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;
use scene_core::bvh::Bvh;
use scene_core::{Camera, GBuffer, Light, Report, Scene, VisibilityImage};

pub use casters::{Casters, near_casters};
use cpu::Receivers;
pub use error::VolumeError;
#[cfg(feature = "gpu")]
pub use gpu::StencilVolumesOnGpu;
pub use params::{Count, Variant, VolumeParams};
use receivers::FlatReceivers;
pub use skips::Skips;
pub use technique::Factory;
use volumes::Volumes;

/// The technique: settings, from which any number of lights can be prepared.
#[derive(Clone, Copy, Debug)]
pub struct StencilVolumes {
    params: VolumeParams,
    skips: Skips,
}

impl Default for StencilVolumes {
    fn default() -> Self {
        Self::new(VolumeParams::default())
    }
}

/// What a variant prepares.
#[derive(Debug)]
enum Prepared {
    Planar(FlatReceivers),
    Volumes(Box<Volumes>),
}

/// One light's shadows for one camera, borrowing the scene.
#[derive(Debug)]
pub struct PreparedVolumes<'a> {
    scene: &'a Scene,
    light: Light,
    camera: Camera,
    skips: Skips,
    tree: Arc<Bvh>,
    prepared: Prepared,
}

impl StencilVolumes {
    /// A technique with these settings.
    pub fn new(params: VolumeParams) -> Self {
        Self { params, skips: Skips::new(params.skip) }
    }

    /// The same with other skips than [`VolumeParams::skip`] says, to measure one by one. No image changes.
    #[must_use]
    pub fn with_skips(self, skips: Skips) -> Self {
        Self { skips, ..self }
    }

    /// Prepares `light` for what `camera` sees. `casters` is made once a scene and kept from frame to frame.
    pub fn prepare<'a>(
        &self,
        casters: &Casters<'a>,
        light: &Light,
        camera: &Camera,
    ) -> (PreparedVolumes<'a>, Report) {
        let mut report = Report::default();
        let skips = self.skips;
        let scene = casters.scene;
        let prepared = match self.params.variant {
            Variant::Planar => {
                Prepared::Planar(report.time("prepare.receivers", |_| FlatReceivers::new(scene, light)))
            }
            Variant::Volumes => {
                let volumes = Volumes::new(casters, light, camera, (&self.params, &skips), &mut report);
                report.bytes = (volumes.bytes() + casters.bytes()) as u64;
                Prepared::Volumes(Box::new(volumes))
            }
        };
        (
            PreparedVolumes {
                scene,
                light: *light,
                camera: *camera,
                skips,
                tree: casters.tree.clone(),
                prepared,
            },
            report,
        )
    }
}

impl PreparedVolumes<'_> {
    /// The volumes; `None` of the variant `planar`.
    pub fn volumes(&self) -> Option<&Volumes> {
        match &self.prepared {
            Prepared::Volumes(volumes) => Some(volumes),
            Prepared::Planar(_) => None,
        }
    }

    /// Fills `visibility`, which must have the G-buffer's size: V where a surface is seen, NaN elsewhere. The
    /// G-buffer must be the camera's.
    pub fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Report {
        let mut report = Report::default();
        let magnitude = self.scene.bounds().magnitude();
        let skip_unlit = self.skips.unlit;
        let receivers = Receivers { scene: self.scene, gbuffer, light: &self.light, magnitude, skip_unlit };
        match &self.prepared {
            Prepared::Planar(flat) => {
                cpu::planar::shade(flat, &receivers, &self.camera, self.skips.unlit, &mut report, visibility);
            }
            Prepared::Volumes(volumes) => {
                let work = cpu::shade(volumes, &receivers, &mut report, visibility);
                report.skip("pixels the light cannot reach", work.unreached);
                report.skip("tiles of one count", work.uniform);
                report.skip("pixels no mask is before", work.free_of_masks);
                report.skip("runs of edges beside a block", work.runs_skipped);
                report.count("pairs of run and block", work.run_pairs);
                report.count("pairs of side and tile", work.pairs);
                report.count("pairs of side and pixel", work.pixel_pairs);
                report.count("pixels traced", work.traced);
            }
        }
        report
    }

    /// V at free points, by one ray each; NaN for a point that is not finite. The slices must be of equal length: what the
    /// longer one has more is left alone.
    pub fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Report {
        let mut report = Report::default();
        report.time("shade.points", |_| {
            visibility.par_iter_mut().zip(points).for_each(|(v, &point)| {
                *v = if !point.is_finite() {
                    f32::NAN
                } else if !self.light.reaches(point) {
                    0.0
                } else {
                    f32::from(u8::from(!self.tree.is_occluded(point, self.light.center())))
                };
            });
        });
        report
    }
}
