#![doc = include_str!("../README.md")]

pub mod baked;
pub mod compression;
pub mod cpu;
pub mod crossings;
pub mod emission;
pub mod error_bound;
pub mod events;
pub mod functions;
#[cfg(feature = "gpu")]
pub mod gpu;
mod greedy;
mod greedy_lanes;
pub mod grid;
mod guide;
pub mod layout;
mod lookup;
pub mod maps;
pub mod nodes;
mod params;
pub mod sorting;
pub mod surfaces;
mod technique;
mod tunnel;
pub mod walk;

use std::borrow::Cow;
use std::sync::Arc;

use glam::Vec3;
use gnomon_shadow_map::receiver_plane::plane_tolerance;
use scene_core::geometry::Object;
use scene_core::relevance::{self, CasterRegion, Receivers};
use scene_core::{Camera, GBuffer, Light, Origin, Report, Scene, VisibilityImage};

use cpu::{Lookup, Window};
use functions::Functions;
use grid::PixelGrid;
use layout::{Fit, Layout, Part};
pub use params::{ErrorMeasure, PdsmParams, Precision};
use surfaces::Surfaces;
pub use technique::Factory;

/// Texels a side of the one map of a light without extent, unless its setting says more: the index alone takes 256 MiB.
const MOST_OF_ONE_MAP: u32 = 8192;

/// What reports call receivers that lie before the first node of all functions that they are read from.
const LIT: &str = "lookups before all shadows";

/// What reports call receivers that face away from all of the light.
const BELOW: &str = "lookups of what faces away";

/// The technique: settings, from which any number of lights can be prepared.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pdsm {
    params: PdsmParams,
}

/// The functions of one light, borrowing the scene they were made from. They hold for any camera; windows of what one camera
/// sees ([`Pdsm::prepare_for`]) are of use to it alone.
#[derive(Debug)]
pub struct PreparedPdsm<'a> {
    /// What scene, light and windows count from.
    origin: Origin,
    scene: Cow<'a, Scene>,
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
    ///
    /// A light without extent takes one map, which gets the texels of all `views` of them, shared by the scene's window and
    /// those of what is seen: it has no penumbra that would hide how coarse they are. [`MOST_OF_ONE_MAP`] a side at most. A ray
    /// passes each of them, since the few events of one map cost little more than the ray's place in the index.
    fn grid(&self, light: &Light) -> (u32, PixelGrid) {
        let PdsmParams { views, map_size, pdsm_size, cascades, .. } = self.params;
        let size = pdsm_size.max(1);
        let ratio = map_size.div_ceil(size).max(1);
        if !light.is_extended() {
            let times = (views / (1 + cascades)).isqrt().max(1);
            let side = size * ratio;
            let size = side.saturating_mul(times).min(MOST_OF_ONE_MAP).max(side);
            return (size, PixelGrid { size, ratio: 1 });
        }
        (size * ratio, PixelGrid { size, ratio })
    }

    /// Builds the PDSM of `light`, all casters in one, for any camera.
    pub fn prepare<'a>(&self, scene: &'a Scene, light: &Light) -> (PreparedPdsm<'a>, Report) {
        self.for_any_camera().prepare_for(scene, light, None)
    }

    /// The same without `cascades`.
    fn for_any_camera(&self) -> Self {
        Self::new(PdsmParams { cascades: 0, ..self.params })
    }

    /// [`prepare`](Self::prepare), with windows of their own for up to `cascades` parts of what `camera` sees.
    pub fn prepare_for<'a>(
        &self,
        scene: &'a Scene,
        light: &Light,
        camera: Option<&Camera>,
    ) -> (PreparedPdsm<'a>, Report) {
        self.counted_from(Origin::near(scene.bounds()), scene, light, camera)
    }

    /// [`prepare_for`](Self::prepare_for) in coordinates of its own.
    fn counted_from<'a>(
        &self,
        origin: Origin,
        scene: &'a Scene,
        light: &Light,
        camera: Option<&Camera>,
    ) -> (PreparedPdsm<'a>, Report) {
        let mut report = Report::default();
        let (scene, light, moving) = (origin.scene(scene), origin.light(light), Arc::default());
        let camera = camera.map(|camera| origin.camera(camera));
        let (windows, tolerance) = self.windows(&scene, &light, camera.as_ref(), |_| true, &mut report);
        (PreparedPdsm { origin, scene, light, windows, moving, tolerance, params: self.params }, report)
    }

    /// Windows with functions over those casters of `scene` that are `meant`, and the tolerance of lookups.
    fn windows(
        &self,
        scene: &Scene,
        light: &Light,
        camera: Option<&Camera>,
        meant: impl Fn(&Object) -> bool,
        report: &mut Report,
    ) -> (Arc<[Window]>, f32) {
        let PdsmParams { views, seed, filter_radius, precision, only_surfaces, skip, .. } = self.params;
        let tolerance = plane_tolerance(scene.bounds(), light);
        let (map_size, grid) = self.grid(light);
        let (casters, (layouts, skipped)) = report.time("prepare.layout", |report| {
            let told = relevance::told_apart_with_solids(scene, light, tolerance);
            report.skip("casters", told.backdrops.iter().filter(|object| meant(object)).count() as u64);
            let casters: Vec<_> = told.drawn.into_iter().filter(|object| meant(object)).collect();
            let layouts = Fit { scene, light, views, map_size, seed }.layouts(&casters);
            (casters, layouts)
        });
        report.skip("windows", skipped);
        let of_view = camera.map_or_else(Vec::new, |camera| {
            report.time("prepare.layout", |_| {
                let rim = (filter_radius + 1) * grid.ratio;
                let parts = layout::parts(scene, light, camera, self.params.cascades, rim);
                parts.iter().filter_map(|part| self.of_part(scene, light, &casters, &layouts, part)).collect()
            })
        });
        // The windows of parts first: where they hold a point, they are the finer ones.
        let of_scene = layouts.into_iter().map(|layout| (layout, casters.clone()));
        let windows: Arc<[Window]> = of_view
            .into_iter()
            .chain(of_scene)
            .map(|(layout, casters)| {
                let (events, rows) = report
                    .time("prepare.events", |_| cpu::collect_events(scene, &casters, &layout, grid, skip));
                report.skip("map rows without casters", rows);
                // Free points are none of a part's business: it keeps V at surfaces alone.
                let surfaces = (only_surfaces || layout.is_of_part()).then(|| {
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

    /// The window of a part of what is seen, with the casters that can shadow it. `None` where it would not show more than
    /// the scene's own: that softens by less than a pixel, or its texels are less than twice as long along a side.
    fn of_part<'o>(
        &self,
        scene: &Scene,
        light: &Light,
        casters: &[&'o Object],
        of_scene: &[Layout],
        part: &Part,
    ) -> Option<(Layout, Vec<&'o Object>)> {
        let PdsmParams { views, seed, .. } = self.params;
        let (map_size, grid) = self.grid(light);
        let middle = part.bounds.center();
        let coarse = of_scene.iter().find(|layout| layout.locate(middle).is_some())?.texel_area(middle);
        // Interpolation softens by two pixels of the PDSM.
        let softened = coarse * (2 * grid.ratio).pow(2) as f32;
        if softened <= part.pixel * part.pixel {
            return None;
        }
        // A texel stands for what its light passes: receivers are grown by what lookups reach around them.
        let reach = part.bounds.diagonal() * (self.params.filter_radius + 1) as f32 / grid.size as f32;
        let receivers = Receivers::within(scene, &[part.bounds], light).grown(f64::from(reach));
        let region = CasterRegion::between(scene, &receivers, light);
        let casters: Vec<_> =
            casters.iter().copied().filter(|object| region.touches(&object.bounds)).collect();
        let layout = Fit { scene, light, views, map_size, seed }.layout_of_part(&casters, part)?;
        let is_finer = layout.texel_area(middle) * 4.0 <= coarse;
        is_finer.then_some((layout, casters))
    }
}

impl PreparedPdsm<'_> {
    fn lookup(&self) -> Lookup<'_> {
        Lookup {
            scene: &self.scene,
            light: &self.light,
            windows: &self.windows,
            moving: &self.moving,
            tolerance: self.tolerance,
            radius: self.radius(),
            skip: self.params.skip,
        }
    }

    /// Pixels that interpolation reaches: 0 for the nearest one.
    fn radius(&self) -> u32 {
        if self.params.bilinear { self.params.filter_radius.max(1) } else { 0 }
    }

    /// Whether it would be the same for any other camera.
    pub fn survives_camera(&self) -> bool {
        !self.windows.iter().any(|window| window.layout.is_of_part())
    }

    /// Leaves out windows of parts, the farthest first, until a device `holds` the bytes of index and nodes of all that are left;
    /// how many that were.
    #[cfg(feature = "gpu")]
    fn leave_out_parts(&mut self, holds: impl Fn([u64; 2]) -> bool) -> u64 {
        let bytes = |window: &Window| {
            let functions = &window.functions;
            [functions.index(), functions.nodes().words()].map(|words| size_of_val(words) as u64)
        };
        let of_all = self.windows.iter().chain(self.moving.iter()).map(bytes);
        let [mut index, mut nodes] = of_all.fold([0; 2], |sum, own| [sum[0] + own[0], sum[1] + own[1]]);
        let parts = self.windows.partition_point(|window| window.layout.is_of_part());
        let mut kept = parts;
        while !holds([index, nodes]) && kept > 0 {
            kept -= 1;
            let own = bytes(&self.windows[kept]);
            (index, nodes) = (index - own[0], nodes - own[1]);
        }
        if kept < parts {
            self.windows = [&self.windows[..kept], &self.windows[parts..]].concat().into();
        }
        (parts - kept) as u64
    }

    /// The windows, with their functions: those of parts first. Their coordinates are the scene's own where that lies far from zero
    /// (see [`Origin`]).
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
        (self.moving, _) =
            pdsm.windows(&self.scene, &self.light, None, |object| object.flags.dynamic, &mut report);
        report.bytes = self.bytes();
        report
    }

    /// Fills `visibility`, which must have the G-buffer's size: V where a surface is seen, NaN elsewhere.
    pub fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Report {
        let mut report = Report::default();
        let gbuffer = self.origin.gbuffer(gbuffer);
        report.time("shade.lookup", |report| {
            let skipped = cpu::shade(&self.lookup(), &gbuffer, visibility);
            report.skip(LIT, skipped.lit);
            report.skip(BELOW, skipped.below);
        });
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
        let points = match self.origin.is_world() {
            true => Cow::Borrowed(points),
            false => points.iter().map(|&point| self.origin.point(point)).collect(),
        };
        report.time("shade.lookup", |report| {
            report.skip(LIT, cpu::free_points(&lookup, &points, visibility).lit);
        });
        report
    }
}
