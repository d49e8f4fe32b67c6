//! The edges that carry sides, extracted from the topology of all casters.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::Vec3;
use rayon::prelude::*;
use scene_core::geometry::{EdgeTopology, Incidence};

use crate::crossing::Edge;

/// Edges of a run: few enough that one lies within one object or a chunk of it, many enough that asking costs nothing beside
/// reading them.
const RUN: usize = 256;

/// Runs a task.
const RUNS_A_TASK: usize = 64;

/// Which faces the edges have, by runs of 256. Holds as long as the topology does.
#[derive(Clone, Debug, Default)]
pub struct EdgeRuns {
    /// The least face of a run's edges, and one past the greatest.
    faces: Vec<Range<usize>>,
    /// Runs all of whose edges have two faces, as those of a closed surface have.
    is_paired: Vec<bool>,
}

impl EdgeRuns {
    /// The runs of `topology`.
    pub fn new(topology: &EdgeTopology) -> Self {
        let starts = (0..topology.len().div_ceil(RUN)).into_par_iter().with_min_len(RUNS_A_TASK);
        let faces_of = |run: usize| {
            let faces =
                edges_of(run, topology).flat_map(|edge| topology.faces(edge)).map(|f| f.face() as usize);
            let nothing = Range { start: usize::MAX, end: 0 };
            faces.fold(nothing, |range, face| range.start.min(face)..range.end.max(face + 1))
        };
        let paired = |run: usize| edges_of(run, topology).all(|edge| topology.faces(edge).len() == 2);
        Self { faces: starts.clone().map(faces_of).collect(), is_paired: starts.map(paired).collect() }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.faces[..]) + size_of_val(&self.is_paired[..])
    }

    /// Whether a run has a face that may be in one of `ranges`, which ascend.
    fn touches(&self, run: usize, ranges: &[Range<usize>]) -> bool {
        let faces = &self.faces[run];
        let first = ranges.partition_point(|range| range.end <= faces.start);
        ranges.get(first).is_some_and(|range| range.start < faces.end)
    }
}

fn edges_of(run: usize, topology: &EdgeTopology) -> Range<usize> {
    run * RUN..((run + 1) * RUN).min(topology.len())
}

/// The silhouette of the faces that `facing` turns, one entry a triangle; a face of 0 is as if it were not there.
/// In order of the topology, whatever the number of threads.
///
/// Reads the faces of every edge and their facings, of the silhouette's the vertices, and writes next to nothing.
pub fn extract(edges: (&EdgeTopology, &EdgeRuns), positions: &[Vec3], facing: &[i8]) -> Vec<Edge> {
    let none_left_out = |_: usize| true;
    extract_where(edges, positions, facing, none_left_out, usize::MAX).unwrap_or_default()
}

/// The edges, of up to 64 that have two faces each, whose faces do not cancel, a bit each. Without a branch: most cancel, but which
/// do not cannot be foreseen, and a row of two needs no look at where it starts.
#[inline]
fn open_pairs(faces: &[Incidence], facing: &[i8]) -> u64 {
    let turned = |face: Incidence| face.sign() as i8 * facing[face.face() as usize];
    let pairs = faces.chunks_exact(2).enumerate();
    pairs.fold(0, |open, (edge, pair)| open | u64::from(turned(pair[0]) + turned(pair[1]) != 0) << edge)
}

/// The same of faces that are 0 outside of `ranges`, which ascend: runs of edges with no face there are not read. `None` if there
/// are more than `most` edges, which is noticed as soon as so many are found.
pub fn extract_within(
    (topology, runs): (&EdgeTopology, &EdgeRuns),
    positions: &[Vec3],
    facing: &[i8],
    ranges: &[Range<usize>],
    most: usize,
) -> Option<Vec<Edge>> {
    extract_where((topology, runs), positions, facing, |run| runs.touches(run, ranges), most)
}

fn extract_where(
    (topology, by_run): (&EdgeTopology, &EdgeRuns),
    positions: &[Vec3],
    facing: &[i8],
    takes: impl Fn(usize) -> bool + Sync,
    most: usize,
) -> Option<Vec<Edge>> {
    let runs = topology.len().div_ceil(RUN);
    let total = AtomicUsize::new(0);
    let starts: Vec<usize> = (0..runs).step_by(RUNS_A_TASK).collect();
    // However the tasks follow each other, the total passes the limit at some time or at none.
    let parts: Option<Vec<Vec<Edge>>> = starts
        .into_par_iter()
        .map(|start| {
            let mut found = Vec::new();
            for run in (start..(start + RUNS_A_TASK).min(runs)).filter(|&run| takes(run)) {
                let before = found.len();
                let mut take = |edge: usize| {
                    let multiplicity = topology.multiplicity(edge, facing);
                    if multiplicity != 0 {
                        let [a, b] = topology.vertices()[edge].map(|i| positions[i as usize]);
                        found.push(Edge::new(a, b, multiplicity));
                    }
                };
                let edges = edges_of(run, topology);
                if by_run.is_paired[run] {
                    let end = edges.end;
                    for first in edges.step_by(64) {
                        let mut open = open_pairs(topology.faces_of(first..end.min(first + 64)), facing);
                        while open != 0 {
                            take(first + open.trailing_zeros() as usize);
                            open &= open - 1;
                        }
                    }
                } else {
                    edges.for_each(take);
                }
                let new = found.len() - before;
                if total.fetch_add(new, Ordering::Relaxed) + new > most {
                    return None;
                }
            }
            Some(found)
        })
        .collect();
    parts.map(|parts| parts.concat())
}

#[cfg(test)]
mod tests {
    use scene_core::geometry::facing;
    use scene_core::scenes;

    use super::*;

    #[test]
    fn runs_that_are_not_read_have_no_edge() {
        let setup = scenes::build("chess", 0.0).unwrap();
        let (scene, light) = (&setup.scene, setup.lights[0].center());
        let topology = EdgeTopology::of_scene(scene, |_| true).unwrap();
        let runs = EdgeRuns::new(&topology);
        let all = facing(scene.positions(), scene.triangles(), light);
        let third = all.len() / 3;
        for ranges in [vec![], vec![0..third, third..all.len()], vec![10..third, 2 * third..2 * third + 900]]
        {
            let mut some = vec![0; all.len()];
            ranges.iter().for_each(|range| some[range.clone()].copy_from_slice(&all[range.clone()]));
            let expected = extract((&topology, &runs), scene.positions(), &some);
            let within = |most| extract_within((&topology, &runs), scene.positions(), &some, &ranges, most);
            assert_eq!(within(expected.len()), Some(expected.clone()));
            assert!(expected.is_empty() || within(expected.len() - 1).is_none());
        }
    }
}
