//! The sides of faces by the edge they lie at: what all knowledge of edges is made from.
//!
//! Sides are dealt to buckets of neighbouring vertices by their edge's lower one, and a bucket's are put in a row a vertex; a row
//! has but a few, and is sorted by the upper vertex. Time is linear but for that.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::deal::{Dealt, MOST_BUCKETS};
use super::{EdgeTopology, Object, Scene, TopologyError, weld};

/// Vertices of a bucket at least: with their sides they fit into a core's cache.
const PER_BUCKET: usize = 8192;

/// Faces that are dealt together.
const PER_CHUNK: usize = 1 << 16;

/// A side of a face.
#[derive(Clone, Copy, Default)]
struct Side {
    lower: u32,
    upper: u32,
    name: u32,
}

/// The sides of a soup's faces, but of those that repeat a welded vertex.
pub(super) struct Sides {
    chunks: Vec<Dealt<Side>>,
    vertices: usize,
    /// Vertices of a bucket.
    per_bucket: usize,
    /// Faces left out: their boundary cancels itself.
    pub(super) degenerate: usize,
}

impl Sides {
    fn new(
        triangles: &[[u32; 3]],
        ranges: &[Range<usize>],
        representative: &[u32],
        name: impl Fn(u32, u32, bool) -> u32 + Sync,
    ) -> Self {
        let vertices = representative.len();
        let per_bucket = vertices.div_ceil(MOST_BUCKETS).max(PER_BUCKET);
        let buckets = vertices.div_ceil(per_bucket);
        let welded = |face: usize| triangles[face].map(|i| representative[i as usize]);
        let deal = |chunk: usize| {
            let chunk = chunk * PER_CHUNK..((chunk + 1) * PER_CHUNK).min(triangles.len());
            let from = ranges.partition_point(|range| range.end <= chunk.start);
            let within = ranges[from..].iter().take_while(|range| range.start < chunk.end);
            let faces: Vec<_> =
                within.map(|range| range.start.max(chunk.start)..range.end.min(chunk.end)).collect();
            let faces = || faces.iter().cloned().flatten();
            let sides = |face: usize| {
                let [a, b, c] = welded(face);
                let sides = if is_degenerate([a, b, c]) { [].iter() } else { [0, 1, 2].iter() };
                sides.map(move |&side| {
                    let (from, to) = ([a, b, c][side], [b, c, a][side]);
                    (face as u32, side as u32, from, to)
                })
            };
            let dealt = Dealt::new(buckets, || {
                faces().flat_map(sides).map(|(face, side, from, to)| {
                    let (lower, upper) = (from.min(to), from.max(to));
                    (lower as usize / per_bucket, Side { lower, upper, name: name(face, side, from < to) })
                })
            });
            (dealt, faces().filter(|&face| is_degenerate(welded(face))).count())
        };
        let dealt: Vec<_> = (0..triangles.len().div_ceil(PER_CHUNK)).into_par_iter().map(deal).collect();
        let degenerate = dealt.iter().map(|&(_, degenerate)| degenerate).sum();
        Self { chunks: dealt.into_iter().map(|(chunk, _)| chunk).collect(), vertices, per_bucket, degenerate }
    }

    /// Of those objects of a scene that `take` chooses, welded across objects.
    pub(super) fn of_scene(
        scene: &Scene,
        take: impl Fn(&Object) -> bool,
        name: impl Fn(u32, u32, bool) -> u32 + Sync,
    ) -> Result<Self, TopologyError> {
        let taken = scene.objects().iter().filter(|&object| take(object));
        let ranges: Vec<_> = taken.map(|object| object.triangles.clone()).collect();
        Self::of_ranges(scene.positions(), scene.triangles(), &ranges, name)
    }

    /// Of the `triangles` in `ranges`, which ascend. Indices are in range. `name` is told face, side (from corner i to i + 1) and
    /// whether that runs from the lower welded vertex to the upper.
    pub(super) fn of_ranges(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        ranges: &[Range<usize>],
        name: impl Fn(u32, u32, bool) -> u32 + Sync,
    ) -> Result<Self, TopologyError> {
        if triangles.len() > EdgeTopology::MAX_TRIANGLES {
            return Err(TopologyError::TooManyTriangles { count: triangles.len() });
        }
        Ok(Self::new(triangles, ranges, &weld(positions).representative, name))
    }

    /// What `take` makes of the edges of each bucket, in the order of their vertices.
    pub(super) fn by_bucket<R: Send>(&self, take: impl Fn(&Rows) -> R + Sync) -> Vec<R> {
        let of_bucket = |bucket: usize| {
            let first = bucket * self.per_bucket;
            let vertices = self.per_bucket.min(self.vertices - first);
            let sides = || self.chunks.iter().flat_map(|chunk| chunk.bucket(bucket));
            take(&Rows::new(first as u32, vertices, sides))
        };
        (0..self.vertices.div_ceil(self.per_bucket)).into_par_iter().map(of_bucket).collect()
    }
}

/// Sides of one bucket, a row for each vertex.
pub(super) struct Rows {
    first_vertex: u32,
    vertices: usize,
    /// The upper vertex above the side's name, which sorts as the pair does.
    entries: Dealt<u64>,
}

impl Rows {
    fn new<'a, I>(first_vertex: u32, vertices: usize, sides: impl Fn() -> I) -> Self
    where
        I: Iterator<Item = &'a Side>,
    {
        let mut entries = Dealt::new(vertices, || {
            sides().map(|&Side { lower, upper, name }| {
                ((lower - first_vertex) as usize, u64::from(upper) << 32 | u64::from(name))
            })
        });
        (0..vertices).for_each(|row| entries.bucket_mut(row).sort_unstable());
        Self { first_vertex, vertices, entries }
    }

    /// Edges with their two vertices, the lower first, in order; and the names of their sides, in order, each in the lower half
    /// of a number.
    pub(super) fn edges(&self) -> impl Iterator<Item = ([u32; 2], &[u64])> {
        (self.first_vertex..).zip(0..self.vertices).flat_map(|(lower, row)| {
            let edges = self.entries.bucket(row).chunk_by(|a, b| a >> 32 == b >> 32);
            edges.map(move |edge| ([lower, (edge[0] >> 32) as u32], edge))
        })
    }

    /// Sides of all edges.
    pub(super) fn entries(&self) -> &[u64] {
        self.entries.things()
    }
}

#[inline]
fn is_degenerate([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// More faces than a chunk, more vertices than a bucket, some faces degenerate, some left out.
    #[test]
    fn edges_have_the_sides_that_a_map_has() {
        const VERTICES: u32 = 20_000;
        let corner = |face: u32, i: u32| (face * 3 + i).wrapping_mul(2_654_435_761) >> 8;
        let triangles: Vec<[u32; 3]> =
            (0..150_000).map(|face| [0, 1, 2].map(|i| corner(face / 2, i) % VERTICES % (19 << i))).collect();
        let representative: Vec<u32> = (0..VERTICES).collect();
        let ranges = [0..10, 40_000..70_000, 70_000..140_000];
        let sides = Sides::new(&triangles, &ranges, &representative, |face, side, _| 3 * face + side);
        let found: Vec<_> = sides
            .by_bucket(|rows| {
                let names = |edge: &[u64]| edge.iter().map(|&name| name as u32).collect::<Vec<_>>();
                rows.edges().map(|(edge, sides)| (edge, names(sides))).collect::<Vec<_>>()
            })
            .concat();

        let (mut expected, mut degenerate) = (BTreeMap::<[u32; 2], Vec<u32>>::new(), 0);
        for face in ranges.into_iter().flatten() {
            let corners = triangles[face];
            if is_degenerate(corners) {
                degenerate += 1;
                continue;
            }
            for side in 0..3 {
                let (from, to) = (corners[side], corners[(side + 1) % 3]);
                expected.entry([from.min(to), from.max(to)]).or_default().push((3 * face + side) as u32);
            }
        }
        assert!(degenerate > 0 && expected.values().any(|sides| sides.len() > 2));
        assert_eq!(sides.degenerate, degenerate);
        assert_eq!(found, expected.into_iter().collect::<Vec<_>>());
    }
}
