//! The CPU path: one function a stage.

use std::sync::atomic::{AtomicU64, Ordering};

use fearless_simd::{Level, Simd, dispatch};
use gnomon_shadow_map::light_cone::LightCone;
use gnomon_shadow_map::light_maps::Receiver;
use rayon::prelude::*;
use scene_core::geometry::Aabb;
use scene_core::raster::{DepthOptions, Fragments, RasterScratch, render_fragments};
use scene_core::{Light, Report, Scene};

use crate::beam::Beam;
use crate::coverage::{Counter, Site};
use crate::distortion_map::{Farthest, distortion_map};
#[cfg(feature = "gpu")]
use crate::grid::Grid;
use crate::grid::TileLists;
use crate::layers::{Layers, Placed};
use crate::light_image::LightImage;
use crate::outer::{self, Kept};
use crate::params::Variant;
use crate::silhouettes::Edge;
use crate::tile_edges::TileEdges;
use crate::tiles::Tiles;
use crate::{PreparedDdoc, paper};

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

/// What a thread keeps from tile to tile.
#[derive(Default)]
struct Thread {
    /// Edges of the tile, and after them those of a block, of a part of that block, and so on.
    edges: Vec<TileEdges>,
    /// The tile's by index.
    indices: Vec<u32>,
    /// The tile's receivers, and where their values go.
    receivers: Vec<(u32, Receiver)>,
    /// The tile, counted from 1, that an edge was last looked up for.
    seen: Vec<u32>,
    turn: u32,
    /// Blocks to come.
    blocks: Vec<Block>,
    counter: Counter,
    /// Whether the counter's points are those of all receivers.
    has_points: bool,
}

/// Neighbouring receivers of a tile.
struct Block {
    receivers: std::ops::Range<usize>,
    /// Where the edges are of the block that it is a part of.
    part_of: Option<usize>,
}

/// Receivers of a block that is not cut again: to choose edges costs as much as asking some receivers about all of them.
const FEW_RECEIVERS: usize = 8;

/// Edges from which none are chosen: as many as two vectors have lanes.
const FEW_EDGES: usize = 32;

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
    let maps = report.time("shade.splat", |_| splats(prepared, &tiles.farthest));
    if prepared.skip {
        report.skip("splats", maps.iter().map(|map| map.left_out).sum());
    }
    report.bytes += maps.iter().map(|map| map.bytes() as u64).sum::<u64>();
    report.time("shade.hard", |report| hard(prepared, &tiles, &maps, values, report, &site));
    report.time("shade.penumbra", |_| penumbra(prepared, &tiles, &maps, values, &site));
}

/// `shade.splat`: the splats of each view, over receivers as far as these.
fn splats(prepared: &PreparedDdoc<'_>, farthest: &[Farthest]) -> Vec<TileLists> {
    let (edges, origin) = (&prepared.edges, prepared.origin);
    let ends = |edge: usize| [edges[edge].a + origin, edges[edge].b + origin];
    let splat = |(layers, farthest): (&Layers, &Farthest)| {
        let image = &layers.image;
        let reach = |edge: usize| {
            let is_paper = prepared.variant == Variant::Paper;
            is_paper.then(|| image.along(edges[edge].far + origin))
        };
        let (hull, skip) = (prepared.hull.as_ref(), prepared.skip);
        distortion_map(image, &ends, &reach, edges.len(), hull, farthest, skip)
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
    splats(prepared, &farthest)
}

/// `shade.hard`: receivers in tiles that no splat reaches.
fn hard(
    prepared: &PreparedDdoc<'_>,
    tiles: &Tiles,
    maps: &[TileLists],
    values: &mut [f32],
    report: &mut Report,
    site: &(impl Fn(usize) -> Result<Receiver, f32> + Sync),
) {
    let answered = AtomicU64::new(0);
    values.par_chunks_mut(1 << 12).enumerate().for_each(|(chunk, values)| {
        let mut count = 0;
        // Neighbours mostly fall into the same tile.
        let mut last = (None, false);
        for (index, value) in values.iter_mut().enumerate() {
            let index = (chunk << 12) + index;
            let Some((view, tile)) = tiles.of(index) else { continue };
            if last.0 != Some((view, tile)) {
                last = (Some((view, tile)), maps[view].is_clear(tile));
            }
            if let (true, Ok(receiver)) = (last.1, site(index)) {
                let is_hidden = !is_below_nothing(prepared, view, &receiver)
                    && before_center(prepared, view, &receiver, &site_of(prepared, &receiver).0) > 0;
                *value = if is_hidden { 0.0 } else { 1.0 };
                count += 1;
            }
        }
        answered.fetch_add(count, Ordering::Relaxed);
    });
    if prepared.skip {
        report.skip("receivers without a splat", answered.into_inner());
    }
}

/// `shade.penumbra`: the others, tile by tile.
fn penumbra(
    prepared: &PreparedDdoc<'_>,
    tiles: &Tiles,
    maps: &[TileLists],
    values: &mut [f32],
    site: &(impl Fn(usize) -> Result<Receiver, f32> + Sync),
) {
    // Edges are looked up once for many receivers where each block of them then chooses its own.
    let is_chosen = prepared.skip && prepared.variant != Variant::Paper;
    let level = if is_chosen { maps.first().map_or(0, |map| (map.grid().levels() - 1).min(1)) } else { 0 };
    let (sorted, ranges) = tiles.sorted(level, |view, tile| !maps[view].is_clear(tile));
    let simd_level = Level::new();
    let parts: Vec<Vec<f32>> = ranges
        .par_iter()
        .map_init(Thread::default, |thread, tile| {
            let receivers = &sorted[tile.range.clone()];
            let splats = Tile { prepared, view: tile.view, map: &maps[tile.view], level, tile: tile.tile };
            dispatch!(simd_level, simd => shade_tile(simd, &splats, receivers, thread, site))
        })
        .collect();
    for (&index, v) in sorted.iter().zip(parts.iter().flatten()) {
        values[index as usize] = *v;
    }
}

#[inline(always)]
fn shade_tile<S: Simd>(
    simd: S,
    splats: &Tile<'_, '_>,
    receivers: &[u32],
    thread: &mut Thread,
    site: &(impl Fn(usize) -> Result<Receiver, f32> + Sync),
) -> Vec<f32> {
    let prepared = splats.prepared;
    let mut values = vec![0.0; receivers.len()];
    thread.receivers.clear();
    for (slot, &index) in receivers.iter().enumerate() {
        match site(index as usize) {
            Ok(receiver) => thread.receivers.push((slot as u32, receiver)),
            Err(known) => values[slot] = known,
        }
    }
    let is_paper = prepared.variant == Variant::Paper;
    if is_paper {
        thread.indices.clear();
        thread.indices.extend(splats.map.of(splats.tile));
    }
    let is_chosen = prepared.skip && !is_paper;
    thread.seen.resize(prepared.edges.len(), 0);
    thread.turn += 1;
    if thread.edges.is_empty() {
        thread.edges.push(TileEdges::default());
    }
    // Edges of the block that is at hand lie one place above those of the block that it is a part of.
    thread.blocks.clear();
    thread.blocks.push(Block { receivers: 0..thread.receivers.len(), part_of: None });
    while let Some(Block { receivers, part_of }) = thread.blocks.pop() {
        let held = &mut thread.receivers[receivers.clone()];
        let bounds = Aabb::from_points(held.iter().map(|(_, receiver)| receiver.point - prepared.origin));
        let hull = prepared.hull.as_ref().filter(|_| is_chosen);
        let beam = || hull.and_then(|hull| Beam::new(&bounds, hull, prepared.origin));
        let edges = match part_of {
            None => {
                let (seen, turn) = (&mut thread.seen, thread.turn);
                let indices = splats.map.of_all_within(splats.level, splats.tile);
                let new = indices.filter(|&index| std::mem::replace(&mut seen[index as usize], turn) != turn);
                thread.edges[0].gather(simd, &prepared.edges, new, beam().as_ref());
                0
            }
            Some(edges) if thread.edges[edges].len() <= FEW_EDGES => edges,
            Some(edges) => {
                if thread.edges.len() == edges + 1 {
                    thread.edges.push(TileEdges::default());
                }
                let (below, above) = thread.edges.split_at_mut(edges + 1);
                beam().map_or(edges, |beam| {
                    above[0].take_within(simd, &below[edges], &beam);
                    edges + 1
                })
            }
        };
        if is_chosen && held.len() > FEW_RECEIVERS && thread.edges[edges].len() > FEW_EDGES {
            let (middle, axis) = (held.len() / 2, bounds.size().max_position());
            held.select_nth_unstable_by(middle, |(_, a), (_, b)| a.point[axis].total_cmp(&b.point[axis]));
            let middle = receivers.start + middle;
            thread.blocks.push(Block { receivers: middle..receivers.end, part_of: Some(edges) });
            thread.blocks.push(Block { receivers: receivers.start..middle, part_of: Some(edges) });
            continue;
        }
        for index in receivers {
            let (slot, receiver) = thread.receivers[index];
            values[slot as usize] = splats.answer(simd, &receiver, thread, edges);
        }
    }
    values
}

/// What a tile's receivers are answered from.
struct Tile<'p, 'a> {
    prepared: &'p PreparedDdoc<'a>,
    view: usize,
    map: &'p TileLists,
    /// The grid that receivers are sorted by, and the tile of it.
    level: u32,
    tile: u32,
}

impl Tile<'_, '_> {
    #[inline(always)]
    fn answer<S: Simd>(&self, simd: S, receiver: &Receiver, thread: &mut Thread, edges: usize) -> f32 {
        let (prepared, edges) = (self.prepared, &thread.edges[edges]);
        let light = &prepared.base.light;
        let (site, cone) = site_of(prepared, receiver);
        let at_center = before_center(prepared, self.view, receiver, &site);
        let hard = if at_center > 0 { 0.0 } else { 1.0 };
        let Some(cone) = cone else { return hard };
        // Only on a sphere do the points differ from receiver to receiver.
        if !thread.has_points || matches!(light, Light::Sphere { .. }) {
            thread.counter.set_points(prepared.points.iter().map(|&point| cone.share(point)));
            thread.has_points = true;
        }
        let taps = prepared.points.len();
        match prepared.variant {
            Variant::Ddoc | Variant::ImageEdges => {
                thread.counter.visible(simd, &site, edges, at_center, taps)
            }
            Variant::Smoothies => outer::visible(Kept::Nearest, &site, edges, hard),
            Variant::PenumbraMap => outer::visible(Kept::Darkest, &site, edges, hard),
            Variant::Paper => {
                let edges = thread.indices.iter().map(|&edge| (edge, &prepared.edges[edge as usize]));
                let (image, points) = (&prepared.layers[self.view].image, &prepared.points);
                let light = (light, prepared.hull.as_ref());
                paper::visible(light, image, receiver, prepared.origin, edges, points, hard)
            }
        }
    }
}

/// A receiver as edges and faces see it, and its cone of lines to the light.
fn site_of(prepared: &PreparedDdoc<'_>, receiver: &Receiver) -> (Site, Option<LightCone>) {
    let (light, origin) = (&prepared.base.light, prepared.origin);
    let Some(cone) = LightCone::new(light, receiver.point) else {
        return (Site::without_cone(receiver, origin, light.center()), None);
    };
    let is_parallel = matches!(light, Light::Directional { .. });
    let point = receiver.point - origin;
    (Site::new(point, receiver.normal, receiver.tolerance, &cone, is_parallel), Some(cone))
}

/// Whether the map has nothing over the texel that a receiver falls into.
fn is_below_nothing(prepared: &PreparedDdoc<'_>, view: usize, receiver: &Receiver) -> bool {
    let (layers, faces) = (&prepared.layers[view], prepared.faces[view].lists());
    layers.fragments.is_empty()
        && layers
            .image
            .place(receiver.point)
            .is_none_or(|place| faces.is_clear(faces.grid().tile(Some(place))))
}

/// How many faces lie between a receiver and the light's centre: the solid ones, those of masks, or what the map shows.
fn before_center(prepared: &PreparedDdoc<'_>, view: usize, receiver: &Receiver, site: &Site) -> i32 {
    let (layers, scene) = (&prepared.layers[view], prepared.base.scene.as_ref());
    let Some(place) = layers.image.place(receiver.point) else { return 0 };
    let center = prepared.base.light.center();
    let placed = Placed { receiver, place };
    let ends = |edge: u32| {
        let Edge { a, b, far, .. } = prepared.edges[edge as usize];
        [a, b, far].map(|end| end + prepared.origin)
    };
    prepared.faces[view].before(scene, receiver, (site, prepared.origin), place, center)
        + layers.at_texel(scene, &placed, center)
        + layers.carried(&placed, center, ends)
}
