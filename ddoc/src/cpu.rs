//! The CPU path: one function a stage.

use std::sync::atomic::{AtomicU64, Ordering};

use fearless_simd::{Level, dispatch};
use glam::Vec2;
use gnomon_shadow_map::light_maps::Receiver;
use rayon::prelude::*;
use scene_core::raster::{DepthOptions, Fragments, RasterScratch, render_fragments};
use scene_core::{Report, Scene};

use crate::PreparedDdoc;
use crate::blocks::{FEW_RECEIVERS, Thread, Tile, shade_tile};
use crate::coverage::Site;
use crate::distortion_map::{FEW_TILES, Farthest, distortion_map};
#[cfg(feature = "gpu")]
use crate::grid::Grid;
use crate::grid::TileLists;
use crate::layers::{Layers, Placed};
use crate::light_image::LightImage;
use crate::params::Variant;
use crate::silhouettes::Edge;
use crate::tiles::{TileReceivers, Tiles};

/// Edges and faces that take as long to take over as a receiver does to answer.
const TAKEN_A_RECEIVER: usize = 4;

/// `prepare.map`: every face of `casters` over every texel's centre, a view each.
pub fn draw_layers(
    scene: &Scene,
    casters: &[std::ops::Range<usize>],
    images: &[LightImage],
    single: bool,
) -> Vec<Layers> {
    let (options, mut scratch) =
        (DepthOptions { triangles: Some(casters), ..Default::default() }, RasterScratch::new());
    let draw = |&image: &LightImage| {
        let matrix = image.view.projection_from_world;
        let fragments: Fragments = if casters.is_empty() {
            Fragments::default()
        } else {
            render_fragments(scene, matrix, image.size, image.size, &options, &mut scratch)
        };
        Layers::new(image, fragments, single)
    };
    images.iter().map(draw).collect()
}

/// All stages of `shade`: V of each of `values.len()` receivers, which `site` knows.
pub fn shade(
    prepared: &PreparedDdoc<'_>,
    values: &mut [f32],
    report: &mut Report,
    site: impl Fn(usize) -> Result<Receiver, f32> + Sync,
) {
    let images: Vec<LightImage> = prepared.layers.iter().map(|layers| layers.image).collect();
    let lone = images.len() == 1;
    let tiles = report.time("shade.receivers", |_| Tiles::new(&images, lone, values, &site));
    let maps = report.time("shade.splat", |_| splats(prepared, &tiles.farthest, FEW_TILES));
    if prepared.skip {
        report.skip("splats", maps.iter().map(|map| map.left_out).sum());
    }
    report.bytes += maps.iter().map(|map| map.bytes() as u64).sum::<u64>();
    report.time("shade.penumbra", |report| penumbra(prepared, &tiles, &maps, values, report, &site));
}

/// `shade.splat`: the splats of each view, over receivers as far as these; those over a `few` tiles are not cut.
fn splats(prepared: &PreparedDdoc<'_>, farthest: &[Farthest], few: u32) -> Vec<TileLists> {
    let (edges, origin) = (&prepared.edges, prepared.origin);
    // A light without extent has no penumbrae: no receiver asks for an edge.
    let is_asked = !prepared.skip || prepared.base.light.is_extended();
    let ends = |edge: usize| [edges[edge].a + origin, edges[edge].b + origin];
    let splat = |(layers, farthest): (&Layers, &Farthest)| {
        let image = &layers.image;
        let reach = |edge: usize| {
            let is_paper = prepared.variant == Variant::Paper;
            is_paper.then(|| image.along(edges[edge].far + origin))
        };
        let (hull, skip) = (prepared.hull.as_ref(), prepared.skip.then_some(few));
        distortion_map(image, &ends, &reach, if is_asked { edges.len() } else { 0 }, hull, farthest, skip)
    };
    prepared.layers.iter().zip(farthest).map(splat).collect()
}

/// The same over all surfaces of the scene that receive shadows: these hold for any camera.
#[cfg(feature = "gpu")]
pub(crate) fn splats_for_any_camera(prepared: &PreparedDdoc<'_>) -> Vec<TileLists> {
    let lone = prepared.layers.len() == 1;
    let of_scene = |layers: &Layers| {
        let grid = Grid::new(layers.image.size, lone);
        Farthest::of_scene(prepared.base.scene.as_ref(), &layers.image, grid)
    };
    let farthest: Vec<_> = prepared.layers.iter().map(of_scene).collect();
    // These lists are gone through every frame, by every pixel: any cut pays.
    splats(prepared, &farthest, 1)
}

/// `shade.penumbra`: all receivers, tile by tile.
fn penumbra(
    prepared: &PreparedDdoc<'_>,
    tiles: &Tiles,
    maps: &[TileLists],
    values: &mut [f32],
    report: &mut Report,
    site: &(impl Fn(usize) -> Result<Receiver, f32> + Sync),
) {
    // Edges are looked up once for many receivers where each block of them then chooses its own.
    let is_chosen = prepared.skip && prepared.variant != Variant::Paper;
    let level = if is_chosen { maps.first().map_or(0, |map| (map.grid().levels() - 1).min(1)) } else { 0 };
    // Not for so many that blocks would be cut below the finest tiles all over, which have their edges listed; but what lies over all of these
    // alike each of them takes over for itself.
    let is_cut = |view: usize, tile: u32, receivers: usize, finest: usize| {
        let shared = || {
            let [splats, faces] = [&maps[view], prepared.faces[view].lists()];
            splats.over_all_of(level, tile) + faces.over_all_of(level, tile)
        };
        level > 0
            && receivers > 2 * FEW_RECEIVERS * finest
            && shared() * finest <= TAKEN_A_RECEIVER * receivers
    };
    let (sorted, ranges) = tiles.sorted(level, is_cut);
    let simd_level = Level::new();
    let without_edge = AtomicU64::new(0);
    let parts: Vec<Vec<f32>> = ranges
        .par_iter()
        .map_init(
            || Thread::new(&prepared.points),
            |thread, tile| {
                let receivers = &sorted[tile.range.clone()];
                let TileReceivers { view, level, tile, .. } = *tile;
                let tile = Tile { prepared, view, splats: &maps[view], level, tile };
                let values = dispatch!(simd_level, simd => shade_tile(simd, &tile, receivers, thread, site));
                without_edge.fetch_add(std::mem::take(&mut thread.without_edge), Ordering::Relaxed);
                values
            },
        )
        .collect();
    for (&index, v) in sorted.iter().zip(parts.iter().flatten()) {
        values[index as usize] = *v;
    }
    if prepared.skip {
        report.skip("receivers without a splat", without_edge.into_inner());
    }
}

/// How many faces lie between a receiver and the light's centre: the solid ones, those of masks, or what the map shows.
pub(crate) fn before_center(
    prepared: &PreparedDdoc<'_>,
    view: usize,
    receiver: &Receiver,
    site: &Site,
) -> i32 {
    let Some(place) = prepared.layers[view].image.place(receiver.point) else { return 0 };
    let (scene, center) = (prepared.base.scene.as_ref(), prepared.base.light.center());
    prepared.faces[view].before(scene, receiver, (site, prepared.origin), place, center)
        + by_map(prepared, view, receiver, place)
}

/// Of them those that the map alone knows, over a receiver's place in the image.
pub(crate) fn by_map(prepared: &PreparedDdoc<'_>, view: usize, receiver: &Receiver, place: Vec2) -> i32 {
    let layers = &prepared.layers[view];
    let center = prepared.base.light.center();
    let placed = Placed { receiver, place };
    let ends = |edge: u32| {
        let Edge { a, b, far, .. } = prepared.edges[edge as usize];
        [a, b, far].map(|end| end + prepared.origin)
    };
    layers.at_texel(prepared.base.scene.as_ref(), &placed, center) + layers.carried(&placed, center, ends)
}
