//! Tiles of the image that a light reaches wholly or not at all, proved by shafts through the casters' tree.
//!
//! Blocks of 64 pixels are tried first and halved down to a tile as long as nothing is proved. A few rays tell which
//! proof is worth trying: where they disagree, none is.
//!
//! | class | proof |
//! | --- | --- |
//! | lit | all of the light lies above every receiver's tangent plane, and no caster reaches into the shaft between the receivers and the light |
//! | umbra | the light lies below the tangent planes, the receivers are outside a spot's cone, or [a sheet of casters](super::sheet) cuts the shaft in two |
//!
//! # Limits
//!
//! A proof takes the box around a tile's receivers, so a tile that sees two surfaces far apart, or a strongly curved one,
//! mostly stays mixed; so does one whose light comes through leaves, however dense.

use rayon::prelude::*;

use super::receiver_group::{Beam, ReceiverGroup};
use super::sheet::Sheets;
use super::tiles::{TileBounds, TileClass};
use crate::bvh::Bvh;
use crate::{GBuffer, Light, Report, Scene};

/// Tiles along the side of the first blocks: 64 pixels.
const BLOCK: u32 = 4;

/// What is known of every tile of an image, row by row as in [`TileBounds`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TileClasses {
    /// Tiles a row.
    pub columns: u32,
    /// Rows of tiles.
    pub rows: u32,
    /// One class a tile.
    pub classes: Vec<TileClass>,
}

impl TileClasses {
    /// Every tile mixed: what holds if nothing is asked.
    pub fn unknown(gbuffer: &GBuffer) -> Self {
        let (columns, rows) = (gbuffer.width.div_ceil(super::TILE), gbuffer.height.div_ceil(super::TILE));
        Self { columns, rows, classes: vec![TileClass::Mixed; columns as usize * rows as usize] }
    }

    /// The class of the tile that holds a pixel; [`TileClass::Mixed`] outside the image.
    #[inline]
    pub fn of_pixel(&self, x: u32, y: u32) -> TileClass {
        let (column, row) = (x / super::TILE, y / super::TILE);
        if column >= self.columns {
            return TileClass::Mixed;
        }
        self.classes.get((row * self.columns + column) as usize).copied().unwrap_or_default()
    }

    /// V of the receivers of the tile that holds a pixel, where it is proved: they need no lookup and no filter.
    #[inline]
    pub fn known(&self, x: u32, y: u32) -> Option<f32> {
        match self.of_pixel(x, y) {
            TileClass::Lit => Some(1.0),
            TileClass::Umbra => Some(0.0),
            TileClass::Empty | TileClass::Mixed => None,
        }
    }

    /// How many tiles are of a class.
    pub fn count(&self, class: TileClass) -> usize {
        self.classes.iter().filter(|&&c| c == class).count()
    }

    /// Books the tiles that need no filter.
    pub fn book(&self, report: &mut Report) {
        report.skip("lit tiles", self.count(TileClass::Lit) as u64);
        report.skip("umbra tiles", self.count(TileClass::Umbra) as u64);
    }
}

/// Classes of the tiles of `gbuffer` under `light`, all of whose extent counts.
///
/// In a [`TileClass::Lit`] tile ground truth has V = 1 at every pixel of a receiver, in an [`TileClass::Umbra`] tile V = 0,
/// whatever samples it takes; objects that do not receive are lit in both. `casters` must be [`Bvh::casters`] of `scene`,
/// `tiles` of this G-buffer ([`TileBounds::of_receivers`] or [`TileBounds::of`]): a tile that it says sees nothing is
/// [`TileClass::Empty`]. Tiles with positions that are not finite or lie outside the scene are mixed, and so are all
/// tiles under a light that is too wide or not finite.
///
/// A technique asks once a frame, writes 1 or 0 in proved tiles and filters the others:
///
/// ```
/// use gnomon_scene_core::bvh::Bvh;
/// use gnomon_scene_core::relevance::{TileBounds, TileClass, classify_tiles};
/// use gnomon_scene_core::{Report, raster, scenes};
///
/// let setup = scenes::build("cornell", 0.0)?;
/// let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
/// let bvh = Bvh::casters(&setup.scene);
/// let tiles = TileBounds::of_receivers(&setup.scene, &gbuffer);
/// let classes = classify_tiles(&setup.scene, &bvh, &setup.lights[0], &gbuffer, &tiles);
/// let mut report = Report::default();
/// classes.book(&mut report);
/// assert!(report.skipped["lit tiles"] + report.skipped["umbra tiles"] > 50);
/// // Receivers of that tile take this value without a lookup; `None` is to be filtered.
/// let known: Option<f32> = classes.known(300, 20);
/// assert_eq!(known.is_some(), matches!(classes.of_pixel(300, 20), TileClass::Lit | TileClass::Umbra));
/// # Ok::<(), gnomon_scene_core::scenes::SceneSpecError>(())
/// ```
///
/// Leaving the filter out changes nothing where the technique says 1 when no caster is in the way and 0 when all of the
/// light is hidden. One that is wrong there (by acne, a leak, a light taken for its centre) gets better instead.
pub fn classify_tiles(
    scene: &Scene,
    casters: &Bvh,
    light: &Light,
    gbuffer: &GBuffer,
    tiles: &TileBounds,
) -> TileClasses {
    let mut classes = TileClasses::unknown(gbuffer);
    if (tiles.columns, tiles.rows) != (classes.columns, classes.rows) {
        return classes;
    }
    let Some(beam) = Beam::new(scene, light) else {
        for (class, tile) in classes.classes.iter_mut().zip(&tiles.tiles) {
            if tile.seen == 0 {
                *class = TileClass::Empty;
            }
        }
        return classes;
    };
    let classifier = Classifier { scene, casters, beam, gbuffer, tiles };
    let blocks_x = classes.columns.div_ceil(BLOCK);
    let blocks = blocks_x * classes.rows.div_ceil(BLOCK);
    let found: Vec<_> = (0..blocks)
        .into_par_iter()
        .map_init(Scratch::default, |scratch, block| {
            classifier.block(block % blocks_x * BLOCK, block / blocks_x * BLOCK, scratch)
        })
        .collect();
    for (block, found) in found.into_iter().enumerate() {
        let (x, y) = (block as u32 % blocks_x * BLOCK, block as u32 / blocks_x * BLOCK);
        for (place, class) in found.into_iter().enumerate() {
            let (column, row) = (x + place as u32 % BLOCK, y + place as u32 / BLOCK);
            if column < classes.columns && row < classes.rows {
                classes.classes[(row * classes.columns + column) as usize] = class;
            }
        }
    }
    classes
}

struct Classifier<'a> {
    scene: &'a Scene,
    casters: &'a Bvh,
    beam: Beam,
    gbuffer: &'a GBuffer,
    tiles: &'a TileBounds,
}

/// A thread's buffers.
#[derive(Default)]
struct Scratch {
    groups: Vec<ReceiverGroup>,
    sheets: Sheets,
}

/// The tiles of a block, row by row.
type BlockClasses = [TileClass; (BLOCK * BLOCK) as usize];

impl Classifier<'_> {
    /// Classes of the block whose first tile is (`x`, `y`).
    fn block(&self, x: u32, y: u32, scratch: &mut Scratch) -> BlockClasses {
        scratch.groups.clear();
        for place in 0..BLOCK * BLOCK {
            let (column, row) = (x + place % BLOCK, y + place / BLOCK);
            let inside = column < self.tiles.columns && row < self.tiles.rows;
            let seen = inside && self.tiles.tiles[(row * self.tiles.columns + column) as usize].seen > 0;
            let group = if seen {
                self.beam.gather(self.scene, self.casters, self.gbuffer, column, row)
            } else {
                ReceiverGroup::EMPTY
            };
            scratch.groups.push(group);
        }
        let mut classes = [TileClass::Empty; (BLOCK * BLOCK) as usize];
        self.part(0, 0, BLOCK, scratch, &mut classes);
        classes
    }

    /// Classes of a square part of a block, `side` tiles wide.
    fn part(&self, x: u32, y: u32, side: u32, scratch: &mut Scratch, classes: &mut BlockClasses) {
        let places = |place: u32| ((y + place / side) * BLOCK + x + place % side) as usize;
        let group = (0..side * side)
            .map(|place| scratch.groups[places(place)])
            .fold(ReceiverGroup::EMPTY, ReceiverGroup::with);
        let class = self.class_of(&group, &mut scratch.sheets);
        if class == TileClass::Mixed && side > 1 {
            let half = side / 2;
            for (dx, dy) in [(0, 0), (half, 0), (0, half), (half, half)] {
                self.part(x + dx, y + dy, half, scratch, classes);
            }
            return;
        }
        for place in (0..side * side).map(places) {
            classes[place] = if scratch.groups[place].is_empty() { TileClass::Empty } else { class };
        }
    }

    fn class_of(&self, group: &ReceiverGroup, sheets: &mut Sheets) -> TileClass {
        if group.is_empty() {
            return TileClass::Empty;
        }
        if group.is_dark() {
            return TileClass::Umbra;
        }
        let may_be_lit = group.may_be_lit();
        if !may_be_lit && !group.may_be_umbra() {
            return TileClass::Mixed;
        }
        let shaft = self.beam.shaft(group);
        if may_be_lit {
            if self.casters.misses(shaft.sides()) { TileClass::Lit } else { TileClass::Mixed }
        } else if sheets.cut(self.scene, self.casters, &self.beam, group.origins(), &shaft) {
            TileClass::Umbra
        } else {
            TileClass::Mixed
        }
    }
}
