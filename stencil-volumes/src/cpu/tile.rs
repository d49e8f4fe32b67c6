//! Counting the pixels of one tile: the innermost loops.

use fearless_simd::{Select, Simd, SimdBase, SimdMask, f64x8, mask64x8};
use glam::DVec3;

use super::TILE;
use crate::bounds::LANES;
use crate::crossing::{Edge, HomogeneousLight, SideFromApex};
use crate::outline::{CLOSE, ScreenEdge};

/// Pixels of a tile.
pub(super) const PIXELS: usize = TILE * TILE;

/// Pixels that are tried as starts: one ray each.
const TRIES: usize = 4;

/// The asked pixels of a tile, packed to the front.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    /// How many there are.
    pub(super) len: usize,
    /// Places, one array an axis.
    place: [[f32; PIXELS]; 3],
    /// Which pixel of the tile each is, row by row.
    pub(super) pixel: [u8; PIXELS],
    /// Which of them stands for the tile.
    pub(super) start: usize,
    /// Faces between each and the light, less those of the start; none where no side and no edge passes.
    counts: Option<Box<[f64; PIXELS]>>,
    /// Bits of those that are so close to an edge that they are traced.
    pub(super) close: u64,
    /// Bits of those that the light cannot reach.
    pub(super) unlit: u64,
    /// Centre of the tile's first pixel, in steps.
    pub(super) corner: [f64; 2],
    /// Greatest depth.
    pub(super) depth: f64,
}

impl Tile {
    pub(super) const EMPTY: Self = Self {
        len: 0,
        place: [[0.0; PIXELS]; 3],
        pixel: [0; PIXELS],
        start: 0,
        counts: None,
        close: 0,
        unlit: 0,
        corner: [0.0; 2],
        depth: f64::NEG_INFINITY,
    };

    #[inline(always)]
    pub(super) fn place(&self, index: usize) -> DVec3 {
        DVec3::new(
            f64::from(self.place[0][index]),
            f64::from(self.place[1][index]),
            f64::from(self.place[2][index]),
        )
    }

    /// Adds an asked pixel; there is room for all of a tile's.
    pub(super) fn push(&mut self, pixel: usize, place: [f32; 3], depth: f64, unlit: bool) {
        let at = self.len;
        self.unlit |= u64::from(unlit) << at;
        for (axis, coordinate) in self.place.iter_mut().zip(place) {
            axis[at] = coordinate;
        }
        self.pixel[at] = pixel as u8;
        self.depth = self.depth.max(depth);
        self.len += 1;
    }

    /// The centre of an asked pixel in steps.
    #[inline(always)]
    pub(super) fn center(&self, index: usize) -> [f64; 2] {
        const STEPS: f64 = scene_core::raster::SnappedView::STEPS as f64;
        let pixel = usize::from(self.pixel[index]);
        [self.corner[0] + (pixel % TILE) as f64 * STEPS, self.corner[1] + (pixel / TILE) as f64 * STEPS]
    }

    /// Faces between an asked pixel and the light, less those of the start.
    #[inline(always)]
    pub(super) fn count(&self, index: usize) -> i32 {
        self.counts.as_ref().map_or(0, |counts| counts[index] as i32)
    }

    /// Chooses the pixel that stands for the tile: the middlemost of those that are close to no edge and whose place serves. Whether
    /// there is one among the first [`TRIES`].
    pub(super) fn choose_start(&mut self, serves: impl Fn(DVec3) -> bool) -> bool {
        let middle = self.len / 2;
        let outwards =
            std::iter::once(middle).chain((1..=self.len).flat_map(|d| [middle.wrapping_sub(d), middle + d]));
        let apart = outwards.filter(|&i| i < self.len && self.close >> i & 1 == 0);
        let start = apart.take(TRIES).find(|&i| serves(self.place(i)));
        self.start = start.unwrap_or_default();
        start.is_some()
    }

    /// Eight places.
    #[inline(always)]
    fn places<S: Simd>(&self, simd: S, at: usize) -> [f64x8<S>; 3] {
        let mut wide = [[0.0; LANES]; 3];
        for (wide, values) in wide.iter_mut().zip(&self.place) {
            for (wide, &value) in wide.iter_mut().zip(&values[at..at + LANES]) {
                *wide = f64::from(value);
            }
        }
        [
            f64x8::from_slice(simd, &wide[0]),
            f64x8::from_slice(simd, &wide[1]),
            f64x8::from_slice(simd, &wide[2]),
        ]
    }

    /// Eight centres in steps.
    #[inline(always)]
    fn centers<S: Simd>(&self, simd: S, at: usize) -> [f64x8<S>; 2] {
        let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
        for (lane, (x, y)) in x.iter_mut().zip(&mut y).enumerate() {
            [*x, *y] = self.center(at + lane);
        }
        [f64x8::from_slice(simd, &x), f64x8::from_slice(simd, &y)]
    }

    /// Adds the multiplicity where `passes`; one that passes the other way is negative.
    #[inline(always)]
    fn book<S: Simd>(&mut self, simd: S, at: usize, multiplicity: i32, passes: mask64x8<S>) {
        let (zero, m) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, f64::from(multiplicity)));
        let counts = &mut self.counts.get_or_insert_with(|| Box::new([0.0; PIXELS]))[at..at + LANES];
        let sums = f64x8::from_slice(simd, counts) + passes.select(m, zero);
        sums.store_slice(counts);
    }

    /// Adds what the chords from the start to every pixel cross of a side: [`crate::crossing::crossing`] for each.
    #[inline(always)]
    pub(super) fn add_side<S: Simd>(&mut self, simd: S, edge: &Edge, light: &HomogeneousLight) {
        let apex = self.place(self.start);
        let side = SideFromApex::new(edge, light, apex);
        let plane = edge.plane(light);
        let begins = edge.is_outside(plane, apex);
        // What lies past the last pixel is zero, and nobody reads its count.
        for at in (0..self.len).step_by(LANES) {
            let place = self.places(simd, at);
            let ends = dot_from(simd, plane, place, edge.a).simd_ge(0.0);
            // Nothing is crossed by a chord whose ends lie on one side.
            let changes = if begins { !ends } else { ends };
            if !changes.any_true() {
                continue;
            }
            let along_a = dot_from(simd, side.along_a, place, apex).simd_ge(0.0);
            let along_b = dot_from(simd, side.along_b, place, apex).simd_ge(0.0);
            let beyond = dot_from(simd, side.edge, place, apex).simd_ge(0.0);
            if begins {
                let enters = changes & !along_a & along_b & beyond;
                self.book(simd, at, edge.multiplicity, enters);
            } else {
                let leaves = changes & along_a & !along_b & !beyond;
                self.book(simd, at, -edge.multiplicity, leaves);
            }
        }
    }

    /// Marks the pixels that are close to an edge on the screen.
    #[inline(always)]
    pub(super) fn mark_close<S: Simd>(&mut self, simd: S, outline: &ScreenEdge) {
        let Some([a, b]) = outline.ends() else {
            for i in 0..self.len {
                // The rasteriser has clipped the edge and snapped what was left.
                self.close |= u64::from(outline.is_close(self.center(i))) << i;
            }
            return;
        };
        let reach = ((b[0] - a[0]).abs() + (b[1] - a[1]).abs()).max(1.0) * CLOSE;
        for at in (0..self.len).step_by(LANES) {
            let [x, y] = self.centers(simd, at);
            // Integers below 2⁵³: exact in any order.
            let value = (y - a[1]) * (b[0] - a[0]) - (x - a[0]) * (b[1] - a[1]);
            let near = value.abs().simd_le(reach)
                & x.simd_ge(a[0].min(b[0]) - CLOSE)
                & x.simd_le(a[0].max(b[0]) + CLOSE)
                & y.simd_ge(a[1].min(b[1]) - CLOSE)
                & y.simd_le(a[1].max(b[1]) + CLOSE);
            self.close |= near.to_bitmask() << at;
        }
    }

    /// Adds what the loops over the start and every pixel link of an edge on the screen: [`ScreenEdge::link`] for each.
    #[inline(always)]
    pub(super) fn add_link<S: Simd>(&mut self, simd: S, edge: &Edge, outline: &ScreenEdge, eye: DVec3) {
        let apex = self.place(self.start);
        let from_eye = apex - eye;
        let towards = (edge.a - apex).cross(edge.b - apex);
        let from_right = outline.is_right(from_eye);
        let past = |v: DVec3| (v - eye).cross(from_eye);
        let (past_a, past_b) = (past(edge.a), past(edge.b));
        for at in (0..self.len).step_by(LANES) {
            let place = self.places(simd, at);
            let right = dot_from(simd, outline.normal(), place, eye).simd_ge(0.0);
            let other = if from_right { !right } else { right };
            if !other.any_true() {
                continue;
            }
            let beyond = dot_from(simd, towards, place, apex).simd_ge(0.0);
            let passes = other & if from_right { beyond } else { !beyond };
            let a_right = dot_from(simd, past_a, place, eye).simd_ge(0.0);
            let b_right = dot_from(simd, past_b, place, eye).simd_ge(0.0);
            self.book(simd, at, edge.multiplicity, passes & a_right & !b_right);
            self.book(simd, at, -edge.multiplicity, passes & !a_right & b_right);
        }
    }
}

/// v · (place − origin), term by term as [`DVec3::dot`] adds them: a sign is the same wherever it is asked for.
#[inline(always)]
fn dot_from<S: Simd>(simd: S, v: DVec3, place: [f64x8<S>; 3], origin: DVec3) -> f64x8<S> {
    let x = (place[0] - origin.x) * f64x8::splat(simd, v.x);
    let y = (place[1] - origin.y) * f64x8::splat(simd, v.y);
    let z = (place[2] - origin.z) * f64x8::splat(simd, v.z);
    x + y + z
}
