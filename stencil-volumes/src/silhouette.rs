//! The edges that carry sides, extracted from the topology of all casters.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::Vec3;
use rayon::prelude::*;
use scene_core::geometry::EdgeTopology;

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
        Self { faces: starts.map(faces_of).collect() }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.faces[..])
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
/// Reads two vertex indices, a row of incidences and their facings an edge and writes next to nothing: it runs at
/// the speed of memory.
pub fn extract(topology: &EdgeTopology, positions: &[Vec3], facing: &[i8]) -> Vec<Edge> {
    let none_left_out = |_: usize| true;
    extract_where(topology, positions, facing, none_left_out, usize::MAX).unwrap_or_default()
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
    extract_where(topology, positions, facing, |run| runs.touches(run, ranges), most)
}

fn extract_where(
    topology: &EdgeTopology,
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
                for edge in edges_of(run, topology) {
                    let multiplicity = topology.multiplicity(edge, facing);
                    if multiplicity != 0 {
                        let [a, b] = topology.vertices()[edge].map(|i| positions[i as usize]);
                        found.push(Edge::new(a, b, multiplicity));
                    }
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
            let expected = extract(&topology, scene.positions(), &some);
            let within = |most| extract_within((&topology, &runs), scene.positions(), &some, &ranges, most);
            assert_eq!(within(expected.len()), Some(expected.clone()));
            assert!(expected.is_empty() || within(expected.len() - 1).is_none());
        }
    }
}
