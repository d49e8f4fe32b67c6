//! The two grids over one window: texels of the shadow maps and pixels of the PDSM.

/// Where the rays of a PDSM of n × n pixels lie on maps of m × m texels, m a multiple of n.
///
/// The centre of a pixel is the middle of a texel, so that the crossings of all its rays lie at the same t. Where m/n is
/// even that is half a texel off the pixel's own middle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelGrid {
    /// Pixels a side, n.
    pub size: u32,
    /// Texels a pixel along each side, m/n.
    pub ratio: u32,
}

impl PixelGrid {
    /// The texel in which the ray of pixel `index` (a column or row) lies at t = 0.
    #[inline]
    pub fn texel(self, index: u32) -> i32 {
        (index * self.ratio + self.ratio / 2) as i32
    }

    /// The pixel whose ray lies in texel `texel` at t = 0, if there is one.
    #[inline]
    pub fn pixel(self, texel: i32) -> Option<u32> {
        let shifted = texel - (self.ratio / 2) as i32;
        if self.ratio == 1 {
            return (0..self.size as i32).contains(&shifted).then_some(shifted as u32);
        }
        let (pixel, rest) = (shifted.div_euclid(self.ratio as i32), shifted.rem_euclid(self.ratio as i32));
        (rest == 0 && (0..self.size as i32).contains(&pixel)).then_some(pixel as u32)
    }

    /// Pixel coordinates, whole numbers at pixel centres, of a position in texels.
    #[inline(always)]
    pub fn from_texels(self, position: glam::Vec2) -> glam::Vec2 {
        (position - ((self.ratio / 2) as f32 + 0.5)) / self.ratio as f32
    }
}

/// Depths t of one shadow map, with a border of one texel in which there is nothing, so that a ray that leaves the map
/// leaves its shadow.
#[derive(Clone, Debug, Default)]
pub struct DepthGrid {
    size: u32,
    /// (`size` + 2)², row by row; infinite where nothing is seen.
    depth: Vec<f32>,
    /// Per row with its borders, from where to where something is seen: places in the bordered row.
    seen: Vec<[u32; 2]>,
}

impl DepthGrid {
    /// Makes it a map of `size` × `size` texels in which nothing is seen. Keeps its memory from map to map.
    pub fn clear(&mut self, size: u32) {
        let side = size as usize + 2;
        self.size = size;
        self.depth.clear();
        self.depth.resize(side * side, f32::INFINITY);
        self.seen.clear();
        self.seen.resize(side, [0; 2]);
    }

    /// All depths with the border, row by row, to be drawn into; then [`drawn`](Self::drawn) must be called. The border
    /// must stay infinite.
    pub fn bordered_mut(&mut self) -> &mut [f32] {
        &mut self.depth
    }

    /// Looks where something is.
    pub fn drawn(&mut self) {
        let side = self.size as usize + 2;
        for (seen, row) in self.seen.iter_mut().zip(self.depth.chunks_exact(side)) {
            let first = row.iter().position(|&t| t < f32::INFINITY);
            let last = row.iter().rposition(|&t| t < f32::INFINITY);
            *seen = first.zip(last).map_or([0; 2], |(first, last)| [first as u32, last as u32 + 1]);
        }
    }

    /// Takes the depths of a map of `size` × `size` texels, row by row, through `t_of`, which must map "nothing" to
    /// infinity.
    pub fn fill(&mut self, size: u32, depths: &[f32], t_of: impl Fn(f32) -> f32) {
        self.clear(size);
        let side = size as usize;
        for (row, depths) in depths.chunks_exact(side.max(1)).take(side).enumerate() {
            let start = (row + 1) * (side + 2) + 1;
            for (into, &depth) in self.depth[start..start + side].iter_mut().zip(depths) {
                *into = t_of(depth);
            }
        }
        self.drawn();
    }

    /// From where to where something is seen in row `row`, −1 to `size`: places in its
    /// [`bordered_row`](Self::bordered_row). Empty where there is nothing.
    #[inline]
    pub fn seen(&self, row: i32) -> std::ops::Range<usize> {
        let [first, end] = self.seen[(row + 1) as usize];
        first as usize..end as usize
    }

    /// Texels a side, without the border.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// Row `row` with its border texels, −1 to `size`: `size` + 2 depths.
    #[inline]
    pub fn bordered_row(&self, row: i32) -> &[f32] {
        let width = self.size as usize + 2;
        let start = (row + 1) as usize * width;
        &self.depth[start..start + width]
    }

    /// Depth in a column and row; infinite outside of the map.
    #[inline]
    pub fn depth(&self, column: i32, row: i32) -> f32 {
        let inside = -1..=self.size as i32;
        if inside.contains(&column) && inside.contains(&row) {
            self.bordered_row(row)[(column + 1) as usize]
        } else {
            f32::INFINITY
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_and_texels_are_inverse() {
        for ratio in 1..=4 {
            let grid = PixelGrid { size: 5, ratio };
            let hits = (-9..40).filter_map(|texel| grid.pixel(texel).map(|pixel| (texel, pixel)));
            let expected = (0..5).map(|pixel| (grid.texel(pixel), pixel));
            assert!(hits.eq(expected));
            let centre = grid.from_texels(glam::Vec2::splat(grid.texel(3) as f32 + 0.5));
            assert_eq!(centre, glam::Vec2::splat(3.0));
        }
    }

    #[test]
    fn outside_of_a_map_there_is_nothing() {
        let mut grid = DepthGrid::default();
        grid.fill(2, &[1.0, 2.0, 3.0, 4.0], |depth| depth);
        assert_eq!(
            [grid.depth(0, 0), grid.depth(1, 0), grid.depth(0, 1), grid.depth(1, 1)],
            [1.0, 2.0, 3.0, 4.0]
        );
        for (column, row) in [(-1, 0), (2, 1), (0, -7), (1, 99)] {
            assert_eq!(grid.depth(column, row), f32::INFINITY);
        }
    }
}
