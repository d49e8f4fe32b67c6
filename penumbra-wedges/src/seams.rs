//! Seams: where sides of faces lie along each other and end at other vertices (T-junctions), both are cut to the same pieces.
//!
//! Modellers leave them where a wall of one quad meets a floor of many. No light comes through, but no two faces share an edge
//! there, and a body looks open to whoever counts faces at edges.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use scene_core::geometry::EdgeTopology;

/// How far a point that was computed to lie on a line or a plane may be off it, for coordinates up to `magnitude`: three
/// roundings to f32 in each of three coordinates, 3·√3·2⁻²⁴, are less than 2⁻²¹.
pub fn rounding(magnitude: f32) -> f64 {
    f64::from(magnitude) / 2_097_152.0
}

/// The largest coordinate of some points.
pub fn magnitude(points: &[Vec3]) -> f32 {
    points.iter().map(|point| point.abs().max_element()).fold(0.0, f32::max)
}

/// The edges of the faces that are `kept`. Sides are cut where ends of others lie on them, up to [`rounding`]; but not those that
/// two faces run along in opposite ways, which is what a clean surface has, nor by their ends.
pub fn close_seams(
    positions: &[Vec3],
    topology: &EdgeTopology,
    kept: impl Fn(u32) -> bool + Sync,
) -> EdgeTopology {
    let edges = 0..topology.len();
    let is_clean = |edge: usize| {
        let mut signs = topology.faces(edge).iter().filter(|face| kept(face.face())).map(|face| face.sign());
        matches!((signs.next(), signs.next(), signs.next()), (Some(a), Some(b), None) if a != b)
    };
    let in_question: Vec<usize> = edges.clone().into_par_iter().filter(|&edge| !is_clean(edge)).collect();
    let ends =
        EndGrid::new(positions, in_question.iter().flat_map(|&edge| topology.vertices()[edge]).collect());
    let names = ends.names();
    let cut =
        |&edge: &usize| ends.along(topology.vertices()[edge].map(|vertex| names[vertex as usize]), &names);
    let cuts: Vec<Vec<u32>> = in_question.par_iter().map(cut).collect();
    let mut cuts = in_question.iter().zip(&cuts).peekable();
    let mut sides = Vec::new();
    for edge in edges {
        let own = topology.vertices()[edge].map(|vertex| names[vertex as usize]);
        let way = cuts.next_if(|(cut, _)| **cut == edge).map_or(&own[..], |(_, way)| way);
        for face in topology.faces(edge).iter().filter(|face| kept(face.face())) {
            let along =
                |piece: &[u32]| if face.sign() > 0 { [piece[0], piece[1]] } else { [piece[1], piece[0]] };
            let pieces = way.windows(2).filter(|piece| piece[0] != piece[1]);
            sides.extend(pieces.map(|piece| (along(piece), face.face())));
        }
    }
    EdgeTopology::of_sides(sides)
}

/// Vertices in the cells of a grid: up to 64 cells a vertex and 2²⁴ in all, most of them empty, since vertices lie on surfaces.
struct EndGrid<'a> {
    positions: &'a [Vec3],
    low: DVec3,
    /// Cells a unit of length.
    scale: f64,
    cells: [usize; 3],
    /// The vertices of cell i are `vertices[first[i] as usize..first[i + 1] as usize]`.
    first: Vec<u32>,
    vertices: Vec<u32>,
}

impl<'a> EndGrid<'a> {
    fn new(positions: &'a [Vec3], mut vertices: Vec<u32>) -> Self {
        vertices.par_sort_unstable();
        vertices.dedup();
        let at = |vertex: u32| positions[vertex as usize].as_dvec3();
        let (low, high) = vertices
            .iter()
            .map(|&vertex| at(vertex))
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let size = if vertices.is_empty() { DVec3::ZERO } else { high - low };
        let along = (64.0 * vertices.len() as f64).cbrt().floor().min(256.0);
        let scale = if size.max_element() > 0.0 { along / size.max_element() } else { 0.0 };
        let cells = (size * scale).to_array().map(|cells| cells as usize + 1);
        let mut grid = Self {
            positions,
            low,
            scale,
            cells,
            first: vec![0; cells.iter().product::<usize>() + 1],
            vertices,
        };
        let cell_of: Vec<usize> =
            grid.vertices.iter().map(|&vertex| grid.index(grid.cell(at(vertex)))).collect();
        cell_of.iter().for_each(|&cell| grid.first[cell + 1] += 1);
        let mut sum = 0;
        for first in &mut grid.first {
            sum += *first;
            *first = sum;
        }
        let mut by_cell: Vec<(usize, u32)> = cell_of.into_iter().zip(grid.vertices.iter().copied()).collect();
        by_cell.par_sort_unstable();
        grid.vertices = by_cell.into_iter().map(|(_, vertex)| vertex).collect();
        grid
    }

    /// The cell of a place, or the nearest there is.
    fn cell(&self, place: DVec3) -> [usize; 3] {
        let cell = ((place - self.low) * self.scale).to_array();
        // A float becomes the nearest integer there is: below zero is zero.
        [0, 1, 2].map(|axis| (cell[axis] as usize).min(self.cells[axis] - 1))
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.cells[1] + y) * self.cells[0] + x
    }

    /// Calls `take` with the vertices in the cells around a box.
    fn visit(&self, low: DVec3, high: DVec3, mut take: impl FnMut(u32)) {
        let (low, high) = (self.cell(low), self.cell(high));
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                let [first, last] = [low[0], high[0]].map(|x| self.index([x, y, z]));
                let row = self.first[first] as usize..self.first[last + 1] as usize;
                self.vertices[row].iter().for_each(|&vertex| take(vertex));
            }
        }
    }

    /// For every vertex of the scene the one that stands for it: of those in the grid that are in one place up to
    /// [`rounding`], the first.
    fn names(&self) -> Vec<u32> {
        let mut names: Vec<u32> = (0..self.positions.len() as u32).collect();
        let mut vertices = self.vertices.clone();
        vertices.sort_unstable();
        for vertex in vertices {
            let place = self.positions[vertex as usize];
            let (at, slack) = (place.as_dvec3(), rounding(magnitude(&[place])));
            let mut name = vertex;
            self.visit(at - slack, at + slack, |other| {
                let is_first = other < name && names[other as usize] == other;
                if is_first && (self.positions[other as usize].as_dvec3() - at).length() <= slack {
                    name = other;
                }
            });
            names[vertex as usize] = name;
        }
        names
    }

    /// An edge's vertices and those on it, in their order.
    fn along(&self, [a, b]: [u32; 2], names: &[u32]) -> Vec<u32> {
        let at = |vertex: u32| self.positions[vertex as usize];
        let slack = rounding(magnitude(&[at(a), at(b)]));
        let (from, to) = (at(a).as_dvec3(), at(b).as_dvec3());
        let way = to - from;
        let off = slack * slack * way.length_squared();
        let mut on_edge: Vec<(f64, u32)> = Vec::new();
        self.visit(from.min(to) - slack, from.max(to) + slack, |vertex| {
            let from_a = at(vertex).as_dvec3() - from;
            let along = from_a.dot(way);
            let is_inside = along > 0.0 && along < way.length_squared() && vertex != a && vertex != b;
            if is_inside && from_a.cross(way).length_squared() <= off && names[vertex as usize] == vertex {
                on_edge.push((along, vertex));
            }
        });
        on_edge.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        std::iter::once(a).chain(on_edge.into_iter().map(|(_, vertex)| vertex)).chain([b]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_is_cut_where_others_end_on_it() {
        // A square in two triangles beside a side that is cut at a third and at two thirds.
        let at = |x: f32, y: f32| Vec3::new(x, y, 7.0);
        let third = 1.0 / 3.0;
        let positions =
            [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(0.5, -1.0), at(third, 0.0), at(2.0 * third, 0.0)];
        let triangles = [[0, 1, 2], [3, 4, 0], [3, 5, 4], [3, 1, 5]];
        let topology = EdgeTopology::new(&positions, &triangles).unwrap();
        assert_eq!(topology.statistics().boundary, 8);
        let closed = close_seams(&positions, &topology, |_| true);
        let statistics = closed.statistics();
        assert_eq!((statistics.boundary, statistics.edges), (4, 9), "the common side is three edges");
        let pieces: Vec<_> =
            (0..closed.len()).filter(|&edge| closed.faces(edge).iter().any(|f| f.face() == 0)).collect();
        assert_eq!(pieces.len(), 5);
        assert!(
            pieces
                .iter()
                .all(|&edge| closed.multiplicity(edge, &[1, 1, 1, 1]) == 0 || closed.faces(edge).len() == 1)
        );
        // Without the middle one, its piece has one face.
        let open = close_seams(&positions, &topology, |face| face != 2);
        assert_eq!(open.statistics().boundary, 4 + 1 + 2);
    }

    #[test]
    fn nothing_is_cut_by_a_vertex_beside_it() {
        let positions = [
            Vec3::ZERO,
            Vec3::X,
            Vec3::Y,
            Vec3::new(0.5, -1e-5, 0.0),
            Vec3::new(0.5, -1.0, 0.0),
            Vec3::new(0.7, -1.0, 0.0),
        ];
        let topology = EdgeTopology::new(&positions, &[[0, 1, 2], [3, 4, 5]]).unwrap();
        assert_eq!(close_seams(&positions, &topology, |_| true).statistics().edges, 6);
    }
}
