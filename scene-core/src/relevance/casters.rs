//! Which casters lie in a region, whole objects first and, inside of big ones, chunks of triangles.

use std::ops::Range;

use rayon::prelude::*;

use super::object_groups::ObjectGroups;
use super::{CasterRegion, HalfSpace, Side};
use crate::geometry::{Aabb, Object};
use crate::{Report, Scene};

/// Triangles of a chunk. A chunk's test costs some 20 ns and spares as many triangles, of 10 ns or more each.
pub(super) const CHUNK: usize = 256;

/// Bounds of the casters' triangles by runs of 256, and of all objects by groups. It holds as long as the scene does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CasterChunks {
    /// Per object where its chunks start in `bounds`, and the end of the last one's.
    starts: Vec<usize>,
    bounds: Vec<Aabb>,
    groups: ObjectGroups,
}

impl CasterChunks {
    /// The chunks of every object that casts, and groups of objects. Takes a pass over the triangles.
    pub fn new(scene: &Scene) -> Self {
        let mut starts = vec![0];
        let mut runs = Vec::new();
        for object in scene.objects() {
            if object.flags.casts {
                runs.extend(parts_of(object.triangles.clone(), CHUNK));
            }
            starts.push(runs.len());
        }
        let (positions, triangles) = (scene.positions(), scene.triangles());
        let bounds_of = |run: &Range<usize>| {
            let corners = triangles[run.clone()].iter().flatten();
            Aabb::from_points(corners.map(|&i| positions[i as usize]))
        };
        let bounds = runs.par_iter().map(bounds_of).collect();
        Self { starts, bounds, groups: ObjectGroups::new(scene) }
    }

    /// The runs of `object`, the scene's of this `id`, with their bounds; one that is not known is a single run.
    pub(super) fn runs_of(
        &self,
        id: usize,
        object: &Object,
    ) -> impl Iterator<Item = (Range<usize>, Aabb)> + use<'_> {
        let runs = match (self.starts.get(id), self.starts.get(id + 1)) {
            (Some(&start), Some(&end)) => &self.bounds[start..end],
            _ => &[],
        };
        // A single chunk is no tighter than its object.
        let is_single = runs.len() <= 1;
        let (whole, runs) =
            if is_single { (Some((object.triangles.clone(), object.bounds)), &[][..]) } else { (None, runs) };
        whole.into_iter().chain(parts_of(object.triangles.clone(), CHUNK).zip(runs.iter().copied()))
    }

    /// [`ObjectGroups::sides`].
    pub(super) fn sides(&self, scene: &Scene, planes: &[HalfSpace]) -> Vec<Side> {
        self.groups.sides(scene, planes)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let chunks = size_of_val(self.starts.as_slice()) + size_of_val(self.bounds.as_slice());
        chunks + self.groups.bytes()
    }
}

/// A range in parts of `size`, the last one perhaps shorter.
pub(super) fn parts_of(
    Range { start, end }: Range<usize>,
    size: usize,
) -> impl Iterator<Item = Range<usize>> {
    (start..end).step_by(size).map(move |first| first..end.min(first + size))
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
    let sides = chunks.sides(scene, region.planes());
    for ((id, object), side) in scene.objects().iter().enumerate().zip(sides) {
        if !object.flags.casts || object.triangles.is_empty() || !consider(id as u32) {
            continue;
        }
        let before = casters.triangles_kept;
        match side {
            _ if region.is_empty() => {}
            Side::Outside => {}
            Side::Across => {
                let touched = chunks.runs_of(id, object).filter(|(_, bounds)| region.touches(bounds));
                touched.for_each(|(run, _)| casters.keep(run));
            }
            Side::Inside => casters.keep(object.triangles.clone()),
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
