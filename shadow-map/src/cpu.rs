//! The CPU path's stages that variants share. What a variant does with a receiver is in the file named after it.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;
use scene_core::raster::{DepthOptions, RasterScratch, render_depth_and_triangles_into};
use scene_core::{GBuffer, Scene, VisibilityImage};

use crate::light_maps::{LightMaps, Receiver, ShadowMapView, Window};
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
    render_maps_into(scene, casters, views, None, size, &mut RasterScratch::new(), &mut maps);
    maps
}

/// [`render_maps`] with casters for each view, and the texels that matter. Where there are no casters the map is empty, and
/// not drawn.
pub fn render_maps_of(
    scene: &Scene,
    needs: &[(Vec<Range<usize>>, Option<Window>)],
    views: &[LightView],
    size: u32,
) -> Vec<ShadowMapView> {
    let mut scratch = RasterScratch::new();
    let draw = |(&view, (casters, window)): (&LightView, &(Vec<Range<usize>>, Option<Window>))| {
        if casters.is_empty() {
            return ShadowMapView::empty(view, size, window.as_ref());
        }
        let mut map = ShadowMapView::undrawn(view);
        render_map_into(scene, casters, view, size, window.as_ref(), &mut scratch, &mut map);
        map
    };
    views.iter().zip(needs).map(draw).collect()
}

/// [`render_maps`] into maps that are there already: what is drawn again and again allocates nothing.
pub fn render_maps_into(
    scene: &Scene,
    casters: &[Range<usize>],
    views: &[LightView],
    windows: Option<&[Window]>,
    size: u32,
    scratch: &mut RasterScratch,
    maps: &mut Vec<ShadowMapView>,
) {
    maps.truncate(views.len());
    for (index, &view) in views.iter().enumerate() {
        if index == maps.len() {
            maps.push(ShadowMapView::undrawn(view));
        }
        let window = windows.and_then(|windows| windows.get(index));
        render_map_into(scene, casters, view, size, window, scratch, &mut maps[index]);
    }
}

/// One map, or of one the texels that matter.
fn render_map_into(
    scene: &Scene,
    casters: &[Range<usize>],
    view: LightView,
    size: u32,
    window: Option<&Window>,
    scratch: &mut RasterScratch,
    target: &mut ShadowMapView,
) {
    let ShadowMapView { view: of, map, triangles, window: drawn } = target;
    *of = view;
    *drawn = window.cloned().unwrap_or([0..size, 0..size]);
    (map.width, map.height) = (size, size);
    let options = DepthOptions { triangles: Some(casters), window, ..Default::default() };
    render_depth_and_triangles_into(scene, view.projection_from_world, &options, scratch, map, triangles);
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

/// What a pixel sees, or its V where no lookup is needed. A call would cost as much as what it does.
#[inline(always)]
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

/// `prepare.ids`: the object of every texel's triangle, [`GBuffer::NOTHING`] where there is none; anything outside the
/// map's window.
pub fn object_ids(scene: &Scene, maps: &[ShadowMapView]) -> Vec<Vec<u32>> {
    let fill_ids = |ids: &mut [u32], triangles: &[u32], depths: &[f32]| {
        // Neighbours mostly see the same object.
        let (mut range, mut id) = (0..0, GBuffer::NOTHING);
        let id_of = |(&triangle, &depth): (&u32, &f32)| {
            if depth <= 0.0 {
                return GBuffer::NOTHING;
            }
            let triangle = triangle as usize;
            if !range.contains(&triangle) {
                id = scene.object_of(triangle);
                range = scene.objects()[id as usize].triangles.clone();
            }
            id
        };
        ids.iter_mut().zip(triangles.iter().zip(depths).map(id_of)).for_each(|(to, id)| *to = id);
    };
    let ids_of_map = |map: &ShadowMapView| {
        let (mut ids, width) = (vec![0; map.triangles.len()], (map.map.width as usize).max(1));
        let [columns, rows] = map.window.clone().map(|side| side.start as usize..side.end as usize);
        ids.par_chunks_mut(width).enumerate().skip(rows.start).take(rows.len()).for_each(|(row, ids)| {
            let line = row * width..(row + 1) * width;
            let (triangles, depths) = (&map.triangles[line.clone()], &map.map.depth[line]);
            fill_ids(&mut ids[columns.clone()], &triangles[columns.clone()], &depths[columns.clone()]);
        });
        ids
    };
    maps.iter().map(ids_of_map).collect()
}

/// `shade.lookup` for free points. What the longer slice has more is left alone.
pub fn answer_points(points: &[Vec3], visibility: &mut [f32], answer: impl Fn(Vec3) -> f32 + Sync) {
    visibility.par_iter_mut().zip(points).for_each(|(v, &point)| *v = answer(point));
}
