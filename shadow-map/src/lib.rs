#![doc = include_str!("../README.md")]

pub mod alias_free;
mod cascaded;
pub mod cascades;
mod cone_reach;
pub mod cpu;
pub mod depth_pyramid;
pub mod filter_maps;
#[cfg(feature = "gpu")]
pub mod gpu;
mod grid_cells;
mod hard;
pub mod light_cone;
pub mod light_maps;
pub mod light_points;
pub mod light_views;
mod moments;
mod multi_view;
mod object_id;
mod params;
pub mod patches;
mod pcf;
mod pcss;
pub mod pixel_hash;
pub mod poisson_disk;
pub mod receiver_plane;
pub mod search_region;
pub mod shade_patches;
pub mod taps;
mod technique;
pub mod texel_outcomes;
pub mod texel_plane;
pub mod view_casters;
mod view_needs;

use std::cell::OnceCell;
use std::fmt::Debug;

use glam::Vec3;
use scene_core::relevance::{Backdrops, CasterChunks, Receivers};
use scene_core::{Camera, GBuffer, Light, Origin, Report, Scene, VisibilityImage};

use cascaded::Cascaded;
use hard::Hard;
use light_maps::{LightMaps, ShadowMapView};
use light_views::LightView;
use moments::Moments;
use multi_view::MultiView;
use object_id::ObjectId;
pub use params::{Kernel, ShadowMapParams, Variant};
use pcf::Pcf;
use pcss::Pcss;
pub use technique::Factory;
use view_casters::ViewNeeds;
use view_needs::{Reach, Seen};

/// The technique: settings, from which any number of lights can be prepared.
#[derive(Clone, Copy, Debug, Default)]
pub struct ShadowMap {
    params: ShadowMapParams,
}

/// A light, prepared by one of the variants, borrowing the scene it shines on.
#[derive(Debug)]
pub struct PreparedShadowMap<'a> {
    /// What the variant's coordinates are counted from.
    origin: Origin,
    variant: Box<dyn PreparedVariant + 'a>,
}

/// What a variant has prepared. Each is a type in the file named after it; this is all that the crate asks of it.
pub(crate) trait PreparedVariant: Debug + Send + Sync {
    /// Fills `visibility`, which has the G-buffer's size: V where a surface is seen, NaN elsewhere.
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report);

    /// V at free points; NaN for a point that is not finite.
    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32], report: &mut Report);

    /// The depth maps with a triangle a texel, one a view; none where the variant keeps none.
    fn maps(&self) -> &[ShadowMapView];

    /// Whether it holds for any camera.
    fn survives_camera(&self) -> bool {
        true
    }
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
            let reach = Reach::of(&self.params, light).filter(|_| self.params.skip)?;
            report.time("prepare.relevance", |report| {
                let map_size = self.params.map_size;
                let receivers = Receivers::seen_closely_by(scene, camera, light, chunks);
                let seen = Seen { scene, light, receivers, casters, chunks, map_size, sine: OnceCell::new() };
                let needs = views.iter().map(|view| seen.needs(view, views.len() > 1, reach));
                let kept = needs.collect::<Option<Vec<_>>>()?;
                kept.iter().for_each(|kept| kept.book(report, map_size));
                Some(kept)
            })
        })
    }

    /// Takes maps that were drawn elsewhere; what is asked has to be counted from their [origin](LightMaps::origin). Variants that draw their own while shading (`cascaded`, `multi-view`,
    /// `alias-free`) look them up as `hard` does.
    pub fn prepare_maps<'a>(&self, maps: LightMaps<'a>) -> (PreparedShadowMap<'a>, Report) {
        let mut report = Report::default();
        (PreparedShadowMap { origin: Origin::WORLD, variant: self.over(maps, &mut report) }, report)
    }

    /// The variant over one set of maps.
    fn over<'a>(&self, maps: LightMaps<'a>, report: &mut Report) -> Box<dyn PreparedVariant + 'a> {
        let params = &self.params;
        match params.variant {
            Variant::Pcf => Box::new(Pcf::new(maps, params, report)),
            Variant::Pcss => Box::new(Pcss::new(maps, params, report)),
            Variant::ObjectId => Box::new(ObjectId::new(maps, params, report)),
            Variant::Moments => Box::new(Moments::new(maps, params, report)),
            Variant::Hard | Variant::Cascaded | Variant::MultiView | Variant::AliasFree => {
                Box::new(Hard { maps, skip: params.skip })
            }
        }
    }

    fn prepare_with<'a>(
        &self,
        scene: &'a Scene,
        light: &Light,
        choose: impl FnOnce(&Backdrops<'_>, &[LightView], &mut Report) -> Option<Vec<ViewNeeds>>,
    ) -> (PreparedShadowMap<'a>, Report) {
        let (mut report, params) = (Report::default(), &self.params);
        let over_maps = |report: &mut Report| {
            let maps = LightMaps::draw_near_for(scene, light, params, report, choose);
            (maps.origin, self.over(maps, report))
        };
        let (origin, variant): (Origin, Box<dyn PreparedVariant + 'a>) = match params.variant {
            Variant::Cascaded => match Cascaded::new(scene, light, params, &mut report) {
                Some(cascaded) => (Origin::WORLD, Box::new(cascaded)),
                None => over_maps(&mut report),
            },
            Variant::MultiView => {
                let views = MultiView::new(scene, light, params, &mut report);
                (views.origin, Box::new(views))
            }
            Variant::AliasFree => {
                let casters = alias_free::Prepared::new(scene, light, params.skip, &mut report);
                (Origin::WORLD, Box::new(casters))
            }
            Variant::Hard | Variant::Pcf | Variant::Pcss | Variant::ObjectId | Variant::Moments => {
                over_maps(&mut report)
            }
        };
        (PreparedShadowMap { origin, variant }, report)
    }
}

impl PreparedShadowMap<'_> {
    /// The maps, one a view, in coordinates counted [from the scene](Origin::near) if it lies far from zero.
    pub fn maps(&self) -> &[ShadowMapView] {
        self.variant.maps()
    }

    /// Whether the preparation holds for any camera.
    pub fn survives_camera(&self) -> bool {
        self.variant.survives_camera()
    }

    /// Fills `visibility`, which must have the G-buffer's size: V where a surface is seen, NaN elsewhere.
    pub fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Report {
        let mut report = Report::default();
        self.variant.shade(&self.origin.gbuffer(gbuffer), visibility, &mut report);
        report
    }

    /// V at free points; NaN for a point that is not finite. The slices must be of equal length: what the
    /// longer one has more is left alone.
    pub fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Report {
        let mut report = Report::default();
        self.variant.visibility_at(&self.origin.points(points), visibility, &mut report);
        report
    }
}
