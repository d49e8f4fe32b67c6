//! Jittered cells of equal area, for any number of samples.

use super::key::BELOW_ONE;
use super::{BATCH, LightView, SampleKey};
use crate::light::LightPoint;
use glam::Vec2;

/// A division of the unit square into cells of equal area, with one or two random points in each.
///
/// Cells stand in rows that are as high as they have cells, which works for any number, a prime too: 7 cells
/// are rows of 3, 2 and 2 with heights 3/7, 2/7 and 2/7. Cells are about square on the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strata {
    /// Cells in all, at least 1.
    cells: u32,
    /// Rows, 1 to `cells`.
    rows: u32,
    /// Points a cell, 1 or 2.
    per_cell: u32,
}

impl Strata {
    /// One point in each of `samples` cells (at least one); `aspect` is the light's width over its height,
    /// where anything but a positive finite number counts as 1.
    pub fn new(samples: u32, aspect: f32) -> Self {
        let cells = samples.max(1);
        let aspect = if aspect > 0.0 && aspect.is_finite() { f64::from(aspect) } else { 1.0 };
        let rows = ((f64::from(cells) / aspect).sqrt().round() as u32).clamp(1, cells);
        Self { cells, rows, per_cell: 1 }
    }

    /// Two independent points in each of `samples` / 2 cells, rounded up; they come as consecutive points. Their
    /// differences estimate the variance within the cells without bias, which single points cannot.
    pub fn paired(samples: u32, aspect: f32) -> Self {
        Self { per_cell: 2, ..Self::new(samples.div_ceil(2), aspect) }
    }

    /// How many points [`fill`](Self::fill) makes.
    pub fn sample_count(&self) -> usize {
        self.cells as usize * self.per_cell as usize
    }

    /// Fills the first [`sample_count`](Self::sample_count) elements of `points`, cell by cell.
    ///
    /// # Panics
    /// If `points` is shorter.
    pub fn fill(&self, view: &LightView, key: SampleKey, points: &mut [LightPoint]) {
        let mut points = &mut points[..self.sample_count()];
        let (mut squares, mut pending, mut index) = ([Vec2::ZERO; BATCH], 0, 0);
        self.for_each_cell(|corner, size| {
            for _ in 0..self.per_cell {
                // A jitter just below 1 may round up to the square's edge.
                squares[pending] = (corner + key.square(index) * size).min(Vec2::splat(BELOW_ONE));
                index += 1;
                pending += 1;
                if pending == BATCH {
                    view.points(&squares, points);
                    points = &mut std::mem::take(&mut points)[BATCH..];
                    pending = 0;
                }
            }
        });
        view.points(&squares[..pending], points);
    }

    /// Calls `visit` with the lower corner and the size of every cell, band by band and column by column: so
    /// a batch of points stays together on the light, and its rays in a narrow shaft.
    #[inline]
    fn for_each_cell(&self, mut visit: impl FnMut(Vec2, Vec2)) {
        // The first rows are the long ones, by one cell.
        let (short, long_rows) = (self.cells / self.rows, self.cells % self.rows);
        let size = |columns: u32| Vec2::new(1.0 / columns as f32, columns as f32 / self.cells as f32);
        let sizes = [size(short), size(short + 1)];
        let band = if self.per_cell == 1 { 8 } else { 6 };
        for first in (0..self.rows).step_by(band) {
            let rows = first..(first + band as u32).min(self.rows);
            for column in 0..=short {
                for row in rows.clone() {
                    let is_long = row < long_rows;
                    if column < short || is_long {
                        let size = sizes[usize::from(is_long)];
                        let before = row * short + row.min(long_rows);
                        visit(Vec2::new(column as f32 * size.x, before as f32 / self.cells as f32), size);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(strata: Strata) -> Vec<(Vec2, Vec2)> {
        let mut cells = Vec::new();
        strata.for_each_cell(|corner, size| cells.push((corner, size)));
        assert_eq!(cells.len(), strata.cells as usize);
        cells
    }

    #[test]
    fn cells_are_equal_disjoint_and_fill_the_square() {
        for count in (1..200).chain([251, 256, 997, 1024]) {
            for aspect in [1.0, 4.0, 0.01, f32::NAN, f32::INFINITY, -1.0] {
                let mut cells = cells(Strata::new(count, aspect));
                assert_eq!(cells.len(), count as usize);
                for &(corner, size) in &cells {
                    assert!((size.x * size.y * count as f32 - 1.0).abs() < 1e-5);
                    assert!((corner + size).max_element() < 1.0 + 1e-6);
                }
                // Row by row, every cell starts where the one before ends, in its row or above it.
                cells.sort_by(|(a, _), (b, _)| (a.y, a.x).partial_cmp(&(b.y, b.x)).unwrap());
                for pair in cells.windows(2) {
                    let ((a, size), (b, _)) = (pair[0], pair[1]);
                    let beside = b.y == a.y && (b.x - a.x - size.x).abs() < 1e-6;
                    let above = b.x == 0.0 && (b.y - a.y - size.y).abs() < 1e-6;
                    assert!(beside || above);
                }
            }
        }
    }

    #[test]
    fn cells_are_about_square_on_the_light() {
        for (count, aspect) in [(256, 1.0), (31, 1.0), (1024, 4.0), (1024, 0.25)] {
            for (_, size) in cells(Strata::new(count, aspect)) {
                let shape = size.x * aspect / size.y;
                assert!((0.6..1.7).contains(&shape), "{count} {aspect}: {shape}");
            }
        }
        assert_eq!(Strata::new(256, 1.0).rows, 16);
    }

    /// Points that are traced together lie in a patch that is not much longer than wide.
    #[test]
    fn batches_are_compact() {
        for (count, pairs) in [(1024, false), (512, true), (4096, true)] {
            let strata = if pairs { Strata::paired(2 * count, 1.0) } else { Strata::new(count, 1.0) };
            let batch = BATCH / strata.per_cell as usize;
            let area = batch as f32 / count as f32;
            for cells in cells(strata).chunks_exact(batch).take(4) {
                let min = cells.iter().fold(Vec2::INFINITY, |m, (corner, _)| m.min(*corner));
                let max = cells.iter().fold(Vec2::NEG_INFINITY, |m, (corner, size)| m.max(*corner + *size));
                let side = (max - min).max_element();
                assert!(side < 1.5 * area.sqrt(), "{count}: {side} for {area}");
            }
        }
    }

    #[test]
    fn pairs_share_a_cell() {
        let strata = Strata::paired(31, 1.0);
        assert_eq!(strata.sample_count(), 32);
        let light =
            crate::Light::Rect { center: glam::Vec3::ZERO, half_u: glam::Vec3::X, half_v: glam::Vec3::Y };
        let mut points = [LightPoint::Towards(glam::Vec3::Z); 32];
        strata.fill(&LightView::new(&light, glam::Vec3::Z), SampleKey::new(0, 0), &mut points);
        for (pair, (corner, size)) in points.chunks(2).zip(cells(strata)) {
            assert_ne!(pair[0], pair[1]);
            for point in pair {
                let LightPoint::At(p) = *point else { panic!("a rect has places") };
                let inside = (p.truncate() * 0.5 + 0.5 - corner) / size;
                assert!(inside.min_element() > -1e-5 && inside.max_element() < 1.0 + 1e-5, "{inside}");
            }
        }
    }
}
