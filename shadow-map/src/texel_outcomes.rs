//! What each texel that a patch is looked up in is to the patch: see [`patches`](crate::patches).

use glam::{DVec2, DVec3, Vec2, Vec3};
use scene_core::GBuffer;

use crate::light_maps::{LightMaps, ShadowMapView};
use crate::light_views::TexelBounds;
use crate::patches::{Form, Outcome, Patch, Questions, TILE};

/// Columns of a table, at most: a row's outcomes are the bits of two words.
const MOST_COLUMNS: usize = 64;
/// Texels of a table, at most.
const MOST_TEXELS: usize = 1024;

/// The texels around a patch in the one view that holds all of it.
#[derive(Clone, Debug, Default)]
pub struct TexelOutcomes {
    /// The view, an index into the maps.
    pub view: usize,
    /// Column and row of the first texel.
    pub first: [i32; 2],
    columns: usize,
    rows: Vec<Row>,
    /// Whether a texel is clear, and all rows over each other.
    has_clear: bool,
    has: Row,
}

/// A bit for each texel of a row, by what it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Row {
    /// [`Outcome::Blocks`].
    pub blocks: u64,
    /// [`Outcome::AtMostOwn`], and [`Outcome::AsOwn`].
    pub at_most_own: u64,
    /// [`Outcome::AtLeastOwn`], and [`Outcome::AsOwn`].
    pub at_least_own: u64,
    /// [`Outcome::IfBefore`].
    pub if_before: u64,
    /// [`Outcome::Unknown`].
    pub unknown: u64,
}

impl Row {
    /// Each word changed alike.
    #[inline]
    fn map(self, change: impl Fn(u64) -> u64) -> Self {
        let Self { blocks, at_most_own, at_least_own, if_before, unknown } = self;
        Self {
            blocks: change(blocks),
            at_most_own: change(at_most_own),
            at_least_own: change(at_least_own),
            if_before: change(if_before),
            unknown: change(unknown),
        }
    }

    /// Either's bits.
    fn union(self, other: Self) -> Self {
        Self {
            blocks: self.blocks | other.blocks,
            at_most_own: self.at_most_own | other.at_most_own,
            at_least_own: self.at_least_own | other.at_least_own,
            if_before: self.if_before | other.if_before,
            unknown: self.unknown | other.unknown,
        }
    }

    /// With what hangs on a pixel's own texel told by what that is.
    #[inline]
    #[must_use]
    pub fn told(self, own: Outcome) -> Self {
        let Self { blocks, at_most_own, at_least_own, if_before, unknown } = self;
        let (at_most, at_least) = (at_most_own & !at_least_own, at_least_own & !at_most_own);
        let [blocks_too, asked, untold] = match own {
            Outcome::Blocks => [at_least_own, at_most, 0],
            Outcome::Clear => [0, 0, at_least],
            _ => [0, 0, at_least_own | at_most_own],
        };
        Self {
            blocks: blocks | blocks_too,
            if_before: if_before | asked,
            unknown: unknown | untold,
            ..Self::default()
        }
    }

    /// Those of which more is to be asked than the table knows.
    #[inline]
    pub fn open(&self) -> u64 {
        self.at_most_own | self.at_least_own | self.if_before | self.unknown
    }
}

/// What a patch is, and what is read for it.
#[derive(Clone, Copy, Debug)]
pub struct Reads<'t> {
    /// Which questions are asked.
    pub form: Form,
    /// Texels that lookups read to the left of and above the receiver's place, and to the right and below.
    pub reach: [f64; 2],
    /// Texels of a table, at most: as many as would be read without it. To ask for a texel costs about as much as to read it.
    pub most: usize,
    /// A table for a patch that this one is a part of: only what it leaves open is asked again.
    pub within: Option<&'t TexelOutcomes>,
}

impl TexelOutcomes {
    /// Fills the table. False if no one view surely holds all of the texels, or if they are too many.
    ///
    /// `object_of` is asked by [`Form::Ids`] for the object in a texel of a view.
    pub fn fill(
        &mut self,
        maps: &LightMaps<'_>,
        patch: &Patch,
        questions: &mut Questions,
        reads: Reads<'_>,
        object_of: impl Fn(usize, usize) -> u32,
    ) -> bool {
        let Reads { form, reach: [before, after], most, within } = reads;
        let is_lone = maps.maps.len() == 1;
        let found = maps.maps.iter().enumerate().find_map(|(index, map)| {
            let (min, max) = texels_of(map, questions)?;
            let size = f64::from(map.map.width);
            let holds =
                |low: f64, high: f64| (min - low).min_element() >= 0.0 && (max + high).max_element() < size;
            // Of a lone view a filter reads beside the map, too, where there is nothing.
            let beside = -0.5 * size;
            let is_held =
                if is_lone && form != Form::Hard { holds(beside, beside) } else { holds(before, after) };
            is_held.then_some((index, map, min, max))
        });
        let Some((view, map, min, max)) = found else { return false };
        let size = map.map.width as usize;
        let first = (min - before).floor().as_ivec2().to_array();
        let last = (max + after).floor().as_ivec2().to_array();
        let [columns, rows] = [0, 1].map(|axis| (last[axis] - first[axis]) as usize + 1);
        if columns > MOST_COLUMNS || columns * rows > most.min(MOST_TEXELS) {
            return false;
        }
        (self.view, self.first, self.columns) = (view, first, columns);
        (self.has_clear, self.has) = (false, Row::default());
        self.rows.clear();
        let within = within.filter(|within| within.view == view);
        let texel = 2.0 / size as f32;
        let whole = u64::MAX >> (64 - columns);
        for row in first[1]..=last[1] {
            let known = within.and_then(|within| within.run(first[0], row, columns as u32));
            let less_known =
                |known: Row| known.if_before | known.unknown | (known.at_most_own ^ known.at_least_own);
            let asked = known.map_or(whole, less_known);
            let mut bits = known.map_or(Row::default(), |known| known.map(|bits| bits & !asked));
            for bit in bits_of(asked) {
                let column = first[0] + bit as i32;
                // Beyond it nothing is held, nor read.
                let is_inside = column >= 0 && row >= 0 && map.holds(column as usize, row as usize);
                let index = if is_inside { row as usize * size + column as usize } else { 0 };
                let depth = if is_inside { map.map.depth[index] } else { 0.0 };
                let outcome = if depth <= 0.0 || form == Form::Ids && object_of(view, index) == patch.object {
                    Outcome::Clear
                } else {
                    questions.ask(form, &maps.scene, map.triangles[index], || {
                        let center = Vec2::new(column as f32 + 0.5, row as f32 + 0.5) * texel;
                        let stored: Vec3 =
                            map.view.unproject(Vec2::new(center.x - 1.0, 1.0 - center.y), depth);
                        (stored, map.view.half_diagonal(depth) * texel)
                    })
                };
                let bit = 1 << bit;
                match outcome {
                    Outcome::Clear => {}
                    Outcome::Blocks => bits.blocks |= bit,
                    Outcome::AsOwn => {
                        bits.at_most_own |= bit;
                        bits.at_least_own |= bit;
                    }
                    Outcome::AtMostOwn => bits.at_most_own |= bit,
                    Outcome::AtLeastOwn => bits.at_least_own |= bit,
                    Outcome::IfBefore => bits.if_before |= bit,
                    Outcome::Unknown => bits.unknown |= bit,
                }
            }
            self.has_clear |= whole & !(bits.blocks | bits.open()) != 0;
            self.has = self.has.union(bits);
            self.rows.push(bits);
        }
        true
    }

    /// What all texels are, if it is one and the same that needs no more questions.
    pub fn all(&self) -> Option<Outcome> {
        match (self.has_clear, self.has.blocks != 0, self.has.open() != 0) {
            (true, false, false) => Some(Outcome::Clear),
            (false, true, false) => Some(Outcome::Blocks),
            _ => None,
        }
    }

    /// Whether what a texel is to a pixel may hang on the pixel's own.
    pub fn asks_own(&self) -> bool {
        self.has.at_most_own | self.has.at_least_own != 0
    }

    /// What one texel is; `Unknown` outside the table.
    #[inline]
    pub fn at(&self, column: i32, row: i32) -> Outcome {
        let Some(bits) = self.run(column, row, 1) else { return Outcome::Unknown };
        match bits {
            Row { blocks: 1, .. } => Outcome::Blocks,
            Row { at_most_own: 1, at_least_own: 1, .. } => Outcome::AsOwn,
            Row { at_most_own: 1, .. } => Outcome::AtMostOwn,
            Row { at_least_own: 1, .. } => Outcome::AtLeastOwn,
            Row { if_before: 1, .. } => Outcome::IfBefore,
            Row { unknown: 1, .. } => Outcome::Unknown,
            _ => Outcome::Clear,
        }
    }

    /// The `count` texels from `column` on, 64 at most; `None` if they are not all in the table.
    #[inline]
    pub fn run(&self, column: i32, row: i32, count: u32) -> Option<Row> {
        let column = usize::try_from(column - self.first[0]).ok()?;
        let bits = self.rows.get(usize::try_from(row - self.first[1]).ok()?)?;
        let mask = u64::MAX >> (64 - count.clamp(1, 64));
        (column + count as usize <= self.columns).then(|| bits.map(|bits| bits >> column & mask))
    }
}

/// Of the tiles a side, one in so many is looked at by [`patches_pay`].
const PAY_STEP: usize = 4;

/// What finding the patches of a tile costs, in reads of a texel: a fifth to a quarter of 64, measured on `ball`, `layers`, `edges` and
/// `pool` at 512² with maps so fine that no patch is asked as one. It decides about time alone.
const TILE_READS: f64 = 16.0;

/// Whether asking the pixels of a patch together takes fewer reads than asking each, judged by the texels between the corners of some
/// tiles. Maps finer than the image have more texels in a patch than it has pixels.
pub(crate) fn patches_pay(maps: &LightMaps<'_>, gbuffer: &GBuffer, [before, after]: [f64; 2]) -> bool {
    let [width, height] = [gbuffer.width, gbuffer.height].map(|side| side as usize);
    let mut balance = 0.0;
    for y in (0..height.saturating_sub(TILE - 1)).step_by(TILE * PAY_STEP) {
        for x in (0..width.saturating_sub(TILE - 1)).step_by(TILE * PAY_STEP) {
            let corners = [[0, 0], [TILE - 1, 0], [0, TILE - 1], [TILE - 1, TILE - 1]];
            let corners = corners.map(|[right, down]| (y + down) * width + x + right);
            if corners.iter().all(|&pixel| !gbuffer.is_seen(pixel)) {
                continue;
            }
            balance -= TILE_READS;
            if corners.iter().any(|&pixel| gbuffer.triangle[pixel] != gbuffer.triangle[corners[0]]) {
                continue;
            }
            let found = maps.maps.iter().find_map(|map| {
                let [a, b, c, d] = corners.map(|pixel| map.view.project(gbuffer.position[pixel]));
                Some(([a?, b?, c?, d?], f64::from(map.map.width) * 0.5))
            });
            let Some((places, scale)) = found else { continue };
            let low = places.into_iter().fold(Vec2::INFINITY, Vec2::min);
            let high = places.into_iter().fold(Vec2::NEG_INFINITY, Vec2::max);
            let sides = (high - low).as_dvec2() * scale + (before + after + 1.0);
            let reads = (TILE * TILE) as f64 * (before + after + 1.0).powi(2);
            balance += (reads - sides.x * sides.y).max(0.0);
        }
    }
    balance > 0.0
}

/// The bits that are set, from the lowest on.
#[inline]
pub(crate) fn bits_of(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros() as usize;
        let more = mask != 0;
        mask &= mask.wrapping_sub(1);
        more.then_some(bit)
    })
}

/// Bounds of a patch in a view's texels, columns and rows, with the rounding of a projection in f32 allowed for. `None` if
/// part of it may lie behind the view, or that is more than a quarter of a texel.
fn texels_of(map: &ShadowMapView, questions: &Questions) -> Option<(DVec2, DVec2)> {
    let (center, half) = questions.bounds();
    let corners = (0..8).map(|corner| {
        let side = |bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
        center + half * DVec3::new(side(0), side(1), side(2))
    });
    let TexelBounds { min, max, error } = map.view.texel_bounds(map.map.width, corners)?;
    (error < 0.25).then(|| (min - error, max + error))
}
