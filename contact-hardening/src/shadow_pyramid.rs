//! Least and greatest S, and greatest D, of any rectangle of pixels in four reads: the umbra skip of section 5 made
//! exact, and the lit skip beside it.

use rayon::prelude::*;

use crate::distance_map::DistanceMap;

/// Side of the smallest tiles in pixels.
pub const TILE: usize = 4;

/// What some pixels hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremes {
    /// Least S; 1 if no pixel has one.
    pub least: f32,
    /// Greatest S; 0 if no pixel has one.
    pub greatest: f32,
    /// Greatest D.
    pub distance: f32,
}

impl Extremes {
    const NONE: Self = Self { least: 1.0, greatest: 0.0, distance: 0.0 };

    fn and(self, other: Self) -> Self {
        Self {
            least: self.least.min(other.least),
            greatest: self.greatest.max(other.greatest),
            distance: self.distance.max(other.distance),
        }
    }
}

/// Pixels of a rectangle, first and last of columns and rows, inclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRect {
    /// First column and row.
    pub first: [usize; 2],
    /// Last column and row.
    pub last: [usize; 2],
}

impl PixelRect {
    /// How many there are.
    pub fn count(&self) -> usize {
        (self.last[0] - self.first[0] + 1) * (self.last[1] - self.first[1] + 1)
    }

    /// The smallest tiles that hold it, cut at the image's border.
    #[must_use]
    pub fn in_tiles(&self, width: usize, height: usize) -> Self {
        let end = |at: usize, size: usize| (at / TILE * TILE + TILE - 1).min(size - 1);
        Self {
            first: self.first.map(|at| at / TILE * TILE),
            last: [end(self.last[0], width), end(self.last[1], height)],
        }
    }
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    tiles: Vec<Extremes>,
}

/// Levels of tiles, each tile the extremes of four of the level below.
#[derive(Clone, Debug)]
pub struct ShadowPyramid {
    levels: Vec<Level>,
}

impl ShadowPyramid {
    /// The pyramid above `map`, which must have a pixel.
    pub fn new(map: &DistanceMap) -> Self {
        let (mut columns, mut rows) = (map.width.div_ceil(TILE), map.height.div_ceil(TILE));
        let mut tiles = vec![Extremes::NONE; columns * rows];
        tiles.par_chunks_mut(columns).enumerate().for_each(|(row, line)| {
            for (column, tile) in line.iter_mut().enumerate() {
                let first = [column * TILE, row * TILE];
                let last = [(first[0] + TILE).min(map.width) - 1, (first[1] + TILE).min(map.height) - 1];
                *tile = extremes(map, PixelRect { first, last });
            }
        });
        let mut levels = vec![Level { width: columns, tiles }];
        while columns > 1 || rows > 1 {
            let below = &levels[levels.len() - 1];
            let (wide, high) = (columns, rows);
            (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
            let at = |x: usize, y: usize| below.tiles[y.min(high - 1) * wide + x.min(wide - 1)];
            let four = |index: usize| {
                let (x, y) = (index % columns * 2, index / columns * 2);
                at(x, y).and(at(x + 1, y)).and(at(x, y + 1)).and(at(x + 1, y + 1))
            };
            let tiles = (0..columns * rows).map(four).collect();
            levels.push(Level { width: columns, tiles });
        }
        Self { levels }
    }

    /// Extremes of `rect`, or of a few pixels beside it, too.
    #[inline]
    pub fn of(&self, rect: PixelRect) -> Extremes {
        let [first, last] = [rect.first, rect.last].map(|at| at.map(|at| at / TILE));
        // From this level on the rectangle touches two tiles a side at most.
        let extent = (last[0] - first[0]).max(last[1] - first[1]);
        let level = ((usize::BITS - extent.leading_zeros()) as usize).min(self.levels.len() - 1);
        let Level { width, tiles } = &self.levels[level];
        let ([x0, y0], [x1, y1]) = (first.map(|at| at >> level), last.map(|at| at >> level));
        let at = |x: usize, y: usize| tiles[y * width + x];
        at(x0, y0).and(at(x1, y0)).and(at(x0, y1)).and(at(x1, y1))
    }
}

/// Extremes of every pixel of `rect`, one by one: what the pyramid is held against.
pub fn extremes(map: &DistanceMap, rect: PixelRect) -> Extremes {
    let mut all = Extremes::NONE;
    for row in rect.first[1]..=rect.last[1] {
        for pixel in row * map.width + rect.first[0]..=row * map.width + rect.last[0] {
            let shadow = map.shadow[pixel];
            if !shadow.is_nan() {
                let distance = map.distance[pixel];
                all = all.and(Extremes { least: shadow, greatest: shadow, distance });
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_rectangle_hides_an_extreme() {
        for (width, height) in [(1usize, 1usize), (5, 9), (33, 17), (64, 20)] {
            let mut map = DistanceMap::new(width, height);
            for pixel in 0..width * height {
                map.shadow[pixel] = [0.0, 1.0, 1.0, f32::NAN][pixel * 7 % 11 % 4];
                map.distance[pixel] = (pixel * 37 % 101) as f32;
            }
            let pyramid = ShadowPyramid::new(&map);
            for start in 0..width * height {
                let first = [start % width, start / width];
                for (w, h) in [(1, 1), (3, 2), (9, 30), (70, 5)] {
                    let last = [(first[0] + w).min(width - 1), (first[1] + h).min(height - 1)];
                    let rect = PixelRect { first, last };
                    let (exact, found) = (extremes(&map, rect), pyramid.of(rect));
                    assert!(found.least <= exact.least && found.greatest >= exact.greatest);
                    assert!(found.distance >= exact.distance);
                }
            }
        }
    }
}
