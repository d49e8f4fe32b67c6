//! The area of a union of convex polygons, every one of them taken by itself: what tests hold the fast way against.
//!
//! The plane is split until few polygons are left in a cell, and there the union is cut into vertical slabs between all
//! corners and crossings: within one no two edges cross, so the covered length is linear in x and the length in the
//! middle times the width is the area. Nothing depends on which of two nearly equal numbers is the larger: rounding
//! moves areas by some 10⁻¹⁶ of the cell and can do no more, whatever coincides with what. That is why this is
//! no polygon arrangement, which has to get its topology right.

use glam::DVec2;

/// Convex polygons whose union is measured. Kept from one use to the next, it stops allocating.
#[derive(Debug, Default)]
pub(super) struct UnionArea {
    /// Corners of all polygons, one after another.
    corners: Vec<DVec2>,
    /// The polygons; those of the cells being split lie behind one another, as on a stack.
    polygons: Vec<Polygon>,
    slabs: Slabs,
}

#[derive(Clone, Copy, Debug)]
struct Polygon {
    start: usize,
    end: usize,
    min: DVec2,
    max: DVec2,
    area: f64,
}

/// Up to this many polygons the slabs cost less than splitting further.
const LEAF: usize = 6;

/// A polygon that leaves less than this share of its cell free covers it.
const COVERED: f64 = 1.0 - 1e-13;

impl UnionArea {
    /// Forgets all polygons.
    pub(super) fn clear(&mut self) {
        self.corners.clear();
        self.polygons.clear();
    }

    /// Adds a convex polygon of either winding. One without area, or not finite, is left out.
    pub(super) fn add(&mut self, corners: impl IntoIterator<Item = DVec2>) {
        let start = self.corners.len();
        self.corners.extend(corners);
        self.close(start);
    }

    /// Makes a polygon of the corners from `start` on, if they span one.
    fn close(&mut self, start: usize) {
        let corners = &self.corners[start..];
        let (min, max) = corners
            .iter()
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(min, max), &c| (min.min(c), max.max(c)));
        // A fan from the first corner: differences first, so that small polygons keep their digits.
        let twice: f64 =
            corners.windows(2).skip(1).map(|w| (w[0] - corners[0]).perp_dot(w[1] - corners[0])).sum();
        let area = 0.5 * twice.abs();
        if area > 0.0 && area.is_finite() {
            self.polygons.push(Polygon { start, end: self.corners.len(), min, max, area });
        } else {
            self.corners.truncate(start);
        }
    }

    /// The area that the polygons cover. Leaves them as they are.
    pub(super) fn area(&mut self) -> f64 {
        self.area_from(0)
    }

    /// The area covered by the polygons from `first` on.
    fn area_from(&mut self, first: usize) -> f64 {
        let polygons = &self.polygons[first..];
        let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for polygon in polygons {
            min = min.min(polygon.min);
            max = max.max(polygon.max);
        }
        let size = max - min;
        match polygons {
            [] => 0.0,
            [only] => only.area,
            _ if polygons.iter().any(|p| p.area >= COVERED * size.x * size.y) => size.x * size.y,
            _ => match (polygons.len() > LEAF).then(|| self.split(first, size)).flatten() {
                Some((axis, at)) => {
                    self.area_of_side(first, axis, at, true) + self.area_of_side(first, axis, at, false)
                }
                None => self.slabs.area(&self.corners, &self.polygons[first..]),
            },
        }
    }

    /// An axis and a place on it that part the polygons from `first` on well enough: the slabs' cost grows with the
    /// square of their number, so the squares must shrink.
    fn split(&mut self, first: usize, size: DVec2) -> Option<(usize, f64)> {
        let polygons = &self.polygons[first..];
        let longer = usize::from(size.y > size.x);
        let middle = polygons.len() / 2;
        [longer, 1 - longer].into_iter().find_map(|axis| {
            let places = &mut self.slabs.places;
            places.clear();
            places.extend(polygons.iter().map(|p| 0.5 * (p.min[axis] + p.max[axis])));
            let (_, &mut at, _) = places.select_nth_unstable_by(middle, f64::total_cmp);
            let below = polygons.iter().filter(|p| p.min[axis] < at).count() as f64;
            let above = polygons.iter().filter(|p| p.max[axis] > at).count() as f64;
            let all = polygons.len() as f64;
            (below * below + above * above < 0.9 * all * all).then_some((axis, at))
        })
    }

    /// The area covered by what the polygons from `first` on have below or above `at`.
    fn area_of_side(&mut self, first: usize, axis: usize, at: f64, below: bool) -> f64 {
        let (corner_count, polygon_count) = (self.corners.len(), self.polygons.len());
        for index in first..polygon_count {
            let Polygon { start, end, min, max, .. } = self.polygons[index];
            let (inside, outside) =
                if below { (max[axis] <= at, min[axis] >= at) } else { (min[axis] >= at, max[axis] <= at) };
            if inside {
                let polygon = self.polygons[index];
                self.polygons.push(polygon);
            } else if !outside {
                let new = self.corners.len();
                for i in start..end {
                    let (a, b) = (self.corners[i], self.corners[if i + 1 == end { start } else { i + 1 }]);
                    let height = |p: DVec2| if below { at - p[axis] } else { p[axis] - at };
                    let (ha, hb) = (height(a), height(b));
                    if ha >= 0.0 {
                        self.corners.push(a);
                    }
                    if (ha > 0.0 && hb < 0.0) || (ha < 0.0 && hb > 0.0) {
                        let mut cut = a + (b - a) * (ha / (ha - hb));
                        cut[axis] = at;
                        self.corners.push(cut);
                    }
                }
                self.close(new);
            }
        }
        let area = self.area_from(polygon_count);
        self.corners.truncate(corner_count);
        self.polygons.truncate(polygon_count);
        area
    }
}

/// Buffers of the slab decomposition.
#[derive(Debug, Default)]
struct Slabs {
    places: Vec<f64>,
    edges: Vec<Edge>,
    intervals: Vec<(f64, f64)>,
}

/// An edge with its left end first; vertical ones are left out.
#[derive(Clone, Copy, Debug)]
struct Edge {
    left: DVec2,
    right: DVec2,
    polygon: usize,
}

impl Edge {
    fn y_at(&self, x: f64) -> f64 {
        let share = (x - self.left.x) / (self.right.x - self.left.x);
        self.left.y + (self.right.y - self.left.y) * share
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

impl Slabs {
    fn area(&mut self, corners: &[DVec2], polygons: &[Polygon]) -> f64 {
        let Self { places, edges, intervals } = self;
        edges.clear();
        places.clear();
        for (polygon, p) in polygons.iter().enumerate() {
            let corners = &corners[p.start..p.end];
            for (i, &a) in corners.iter().enumerate() {
                let b = corners[if i + 1 == corners.len() { 0 } else { i + 1 }];
                places.push(a.x);
                if a.x != b.x {
                    let (left, right) = if a.x < b.x { (a, b) } else { (b, a) };
                    edges.push(Edge { left, right, polygon });
                }
            }
        }
        for (i, a) in edges.iter().enumerate() {
            let crossings = edges[i + 1..].iter().filter(|b| b.polygon != a.polygon);
            places.extend(crossings.filter_map(|b| a.crossing(b)));
        }
        places.sort_unstable_by(f64::total_cmp);

        let mut area = 0.0;
        for slab in places.windows(2) {
            let (from, to) = (slab[0], slab[1]);
            let x = 0.5 * (from + to);
            if !(from < x && x < to) {
                continue;
            }
            // A convex polygon has two edges over x; its edges follow one another in the list.
            intervals.clear();
            let mut current = usize::MAX;
            for edge in edges.iter().filter(|e| e.left.x <= from && e.right.x >= to) {
                let y = edge.y_at(x);
                match intervals.last_mut() {
                    Some((low, high)) if current == edge.polygon => (*low, *high) = (low.min(y), high.max(y)),
                    _ => intervals.push((y, y)),
                }
                current = edge.polygon;
            }
            intervals.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let (mut length, mut covered_to) = (0.0, f64::NEG_INFINITY);
            for &(low, high) in &*intervals {
                length += (high - low.max(covered_to)).max(0.0);
                covered_to = covered_to.max(high);
            }
            area += length * (to - from);
        }
        area
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::sampling::SampleKey;

    fn area(polygons: &[Vec<DVec2>]) -> f64 {
        let mut union = UnionArea::default();
        polygons.iter().for_each(|p| union.add(p.iter().copied()));
        union.area()
    }

    fn square(x: f64, y: f64, side: f64) -> Vec<DVec2> {
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(u, v)| DVec2::new(x + u * side, y + v * side))
            .into()
    }

    fn random_triangles(count: u32, seed: u64, size: f64) -> Vec<Vec<DVec2>> {
        let key = SampleKey::new(seed, 0);
        let at = |i| key.square(i).as_dvec2();
        (0..count).map(|i| (0..3).map(|c| at(4 * i + 3) + (at(4 * i + c) - 0.5) * size).collect()).collect()
    }

    #[test]
    fn simple_unions_are_exact() {
        assert_eq!(area(&[]), 0.0);
        assert_eq!(area(&[square(0.0, 0.0, 2.0)]), 4.0);
        assert_eq!(area(&[square(0.0, 0.0, 2.0), square(1.0, 1.0, 2.0)]), 7.0);
        assert_eq!(area(&[square(0.0, 0.0, 1.0), square(1.0, 0.0, 1.0), square(5.0, 5.0, 1.0)]), 3.0);
        let star = [
            vec![DVec2::new(0.0, 0.0), DVec2::new(3.0, 0.0), DVec2::new(1.5, 3.0)],
            vec![DVec2::new(0.0, 2.0), DVec2::new(1.5, -1.0), DVec2::new(3.0, 2.0)],
        ];
        // Two triangles of 4.5; they share a hexagon: each less three corners, a ninth of 4.5 each.
        assert!((area(&star) - (4.5 + 3.0 * 0.5)).abs() < 1e-12, "{}", area(&star));
    }

    #[test]
    fn copies_and_degenerate_polygons_add_nothing() {
        let mut many: Vec<_> = (0..40).map(|_| square(0.1, 0.2, 0.5)).collect();
        many.push(vec![DVec2::ZERO, DVec2::ONE, DVec2::splat(2.0)]);
        many.push(vec![DVec2::NAN; 3]);
        many.push(vec![DVec2::ZERO]);
        many.push(Vec::new());
        assert!((area(&many) - 0.25).abs() < 1e-14);
    }

    #[test]
    fn a_tiling_covers_its_square() {
        // A square of 30 × 30 cells, each of two triangles, corners jittered inside.
        let n = 30;
        let corner = |i: u32, j: u32| {
            let jitter = (SampleKey::new(4, 0).square(i * 100 + j).as_dvec2() - 0.5) * 0.8;
            let on_rim = |k| k == 0 || k == n;
            let free = DVec2::new(f64::from(u8::from(!on_rim(i))), f64::from(u8::from(!on_rim(j))));
            (DVec2::new(f64::from(i), f64::from(j)) + jitter * free * 0.5) / f64::from(n)
        };
        let mut tiles = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                tiles.extend([vec![a, b, c], vec![a, c, d]]);
            }
        }
        assert!((area(&tiles) - 1.0).abs() < 1e-12, "{}", area(&tiles));
        let hole = tiles.remove(777);
        let missing = 0.5 * (hole[1] - hole[0]).perp_dot(hole[2] - hole[0]);
        assert!((area(&tiles) - (1.0 - missing)).abs() < 1e-12);
    }

    /// Splitting and slabs are two ways to the same area.
    #[test]
    fn cells_and_slabs_agree() {
        for (count, size) in [(7, 1.0), (30, 0.5), (100, 0.3), (60, 2.0)] {
            let triangles = random_triangles(count, u64::from(count), size);
            let mut union = UnionArea::default();
            triangles.iter().for_each(|t| union.add(t.iter().copied()));
            let UnionArea { corners, polygons, slabs } = &mut union;
            let by_slabs = slabs.area(corners, polygons);
            let by_cells = union.area();
            assert!((by_slabs - by_cells).abs() < 1e-12, "{by_slabs} {by_cells}");
        }
    }

    /// Against counting points: 4 standard deviations of 40,000 random ones.
    #[test]
    fn random_unions_agree_with_counting() {
        let triangles = random_triangles(50, 9, 0.6);
        let inside = |p: DVec2, t: &[DVec2]| {
            let side = |i: usize| (t[(i + 1) % 3] - t[i]).perp_dot(p - t[i]);
            (side(0) > 0.0 && side(1) > 0.0 && side(2) > 0.0)
                || (side(0) < 0.0 && side(1) < 0.0 && side(2) < 0.0)
        };
        let key = SampleKey::new(10, 1);
        let n = 40_000;
        let hits = (0..n)
            .filter(|&i| {
                let p = key.square(i).as_dvec2() * 2.0 - 0.5;
                triangles.iter().any(|t| inside(p, t))
            })
            .count();
        let share = hits as f64 / f64::from(n);
        let sigma = (share * (1.0 - share) / f64::from(n)).sqrt();
        assert!((area(&triangles) - 4.0 * share).abs() < 16.0 * sigma);
    }
}
