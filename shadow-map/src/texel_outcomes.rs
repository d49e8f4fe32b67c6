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
    /// Whether a texel of each kind is among them.
    has: [bool; 3],
}

/// A bit for each texel of a row.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    blocks: u64,
    unknown: u64,
}

impl TexelOutcomes {
    /// Fills the table for lookups that read `before` texels to the left of and above the receiver's place, and `after` to
    /// the right and below, in texels. False if no one view surely holds all of them, or if they are more than the pixels would
    /// read one by one: to ask for a texel costs about as much as to read it.
    ///
    /// `object_of` is asked by [`Form::Ids`] for the object in a texel of a view.
    pub fn fill(
        &mut self,
        maps: &LightMaps<'_>,
        patch: &Patch,
        questions: &mut Questions,
        form: Form,
        [before, after]: [f64; 2],
        object_of: impl Fn(usize, usize) -> u32,
    ) -> bool {
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
        let reads = patch.mask.count_ones() as usize * (before + after + 1.0).powi(2) as usize;
        if columns > MOST_COLUMNS || columns * rows > MOST_TEXELS.min(reads) {
            return false;
        }
        (self.view, self.first, self.columns, self.has) = (view, first, columns, [false; 3]);
        self.rows.clear();
        let texel = 2.0 / size as f32;
        for row in first[1]..=last[1] {
            let mut bits = Row::default();
            for (bit, column) in (first[0]..=last[0]).enumerate() {
                let is_inside = (0..size as i32).contains(&column) && (0..size as i32).contains(&row);
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
                match outcome {
                    Outcome::Clear => {}
                    Outcome::Blocks => bits.blocks |= 1 << bit,
                    Outcome::Unknown => bits.unknown |= 1 << bit,
                }
                self.has[outcome as usize] = true;
            }
            self.rows.push(bits);
        }
        true
    }

    /// What all texels are, if it is one and the same.
    pub fn all(&self) -> Option<Outcome> {
        match self.has {
            [true, false, false] => Some(Outcome::Clear),
            [false, true, false] => Some(Outcome::Blocks),
            _ => None,
        }
    }

    /// What one texel is; `Unknown` outside the table.
    #[inline]
    pub fn at(&self, column: i32, row: i32) -> Outcome {
        let (column, row) = ((column - self.first[0]) as usize, (row - self.first[1]) as usize);
        match self.rows.get(row) {
            Some(bits) if column < self.columns => {
                if bits.unknown >> column & 1 == 1 {
                    Outcome::Unknown
                } else if bits.blocks >> column & 1 == 1 {
                    Outcome::Blocks
                } else {
                    Outcome::Clear
                }
            }
            _ => Outcome::Unknown,
        }
    }

    /// A bit for each of the `count` texels from `column` on that block and that are unknown; `None` if they are not all in
    /// the table.
    #[inline]
    pub fn run(&self, column: i32, row: i32, count: u32) -> Option<[u128; 2]> {
        let (column, row) = ((column - self.first[0]) as usize, (row - self.first[1]) as usize);
        let bits = self.rows.get(row)?;
        let mask = u64::MAX >> (64 - count.clamp(1, 64));
        (column < self.columns && column + count as usize <= self.columns)
            .then(|| [bits.blocks, bits.unknown].map(|bits| u128::from(bits >> column & mask)))
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
pub(crate) fn bits(mut mask: u128) -> impl Iterator<Item = usize> {
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
