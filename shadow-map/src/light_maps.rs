//! The maps of one light and what their texels stand for: what every variant looks receivers up in.

use std::borrow::Cow;
use std::ops::Range;

use glam::{Vec2, Vec3};
use scene_core::geometry::Object;
use scene_core::light::LightPoint;
use scene_core::raster::DepthMap;
use scene_core::relevance::{self, Backdrops, CasterRegion};
use scene_core::{Light, Origin, Report, Scene};

use crate::cpu;
use crate::light_views::{self, LightView};
use crate::receiver_plane::{is_behind, meets, plane_tolerance};
use crate::view_casters::ViewNeeds;
use crate::{ShadowMapParams, Variant};

/// As far beside a map as matters: farther than any filter reaches, and columns and rows still fit into an `i32`.
pub(crate) const FAR_TEXEL: f32 = 1e6;

/// What the light sees through one view: depth and triangle a texel.
#[derive(Clone, Debug)]
pub struct ShadowMapView {
    /// The projection.
    pub view: LightView,
    /// Reversed depth; 0 where there is no caster.
    pub map: DepthMap,
    /// The triangle seen, as an index into [`Scene::triangles`]; anything where there is no caster.
    pub triangles: Vec<u32>,
    /// The texels that are looked up; others may hold anything, and rows after them may not be held.
    pub window: Window,
}

/// Columns and rows of a map.
pub type Window = [Range<u32>; 2];

impl ShadowMapView {
    /// A map of no texels yet.
    pub(crate) fn undrawn(view: LightView) -> Self {
        Self { view, map: DepthMap::default(), triangles: Vec::new(), window: [0..0, 0..0] }
    }

    /// A map of no casters, of which the rows up to the window's last are held.
    pub(crate) fn empty(view: LightView, size: u32, window: Option<&Window>) -> Self {
        let window = window.cloned().unwrap_or([0..size, 0..size]);
        // A pyramid reads pairs of rows.
        let texels = size as usize * window[1].end.next_multiple_of(2).min(size) as usize;
        let map = DepthMap { width: size, height: size, depth: vec![0.0; texels] };
        Self { view, map, triangles: vec![0; texels], window }
    }

    /// Whether a texel is one of those that are looked up.
    #[inline]
    pub(crate) fn holds(&self, column: usize, row: usize) -> bool {
        let [columns, rows] = &self.window;
        (columns.start as usize..columns.end as usize).contains(&column)
            && (rows.start as usize..rows.end as usize).contains(&row)
    }

    /// The centre of a texel (column and row), in normalised device coordinates.
    #[inline]
    pub fn center(&self, [column, row]: [usize; 2]) -> Vec2 {
        let center = Vec2::new(column as f32 + 0.5, row as f32 + 0.5) * (2.0 / self.map.width as f32);
        Vec2::new(center.x - 1.0, 1.0 - center.y)
    }

    /// The surface stored in a texel (column and row) at `depth`, which is not 0.
    #[inline]
    pub fn occluder(&self, [column, row]: [usize; 2], depth: f32) -> Occluder {
        let texel = 2.0 / self.map.width as f32;
        Occluder {
            point: self.view.unproject(self.center([column, row]), depth),
            triangle: self.triangles[row * self.map.width as usize + column] as usize,
            texel: self.view.half_diagonal(depth) * texel,
        }
    }

    /// Normalised device coordinates in texels: column and row, a texel's centre at one half; beside the map, too.
    #[inline]
    pub(crate) fn texel_at(&self, ndc: Vec2) -> Vec2 {
        let at = Vec2::new(ndc.x * 0.5 + 0.5, 0.5 - ndc.y * 0.5) * self.map.width as f32;
        at.clamp(Vec2::splat(-FAR_TEXEL), Vec2::splat(FAR_TEXEL))
    }

    /// Column and row of normalised device coordinates within the map. Row 0 is on top, as in every image; NDC 1 belongs to
    /// the last texel.
    #[inline]
    pub fn texel(&self, ndc: Vec2) -> [usize; 2] {
        let (size, last) = (self.map.width as f32, self.map.width as usize - 1);
        [ndc.x * 0.5 + 0.5, 0.5 - ndc.y * 0.5].map(|at| ((at * size) as usize).min(last))
    }
}

/// The maps of one light.
#[derive(Clone, Debug)]
pub struct LightMaps<'a> {
    /// What coordinates of all that follows, and of all that is asked, are counted from.
    pub origin: Origin,
    /// Geometry, for the planes of stored triangles.
    pub scene: Cow<'a, Scene>,
    /// The light.
    pub light: Light,
    /// Its maps.
    pub maps: Vec<ShadowMapView>,
    /// Casters that are in no map because no surface lies behind them; a free point may.
    pub backdrops: Vec<Object>,
    /// [`plane_tolerance`].
    pub tolerance: f32,
}

/// A surface point that a camera sees and that faces the light's centre.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Where it is, world space.
    pub point: Vec3,
    /// Unit normal on the side that the light shines on.
    pub normal: Vec3,
    /// The object it is on, as an index into [`Scene::objects`].
    pub object: u32,
    /// Distance from a plane below which it counts as on it, in scene units.
    pub tolerance: f32,
    /// Column and row of the pixel that sees it: what its random numbers are drawn from.
    pub pixel: [u32; 2],
}

/// A stored surface point: what the light sees in the texel that a receiver falls into.
#[derive(Clone, Copy, Debug)]
pub struct Occluder {
    /// The point at the texel's centre, world space.
    pub point: Vec3,
    /// Its triangle, as an index into [`Scene::triangles`].
    pub triangle: usize,
    /// Diagonal of the texel at the point's distance, world units.
    pub texel: f32,
}

impl<'a> LightMaps<'a> {
    /// `prepare.views` and `prepare.maps`: chooses the views of `light` and draws them. `choose` may narrow the
    /// casters of each view down to those that matter. A face of a cube is drawn from the objects that reach into it.
    pub fn draw(
        scene: &'a Scene,
        light: &Light,
        params: &ShadowMapParams,
        report: &mut Report,
        choose: impl FnOnce(&Backdrops<'_>, &[LightView], &mut Report) -> Option<Vec<ViewNeeds>>,
    ) -> Self {
        Self::draw_in(Origin::WORLD, Cow::Borrowed(scene), *light, params, report, choose)
    }

    /// The same in coordinates counted [from the scene](Origin::near) if it lies far from zero. What is asked has to be
    /// counted from [`origin`](Self::origin), too.
    pub fn draw_near(scene: &'a Scene, light: &Light, params: &ShadowMapParams, report: &mut Report) -> Self {
        Self::draw_near_for(scene, light, params, report, |_, _, _| None)
    }

    /// [`draw_near`](Self::draw_near) of what `choose` leaves. Its bounds are of the world: where the scene moves it is not asked.
    pub(crate) fn draw_near_for(
        scene: &'a Scene,
        light: &Light,
        params: &ShadowMapParams,
        report: &mut Report,
        choose: impl FnOnce(&Backdrops<'_>, &[LightView], &mut Report) -> Option<Vec<ViewNeeds>>,
    ) -> Self {
        let origin = Origin::near(scene.bounds());
        if origin.is_world() {
            return Self::draw(scene, light, params, report, choose);
        }
        Self::draw_in(origin, origin.scene(scene), origin.light(light), params, report, |_, _, _| None)
    }

    fn draw_in(
        origin: Origin,
        scene: Cow<'a, Scene>,
        light: Light,
        params: &ShadowMapParams,
        report: &mut Report,
        choose: impl FnOnce(&Backdrops<'_>, &[LightView], &mut Report) -> Option<Vec<ViewNeeds>>,
    ) -> Self {
        let tolerance = plane_tolerance(scene.bounds(), &light);
        let (casters, views) = report.time("prepare.views", |_| {
            let casters = relevance::told_apart(&scene, &light, tolerance);
            let views = light_views::light_views(&scene, &light, &casters.drawn, params.skips_faces());
            (casters, views)
        });
        report.skip("casters", casters.backdrops.len() as u64);
        report.skip("faces", views.skipped_faces);
        let chosen = choose(&casters, &views.views, report);
        // A filter goes on from an empty face into others; one comparison needs no such face. What touches a face by no more than
        // rounding holds no texel: their centres lie half a texel within.
        let leaves_out_empty = chosen.is_some() && params.variant == Variant::Hard;
        let mut views = views.views;
        let maps = report.time("prepare.maps", |report| {
            let mut needs: Vec<(Vec<Range<usize>>, Option<Window>)> = match chosen {
                Some(chosen) => {
                    chosen.into_iter().map(|needs| (needs.casters.ranges, Some(needs.window))).collect()
                }
                None => {
                    let reaches_into = |view: &LightView| {
                        let is_face = params.skip && views.len() > 1;
                        let region = is_face.then(|| CasterRegion::inside(&scene, &view.sides(1.0, 0.0)));
                        move |object: &&&Object| region.as_ref().is_none_or(|r| r.touches(&object.bounds))
                    };
                    let of = |view: &LightView| {
                        let objects = casters.drawn.iter().filter(reaches_into(view));
                        (objects.map(|object| object.triangles.clone()).collect(), None)
                    };
                    views.iter().map(of).collect()
                }
            };
            let undrawn = needs.iter().filter(|(ranges, _)| ranges.is_empty()).count();
            report.skip("undrawn faces", if params.skip { undrawn as u64 } else { 0 });
            if leaves_out_empty {
                let mut of_views = needs.iter();
                views.retain(|_| of_views.next().is_some_and(|(ranges, _)| !ranges.is_empty()));
                needs.retain(|(ranges, _)| !ranges.is_empty());
            }
            cpu::render_maps_of(&scene, &needs, &views, params.map_size)
        });
        let backdrops = casters.backdrops.into_iter().cloned().collect();
        let maps = Self { origin, scene, light, maps, backdrops, tolerance };
        report.bytes += maps.bytes();
        maps
    }

    /// Bytes of the texels: a depth and a triangle index each.
    pub fn bytes(&self) -> u64 {
        self.maps.iter().map(|map| map.map.depth.len() as u64 * 8).sum()
    }

    /// The surface that the light sees in the receiver's texel; `None` if there is none or no map holds the
    /// receiver.
    #[inline]
    pub fn occluder(&self, receiver: Vec3) -> Option<Occluder> {
        let (map, ndc) = self.maps.iter().find_map(|m| m.view.project(receiver).map(|ndc| (m, ndc)))?;
        let [column, row] = map.texel(ndc);
        // For one view only a part is drawn.
        let depth =
            if map.holds(column, row) { map.map.depth[row * map.map.width as usize + column] } else { 0.0 };
        (depth > 0.0).then(|| map.occluder([column, row], depth))
    }

    /// Whether one of the triangles that the light sees around the receiver's texel crosses the receiver's own ray.
    #[cold]
    pub fn meets_beside(&self, receiver: Vec3, tolerance: f32) -> bool {
        let found = self.maps.iter().find_map(|m| m.view.project(receiver).map(|ndc| (m, ndc)));
        found.is_some_and(|(map, ndc)| {
            let (last, light) = (map.map.width as usize - 1, self.light.center());
            let [column, row] = map.texel(ndc);
            let around = |at: usize| at.saturating_sub(1)..=(at + 1).min(last);
            around(row).any(|row| {
                around(column).any(|column| {
                    let texel = row * (last + 1) + column;
                    map.holds(column, row) && map.map.depth[texel] > 0.0 && {
                        let corners = self.scene.corners(map.triangles[texel] as usize);
                        is_behind(corners, receiver, light, tolerance) && meets(corners, receiver, light)
                    }
                })
            })
        })
    }

    /// Whether `normal` at `point` is turned to the light's centre and light is sent there at all.
    #[inline]
    pub fn faces(&self, point: Vec3, normal: Vec3) -> bool {
        let faces_light = match self.light.center() {
            LightPoint::At(place) => normal.dot(place - point) > 0.0,
            LightPoint::Towards(direction) => normal.dot(direction) > 0.0,
        };
        faces_light && self.light.reaches(point)
    }

    /// Whether a backdrop hides the light from a free point, triangle by triangle: backdrops are few and flat,
    /// and only points beyond all of the scene are behind one.
    pub fn is_behind_backdrop(&self, point: Vec3) -> bool {
        let light = self.light.center();
        let mut triangles = self.backdrops.iter().flat_map(|object| object.triangles.clone());
        triangles.any(|triangle| {
            let corners = self.scene.corners(triangle);
            is_behind(corners, point, light, self.tolerance) && meets(corners, point, light)
        })
    }
}
