//! The CPU path: tiles, the wedges that each is in, and the pixels in those.
//!
//! The image is cut into tiles of 8 × 8 pixels. What a tile sees is in a box, and a wedge outside of that box changes none of its
//! pixels; the others are asked again for each pixel (Szabó, 7.8: a stencil there, half-spaces here, which are
//! stricter, since they bound the wedge on all sides). Most edges are left out in runs, by the tile's [`Shaft`]; for
//! `interpolated`, whose wedges are wider, by boxes of whole strips of tiles and of runs of eight tiles first. Only pixels inside of a
//! wedge run the inner loop of [`exact`](crate::exact), [`coverage`](crate::coverage) or [`interpolated`](crate::interpolated). A tile in
//! very many wedges is traced, as in foliage: to find those of its pixels alone would take longer, too.

use fearless_simd::{Level, dispatch};
use glam::DVec3;
use rayon::prelude::*;
use scene_core::bvh::Bvh;
use scene_core::{GBuffer, Report, Scene, VisibilityImage};

use crate::coverage::Coverage;
use crate::exact::{Exact, Scratch, Work};
use crate::interpolated::Interpolated;
use crate::params::{Variant, WedgeParams};
use crate::receiver::{Asked, Receiver};
use crate::shaft::{EdgeGroups, Shaft};
use crate::wedge::Wedge;
use crate::wedges::Wedges;

/// Pixels a side of a tile.
pub const TILE: usize = 8;

/// Tiles of a run.
const RUN: usize = 8;

/// Edges for each sample of the light above which the pixels of a tile are traced. It decides about time alone, and not of much: from
/// two to four times as many edges as samples counting takes 1.17 of the time of tracing, from one to two .82 (README,
/// `--example what_culling_saves -- rays`).
pub const EDGES_A_RAY: usize = 4;

/// Parts of a tile with up to so many edges, or receivers, are halved no more: there is little to be left out.
const FEW_EDGES: usize = 64;

/// See [`FEW_EDGES`].
const FEW_RECEIVERS: usize = 4;

/// What answers for a receiver.
#[derive(Clone, Copy, Debug)]
pub enum Answer<'a> {
    /// Samples.
    Exact(Exact<'a>),
    /// Areas.
    Coverage(Coverage<'a>),
    /// Planes.
    Interpolated(Interpolated<'a>),
}

impl<'a> Answer<'a> {
    /// By what `wedges` were prepared for.
    pub fn new(scene: &'a Scene, tree: &'a Bvh, wedges: &'a Wedges, variant: Variant, skip: bool) -> Self {
        let all = Exact { scene, tree, wedges, skip };
        match (&wedges.middle, variant) {
            (Some(middle), Variant::Coverage) => Self::Coverage(Coverage { all, middle }),
            (Some(middle), Variant::Interpolated) => Self::Interpolated(Interpolated { all, middle }),
            _ => Self::Exact(all),
        }
    }

    /// V, by those of the edges that are in question.
    #[inline(always)]
    pub fn visibility(&self, receiver: &Receiver, edges: &[u32], scratch: &mut Scratch) -> f32 {
        let unclamped = match self {
            Self::Exact(exact) => return exact.visibility(receiver, edges, scratch),
            Self::Coverage(coverage) => coverage.unclamped(receiver, edges, &mut scratch.work),
            Self::Interpolated(planes) => Some(planes.unclamped(receiver, edges, &mut scratch.work)),
        };
        match unclamped {
            Some(v) => {
                let by_edges = v.clamp(0.0, 1.0) as f32;
                let (share, above) = self.as_exact().seen_of_traced(receiver, scratch);
                (by_edges * share).min(above)
            }
            None => self.as_exact().traced(receiver, scratch),
        }
    }

    /// The same wedges, to trace samples with.
    pub fn as_exact(&self) -> Exact<'a> {
        match *self {
            Self::Exact(all)
            | Self::Coverage(Coverage { all, .. })
            | Self::Interpolated(Interpolated { all, .. }) => all,
        }
    }
}

/// What a tile, a run or a strip sees.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    min: DVec3,
    max: DVec3,
}

impl Bounds {
    const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    fn with(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    fn is_empty(&self) -> bool {
        self.min.x > self.max.x
    }

    /// Middle and half size.
    #[inline(always)]
    fn middle(&self) -> (DVec3, DVec3) {
        ((self.min + self.max) * 0.5, (self.max - self.min) * 0.5)
    }
}

/// Puts into `kept` those of `edges` whose wedges touch a box.
#[inline(always)]
fn keep(wedges: &[Wedge], edges: impl Iterator<Item = u32>, bounds: &Bounds, kept: &mut Vec<u32>) {
    let (center, half) = bounds.middle();
    kept.clear();
    if !bounds.is_empty() {
        kept.extend(edges.filter(|&edge| wedges[edge as usize].touches(center, half)));
    }
}

/// The same for those of all edges whose groups the box's shaft does not miss, until there are more than `most`.
#[inline(always)]
fn keep_by_shaft(wedges: &Wedges, groups: &EdgeGroups, bounds: &Bounds, most: usize, kept: &mut Vec<u32>) {
    let (center, half) = bounds.middle();
    kept.clear();
    if bounds.is_empty() {
        return;
    }
    let shaft = Shaft::new(&wedges.light, center, half);
    for group in groups.not_missed(&shaft, wedges.wedges.len()) {
        kept.extend(group.filter(|&edge| wedges.wedges[edge].touches(center, half)).map(|edge| edge as u32));
        if kept.len() > most {
            return;
        }
    }
}

/// `shade.wedges`: V where a surface is seen, NaN elsewhere.
pub fn shade(
    answer: &Answer<'_>,
    gbuffer: &GBuffer,
    magnitude: f32,
    params: &WedgeParams,
    report: &mut Report,
    visibility: &mut VisibilityImage,
) -> Work {
    let width = gbuffer.width as usize;
    if width * gbuffer.height as usize == 0 {
        return Work::default();
    }
    let level = Level::new();
    report.time("shade.wedges", |_| {
        let strips = visibility.values.par_chunks_mut(width * TILE).enumerate();
        strips
            .map_init(Buffers::default, |buffers, (strip, values)| {
                let shader = Strip { answer, gbuffer, magnitude, params, first: strip * TILE * width };
                dispatch!(level, _simd => shader.shade(values, buffers));
                std::mem::take(&mut buffers.scratch.work)
            })
            .reduce(Work::default, |mut a, b| {
                a += b;
                a
            })
    })
}

/// A thread's buffers.
#[derive(Default)]
struct Buffers {
    scratch: Scratch,
    asked: Vec<Asked>,
    bounds: Vec<Bounds>,
    of_strip: Vec<u32>,
    of_run: Vec<u32>,
    of_tile: Vec<u32>,
    all: Vec<u32>,
    members: Vec<(u32, Receiver)>,
    parts: Vec<Part>,
}

/// Some receivers of a tile, and where the edges are listed that they are asked about.
#[derive(Clone, Copy)]
struct Part {
    first: usize,
    end: usize,
    from: usize,
    to: usize,
}

/// A row of tiles.
struct Strip<'a> {
    answer: &'a Answer<'a>,
    gbuffer: &'a GBuffer,
    magnitude: f32,
    params: &'a WedgeParams,
    /// The first pixel.
    first: usize,
}

impl Strip<'_> {
    #[inline(always)]
    fn shade(&self, values: &mut [f32], buffers: &mut Buffers) {
        let exact = self.answer.as_exact();
        let wedges = &exact.wedges.wedges;
        let width = self.gbuffer.width as usize;
        let Buffers { scratch, asked, bounds, of_strip, of_run, of_tile, all, members, parts } = buffers;
        if !self.params.skip && all.is_empty() {
            all.extend(0..wedges.len() as u32);
        }
        asked.clear();
        bounds.clear();
        bounds.resize(width.div_ceil(TILE), Bounds::EMPTY);
        for pixel in 0..values.len() {
            let known = Receiver::at(
                exact.scene,
                self.gbuffer,
                &exact.wedges.light,
                self.magnitude,
                self.first + pixel,
            );
            if let Asked::Yes(receiver) = &known {
                let tile = &mut bounds[pixel % width / TILE];
                let place = receiver.place();
                *tile = tile.with(Bounds { min: place, max: place });
            }
            asked.push(known);
        }
        let whole = bounds.iter().fold(Bounds::EMPTY, |sum, tile| sum.with(*tile));
        let groups = exact.wedges.groups.as_ref();
        let dense = self.dense();
        if groups.is_none() {
            keep(wedges, 0..wedges.len() as u32, &whole, of_strip);
        }
        for (run, tiles) in bounds.chunks(RUN).enumerate() {
            let whole = tiles.iter().fold(Bounds::EMPTY, |sum, tile| sum.with(*tile));
            if groups.is_none() {
                keep(wedges, of_strip.iter().copied(), &whole, of_run);
            }
            for (tile, bounds) in tiles.iter().enumerate() {
                if let Some(groups) = groups {
                    keep_by_shaft(exact.wedges, groups, bounds, dense, of_tile);
                } else {
                    keep(wedges, of_run.iter().copied(), bounds, of_tile);
                }
                let is_traced = of_tile.len() > dense;
                if !bounds.is_empty() {
                    scratch.work.tiles += 1;
                    scratch.work.free_tiles += u64::from(of_tile.is_empty());
                    if !is_traced {
                        scratch.work.wedges_left_out += (wedges.len() - of_tile.len()) as u64;
                    }
                }
                let first = (run * RUN + tile) * TILE;
                members.clear();
                for row in (0..values.len()).step_by(width) {
                    for pixel in row + first..row + (first + TILE).min(width) {
                        match &asked[pixel] {
                            Asked::Known(v) => values[pixel] = *v,
                            Asked::Dark => {
                                scratch.work.dark += 1;
                                values[pixel] = 0.0;
                            }
                            Asked::Yes(receiver) => members.push((pixel as u32, *receiver)),
                        }
                    }
                }
                if is_traced {
                    for (pixel, receiver) in &*members {
                        scratch.work.asked += 1;
                        values[*pixel as usize] = exact.traced(receiver, scratch);
                    }
                    continue;
                }
                let asked_of_all = (!self.params.skip).then_some(&all[..]);
                self.shade_parts(values, members, of_tile, asked_of_all, parts, scratch);
            }
        }
    }

    /// Edges above which a tile's receivers are traced, whatever is left out: a sample on an edge may be counted otherwise than it
    /// is traced.
    fn dense(&self) -> usize {
        let may_trace = self.params.rays && matches!(self.answer, Answer::Exact(_));
        if may_trace { EDGES_A_RAY * self.answer.as_exact().wedges.patterns[0].count } else { usize::MAX }
    }

    /// Shades a tile's receivers, halved by place as long as that may leave out edges: a tile often sees two surfaces far apart.
    /// `edges` holds the tile's, and lists of parts behind them. With `all` receivers are asked about these edges instead.
    #[inline(always)]
    fn shade_parts(
        &self,
        values: &mut [f32],
        members: &mut [(u32, Receiver)],
        edges: &mut Vec<u32>,
        all: Option<&[u32]>,
        parts: &mut Vec<Part>,
        scratch: &mut Scratch,
    ) {
        let wedges = &self.answer.as_exact().wedges.wedges;
        parts.clear();
        parts.push(Part { first: 0, end: members.len(), from: 0, to: edges.len() });
        while let Some(Part { first, end, from, to }) = parts.pop() {
            let members = &mut members[first..end];
            // Behind the list of the part that this one is a half of.
            edges.truncate(to);
            let bounds = members.iter().fold(Bounds::EMPTY, |sum, (_, receiver)| {
                let place = receiver.place();
                sum.with(Bounds { min: place, max: place })
            });
            let (center, half) = bounds.middle();
            let start = edges.len();
            for place in from..to {
                let edge = edges[place];
                if wedges[edge as usize].touches(center, half) {
                    edges.push(edge);
                }
            }
            let found = edges.len() - start;
            if found > FEW_EDGES && members.len() > FEW_RECEIVERS && half.max_element() > 0.0 {
                let axis = (0..3).max_by(|&a, &b| half[a].total_cmp(&half[b])).unwrap_or(0);
                let mut middle = 0;
                for member in 0..members.len() {
                    if members[member].1.place()[axis] <= center[axis] {
                        members.swap(member, middle);
                        middle += 1;
                    }
                }
                if middle > 0 && middle < members.len() {
                    let part = Part { first, end: first + middle, from: start, to: start + found };
                    parts.push(part);
                    parts.push(Part { first: part.end, end, ..part });
                    continue;
                }
            }
            for (pixel, receiver) in &*members {
                let edges = all.unwrap_or(&edges[start..]);
                values[*pixel as usize] = self.answer.visibility(receiver, edges, scratch);
            }
        }
    }
}
