//! The CPU path, one function a stage, in the order and with the names of the report.

use std::ops::Range;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use scene_core::geometry::Object;
use scene_core::light::LightPoint;
use scene_core::raster::{
    DEPTH_POSITION_ERROR, DepthMap, DepthOptions, RasterScratch, render_depth_and_triangles_into,
};
use scene_core::{GBuffer, Light, Scene, VisibilityImage};

use crate::light_views::LightView;
use crate::receiver_plane::{is_behind, is_near, meets, rises_above, view_tolerance};

/// What the light sees through one view: depth and triangle a texel.
#[derive(Clone, Debug)]
pub struct ShadowMapView {
    /// The projection.
    pub view: LightView,
    /// Reversed depth; 0 where there is no caster.
    pub map: DepthMap,
    /// The triangle seen, as an index into [`Scene::triangles`].
    pub triangles: Vec<u32>,
}

/// `prepare.maps`: draws the casters, ranges of [`Scene::triangles`], as each view sees them.
pub fn render_maps(
    scene: &Scene,
    casters: &[Range<usize>],
    views: &[LightView],
    size: u32,
) -> Vec<ShadowMapView> {
    let options = DepthOptions { triangles: Some(casters), ..Default::default() };
    let mut scratch = RasterScratch::new();
    views
        .iter()
        .map(|&view| {
            let mut map = DepthMap { width: size, height: size, depth: Vec::new() };
            let mut triangles = Vec::new();
            let projection = view.projection_from_world;
            render_depth_and_triangles_into(
                scene,
                projection,
                &options,
                &mut scratch,
                &mut map,
                &mut triangles,
            );
            ShadowMapView { view, map, triangles }
        })
        .collect()
}

/// What the lookups read.
#[derive(Clone, Copy, Debug)]
pub struct Lookup<'a> {
    /// Geometry, for the planes of stored triangles.
    pub scene: &'a Scene,
    /// The light.
    pub light: &'a Light,
    /// Its maps.
    pub maps: &'a [ShadowMapView],
    /// Casters that are in no map because no surface lies behind them; a free point may.
    pub backdrops: &'a [&'a Object],
    /// [`crate::receiver_plane::plane_tolerance`].
    pub tolerance: f32,
}

/// A stored surface point: what the light sees in the texel that a receiver falls into.
struct Occluder {
    point: Vec3,
    triangle: usize,
    /// Diagonal of the texel at the point's distance, world units.
    texel: f32,
}

impl Lookup<'_> {
    /// The surface that the light sees in the receiver's texel; `None` if there is none or no map holds the
    /// receiver.
    #[inline]
    fn occluder(&self, receiver: Vec3) -> Option<Occluder> {
        let (map, ndc) = self.maps.iter().find_map(|m| m.view.project(receiver).map(|ndc| (m, ndc)))?;
        let (size, count) = (map.map.width as f32, map.map.width as usize);
        // Row 0 is on top, as in every image. NDC 1 belongs to the last texel.
        let column = (((ndc.x * 0.5 + 0.5) * size) as usize).min(count - 1);
        let row = (((0.5 - ndc.y * 0.5) * size) as usize).min(count - 1);
        let depth = map.map.depth[row * count + column];
        let center = Vec2::new(column as f32 + 0.5, row as f32 + 0.5) * (2.0 / size);
        (depth > 0.0).then(|| Occluder {
            point: map.view.unproject(Vec2::new(center.x - 1.0, 1.0 - center.y), depth),
            triangle: map.triangles[row * count + column] as usize,
            texel: map.view.half_diagonal(depth) * (2.0 / size),
        })
    }

    /// `shade.lookup` of one receiver with the unit normal on its lit side.
    #[inline]
    fn hard(&self, receiver: Vec3, normal: Vec3, depth: f32) -> f32 {
        let tolerance = self.tolerance + view_tolerance(depth);
        let light = self.light.center();
        let shadowed = self.occluder(receiver).is_some_and(|occluder| {
            let corners = self.scene.corners(occluder.triangle);
            let snapping = occluder.texel * DEPTH_POSITION_ERROR;
            rises_above(occluder.point, receiver, normal, tolerance + snapping)
                && is_behind(corners, receiver, light, tolerance)
                && (!is_near(occluder.point, receiver, normal, light, occluder.texel)
                    || meets(corners, receiver, light))
        });
        if shadowed { 0.0 } else { 1.0 }
    }

    /// V at a free point, which has no surface of its own: shadowed if the stored surface is nearer to the
    /// light and the point lies behind it.
    pub fn hard_at(&self, point: Vec3) -> f32 {
        if !point.is_finite() {
            return f32::NAN;
        }
        if !self.light.reaches(point) {
            return 0.0;
        }
        let (to_light, _) = self.light.center().ray_from(point);
        let shadowed = self.occluder(point).is_some_and(|occluder| {
            (occluder.point - point).dot(to_light) > 0.0
                && is_behind(
                    self.scene.corners(occluder.triangle),
                    point,
                    self.light.center(),
                    self.tolerance,
                )
        });
        if shadowed || self.is_behind_backdrop(point) { 0.0 } else { 1.0 }
    }

    /// Whether a backdrop hides the light from a free point, triangle by triangle: backdrops are few and flat,
    /// and only points beyond all of the scene are behind one.
    fn is_behind_backdrop(&self, point: Vec3) -> bool {
        let light = self.light.center();
        let mut triangles = self.backdrops.iter().flat_map(|object| object.triangles.clone());
        triangles.any(|triangle| {
            let corners = self.scene.corners(triangle);
            is_behind(corners, point, light, self.tolerance) && meets(corners, point, light)
        })
    }
}

/// `shade.lookup`: V of every pixel that sees a surface, NaN elsewhere.
pub fn shade_hard(lookup: &Lookup<'_>, gbuffer: &GBuffer, visibility: &mut VisibilityImage) {
    let width = gbuffer.width.max(1) as usize;
    visibility.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        for (column, value) in values.iter_mut().enumerate() {
            *value = shade_pixel(lookup, gbuffer, row * width + column);
        }
    });
}

#[inline]
fn shade_pixel(lookup: &Lookup<'_>, gbuffer: &GBuffer, pixel: usize) -> f32 {
    if !gbuffer.is_seen(pixel) {
        return f32::NAN;
    }
    if !lookup.scene.objects()[gbuffer.object[pixel] as usize].flags.receives {
        return 1.0;
    }
    let (receiver, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
    let faces_light = match lookup.light.center() {
        LightPoint::At(place) => normal.dot(place - receiver) > 0.0,
        LightPoint::Towards(direction) => normal.dot(direction) > 0.0,
    };
    if !faces_light || !lookup.light.reaches(receiver) {
        return 0.0;
    }
    lookup.hard(receiver, normal, gbuffer.depth[pixel])
}
