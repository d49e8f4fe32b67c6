//! The CPU path's stages that variants share. What a variant does with a receiver is in the file named after it.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;
use scene_core::raster::{DepthMap, DepthOptions, RasterScratch, render_depth_and_triangles_into};
use scene_core::{GBuffer, Scene, VisibilityImage};

use crate::light_maps::{LightMaps, Receiver, ShadowMapView};
use crate::light_views::LightView;
use crate::receiver_plane::view_tolerance;

/// `prepare.maps`: draws the casters, ranges of [`Scene::triangles`], as each view sees them.
pub fn render_maps(
    scene: &Scene,
    casters: &[Range<usize>],
    views: &[LightView],
    size: u32,
) -> Vec<ShadowMapView> {
    let mut maps = Vec::new();
    render_maps_into(scene, casters, views, size, &mut RasterScratch::new(), &mut maps);
    maps
}

/// [`render_maps`] with casters for each view. Where there are none the map is empty, and not drawn.
pub fn render_maps_of(
    scene: &Scene,
    casters: &[Vec<Range<usize>>],
    views: &[LightView],
    size: u32,
) -> Vec<ShadowMapView> {
    let (mut scratch, texels) = (RasterScratch::new(), size as usize * size as usize);
    let draw = |(&view, casters): (&LightView, &Vec<Range<usize>>)| {
        if casters.is_empty() {
            let map = DepthMap { width: size, height: size, depth: vec![0.0; texels] };
            return ShadowMapView { view, map, triangles: vec![GBuffer::NOTHING; texels] };
        }
        let mut drawn = Vec::new();
        render_maps_into(scene, casters, &[view], size, &mut scratch, &mut drawn);
        drawn.remove(0)
    };
    views.iter().zip(casters).map(draw).collect()
}

/// [`render_maps`] into maps that are there already: what is drawn again and again allocates nothing.
pub fn render_maps_into(
    scene: &Scene,
    casters: &[Range<usize>],
    views: &[LightView],
    size: u32,
    scratch: &mut RasterScratch,
    maps: &mut Vec<ShadowMapView>,
) {
    let options = DepthOptions { triangles: Some(casters), ..Default::default() };
    maps.truncate(views.len());
    for (index, &view) in views.iter().enumerate() {
        if index == maps.len() {
            maps.push(ShadowMapView { view, map: DepthMap::default(), triangles: Vec::new() });
        }
        let ShadowMapView { view: of, map, triangles } = &mut maps[index];
        *of = view;
        (map.width, map.height) = (size, size);
        let projection = view.projection_from_world;
        render_depth_and_triangles_into(scene, projection, &options, scratch, map, triangles);
    }
}

/// `shade.lookup`: V of every pixel that sees a surface, NaN elsewhere. `answer` is asked where it takes a lookup:
/// for receivers that face the light and are reached by it.
pub fn shade_pixels(
    maps: &LightMaps<'_>,
    gbuffer: &GBuffer,
    visibility: &mut VisibilityImage,
    answer: impl Fn(&Receiver) -> f32 + Sync,
) {
    let width = gbuffer.width.max(1) as usize;
    visibility.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        for (column, value) in values.iter_mut().enumerate() {
            *value = match receiver(maps, gbuffer, row * width + column) {
                Ok(receiver) => answer(&receiver),
                Err(known) => known,
            };
        }
    });
}

/// What a pixel sees, or its V where no lookup is needed.
#[inline]
pub fn receiver(maps: &LightMaps<'_>, gbuffer: &GBuffer, pixel: usize) -> Result<Receiver, f32> {
    if !gbuffer.is_seen(pixel) {
        return Err(f32::NAN);
    }
    let object = gbuffer.object[pixel];
    if !maps.scene.objects()[object as usize].flags.receives {
        return Err(1.0);
    }
    let (point, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
    if !maps.faces(point, normal) {
        return Err(0.0);
    }
    let tolerance = maps.tolerance + view_tolerance(gbuffer.depth[pixel]);
    let width = gbuffer.width as usize;
    let pixel = [(pixel % width) as u32, (pixel / width) as u32];
    Ok(Receiver { point, normal, object, tolerance, pixel })
}

/// `shade.filter`: as [`shade_pixels`], for answers that count what needed no filter. Returns their sum.
pub fn filter_pixels(
    maps: &LightMaps<'_>,
    gbuffer: &GBuffer,
    visibility: &mut VisibilityImage,
    answer: impl Fn(&Receiver, &mut u64) -> f32 + Sync,
) -> u64 {
    let width = gbuffer.width.max(1) as usize;
    let rows = visibility.values.par_chunks_mut(width).enumerate();
    rows.map(|(row, values)| {
        let mut count = 0;
        for (column, value) in values.iter_mut().enumerate() {
            *value = match receiver(maps, gbuffer, row * width + column) {
                Ok(receiver) => answer(&receiver, &mut count),
                Err(known) => known,
            };
        }
        count
    })
    .sum()
}

/// `shade.filter` for free points: each is answered as a small surface turned to the light's centre.
pub fn filter_points(
    maps: &LightMaps<'_>,
    points: &[Vec3],
    visibility: &mut [f32],
    answer: impl Fn(&Receiver) -> f32 + Sync,
) {
    answer_points(points, visibility, |point| {
        if !point.is_finite() {
            return f32::NAN;
        }
        if !maps.light.reaches(point) || maps.is_behind_backdrop(point) {
            return 0.0;
        }
        let (to_light, _) = maps.light.center().ray_from(point);
        let (normal, tolerance) = (to_light.normalize_or_zero(), maps.tolerance);
        answer(&Receiver { point, normal, object: GBuffer::NOTHING, tolerance, pixel: [0; 2] })
    });
}

/// `prepare.ids`: the object of every texel's triangle, [`GBuffer::NOTHING`] where there is none.
pub fn object_ids(scene: &Scene, maps: &[ShadowMapView]) -> Vec<Vec<u32>> {
    let ids_of = |triangles: &[u32]| {
        // Neighbours mostly see the same object.
        let (mut range, mut id) = (0..0, GBuffer::NOTHING);
        let id_of = |&triangle: &u32| {
            if triangle == GBuffer::NOTHING {
                return GBuffer::NOTHING;
            }
            let triangle = triangle as usize;
            if !range.contains(&triangle) {
                id = scene.object_of(triangle);
                range = scene.objects()[id as usize].triangles.clone();
            }
            id
        };
        triangles.iter().map(id_of).collect::<Vec<_>>()
    };
    let ids_of_map = |map: &ShadowMapView| {
        let rows = map.triangles.par_chunks((map.map.width as usize).max(1));
        rows.flat_map_iter(ids_of).collect()
    };
    maps.iter().map(ids_of_map).collect()
}

/// `shade.lookup` for free points. What the longer slice has more is left alone.
pub fn answer_points(points: &[Vec3], visibility: &mut [f32], answer: impl Fn(Vec3) -> f32 + Sync) {
    visibility.par_iter_mut().zip(points).for_each(|(v, &point)| *v = answer(point));
}
