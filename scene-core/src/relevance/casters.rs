//! Which casters lie in a region, whole objects first and, inside of big ones, chunks of triangles.

use std::ops::Range;

use rayon::prelude::*;

use super::{CasterRegion, Side};
use crate::geometry::Aabb;
use crate::{Report, Scene};

/// Triangles of a chunk. A chunk's test costs some 20 ns and spares as many triangles, of 10 ns or more each.
const CHUNK: usize = 256;

/// Bounds of the casters' triangles by runs of 256. It holds as long as the scene does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CasterChunks {
    /// Per object where its chunks start in `bounds`, and the end of the last one's.
    starts: Vec<usize>,
    bounds: Vec<Aabb>,
}

impl CasterChunks {
    /// The chunks of every object that casts. Takes a pass over the triangles.
    pub fn new(scene: &Scene) -> Self {
        let mut starts = vec![0];
        let mut runs = Vec::new();
        for object in scene.objects() {
            if object.flags.casts {
                let Range { start, end } = object.triangles;
                runs.extend((start..end).step_by(CHUNK).map(|first| first..end.min(first + CHUNK)));
            }
            starts.push(runs.len());
        }
        let (positions, triangles) = (scene.positions(), scene.triangles());
        let bounds_of = |run: &Range<usize>| {
            let corners = triangles[run.clone()].iter().flatten();
            Aabb::from_points(corners.map(|&i| positions[i as usize]))
        };
        Self { starts, bounds: runs.par_iter().map(bounds_of).collect() }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.starts.as_slice()) + size_of_val(self.bounds.as_slice())
    }
}

/// The casters that matter, as ranges of [`Scene::triangles`], and what was left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RelevantCasters {
    /// Ascending, disjoint, none empty; a range may go over several objects, of which only those that cast count.
    pub ranges: Vec<Range<usize>>,
    /// Casting objects of which something is kept.
    pub objects_kept: usize,
    /// Casting objects left out.
    pub objects_culled: usize,
    /// Casting triangles kept.
    pub triangles_kept: usize,
    /// Casting triangles left out.
    pub triangles_culled: usize,
}

impl RelevantCasters {
    /// Books what was left out.
    pub fn book(&self, report: &mut Report) {
        report.skip("casters outside view", self.objects_culled as u64);
        report.skip("caster triangles outside view", self.triangles_culled as u64);
    }

    fn keep(&mut self, range: Range<usize>) {
        self.triangles_kept += range.len();
        match self.ranges.last_mut() {
            Some(last) if last.end == range.start => last.end = range.end,
            _ => self.ranges.push(range),
        }
    }
}

/// The casters with a part in `region`, of those that `consider` accepts by their id. `chunks` must be of the
/// same scene; objects it does not know are kept or left out as a whole.
pub fn relevant_casters(
    scene: &Scene,
    region: &CasterRegion,
    chunks: &CasterChunks,
    mut consider: impl FnMut(u32) -> bool,
) -> RelevantCasters {
    let mut casters = RelevantCasters::default();
    for (id, object) in scene.objects().iter().enumerate() {
        if !object.flags.casts || object.triangles.is_empty() || !consider(id as u32) {
            continue;
        }
        let before = casters.triangles_kept;
        let runs = match (chunks.starts.get(id), chunks.starts.get(id + 1)) {
            (Some(&start), Some(&end)) => &chunks.bounds[start..end],
            _ => &[],
        };
        match region.side_of(&object.bounds) {
            Side::Outside => {}
            // A single chunk is no tighter than its object.
            Side::Across if runs.len() > 1 => {
                for (first, bounds) in object.triangles.clone().step_by(CHUNK).zip(runs) {
                    if region.touches(bounds) {
                        casters.keep(first..object.triangles.end.min(first + CHUNK));
                    }
                }
            }
            Side::Across | Side::Inside => casters.keep(object.triangles.clone()),
        }
        let kept = casters.triangles_kept - before;
        casters.triangles_culled += object.triangles.len() - kept;
        if kept > 0 {
            casters.objects_kept += 1;
        } else {
            casters.objects_culled += 1;
        }
    }
    casters
}
