//! The three passes: project vertices, sort triangles into bands, fill bands.

use std::ops::Range;

use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;

use super::bins::{BAND_ROWS, Bins, Piece, sort_piece};
use super::clip::FlatTriangle;
use super::cutout::Cutout;
use super::depth::Cull;
use super::pixels::Pixels;
use super::projection::{Projection, ScreenVertex};
use super::spans::Tests;
use super::{small, spans};
use crate::Scene;

/// Vertices a task of the first pass projects.
const VERTEX_CHUNK: usize = 4096;
/// Triangles a task of the second pass sorts at least: below that starting it costs more than it does.
const TRIANGLE_CHUNK: usize = 4096;

/// Memory that drawing needs besides its target. Kept from frame to frame, it is not allocated again; its
/// contents never influence a result.
#[derive(Debug)]
pub struct RasterScratch {
    pub(super) level: Level,
    vertices: Vec<ScreenVertex>,
    pieces: Vec<Piece>,
    tasks: Vec<Range<usize>>,
    bins: Vec<Bins>,
}

impl Default for RasterScratch {
    fn default() -> Self {
        Self::new()
    }
}

impl RasterScratch {
    /// Holds nothing yet.
    pub fn new() -> Self {
        Self {
            level: Level::new(),
            vertices: Vec::new(),
            pieces: Vec::new(),
            tasks: Vec::new(),
            bins: Vec::new(),
        }
    }
}

/// What is drawn and how.
pub(super) struct Drawing<'a> {
    pub(super) scene: &'a Scene,
    pub(super) projection: Projection,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) cull: Cull,
    /// Depths out of range are clamped instead of rejected.
    pub(super) clamp: bool,
    /// Columns and rows that matter.
    pub(super) window: [Range<i32>; 2],
}

/// What every task reads.
pub(super) struct Frame<'a> {
    pub(super) scene: &'a Scene,
    pub(super) projection: &'a Projection,
    pub(super) vertices: &'a [ScreenVertex],
    pub(super) width: i32,
    pub(super) height: i32,
    pub(super) cull: Cull,
    pub(super) clamp: bool,
    /// Triangles that touch none of these columns or none of these rows are not sorted in.
    pub(super) window: [Range<i32>; 2],
}

/// Draws the triangles of `ranges`, each within one object, into `bands`, which take 32 rows each from the top.
pub(super) fn draw<P: Pixels>(
    drawing: &Drawing<'_>,
    ranges: impl Iterator<Item = (Range<usize>, u32)> + Clone,
    scratch: &mut RasterScratch,
    bands: impl IndexedParallelIterator<Item = P>,
) {
    let level = scratch.level;
    scratch.plan(drawing.scene, ranges);
    scratch.project(drawing);
    let frame = Frame {
        scene: drawing.scene,
        projection: &drawing.projection,
        vertices: &scratch.vertices,
        width: drawing.width as i32,
        height: drawing.height as i32,
        cull: drawing.cull,
        clamp: drawing.clamp,
        window: drawing.window.clone(),
    };
    let [columns, rows] = &drawing.window;
    let bands_seen = match columns.is_empty() || rows.is_empty() {
        true => 0..0,
        false => rows.start as usize / BAND_ROWS..(rows.end as usize).div_ceil(BAND_ROWS),
    };
    let band_count = (drawing.height as usize).div_ceil(BAND_ROWS);
    let bins = &mut scratch.bins[..scratch.tasks.len()];
    bins.par_iter_mut().zip(scratch.tasks.par_iter()).for_each(|(bins, task)| {
        bins.reset(band_count);
        for piece in &scratch.pieces[task.clone()] {
            dispatch!(level, simd => sort_piece(simd, &frame, piece, bins));
        }
    });
    let bins = &scratch.bins[..scratch.tasks.len()];
    bands.enumerate().filter(|(band, _)| bands_seen.contains(band)).for_each(|(band, mut pixels)| {
        pixels.begin();
        dispatch!(level, simd => fill_band(simd, &frame, band, bins, &mut pixels));
        pixels.finish();
    });
}

impl RasterScratch {
    /// Cuts what is to be drawn into tasks of about equal size.
    fn plan(&mut self, scene: &Scene, ranges: impl Iterator<Item = (Range<usize>, u32)> + Clone) {
        self.pieces.clear();
        self.tasks.clear();
        let total: usize = ranges.clone().map(|(range, _)| range.len()).sum();
        // Four a thread even out; how many there are changes no result.
        let share = total.div_ceil(rayon::current_num_threads() * 4).max(TRIANGLE_CHUNK);
        let (mut first_piece, mut triangles) = (0, 0);
        for (range, object) in ranges {
            let cutout = scene.objects()[object as usize].alpha.is_some();
            let mut start = range.start;
            while start < range.end {
                let end = range.end.min(start + (share - triangles));
                self.pieces.push(Piece { triangles: start..end, cutout });
                triangles += end - start;
                start = end;
                if triangles == share {
                    self.tasks.push(first_piece..self.pieces.len());
                    (first_piece, triangles) = (self.pieces.len(), 0);
                }
            }
        }
        if triangles > 0 {
            self.tasks.push(first_piece..self.pieces.len());
        }
        if self.bins.len() < self.tasks.len() {
            self.bins.resize_with(self.tasks.len(), Bins::default);
        }
    }

    /// Projects the scene's vertices: all, or where few triangles are drawn those between their least and their
    /// greatest, piece by piece.
    fn project(&mut self, drawing: &Drawing<'_>) {
        let level = self.level;
        let positions = drawing.scene.positions();
        if self.vertices.len() < positions.len() {
            // Zeroes that nobody looks at cost no memory.
            self.vertices = vec![[0; 4]; positions.len()];
        }
        let project = |(vertices, positions): (&mut [ScreenVertex], &[glam::Vec3])| {
            dispatch!(level, simd => project_vertices(simd, &drawing.projection, positions, vertices));
        };
        let drawn: usize = self.pieces.iter().map(|piece| piece.triangles.len()).sum();
        if 2 * drawn >= drawing.scene.triangles().len() {
            let vertices = self.vertices[..positions.len()].par_chunks_mut(VERTEX_CHUNK);
            vertices.zip(positions.par_chunks(VERTEX_CHUNK)).for_each(project);
            return;
        }
        let mut parts = Vec::with_capacity(self.pieces.len());
        let (mut rest, mut start) = (&mut self.vertices[..], 0);
        for range in vertices_of(drawing.scene, &self.pieces) {
            let (part, after) = rest[range.start - start..].split_at_mut(range.len());
            (rest, start) = (after, range.end);
            parts.extend(part.chunks_mut(VERTEX_CHUNK).zip(positions[range].chunks(VERTEX_CHUNK)));
        }
        parts.into_par_iter().for_each(project);
    }
}

/// Ascending and disjoint ranges that hold the vertices of all pieces.
fn vertices_of(scene: &Scene, pieces: &[Piece]) -> Vec<Range<usize>> {
    let of = |piece: &Piece| {
        let corners = scene.triangles()[piece.triangles.clone()].iter().flatten();
        let [first, last] = corners.fold([u32::MAX, 0], |[first, last], &i| [first.min(i), last.max(i)]);
        first as usize..last as usize + 1
    };
    let mut ranges: Vec<_> = pieces.par_iter().filter(|piece| !piece.triangles.is_empty()).map(of).collect();
    ranges.sort_unstable_by_key(|range| range.start);
    ranges.dedup_by(|next, last| {
        let joins = next.start <= last.end;
        if joins {
            last.end = last.end.max(next.end);
        }
        joins
    });
    ranges
}

#[inline(always)]
fn project_vertices<S: Simd>(
    _simd: S,
    projection: &Projection,
    positions: &[glam::Vec3],
    vertices: &mut [ScreenVertex],
) {
    for (vertex, &position) in vertices.iter_mut().zip(positions) {
        *vertex = projection.vertex(position);
    }
}

#[inline(always)]
fn fill_band<S: Simd>(simd: S, frame: &Frame<'_>, band: usize, bins: &[Bins], pixels: &mut impl Pixels) {
    for bins in bins {
        let bin = &bins.bands[band];
        small::fill_tiny(simd, frame, band, &bin.tiny, pixels);
        small::fill_small(simd, frame, band, &bin.small, pixels);
        for &id in &bin.large {
            let triangle = FlatTriangle::whole(frame, id);
            spans::fill(simd, frame, band, &triangle, &Tests::NONE, pixels);
        }
        for &index in &bin.flat {
            let triangle = &bins.flat[index as usize];
            let [far, near] = frame.projection.range;
            let in_range = triangle.nearness.iter().all(|n| (far..=near).contains(n));
            let tests = Tests {
                range: (!in_range).then_some([far as f32, near as f32]),
                clamp: frame.clamp,
                cutout: Cutout::new(frame.scene, frame.projection, triangle.id as usize),
            };
            spans::fill(simd, frame, band, triangle, &tests, pixels);
        }
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::Level;
    use glam::{Affine3A, Mat4, Vec3};

    use super::RasterScratch;
    use crate::geometry::ObjectFlags;
    use crate::raster::{DepthConvention, DepthMap, DepthOptions, render_depth_and_objects_into};
    use crate::{Scene, TriangleMesh};

    /// Every level of vector instructions this processor has.
    fn levels() -> Vec<Level> {
        let best = Level::new();
        let mut levels = vec![Level::baseline(), best];
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        {
            use fearless_simd::Simd as _;
            levels.extend(best.as_sse2().map(|s| s.level()));
            levels.extend(best.as_sse4_2().map(|s| s.level()));
            levels.extend(best.as_avx2().map(|s| s.level()));
        }
        levels
    }

    #[test]
    fn every_level_of_vector_instructions_gives_the_same_bits() {
        // A sheet of waves in which triangles of all sizes occur, some across near, far and the sides.
        let side = 120_u32;
        let mut positions = Vec::new();
        for i in 0..side * side {
            let (x, y) = ((i % side) as f32 / 60.0 - 1.0, (i / side) as f32 / 60.0 - 1.0);
            let stretch = (x * 5.0).exp2() * 0.1;
            positions.push(Vec3::new(x * 1.3, y * stretch, 0.5 + 0.55 * (x * 7.0).sin() * (y * 11.0).cos()));
        }
        let mut triangles = Vec::new();
        for i in (0..side - 1).flat_map(|row| (0..side - 1).map(move |column| row * side + column)) {
            triangles.extend([[i, i + 1, i + side], [i + 1, i + side + 1, i + side]]);
        }
        let mut scene = Scene::new();
        for _ in 0..2 {
            let mesh = TriangleMesh::new("waves", positions.clone(), triangles.clone());
            scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
            positions.iter_mut().for_each(|p| *p = Vec3::new(p.y, p.x, p.z + 0.01));
        }
        for convention in [DepthConvention::Reversed, DepthConvention::Forward] {
            let options = DepthOptions { convention, ..Default::default() };
            let drawn: Vec<_> = levels()
                .into_iter()
                .map(|level| {
                    let mut scratch = RasterScratch { level, ..RasterScratch::new() };
                    let mut map = DepthMap { width: 517, height: 301, depth: Vec::new() };
                    let mut objects = Vec::new();
                    let matrix = Mat4::IDENTITY;
                    render_depth_and_objects_into(
                        &scene,
                        matrix,
                        &options,
                        &mut scratch,
                        &mut map,
                        &mut objects,
                    );
                    (map.depth.iter().map(|d| d.to_bits()).collect::<Vec<_>>(), objects)
                })
                .collect();
            assert!(drawn[0].1.contains(&0) && drawn[0].1.contains(&1));
            assert!(drawn.iter().all(|d| *d == drawn[0]));
        }
    }
}
