//! The CPU path: one function a stage.

use std::sync::atomic::{AtomicU64, Ordering};

use fearless_simd::{Level, Simd, dispatch};
use glam::Vec3;
use gnomon_shadow_map::light_cone::LightCone;
use gnomon_shadow_map::light_maps::Receiver;
use rayon::prelude::*;
use scene_core::light::LightPoint;
use scene_core::raster::{DepthOptions, Fragments, RasterScratch, render_fragments};
use scene_core::{Light, Report, Scene};

use crate::coverage::{Counter, Site, TileEdges};
use crate::distortion_map::{DistortionMap, Farthest};
use crate::layers::{CenterEdge, Layers, Placed};
use crate::light_image::LightImage;
use crate::outer::{self, Kept};
use crate::params::Variant;
use crate::silhouettes::Edge;
use crate::tiles::{TileReceivers, Tiles};
use crate::{PreparedDdoc, paper};

/// `prepare.map`: every face over every texel, a view each.
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
        let fragments: Fragments =
            render_fragments(scene, matrix, image.size, image.size, &options, &mut scratch);
        Layers { image, fragments, single }
    };
    images.iter().map(draw).collect()
}

/// `prepare.silhouettes`: the edges that the light's centre sees as silhouettes, in each view's image; one an edge, of
/// multiplicity 0 for the others.
pub fn center_edges(images: &[LightImage], edges: &[Edge], origin: Vec3) -> Vec<Vec<CenterEdge>> {
    let in_image = |image: &LightImage| {
        let place = |(index, edge): (usize, &Edge)| {
            let ends =
                (edge.from_center != 0).then(|| image.snapped([edge.a + origin, edge.b + origin])).flatten();
            let multiplicity = if ends.is_some() { edge.from_center } else { 0 };
            CenterEdge { ends: ends.unwrap_or_default(), multiplicity, edge: index as u32 }
        };
        edges.par_iter().enumerate().map(place).collect()
    };
    images.iter().map(in_image).collect()
}

/// What a thread keeps from tile to tile.
#[derive(Default)]
struct Thread {
    edges: TileEdges,
    center: Vec<CenterEdge>,
    /// The same edges by index.
    indices: Vec<u32>,
    counter: Counter,
    /// Whether the counter's points are those of all receivers.
    has_points: bool,
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
    let maps: Vec<DistortionMap> = report.time("shade.splat", |_| {
        let (edges, origin) = (&prepared.edges, prepared.origin);
        let ends = |edge: usize| [edges[edge].a + origin, edges[edge].b + origin];
        let splat = |(image, farthest): (&LightImage, &Farthest)| {
            let reach = |edge: usize| {
                let is_paper = prepared.variant == Variant::Paper;
                is_paper.then(|| image.along(edges[edge].far + origin))
            };
            let (hull, skip) = (prepared.hull.as_ref(), prepared.skip);
            DistortionMap::new(image, &ends, &reach, edges.len(), hull, farthest, skip)
        };
        images.iter().zip(&tiles.farthest).map(splat).collect()
    });
    if prepared.skip {
        report.skip("splats", maps.iter().map(|map| map.left_out).sum());
    }
    report.bytes += maps.iter().map(|map| map.bytes() as u64).sum::<u64>();
    report.time("shade.hard", |report| hard(prepared, &tiles, &maps, values, report, &site));
    report.time("shade.penumbra", |_| penumbra(prepared, &tiles, &maps, values, &site));
}

/// `shade.hard`: receivers in tiles that no splat reaches.
fn hard(
    prepared: &PreparedDdoc<'_>,
    tiles: &Tiles,
    maps: &[DistortionMap],
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
                let layers = &prepared.layers[view];
                let at_center = layers.image.place(receiver.point).map_or(0, |place| {
                    let placed = Placed { receiver: &receiver, place };
                    layers.at_texel(prepared.base.scene, &placed, prepared.base.light.center())
                });
                *value = if at_center > 0 { 0.0 } else { 1.0 };
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
    maps: &[DistortionMap],
    values: &mut [f32],
    site: &(impl Fn(usize) -> Result<Receiver, f32> + Sync),
) {
    let (sorted, ranges) = tiles.sorted(|view, tile| !maps[view].is_clear(tile));
    let level = Level::new();
    let parts: Vec<Vec<f32>> = ranges
        .par_iter()
        .map_init(Thread::default, |thread, tile| {
            let receivers = &sorted[tile.range.clone()];
            dispatch!(level, simd => shade_tile(simd, prepared, &maps[tile.view], tile, receivers, thread, site))
        })
        .collect();
    for (&index, v) in sorted.iter().zip(parts.iter().flatten()) {
        values[index as usize] = *v;
    }
}

#[inline(always)]
fn shade_tile<S: Simd>(
    simd: S,
    prepared: &PreparedDdoc<'_>,
    map: &DistortionMap,
    tile: &TileReceivers,
    receivers: &[u32],
    thread: &mut Thread,
    site: &(impl Fn(usize) -> Result<Receiver, f32> + Sync),
) -> Vec<f32> {
    thread.edges.clear();
    thread.center.clear();
    thread.indices.clear();
    for edge in map.of(tile.tile) {
        thread.edges.push(&prepared.edges[edge as usize]);
        thread.indices.push(edge);
        let center = prepared.center_edges[tile.view][edge as usize];
        if center.multiplicity != 0 {
            thread.center.push(center);
        }
    }
    thread.edges.pad();
    let splats = Tile { prepared, layers: &prepared.layers[tile.view] };
    receivers
        .iter()
        .map(|&index| match site(index as usize) {
            Ok(receiver) => splats.answer(simd, &receiver, thread),
            Err(known) => known,
        })
        .collect()
}

/// What a tile's receivers are answered from.
struct Tile<'p, 'a> {
    prepared: &'p PreparedDdoc<'a>,
    layers: &'p Layers,
}

impl Tile<'_, '_> {
    #[inline(always)]
    fn answer<S: Simd>(&self, simd: S, receiver: &Receiver, thread: &mut Thread) -> f32 {
        let prepared = self.prepared;
        let light = &prepared.base.light;
        let at_center = self.at_center(receiver, &thread.center, light.center());
        let hard = if at_center > 0 { 0.0 } else { 1.0 };
        let Some(cone) = LightCone::new(light, receiver.point) else { return hard };
        let is_parallel = matches!(light, Light::Directional { .. });
        let point = receiver.point - prepared.origin;
        let site = Site::new(point, receiver.normal, receiver.tolerance, &cone, is_parallel);
        // Only on a sphere do the points differ from receiver to receiver.
        if !thread.has_points || matches!(light, Light::Sphere { .. }) {
            thread.counter.set_points(prepared.points.iter().map(|&point| cone.share(point)));
            thread.has_points = true;
        }
        let taps = prepared.points.len();
        match prepared.variant {
            Variant::Ddoc | Variant::ImageEdges => {
                thread.counter.visible(simd, &site, &thread.edges, at_center, taps)
            }
            Variant::Smoothies => outer::visible(Kept::Nearest, &site, &thread.edges, hard),
            Variant::PenumbraMap => outer::visible(Kept::Darkest, &site, &thread.edges, hard),
            Variant::Paper => {
                let edges = thread.indices.iter().map(|&edge| (edge, &prepared.edges[edge as usize]));
                let (image, points) = (&self.layers.image, &prepared.points);
                let light = (light, prepared.hull.as_ref());
                paper::visible(light, image, receiver.point, prepared.origin, edges, points, hard)
            }
        }
    }

    fn at_center(&self, receiver: &Receiver, edges: &[CenterEdge], center: LightPoint) -> i32 {
        let Some(place) = self.layers.image.place(receiver.point) else { return 0 };
        let placed = Placed { receiver, place };
        let ends = |edge: u32| {
            let Edge { a, b, far, .. } = self.prepared.edges[edge as usize];
            [a, b, far].map(|end| end + self.prepared.origin)
        };
        let at_texel = self.layers.at_texel(self.prepared.base.scene, &placed, center);
        // A texel's splat is no edge between centres.
        if self.prepared.variant == Variant::Paper {
            return at_texel;
        }
        at_texel + self.layers.carried(&placed, center, edges, ends)
    }
}
