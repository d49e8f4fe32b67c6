#![doc = include_str!("../README.md")]

pub mod area_light;
pub mod bodies;
mod casters;
pub mod chord;
pub mod coverage;
pub mod cpu;
pub mod depth_complexity;
pub mod edges;
mod error;
pub mod exact;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod interpolated;
pub mod layers;
mod params;
pub mod receiver;
pub mod samples;
pub mod seams;
pub mod shaft;
mod technique;
pub mod wedge;
pub mod wedges;

use glam::Vec3;
use rayon::prelude::*;
use scene_core::bvh::shadow_origin;
use scene_core::light::LightPoint;
use scene_core::{Camera, GBuffer, Light, Report, VisibilityImage};

use area_light::AreaLight;
pub use casters::Casters;
use cpu::Answer;
pub use error::WedgeError;
use exact::{Scratch, Work};
#[cfg(feature = "gpu")]
pub use gpu::PenumbraWedgesOnGpu;
pub use params::{Variant, WedgeParams};
use receiver::Receiver;
pub use technique::Factory;
use wedges::Wedges;

/// The technique: settings, from which any number of lights can be prepared.
#[derive(Clone, Copy, Debug, Default)]
pub struct PenumbraWedges {
    params: WedgeParams,
}

/// One light's shadows for one camera, borrowing the scene's casters.
#[derive(Debug)]
pub struct PreparedWedges<'a> {
    casters: Casters<'a>,
    light: Light,
    params: WedgeParams,
    /// `None` for a light without extent.
    wedges: Option<Wedges>,
}

impl PenumbraWedges {
    /// A technique with these settings.
    pub fn new(params: WedgeParams) -> Self {
        Self { params }
    }

    /// Prepares `light` for what `camera` sees. `casters` is made once a scene and kept from frame to frame.
    ///
    /// # Errors
    /// A caster with a cut-out mask, for variants other than `exact`.
    pub fn prepare<'a>(
        &self,
        casters: &Casters<'a>,
        light: &Light,
        camera: &Camera,
    ) -> Result<(PreparedWedges<'a>, Report), WedgeError> {
        let mut report = Report::default();
        if self.params.variant != Variant::Exact
            && let Some(object) = casters.masked()
        {
            return Err(WedgeError::Masked { object: object.name.clone() });
        }
        let wedges = AreaLight::new(light)
            .map(|area| Wedges::new(casters, light, area, camera, &self.params, &mut report));
        report.bytes = (casters.bytes() + wedges.as_ref().map_or(0, Wedges::bytes)) as u64;
        Ok((PreparedWedges { casters: casters.clone(), light: *light, params: self.params, wedges }, report))
    }
}

impl PreparedWedges<'_> {
    /// The wedges; `None` of a light without extent.
    pub fn wedges(&self) -> Option<&Wedges> {
        self.wedges.as_ref()
    }

    /// What answers for receivers; `None` of a light without extent.
    pub fn answer(&self) -> Option<Answer<'_>> {
        let wedges = self.wedges.as_ref()?;
        Some(Answer::new(
            self.casters.scene,
            &self.casters.tree,
            wedges,
            self.params.variant,
            self.params.skip,
        ))
    }

    /// Fills `visibility`, which must have the G-buffer's size: V where a surface is seen, NaN elsewhere. The
    /// G-buffer must be the camera's.
    pub fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Report {
        self.shade_and_count(gbuffer, visibility).0
    }

    /// [`shade`](Self::shade), and what it took.
    pub fn shade_and_count(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> (Report, Work) {
        let mut report = Report::default();
        let magnitude = self.casters.scene.bounds().magnitude();
        let Some(answer) = self.answer() else {
            report.time("shade.rays", |_| self.shade_hard(gbuffer, magnitude, visibility));
            return (report, Work::default());
        };
        let work = cpu::shade(&answer, gbuffer, magnitude, &self.params, &mut report, visibility);
        if self.params.skip {
            report.skip("tiles in no wedge", work.free_tiles);
            report.skip("wedges outside of a tile", work.wedges_left_out);
            report.skip("pixels outside of a wedge", work.pairs - work.inside);
        }
        report.skip("pixels the light cannot reach", work.dark);
        report.count("penumbra pixels", work.penumbra);
        (report, work)
    }

    /// V at free points; NaN for a point that is not finite. Every wedge is asked about every point. The slices must be of
    /// equal length: what the longer one has more is left alone.
    pub fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Report {
        let mut report = Report::default();
        let answer = self.answer();
        let edges: Vec<u32> = (0..self.wedges.as_ref().map_or(0, |w| w.wedges.len() as u32)).collect();
        report.time("shade.points", |_| {
            let pairs = visibility.par_iter_mut().zip(points).enumerate();
            pairs.for_each_init(Scratch::default, |scratch, (index, (v, &point))| {
                *v = if !point.is_finite() {
                    f32::NAN
                } else if let Some(answer) = &answer {
                    answer.visibility(&Receiver::free(point, index % samples::PATTERNS), &edges, scratch)
                } else {
                    self.hard(point, point)
                };
            });
        });
        report
    }

    /// One ray to a light without extent.
    fn hard(&self, position: Vec3, origin: Vec3) -> f32 {
        let is_lit =
            self.light.reaches(position) && !self.casters.tree.is_occluded(origin, self.light.center());
        f32::from(u8::from(is_lit))
    }

    fn shade_hard(&self, gbuffer: &GBuffer, magnitude: f32, visibility: &mut VisibilityImage) {
        let objects = self.casters.scene.objects();
        visibility.values.par_iter_mut().enumerate().for_each(|(pixel, v)| {
            *v = if !gbuffer.is_seen(pixel) {
                f32::NAN
            } else if !objects[gbuffer.object[pixel] as usize].flags.receives {
                1.0
            } else {
                let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
                let height = match self.light.center() {
                    LightPoint::At(place) => normal.dot(place - position),
                    LightPoint::Towards(direction) => normal.dot(direction),
                };
                let origin = shadow_origin(position, normal, magnitude);
                if height > 0.0 { self.hard(position, origin) } else { 0.0 }
            };
        });
    }
}
