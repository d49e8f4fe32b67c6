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

    /// Calls `visit` with the lower corner and the size of every cell.
    #[inline]
    fn for_each_cell(&self, mut visit: impl FnMut(Vec2, Vec2)) {
        let (short, long_rows) = (self.cells / self.rows, self.cells % self.rows);
        let mut before = 0;
        for row in 0..self.rows {
            let columns = short + u32::from(row < long_rows);
            let y = before as f32 / self.cells as f32;
            let size = Vec2::new(1.0 / columns as f32, columns as f32 / self.cells as f32);
            for column in 0..columns {
                visit(Vec2::new(column as f32 * size.x, y), size);
            }
            before += columns;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(strata: Strata) -> Vec<(Vec2, Vec2)> {
        let mut cells = Vec::new();
        strata.for_each_cell(|corner, size| cells.push((corner, size)));
        cells
    }

    #[test]
    fn cells_are_equal_disjoint_and_fill_the_square() {
        for count in (1..200).chain([251, 256, 997, 1024]) {
            for aspect in [1.0, 4.0, 0.01, f32::NAN, f32::INFINITY, -1.0] {
                let cells = cells(Strata::new(count, aspect));
                assert_eq!(cells.len(), count as usize);
                for &(corner, size) in &cells {
                    assert!((size.x * size.y * count as f32 - 1.0).abs() < 1e-5);
                    assert!((corner + size).max_element() < 1.0 + 1e-6);
                }
                // In every pair the later cell starts where the earlier one ends, in its row or above it.
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
