//! The area that no shadow covers, from the shadows' edges alone.
//!
//! Every edge says by how much the number of shadows over a place changes when it is crossed upwards, so edges that two
//! neighbours share cancel before they come here, and what is left of a fine mesh is its silhouette. The number at a place is
//! that at the cell's lower side and the changes of all edges below it.
//!
//! A cell is split in two until few edges cross it, or none (the number is then constant but for steps along the lower
//! side), or so many shadows lie over all of it that no edge in it can end them. In the last cells vertical slabs are
//! cut at all corners and crossings: within one no two edges cross, so lengths are linear in x and the one in the middle times the
//! width is the area. Nothing depends on which of two nearly equal numbers is the larger: closed outlines stay closed
//! because an edge is only ever cut into pieces that meet, so rounding moves areas by some 10⁻¹⁶ of the
//! cell, whatever coincides with what. That is why this is no polygon arrangement, which has to get its
//! topology right. Time is O(n log n + crossings) for n edges that can be parted; those that all meet in one place cannot, and
//! take O(n²).

use std::ops::Range;

use glam::DVec2;

/// Edges of shadows. Kept from one use to the next, it stops allocating.
#[derive(Debug, Default)]
pub(super) struct LitArea {
    /// What was added; above it, as on a stack, the parts inside the cells being split.
    edges: Vec<Edge>,
    /// Steps of the cells being split.
    steps: Vec<Step>,
    places: Vec<f64>,
    crossed: Vec<(f64, i32)>,
}

/// An edge with its left end first. Vertical ones are of no account.
#[derive(Clone, Copy, Debug)]
struct Edge {
    left: DVec2,
    right: DVec2,
    /// Shadows above it less those below.
    change: i32,
}

/// At the lower side of a cell the number of shadows changes at `x`.
#[derive(Clone, Copy, Debug)]
struct Step {
    x: f64,
    change: i32,
}

/// A rectangle, what it holds of the edges, and the number of shadows at its lower left corner.
#[derive(Clone, Debug)]
struct Cell {
    min: DVec2,
    max: DVec2,
    edges: Range<usize>,
    steps: Range<usize>,
    shadows: i32,
}

/// Up to this many edges the slabs cost less than splitting further.
const LEAF: usize = 8;

impl Edge {
    fn y_at(&self, x: f64) -> f64 {
        let share = (x - self.left.x) / (self.right.x - self.left.x);
        self.left.y + (self.right.y - self.left.y) * share
    }

    /// Where it has the height `y`, which lies between those of its ends.
    fn x_at(&self, y: f64) -> f64 {
        let share = (y - self.left.y) / (self.right.y - self.left.y);
        (self.left.x + (self.right.x - self.left.x) * share).clamp(self.left.x, self.right.x)
    }

    /// Where two edges cross, if they do within both.
    fn crossing(&self, other: &Self) -> Option<f64> {
        let (from, to) = (self.left.x.max(other.left.x), self.right.x.min(other.right.x));
        if from >= to {
            return None;
        }
        let (start, end) = (self.y_at(from) - other.y_at(from), self.y_at(to) - other.y_at(to));
        (start * end < 0.0).then(|| from + (to - from) * (start / (start - end)))
    }
}

impl LitArea {
    /// Forgets all edges.
    pub(super) fn clear(&mut self) {
        self.edges.clear();
    }

    /// Edges held.
    pub(super) fn len(&self) -> usize {
        self.edges.len()
    }

    /// Forgets all but the first `len` edges.
    pub(super) fn truncate(&mut self, len: usize) {
        self.edges.truncate(len);
    }

    /// Adds the edge from `a` to `b` of `count` shadows that lie to its left (to its right if negative).
    pub(super) fn add(&mut self, a: DVec2, b: DVec2, count: i32) {
        if a.x < b.x {
            self.edges.push(Edge { left: a, right: b, change: count });
        } else if b.x < a.x {
            self.edges.push(Edge { left: b, right: a, change: -count });
        }
    }

    /// Adds the outline of a polygon of either winding that is `count` shadows.
    pub(super) fn add_polygon(&mut self, corners: &[DVec2], count: i32) {
        let Some(&first) = corners.first() else { return };
        let twice: f64 = corners.windows(2).map(|w| (w[0] - first).perp_dot(w[1] - first)).sum();
        let count = if twice < 0.0 { -count } else { count };
        for (i, &a) in corners.iter().enumerate() {
            self.add(a, corners[if i + 1 == corners.len() { 0 } else { i + 1 }], count);
        }
    }

    /// The area of the rectangle that no shadow covers. Below it and far to its left there are `shadows` of them.
    /// Leaves the edges as they are.
    pub(super) fn area(&mut self, min: DVec2, max: DVec2, shadows: i32) -> f64 {
        let all = 0..self.edges.len();
        self.steps.clear();
        self.cell(min, max, all, 0..0, shadows)
    }

    /// The lit area of what `edges` and the `steps` below them leave of a rectangle, which may be a part of theirs.
    fn cell(
        &mut self,
        min: DVec2,
        max: DVec2,
        edges: Range<usize>,
        steps: Range<usize>,
        shadows: i32,
    ) -> f64 {
        let (edge_count, step_count) = (self.edges.len(), self.steps.len());
        let cell = self.cut(min, max, edges, steps, shadows);
        let area = self.area_of(&cell);
        self.edges.truncate(edge_count);
        self.steps.truncate(step_count);
        area
    }

    /// Puts the parts of edges that lie inside on the stack, and what lies below into steps.
    fn cut(
        &mut self,
        min: DVec2,
        max: DVec2,
        edges: Range<usize>,
        steps: Range<usize>,
        mut shadows: i32,
    ) -> Cell {
        let (first_edge, first_step) = (self.edges.len(), self.steps.len());
        for index in edges {
            let mut edge = self.edges[index];
            if edge.right.x <= min.x || edge.left.x >= max.x || edge.left.y.min(edge.right.y) >= max.y {
                continue;
            }
            let whole = edge;
            if edge.left.x < min.x {
                edge.left = DVec2::new(min.x, whole.y_at(min.x));
            }
            if edge.right.x > max.x {
                edge.right = DVec2::new(max.x, whole.y_at(max.x));
            }
            let Edge { left, right, change } = edge;
            let mut below = |from: f64, to: f64| {
                self.steps.push(Step { x: from, change });
                self.steps.push(Step { x: to, change: -change });
            };
            if left.y.max(right.y) <= min.y {
                below(left.x, right.x);
                continue;
            }
            if left.y.min(right.y) >= max.y {
                continue;
            }
            if left.y < min.y {
                edge.left = DVec2::new(whole.x_at(min.y).clamp(left.x, right.x), min.y);
                below(left.x, edge.left.x);
            } else if right.y < min.y {
                edge.right = DVec2::new(whole.x_at(min.y).clamp(left.x, right.x), min.y);
                below(edge.right.x, right.x);
            }
            if left.y > max.y {
                edge.left = DVec2::new(whole.x_at(max.y).clamp(edge.left.x, edge.right.x), max.y);
            } else if right.y > max.y {
                edge.right = DVec2::new(whole.x_at(max.y).clamp(edge.left.x, edge.right.x), max.y);
            }
            if edge.left.x < edge.right.x {
                self.edges.push(edge);
            }
        }
        for index in steps {
            let step = self.steps[index];
            if step.x < max.x {
                self.steps.push(step);
            }
        }
        // Of one place there is one step, and none where changes cancel: an outline that goes on below leaves nothing.
        self.steps[first_step..].sort_unstable_by(|a, b| a.x.total_cmp(&b.x));
        let mut kept = first_step;
        let mut index = first_step;
        while index < self.steps.len() {
            let mut step = self.steps[index];
            index += 1;
            while index < self.steps.len() && self.steps[index].x == step.x {
                step.change += self.steps[index].change;
                index += 1;
            }
            if step.x <= min.x {
                shadows += step.change;
            } else if step.change != 0 && step.x < max.x {
                self.steps[kept] = step;
                kept += 1;
            }
        }
        self.steps.truncate(kept);
        Cell { min, max, edges: first_edge..self.edges.len(), steps: first_step..kept, shadows }
    }

    fn area_of(&mut self, cell: &Cell) -> f64 {
        let edges = &self.edges[cell.edges.clone()];
        // Shadows over every place of the cell, at least.
        let mut fewest = cell.shadows;
        let mut lower = cell.shadows;
        for step in &self.steps[cell.steps.clone()] {
            lower += step.change;
            fewest = fewest.min(lower);
        }
        fewest += edges.iter().map(|edge| edge.change.min(0)).sum::<i32>();
        if fewest > 0 {
            return 0.0;
        }
        if edges.len() > LEAF
            && let Some((axis, at)) = self.split(cell)
        {
            let (mut lower_max, mut upper_min) = (cell.max, cell.min);
            (lower_max[axis], upper_min[axis]) = (at, at);
            let Cell { min, max, edges, steps, shadows } = cell.clone();
            return self.cell(min, lower_max, edges.clone(), steps.clone(), shadows)
                + self.cell(upper_min, max, edges, steps, shadows);
        }
        self.slabs(cell)
    }

    /// An axis and a place on it that part the edges of a cell well enough: the slabs' cost grows with the square of
    /// their number, so the squares must shrink.
    fn split(&mut self, cell: &Cell) -> Option<(usize, f64)> {
        let edges = &self.edges[cell.edges.clone()];
        let size = cell.max - cell.min;
        let longer = usize::from(size.y > size.x);
        [longer, 1 - longer].into_iter().find_map(|axis| {
            let places = &mut self.places;
            places.clear();
            places.extend(edges.iter().map(|e| 0.5 * (e.left[axis] + e.right[axis])));
            let middle = places.len() / 2;
            let (_, &mut at, _) = places.select_nth_unstable_by(middle, f64::total_cmp);
            let below = edges.iter().filter(|e| e.left[axis].min(e.right[axis]) < at).count() as f64;
            let above = edges.iter().filter(|e| e.left[axis].max(e.right[axis]) > at).count() as f64;
            let all = edges.len() as f64;
            let inside = cell.min[axis] < at && at < cell.max[axis];
            (inside && below * below + above * above < 0.9 * all * all).then_some((axis, at))
        })
    }

    fn slabs(&mut self, cell: &Cell) -> f64 {
        let Self { edges, steps, places, crossed } = self;
        let (edges, steps) = (&edges[cell.edges.clone()], &steps[cell.steps.clone()]);
        places.clear();
        places.extend([cell.min.x, cell.max.x]);
        places.extend(steps.iter().map(|step| step.x));
        for (i, a) in edges.iter().enumerate() {
            places.extend([a.left.x, a.right.x]);
            places.extend(edges[i + 1..].iter().filter_map(|b| a.crossing(b)));
        }
        places.sort_unstable_by(f64::total_cmp);

        let mut area = 0.0;
        let mut lower = cell.shadows;
        let mut coming = steps.iter().peekable();
        for slab in places.windows(2) {
            let (from, to) = (slab[0], slab[1]);
            let x = 0.5 * (from + to);
            while let Some(step) = coming.next_if(|step| step.x <= from) {
                lower += step.change;
            }
            if !(from < x && x < to) {
                continue;
            }
            crossed.clear();
            let over = edges.iter().filter(|e| e.left.x <= from && e.right.x >= to);
            crossed.extend(over.map(|edge| (edge.y_at(x), edge.change)));
            crossed.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let (mut length, mut shadows, mut y) = (0.0, lower, cell.min.y);
            for &(next, change) in &*crossed {
                if shadows == 0 {
                    length += next - y;
                }
                shadows += change;
                y = next;
            }
            if shadows == 0 {
                length += cell.max.y - y;
            }
            area += length * (to - from);
        }
        area
    }
}

#[cfg(test)]
mod tests {
    use super::super::oracle::UnionArea;
    use super::*;
    use crate::light::sampling::SampleKey;

    fn both(polygons: &[Vec<DVec2>]) -> [f64; 2] {
        let (mut lit, mut union) = (LitArea::default(), UnionArea::default());
        for polygon in polygons {
            lit.add_polygon(polygon, 1);
            union.add(polygon.iter().copied());
        }
        let side = 8.0;
        [side * side - lit.area(DVec2::splat(-2.0), DVec2::splat(side - 2.0), 0), union.area()]
    }

    fn triangles(count: u32, seed: u64, size: f64) -> Vec<Vec<DVec2>> {
        let key = SampleKey::new(seed, 0);
        let at = |i| key.square(i).as_dvec2();
        (0..count).map(|i| (0..3).map(|c| at(4 * i + 3) + (at(4 * i + c) - 0.5) * size).collect()).collect()
    }

    #[test]
    fn random_unions_are_those_of_the_oracle() {
        for (count, size) in [(0, 1.0), (1, 1.0), (2, 1.0), (7, 1.0), (30, 0.5), (300, 0.1), (60, 2.0)] {
            let [found, expected] = both(&triangles(count, u64::from(count), size));
            assert!((found - expected).abs() < 1e-12, "{count}: {found} {expected}");
        }
    }

    /// Corners on a coarse grid: edges that coincide, cross in corners and overlap in part.
    #[test]
    fn coincidences_do_no_harm() {
        for seed in 0..40 {
            let mut soup = triangles(60, seed, 1.5);
            soup.iter_mut().flatten().for_each(|p| *p = (*p * 6.0).round() / 6.0);
            let [found, expected] = both(&soup);
            assert!((found - expected).abs() < 1e-12, "{seed}: {found} {expected}");
        }
    }

    #[test]
    fn a_fan_of_edges_in_one_place_is_measured() {
        let spoke = |i: u32| DVec2::from_angle(f64::from(i) * 0.07);
        let fan: Vec<_> = (0..40).map(|i| vec![DVec2::ZERO, spoke(2 * i), spoke(2 * i + 1)]).collect();
        let [found, expected] = both(&fan);
        assert!((found - 20.0 * 0.07f64.sin()).abs() < 1e-12, "{found}");
        assert!((found - expected).abs() < 1e-12);
    }

    /// Edges that cross a rectangle's corners, or pass them by on either side.
    #[test]
    fn edges_near_corners_are_cut_right() {
        let key = SampleKey::new(8, 0);
        for i in 0..500 {
            let corners: Vec<DVec2> = (0..3).map(|c| key.square(3 * i + c).as_dvec2() * 6.0 - 3.0).collect();
            let mut lit = LitArea::default();
            lit.add_polygon(&corners, 1);
            let inside =
                [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y].iter().fold(corners, |polygon, side| {
                    super::super::cone::clip(&polygon, |p| 1.0 - side.dot(p), |a, b, t| a.lerp(b, t))
                });
            let mut union = UnionArea::default();
            union.add(inside.iter().copied());
            let (found, expected) = (lit.area(DVec2::splat(-1.0), DVec2::ONE, 0), 4.0 - union.area());
            assert!((found - expected).abs() < 1e-12, "{inside:?}: {found} {expected}");
        }
    }

    #[test]
    fn what_is_left_of_a_rectangle_is_measured() {
        let mut lit = LitArea::default();
        let area = |lit: &mut LitArea, shadows| lit.area(DVec2::splat(-1.0), DVec2::ONE, shadows);
        assert_eq!([area(&mut lit, 0), area(&mut lit, 1)], [4.0, 0.0]);
        // A window in the dark, half of it beyond the rectangle, and a far larger shadow over its lower half.
        let square = |x: f64, y: f64, r: f64| {
            [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(u, v)| DVec2::new(x + u, y + v))
        };
        lit.add_polygon(&square(1.0, 0.0, 0.5), -1);
        assert_eq!(area(&mut lit, 1), 0.5);
        lit.add_polygon(&square(0.0, -100.0, 100.0), 1);
        assert_eq!(area(&mut lit, 1), 0.25);
        lit.add_polygon(&square(0.0, 0.0, 100.0), 1);
        assert_eq!(area(&mut lit, 1), 0.0);
        lit.clear();
        lit.add_polygon(&[], 1);
        lit.add_polygon(&[DVec2::splat(f64::NAN); 3], 1);
        lit.add_polygon(&[DVec2::ZERO, DVec2::ONE, DVec2::splat(2.0)], 1);
        assert!((area(&mut lit, 0) - 4.0).abs() < 1e-15);
    }
}
