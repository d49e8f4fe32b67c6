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
    #[inline]
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
    /// Per row with its borders, whether there is nothing in it.
    is_empty: Vec<bool>,
}

impl DepthGrid {
    /// Takes the depths of a map of `size` × `size` texels, row by row, through `t_of`, which must map "nothing" to
    /// infinity. Keeps its memory from map to map.
    pub fn fill(&mut self, size: u32, depths: &[f32], t_of: impl Fn(f32) -> f32) {
        let side = size as usize;
        self.size = size;
        self.depth.clear();
        self.depth.resize((side + 2) * (side + 2), f32::INFINITY);
        for (row, depths) in depths.chunks_exact(side.max(1)).take(side).enumerate() {
            let start = (row + 1) * (side + 2) + 1;
            for (into, &depth) in self.depth[start..start + side].iter_mut().zip(depths) {
                *into = t_of(depth);
            }
        }
        self.is_empty.clear();
        self.is_empty
            .extend(self.depth.chunks_exact(side + 2).map(|row| row.iter().all(|&t| t == f32::INFINITY)));
    }

    /// Whether there is nothing in row `row`, −1 to `size`.
    #[inline]
    pub fn is_row_empty(&self, row: i32) -> bool {
        self.is_empty[(row + 1) as usize]
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
