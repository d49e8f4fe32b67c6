#![doc = include_str!("../README.md")]

pub mod aliasing;
pub mod caster_boxes;
pub mod caster_image;
mod casters;
pub mod choice;
pub mod cpu;
pub mod fitted;
pub mod follow;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod light_image;
pub mod lispsm;
mod lookup;
mod params;
pub mod points;
pub mod post_perspective;
pub mod seen;
mod technique;
pub mod view_frame;
pub mod views;
pub mod virtual_camera;
pub mod warp;

use std::sync::Arc;

use glam::Vec3;
use gnomon_shadow_map::cpu::answer_points;
use gnomon_shadow_map::light_maps::LightMaps;
use gnomon_shadow_map::receiver_plane::plane_tolerance;
use scene_core::geometry::Surfaces;
use scene_core::{Camera, GBuffer, Light, Origin, Report, Scene, VisibilityImage, relevance};

pub use casters::Casters;
pub use choice::Parametrisation;
pub use lookup::{Occluder, Surroundings};
pub use params::{Lookup, PsmParams, Show, Variant};
use points::PointClouds;
pub use technique::Factory;
use view_frame::ViewFrame;
use views::MapView;

/// The technique: settings, from which any number of frames can be prepared.
#[derive(Clone, Copy, Debug, Default)]
pub struct Psm {
    params: PsmParams,
}

/// A map: the triangle that the light sees at the centre of each texel.
#[derive(Clone, Debug)]
pub struct PsmMap {
    /// Its projection.
    pub view: MapView,
    /// Texels a side.
    pub size: u32,
    /// Row by row from the top left, as indices into [`Scene::triangles`]; [`GBuffer::NOTHING`] where there is none.
    pub triangles: Vec<u32>,
}

/// A light, prepared for one frame, borrowing the scene it shines on.
#[derive(Debug)]
pub struct PreparedPsm<'a> {
    /// Light, tolerance and what all receivers are asked first; its own maps are none.
    questions: LightMaps<'a>,
    surfaces: Option<Arc<Surfaces>>,
    maps: Vec<PsmMap>,
    frame: ViewFrame,
    params: PsmParams,
}

impl Psm {
    /// A technique with these settings.
    pub fn new(params: PsmParams) -> Self {
        Self { params }
    }

    /// Draws the maps of `light` for what `camera` sees in `gbuffer`. They hold for this G-buffer alone.
    ///
    /// What lives as long as the scene is made anew; see [`prepare_with`](Self::prepare_with).
    pub fn prepare<'a>(
        &self,
        scene: &'a Scene,
        light: &Light,
        camera: &Camera,
        gbuffer: &GBuffer,
    ) -> (PreparedPsm<'a>, Report) {
        let mut report = Report::default();
        let casters = Casters::new(scene, &self.params, &mut report);
        let (prepared, rest) = self.prepare_with(&casters, scene, light, camera, gbuffer);
        report.merge(&rest);
        (prepared, report)
    }

    /// As [`prepare`](Self::prepare), with the casters of the same scene, kept from frame to frame.
    pub fn prepare_with<'a>(
        &self,
        lasting: &Casters,
        scene: &'a Scene,
        light: &Light,
        camera: &Camera,
        gbuffer: &GBuffer,
    ) -> (PreparedPsm<'a>, Report) {
        let (mut report, params) = (Report::default(), self.params);
        // Where the scene lies far from zero, its own coordinates.
        let origin = Origin::near(scene.bounds());
        let (scene, light, camera) = (origin.scene(scene), origin.light(light), origin.camera(camera));
        let gbuffer = origin.gbuffer(gbuffer);
        let own = (!origin.is_world()).then(|| PointClouds::new(&scene));
        let clouds = own.as_ref().unwrap_or(&lasting.clouds);
        let tolerance = plane_tolerance(scene.bounds(), &light);
        let casters = relevance::told_apart_with_solids(&scene, &light, tolerance);
        report.skip("casters", casters.backdrops.len() as u64);
        let boxes: Vec<_> = casters.drawn.iter().map(|object| object.bounds).collect();
        let views = views::map_views(&scene, &light, &camera, &gbuffer, &boxes, &params, &mut report);
        let maps = report.time("prepare.maps", |report| {
            cpu::render_maps(&scene, &casters, clouds, views, &params, report)
        });
        report.bytes = maps.iter().map(|map| map.triangles.len() as u64 * 4).sum::<u64>() + clouds.bytes();
        let backdrops = casters.backdrops.into_iter().cloned().collect();
        let tolerance = lookup::tolerance(scene.bounds(), &light);
        let questions = LightMaps { origin, scene, light, maps: Vec::new(), backdrops, tolerance };
        let frame = ViewFrame::new(&camera);
        (PreparedPsm { questions, surfaces: lasting.surfaces.clone(), maps, frame, params }, report)
    }
}

impl PreparedPsm<'_> {
    /// The maps: none if nothing can be in shadow, one, or one a face of the cube around the light.
    pub fn maps(&self) -> &[PsmMap] {
        &self.maps
    }

    /// What its maps' texels are asked with.
    fn surroundings(&self) -> Surroundings<'_> {
        let LightMaps { scene, light, .. } = &self.questions;
        Surroundings { scene, surfaces: self.surfaces.as_deref(), light: light.center() }
    }

    /// The map that holds `point`, and the texel it falls into.
    #[inline]
    fn map_of(&self, point: Vec3) -> Option<(&PsmMap, [usize; 2])> {
        self.maps.iter().find_map(|map| map.texel_of(point).map(|texel| (map, texel)))
    }

    /// Fills `visibility`, which must have the size of the G-buffer that was prepared for: V where a surface is seen,
    /// NaN elsewhere. A receiver of another G-buffer that lies in no map is taken for lit.
    pub fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Report {
        let mut report = Report::default();
        let gbuffer = self.questions.origin.gbuffer(gbuffer);
        report.time("shade.lookup", |_| cpu::shade(self, &gbuffer, visibility));
        report
    }

    /// V at free points, by what the maps hold: a point whose ray to the light meets no receiver that the camera saw
    /// lies in no map, and is lit as far as anyone knows; beyond the last receiver of its ray everything is behind
    /// what the map holds. NaN for a point that is not finite. The slices must be of equal length: what the longer one
    /// has more is left alone.
    pub fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Report {
        let mut report = Report::default();
        let LightMaps { origin, light, tolerance, .. } = &self.questions;
        let surroundings = self.surroundings();
        report.time("shade.lookup", |_| {
            answer_points(points, visibility, |point| {
                let point = origin.point(point);
                if !point.is_finite() {
                    return f32::NAN;
                }
                if !light.reaches(point) {
                    return 0.0;
                }
                let shadowed = self
                    .map_of(point)
                    .is_some_and(|(map, texel)| map.shadows_free(&surroundings, (point, *tolerance), texel));
                if shadowed || self.questions.is_behind_backdrop(point) { 0.0 } else { 1.0 }
            });
        });
        report
    }
}
