//! `shade.penumbra`: a tile's receivers, block by block.
//!
//! A tile of the light's image holds receivers at many depths, with edges and faces for all of them. Its receivers are cut into
//! blocks of neighbours, and each block chooses from the edges and faces of the one that it is a part of those that reach
//! into its beam ([`beam`](crate::beam)), until few are left, or the last choice left out too few to pay for another. Then
//!
//! - a block that no edge reaches has no penumbra: with no face before any of its receivers, or one before all, it is answered
//!   as a whole, or else by faces alone, the hard test;
//! - of the others each receiver asks the edges and faces that are left, sixteen pairs of both at a time ([`sites`](crate::sites)).
//!
//! Whatever is left out would not have counted, so that the image is the same without blocks (`skip` off).

use fearless_simd::Simd;
use glam::{Vec2, Vec3};
use gnomon_shadow_map::light_maps::Receiver;
use scene_core::geometry::Aabb;

use crate::beam::Beam;
use crate::block_faces::{Before, BlockFaces};
use crate::chosen::Chosen;
use crate::coverage::Counter;
use crate::cpu::{before_center, by_map};
use crate::grid::TileLists;
use crate::lanes::LANES;
use crate::outer::{self, Kept};
use crate::params::Variant;
use crate::sites::{Sites, by_receivers};
use crate::tile_edges::TileEdges;
use crate::{PreparedDdoc, paper};

/// Receivers of a block that is not cut again: to choose edges costs as much as asking so many receivers about all of them.
pub(crate) const FEW_RECEIVERS: usize = 8;

/// Receivers of a block with edges at most.
const MOST_RECEIVERS: usize = 128;

/// Edges and faces from which none are chosen: sixteen receivers ask about each of them at once.
const FEW_EDGES: usize = 32;
const FEW_FACES: usize = 64;

/// What a thread keeps from tile to tile.
#[derive(Default)]
pub(crate) struct Thread {
    /// Edges and faces of the tile, and after them those of a block, of a part of that block, and so on.
    chosen: Vec<(Chosen<6>, Chosen<9>)>,
    /// Those that the block at hand is asked about.
    edges: TileEdges,
    faces: BlockFaces,
    /// Its receivers, and how many faces lie before the light's centre for each.
    sites: Sites,
    at_center: Vec<i32>,
    /// The tile's edges or faces by index.
    indices: Vec<u32>,
    /// The tile's receivers, and where their values go.
    receivers: Vec<(u32, Receiver)>,
    seen_edges: Seen,
    seen_faces: Seen,
    /// Blocks to come.
    blocks: Vec<Block>,
    counter: Counter,
    /// Receivers without an edge.
    pub(crate) without_edge: u64,
}

impl Thread {
    /// To count at these points of the light.
    pub(crate) fn new(points: &[Vec2]) -> Self {
        let mut thread = Self::default();
        thread.counter.set_points(points);
        thread
    }
}

/// Things of the tile at hand: lists of several tiles may name one more than once.
#[derive(Default)]
struct Seen {
    /// The tile, counted from 1, that a thing was last found in.
    of: Vec<u32>,
    turn: u32,
}

impl Seen {
    fn begin(&mut self, count: usize) {
        self.of.resize(count, 0);
        self.turn += 1;
    }

    /// Puts each of what is `listed` into `indices` once, instead of what is there.
    #[inline(always)]
    fn take_new(&mut self, listed: impl Iterator<Item = u32>, indices: &mut Vec<u32>) {
        indices.clear();
        let new =
            listed.filter(|&index| std::mem::replace(&mut self.of[index as usize], self.turn) != self.turn);
        // List by list: `extend` would ask across all tiles' lists for one after the other.
        new.for_each(|index| indices.push(index));
    }
}

/// Neighbouring receivers of a tile.
struct Block {
    receivers: std::ops::Range<usize>,
    /// Where the edges and faces are of the block that it is a part of.
    part_of: Option<usize>,
}

/// What a tile's receivers are answered from.
pub(crate) struct Tile<'p, 'a> {
    pub(crate) prepared: &'p PreparedDdoc<'a>,
    pub(crate) view: usize,
    pub(crate) splats: &'p TileLists,
    /// The grid that receivers are sorted by, and the tile of it.
    pub(crate) level: u32,
    pub(crate) tile: u32,
}

/// V of a tile's `receivers`, in their order.
#[inline(always)]
pub(crate) fn shade_tile<S: Simd>(
    simd: S,
    tile: &Tile<'_, '_>,
    receivers: &[u32],
    thread: &mut Thread,
    site: &(impl Fn(usize) -> Result<Receiver, f32> + Sync),
) -> Vec<f32> {
    let prepared = tile.prepared;
    let mut values = vec![0.0; receivers.len()];
    thread.receivers.clear();
    for (slot, &index) in receivers.iter().enumerate() {
        match site(index as usize) {
            Ok(receiver) => thread.receivers.push((slot as u32, receiver)),
            Err(known) => values[slot] = known,
        }
    }
    if prepared.skip && prepared.variant != Variant::Paper {
        shade_blocks(simd, tile, thread, &mut values);
    } else {
        thread.indices.clear();
        thread.indices.extend(tile.splats.of(tile.tile));
        thread.edges.gather(&prepared.edges, thread.indices.iter().copied());
        if thread.edges.is_empty() {
            thread.without_edge += thread.receivers.len() as u64;
        }
        thread.sites.place(&thread.receivers, prepared.origin);
        thread.sites.set_light(simd, &prepared.base.light);
        thread.at_center.clear();
        for (index, (_, receiver)) in thread.receivers.iter().enumerate() {
            let site = thread.sites.site(index);
            thread.at_center.push(before_center(prepared, tile.view, receiver, &site));
        }
        tile.answer(simd, 0..thread.receivers.len(), thread, &mut values);
    }
    values
}

#[inline(always)]
fn shade_blocks<S: Simd>(simd: S, tile: &Tile<'_, '_>, thread: &mut Thread, values: &mut [f32]) {
    let Tile { prepared, view, splats, level, tile: number } = *tile;
    let (scene, light, origin) = (prepared.base.scene.as_ref(), &prepared.base.light, prepared.origin);
    let (layers, lists) = (&prepared.layers[view], prepared.faces[view].lists());
    let by_map_too = !layers.is_clear(splats.grid().texels_within(level, number));
    let silhouettes = !matches!(prepared.variant, Variant::Smoothies | Variant::PenumbraMap);
    thread.seen_edges.begin(prepared.edges.len());
    thread.seen_faces.begin(scene.triangles().len());
    thread.blocks.clear();
    thread.blocks.push(Block { receivers: 0..thread.receivers.len(), part_of: None });
    while let Some(Block { receivers, part_of }) = thread.blocks.pop() {
        let held = &mut thread.receivers[receivers.clone()];
        let bounds = bounds_of(held, origin);
        let (mut to_light, mut to_center) = (None, None);
        if let Some(hull) = &prepared.hull {
            to_light = Beam::new(simd, &bounds, hull, origin);
        }
        let has_faces = part_of.is_none_or(|whole| thread.chosen[whole].1.len() > 0);
        if let Some(hull) = prepared.center_hull.as_ref().filter(|_| has_faces) {
            to_center = Beam::new(simd, &bounds, hull, origin);
        }
        // Those of a part lie one place above those of the whole.
        let place = part_of.map_or(0, |whole| whole + 1);
        if thread.chosen.len() == place {
            thread.chosen.push(Default::default());
        }
        let (below, above) = thread.chosen.split_at_mut(place);
        let (edges, faces) = &mut above[0];
        let mut of_whole = None;
        if let Some((edges_below, faces_below)) = below.last() {
            of_whole = Some(edges_below.len() + faces_below.len());
            edges.take_within(simd, edges_below, to_light.as_ref(), Vec3::ZERO);
            faces.take_within(simd, faces_below, to_center.as_ref(), origin);
        } else {
            let indices = &mut thread.indices;
            thread.seen_edges.take_new(splats.of_all_within(level, number), indices);
            let ends = |index: u32| {
                let edge = &prepared.edges[index as usize];
                [edge.a.x, edge.a.y, edge.a.z, edge.b.x, edge.b.y, edge.b.z]
            };
            edges.gather(simd, indices, ends, to_light.as_ref(), Vec3::ZERO);
            thread.seen_faces.take_new(lists.of_all_within(level, number), indices);
            let corners = |index: u32| {
                let [a, b, c] = scene.corners(index as usize);
                [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z]
            };
            faces.gather(simd, indices, corners, to_center.as_ref(), origin);
        }
        let is_small = held.len() <= FEW_RECEIVERS
            || edges.len() <= FEW_EDGES
                && faces.len() <= FEW_FACES
                && (edges.len() == 0 || held.len() <= MOST_RECEIVERS);
        let is_settled = held.len() <= MOST_RECEIVERS
            && of_whole.is_some_and(|whole| costs_more(held.len(), whole, edges.len() + faces.len()));
        // Without a beam no part has less than the whole.
        if !is_small && !is_settled && to_light.is_some() {
            let middle = receivers.start + split(held, &bounds, origin);
            thread.blocks.push(Block { receivers: middle..receivers.end, part_of: Some(place) });
            thread.blocks.push(Block { receivers: receivers.start..middle, part_of: Some(place) });
            continue;
        }
        let held = &thread.receivers[receivers.clone()];
        thread.sites.place(held, origin);
        thread.edges.gather(&prepared.edges, edges.indices().iter().copied());
        thread.edges.keep_for(simd, &thread.sites, silhouettes);
        thread.faces.gather(simd, faces, origin, light.center());
        let before = thread.faces.keep_for(simd, &thread.sites, &bounds, (light, origin));
        if thread.edges.is_empty() {
            thread.without_edge += held.len() as u64;
            // Behind the light's plane nothing is taken to lie before the centre.
            let known = match before {
                Before::None => Some(1.0),
                Before::All if layers.image.is_before(&bounds, origin) => Some(0.0),
                _ => None,
            };
            if let Some(v) = known.filter(|_| !by_map_too) {
                held.iter().for_each(|(slot, _)| values[*slot as usize] = v);
                continue;
            }
        }
        thread.sites.set_light(simd, light);
        thread.at_center.clear();
        thread.at_center.resize(held.len(), 0);
        thread.faces.add_before(simd, &thread.sites, &mut thread.at_center);
        for (count, (_, receiver)) in thread.at_center.iter_mut().zip(held) {
            match layers.image.place(receiver.point) {
                Some(place) if by_map_too => *count += by_map(prepared, view, receiver, place),
                Some(_) => {}
                None => *count = 0,
            }
        }
        tile.answer(simd, receivers, thread, values);
    }
}

/// Whether to choose again, for the parts of a block, costs more than it saves: asking all of its receivers about those that are
/// left out then. They are taken to be the share that was left out last, when of the `whole` block's edges and faces `kept`
/// were chosen: the smaller blocks are beside the penumbra's width, the less sets them apart.
fn costs_more(receivers: usize, whole: usize, kept: usize) -> bool {
    receivers * (whole - kept) <= FEW_RECEIVERS * whole
}

/// Brings the receivers on one side of the middle of their box to the front, and says how many these are; half of all where all lie
/// on one side.
fn split(receivers: &mut [(u32, Receiver)], bounds: &Aabb, origin: Vec3) -> usize {
    let axis = bounds.size().max_position();
    let middle = bounds.center()[axis] + origin[axis];
    let mut below = 0;
    for index in 0..receivers.len() {
        if receivers[index].1.point[axis] < middle {
            receivers.swap(index, below);
            below += 1;
        }
    }
    if below == 0 || below == receivers.len() { receivers.len() / 2 } else { below }
}

/// The box around receivers, relative to the origin. A difference rounded is the least where the number was.
#[inline(always)]
fn bounds_of(receivers: &[(u32, Receiver)], origin: Vec3) -> Aabb {
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for (_, receiver) in receivers {
        (min, max) = (min.min(receiver.point), max.max(receiver.point));
    }
    Aabb { min: min - origin, max: max - origin }
}

impl Tile<'_, '_> {
    /// V of the receivers in a range, which are those of `thread.sites`, from what is at hand.
    #[inline(always)]
    fn answer<S: Simd>(
        &self,
        simd: S,
        receivers: std::ops::Range<usize>,
        thread: &mut Thread,
        values: &mut [f32],
    ) {
        let Thread { sites, edges, at_center, counter, indices, .. } = thread;
        let (prepared, sites, edges) = (self.prepared, &*sites, &*edges);
        let counts = matches!(prepared.variant, Variant::Ddoc | Variant::ImageEdges);
        for (vector, held) in thread.receivers[receivers].chunks(LANES).enumerate() {
            let together = counts && by_receivers(held.len(), edges.len());
            if together {
                counter.set_receivers(simd, sites, vector, edges);
            }
            for (lane, (slot, receiver)) in held.iter().enumerate() {
                let index = vector * LANES + lane;
                let at_center = at_center[index];
                let hard = if at_center > 0 { 0.0 } else { 1.0 };
                let height = sites.height(index);
                let outer = |kept| outer::visible(kept, &sites.site(index), edges, hard);
                values[*slot as usize] = match (prepared.variant, height) {
                    (_, None) => hard,
                    (Variant::Ddoc | Variant::ImageEdges, Some(height)) => {
                        if !together {
                            counter.set_receiver(simd, sites, index, edges);
                        }
                        counter.visible(simd, if together { lane } else { 0 }, at_center, height)
                    }
                    (Variant::Smoothies, _) => outer(Kept::Nearest),
                    (Variant::PenumbraMap, _) => outer(Kept::Darkest),
                    (Variant::Paper, _) => {
                        let edges = indices.iter().map(|&edge| (edge, &prepared.edges[edge as usize]));
                        let (image, points) = (&prepared.layers[self.view].image, &prepared.points);
                        let light = (&prepared.base.light, prepared.hull.as_ref());
                        paper::visible(light, image, receiver, prepared.origin, edges, points, hard)
                    }
                };
            }
        }
    }
}
