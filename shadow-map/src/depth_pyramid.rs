//! The nearest depth of any rectangle of texels in four reads: what decides that a filter has nothing to find.

use std::ops::Range;

use rayon::prelude::*;
use scene_core::raster::DepthMap;

/// Levels of a map, each texel the nearest of four of the level below; sides are halved and rounded up.
#[derive(Clone, Debug, Default)]
pub struct DepthPyramid {
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    depth: Vec<f32>,
}

impl DepthPyramid {
    /// The pyramid above `map`, reversed depth: the greatest is the nearest. A map without texels has no levels.
    pub fn new(map: &DepthMap) -> Self {
        Self::of(map, &(0..map.height))
    }

    /// The pyramid above some rows of `map`: what is asked must lie in them.
    pub fn of(map: &DepthMap, rows: &Range<u32>) -> Self {
        let mut asked = rows.start as usize..rows.end as usize;
        let (mut width, mut height) = (map.width as usize, map.height as usize);
        let mut levels: Vec<Level> = Vec::new();
        while width > 1 || height > 1 {
            let below = levels.last().map_or(map.depth.as_slice(), |level| level.depth.as_slice());
            let (columns, rows) = (width.div_ceil(2), height.div_ceil(2));
            let mut depth = vec![0.0f32; columns * rows];
            asked = asked.start / 2..asked.end.div_ceil(2).min(rows);
            let lines = depth.par_chunks_mut(columns).enumerate().skip(asked.start).take(asked.len());
            lines.for_each(|(row, line)| {
                let upper = &below[2 * row * width..][..width];
                let lower = &below[(2 * row + 1).min(height - 1) * width..][..width];
                for ((nearest, a), b) in line.iter_mut().zip(upper.chunks(2)).zip(lower.chunks(2)) {
                    *nearest = a.iter().chain(b).fold(0.0, |nearest: f32, &depth| nearest.max(depth));
                }
            });
            levels.push(Level { width: columns, height: rows, depth });
            (width, height) = (columns, rows);
        }
        Self { levels }
    }

    /// The nearest depth in the texels `first` to `last` (column and row, inclusive) of `map`, or of a few beside
    /// them: never farther than the true one. Both must lie inside the map; rows that are not held are empty.
    #[inline]
    pub fn nearest(&self, map: &DepthMap, first: [usize; 2], last: [usize; 2]) -> f32 {
        // From this level on the rectangle touches two texels a side at most.
        let extent = (last[0] - first[0]).max(last[1] - first[1]);
        let level = (usize::BITS - extent.leading_zeros()) as usize;
        let (width, depth) = match level.checked_sub(1).and_then(|above| self.levels.get(above)) {
            Some(level) => (level.width, &level.depth),
            None => (map.width as usize, &map.depth),
        };
        let [x0, y0] = first.map(|at| at >> level);
        let [x1, y1] = last.map(|at| at >> level);
        let at = |x: usize, y: usize| depth.get(y * width + x).copied().unwrap_or(0.0);
        at(x0, y0).max(at(x1, y0)).max(at(x0, y1)).max(at(x1, y1))
    }

    /// Bytes of all levels.
    pub fn bytes(&self) -> u64 {
        self.levels.iter().map(|level| (level.width * level.height * 4) as u64).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_rectangle_hides_a_nearer_texel() {
        for size in [1u32, 2, 3, 7, 16, 21] {
            let depth: Vec<f32> = (0..size * size).map(|i| (i * 37 % 101) as f32 / 101.0).collect();
            let map = DepthMap { width: size, height: size, depth };
            let pyramid = DepthPyramid::new(&map);
            let side = size as usize;
            for (x0, y0) in (0..side).flat_map(|x| (0..side).map(move |y| (x, y))) {
                for (x1, y1) in (x0..side).flat_map(|x| (y0..side).map(move |y| (x, y))) {
                    let inside = (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| (x, y)));
                    let exact = inside.map(|(x, y)| map.depth[y * side + x]).fold(0.0, f32::max);
                    let found = pyramid.nearest(&map, [x0, y0], [x1, y1]);
                    assert!(found >= exact, "{size}: {x0},{y0} to {x1},{y1}");
                }
            }
            let all = map.depth.iter().copied().fold(0.0, f32::max);
            assert_eq!(pyramid.nearest(&map, [0, 0], [side - 1, side - 1]), all);
        }
    }
}
