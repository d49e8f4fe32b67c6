//! Which triangles a cut-out mask leaves whole.
//!
//! One material often covers a whole prop, trunk and leaves, and most of its triangles lie where the mask is solid. Those need no
//! mask: they have edges and volumes like any others. A triangle's texels are taken to be all of the rectangle around its
//! corners, and a table of sums says how many of these are holes.

use std::fmt;
use std::ops::Range;

use glam::{DVec2, Vec2};

use super::{AlphaMask, Wrap};

/// Share of a coordinate's magnitude within which an interpolated one is good: a few roundings of f32.
const ROUNDING: f64 = 1.0 / (1u32 << 20) as f64;

/// Texels beside a triangle's own that must be solid, too.
const MARGIN: f64 = 1.0 / 64.0;

/// How many holes a mask has in any rectangle.
#[derive(Clone)]
pub(super) struct Holes {
    /// Holes above and left of a texel's corner, row by row, with one corner more than texels each way. Wraps around, as
    /// differences may: there are fewer than 2³² in a rectangle of a mask whose bytes fit in memory, or all of it is asked.
    sums: Vec<u32>,
    /// Corners a row.
    row: usize,
}

impl fmt::Debug for Holes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Holes").finish_non_exhaustive()
    }
}

impl Holes {
    pub(super) fn new(mask: &AlphaMask) -> Self {
        let (width, row) = (mask.width() as usize, mask.width() as usize + 1);
        let mut sums = vec![0u32; row * (mask.height() as usize + 1)];
        for (y, texels) in mask.texels().chunks_exact(width).enumerate() {
            let (above, below) = sums[y * row..(y + 2) * row].split_at_mut(row);
            let mut holes = 0u32;
            for (x, &solid) in texels.iter().enumerate() {
                holes = holes.wrapping_add(u32::from(!solid));
                below[x + 1] = above[x + 1].wrapping_add(holes);
            }
        }
        Self { row, sums }
    }

    /// Whether the mask is solid all over a triangle with these texture coordinates. One that is not finite may be cut.
    pub(super) fn leaves_whole(&self, mask: &AlphaMask, uvs: [Vec2; 3]) -> bool {
        let size = DVec2::new(mask.width().into(), mask.height().into());
        let corners = uvs.map(|uv| uv.as_dvec2() * size);
        let (min, max) =
            (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        if !uvs.iter().all(|uv| uv.is_finite()) {
            return false;
        }
        let slack = MARGIN + ROUNDING * min.abs().max(max.abs());
        let (min, max) = ((min - slack).floor(), (max + slack).floor());
        let [across, down] = mask.wrap();
        let columns = texels(across, [min.x, max.x], mask.width());
        let rows = texels(down, [min.y, max.y], mask.height());
        columns.iter().all(|columns| rows.iter().all(|rows| self.count(columns, rows) == 0))
    }

    fn count(&self, columns: &Range<usize>, rows: &Range<usize>) -> u32 {
        let at = |x: usize, y: usize| self.sums[y * self.row + x];
        let (left, right) = (columns.start, columns.end);
        let until = |y: usize| at(right, y).wrapping_sub(at(left, y));
        until(rows.end).wrapping_sub(until(rows.start))
    }
}

/// The texels that an interval of unbounded ones, both ends included, is wrapped to: one range, or two around an end.
fn texels(wrap: Wrap, [first, last]: [f64; 2], size: u32) -> [Range<usize>; 2] {
    let (all, none) = (0..size as usize, 0..0);
    let copy = |texel: f64| (texel / f64::from(size)).floor();
    let is_all = match wrap {
        Wrap::Repeat => last - first + 1.0 >= size.into(),
        Wrap::Mirror => copy(first) != copy(last),
        Wrap::Clamp => false,
    };
    if is_all {
        return [all, none];
    }
    let [x, y] = [first, last].map(|texel| wrap.texel(texel as i64, size.into()) as usize);
    if wrap == Wrap::Repeat && x > y {
        return [x..all.end, 0..y + 1];
    }
    [x.min(y)..x.max(y) + 1, none]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splitmix;

    /// No point of a triangle that is left whole is a hole, wherever it lies in any kind of mask, and one that is cut has a
    /// hole in the rectangle around it.
    #[test]
    fn whole_triangles_have_no_hole() {
        let mut state = 0;
        let mut unit = || {
            state += 1;
            (splitmix::hash(state) >> 40) as f32 / (1u32 << 24) as f32
        };
        let mut whole = 0;
        for round in 0..6_000 {
            let [width, height] = [0; 2].map(|_| 1 + (unit() * 9.0) as u32);
            let solid = (0..width * height).map(|_| unit() < 0.9).collect();
            let wrap = [0; 2].map(|_| [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp][(unit() * 3.0) as usize]);
            let mask = AlphaMask::from_solid(width, height, solid, wrap).unwrap();
            let reach = [0.1, 0.5, 3.0][round % 3];
            let mut place = |reach: f32| Vec2::new(unit() - 0.5, unit() - 0.5) * reach;
            let middle = place(8.0);
            let uvs = [middle + place(reach), middle + place(reach), middle + place(reach)];
            let (min, max) = (uvs[0].min(uvs[1]).min(uvs[2]), uvs[0].max(uvs[1]).max(uvs[2]));
            let is_whole = mask.leaves_whole(uvs);
            whole += usize::from(is_whole);
            if is_whole {
                for i in 0..=20 {
                    for j in 0..=20 - i {
                        let (a, b) = (i as f32 / 20.0, j as f32 / 20.0);
                        let uv = uvs[0] * a + uvs[1] * b + uvs[2] * (1.0 - a - b);
                        assert!(mask.is_solid(uv), "{mask:?}, {uvs:?}: {uv}");
                    }
                }
            } else {
                // Steps finer than texels, over the rectangle and what lies within its margin.
                let texel = Vec2::new(width as f32, height as f32).recip();
                let (min, max) = (min - texel * 0.05, max + texel * 0.05);
                let steps = ((max - min) / texel * 4.0).ceil().as_uvec2() + 1;
                let mut at = (0..=steps.x).flat_map(|x| (0..=steps.y).map(move |y| (x, y)));
                let hole = at.any(|(x, y)| {
                    let share = Vec2::new(x as f32, y as f32) / steps.as_vec2();
                    !mask.is_solid(min + (max - min) * share)
                });
                assert!(hole || wrap.contains(&Wrap::Mirror), "{mask:?}, {uvs:?}");
            }
        }
        assert!((1_000..5_000).contains(&whole), "{whole}");
    }

    #[test]
    fn broken_coordinates_may_be_cut() {
        let mask = AlphaMask::from_solid(2, 1, vec![true, false], [Wrap::Repeat; 2]).unwrap();
        assert!(mask.leaves_whole([Vec2::new(0.25, 0.5); 3]));
        assert!(!mask.leaves_whole([Vec2::new(0.25, 0.5), Vec2::NAN, Vec2::ZERO]));
        assert!(!mask.leaves_whole([Vec2::splat(f32::MAX), Vec2::splat(f32::MIN), Vec2::ZERO]));
    }
}
