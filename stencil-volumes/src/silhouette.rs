//! The edges that carry sides, extracted from the topology of all casters.

use glam::Vec3;
use rayon::prelude::*;
use scene_core::geometry::EdgeTopology;

use crate::crossing::Edge;

/// Edges a task.
const CHUNK: usize = 1 << 14;

/// The silhouette of the faces that `facing` turns, one entry a triangle; a face of 0 is as if it were not there.
/// In order of the topology, whatever the number of threads.
///
/// Reads two vertex indices, a row of incidences and their facings an edge and writes next to nothing: it runs at
/// the speed of memory.
pub fn extract(topology: &EdgeTopology, positions: &[Vec3], facing: &[i8]) -> Vec<Edge> {
    let starts: Vec<usize> = (0..topology.len()).step_by(CHUNK).collect();
    let parts: Vec<Vec<Edge>> = starts
        .into_par_iter()
        .map(|start| {
            let mut found = Vec::new();
            for edge in start..(start + CHUNK).min(topology.len()) {
                let multiplicity = topology.multiplicity(edge, facing);
                if multiplicity != 0 {
                    let [a, b] = topology.vertices()[edge].map(|i| positions[i as usize]);
                    found.push(Edge::new(a, b, multiplicity));
                }
            }
            found
        })
        .collect();
    parts.concat()
}
