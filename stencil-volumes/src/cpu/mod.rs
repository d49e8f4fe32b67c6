//! The CPU path: hierarchical counting.
//!
//! The image is cut into blocks of 64 × 64 pixels and these into tiles of 8 × 8. Within a tile the count changes only
//! where a side passes through the box around what the tile sees, or where a silhouette edge passes before it
//! ([`crate::outline`]). A tile with neither takes one count for all its pixels. Tiles are joined by chords between one
//! pixel of each, and the first tile of a block is counted from the eye or from infinity ([`crate::volumes`]). So work
//! grows with the number of silhouette edges and the length of the shadows' outlines, not with the area of the sides.
//!
//! Casters with cut-out masks are not counted ([`crate::masked`]). A few pixels are not counted but traced: those in tiles of
//! very many sides, where rays cost less; those closer than 1/128 pixel to a silhouette edge; those behind a caster that the near
//! plane cut; those whose ray starts at a place that is seen beside the pixel's centre ([`crate::outline::OFF_CENTER`]); and those
//! whose position lies beside the triangle it was found on. The rasteriser may take a triangle for seen up to 2⁻⁹ pixel beside it;
//! the position, on its plane, is then on no surface, perhaps behind a neighbour's, and what lies between the eye and it is not
//! known. That a tile's start lies behind nothing is asked of a ray to the eye: all its pixels hang on it.
//!
//! After Aila and Akenine-Möller, *A hierarchical shadow volume algorithm* (2004), which tests a tile's whole depth range
//! and counts non-boundary tiles at one pixel each by rasterising all sides there.

mod block;
pub mod planar;
mod tile;
mod traced;

use std::ops::AddAssign;

use fearless_simd::{Level, dispatch};
use rayon::prelude::*;
use scene_core::light::LightPoint;
use scene_core::{GBuffer, Light, Report, Scene, VisibilityImage};

use crate::volumes::Volumes;
use block::Block;

/// Pixels a side of a tile.
pub const TILE: usize = 8;
/// Tiles a side of a block.
pub const BLOCK_TILES: usize = 8;
/// Pixels a side of a block: the bits of one word.
pub const BLOCK: usize = TILE * BLOCK_TILES;

/// What counting cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Tiles with a pixel whose count was asked for.
    pub tiles: u64,
    /// Those that took one count for all pixels.
    pub uniform: u64,
    /// Pixels whose count was asked for.
    pub asked: u64,
    /// Seen pixels of receivers that the light cannot reach: it is behind them, or they are outside its cone.
    pub unreached: u64,
    /// Pixels that a ray decided.
    pub traced: u64,
    /// Lit pixels that a ray decided because a caster with a mask may be in the way.
    pub asked_of_masks: u64,
    /// Lit pixels with no such caster in the way, in a scene that has some.
    pub free_of_masks: u64,
    /// Pairs of a side or an edge on the screen and a tile that were counted pixel by pixel.
    pub pairs: u64,
    /// The same with each of the tile's pixels.
    pub pixel_pairs: u64,
    /// Pairs of a run of edges and a block whose edges were asked one by one.
    pub run_pairs: u64,
    /// Those of which bounds said that none matters there.
    pub runs_skipped: u64,
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.tiles += other.tiles;
        self.uniform += other.uniform;
        self.asked += other.asked;
        self.unreached += other.unreached;
        self.traced += other.traced;
        self.asked_of_masks += other.asked_of_masks;
        self.free_of_masks += other.free_of_masks;
        self.pairs += other.pairs;
        self.pixel_pairs += other.pixel_pairs;
        self.run_pairs += other.run_pairs;
        self.runs_skipped += other.runs_skipped;
    }
}

/// Which pixels' visibility is a question, and where they are.
#[derive(Clone, Copy, Debug)]
pub struct Receivers<'a> {
    /// Geometry.
    pub scene: &'a Scene,
    /// What is seen.
    pub gbuffer: &'a GBuffer,
    /// The light.
    pub light: &'a Light,
    /// Largest coordinate of the scene.
    pub magnitude: f32,
    /// Whether pixels that the light cannot reach are left out.
    pub skip_unlit: bool,
}

/// What is known of a pixel before any counting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// It sees nothing.
    Nothing,
    /// Its object does not receive shadows.
    Lit,
    /// The light is behind the surface or does not send there.
    Dark,
    /// It depends on the casters.
    Yes,
}

impl Receivers<'_> {
    /// What is known of a pixel.
    #[inline]
    pub fn ask(&self, pixel: usize) -> Asked {
        let gbuffer = self.gbuffer;
        if !gbuffer.is_seen(pixel) {
            return Asked::Nothing;
        }
        if !self.scene.objects()[gbuffer.object[pixel] as usize].flags.receives {
            return Asked::Lit;
        }
        let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
        let height = match self.light.center() {
            LightPoint::At(place) => normal.dot(place - position),
            LightPoint::Towards(direction) => normal.dot(direction),
        };
        if height > 0.0 && self.light.reaches(position) { Asked::Yes } else { Asked::Dark }
    }
}

/// Fills `visibility`, of the G-buffer's size: V where a surface is seen, NaN elsewhere.
pub fn shade(
    volumes: &Volumes,
    receivers: &Receivers<'_>,
    report: &mut Report,
    visibility: &mut VisibilityImage,
) -> Work {
    let (width, height) = (receivers.gbuffer.width as usize, receivers.gbuffer.height as usize);
    let (columns, rows) = (width.div_ceil(BLOCK), height.div_ceil(BLOCK));
    if columns * rows == 0 {
        return Work::default();
    }
    if volumes.all_dense {
        return traced::shade(volumes, receivers, report, visibility);
    }
    let level = Level::new();
    let mut blocks: Vec<Block> = report.time("shade.tiles", |_| {
        let blocks = (0..columns * rows).into_par_iter();
        blocks
            .map(|index| {
                let corner = [index % columns * BLOCK, index / columns * BLOCK];
                dispatch!(level, simd => Block::new(simd, volumes, receivers, corner))
            })
            .collect()
    });
    report.time("shade.starts", |_| {
        let starts: Vec<_> = blocks.iter().filter_map(|block| block.start).collect();
        let mut counts = vec![0; starts.len()];
        volumes.count_starts(&starts, &mut counts);
        let with_start = blocks.iter_mut().filter(|block| block.start.is_some());
        with_start.zip(counts).for_each(|(block, count)| block.start_count = count);
    });
    report.time("shade.count", |_| {
        blocks.par_iter_mut().for_each(|block| {
            dispatch!(level, simd => block.count(simd, volumes, receivers.light.center()));
        });
    });
    let mut work = Work::default();
    blocks.iter().for_each(|block| work += block.work);
    report.time("shade.write", |_| {
        visibility.values.par_chunks_mut(width).enumerate().for_each(|(y, values)| {
            for (x, value) in values.iter_mut().enumerate() {
                let block = &blocks[y / BLOCK * columns + x / BLOCK];
                let is_lit = block.lit[y % BLOCK] >> (x % BLOCK) & 1 == 1;
                let seen = receivers.gbuffer.is_seen(y * width + x);
                *value = if !seen {
                    f32::NAN
                } else if is_lit {
                    1.0
                } else {
                    0.0
                };
            }
        });
    });
    work
}
