//! What is asked of a scene's casters, as tables on the device: runs of triangles, and points of those that the scene marks.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use scene_core::Scene;
use scene_core::geometry::Aabb;
use scene_core::gpu::{GeometryBuffers, GpuError, GpuObject, GpuScene, RUN, binding_limit, storage_buffer};

use super::layout::{CloudOnGpu, NO_CLOUD, RunOnGpu};
use crate::points::{PIECE, PointClouds, along};

/// What the tables are made from: they hold as long as it is the same.
#[derive(Debug)]
struct MadeFor {
    buffers: GeometryBuffers,
    /// With their ids.
    casters: Vec<(u32, GpuObject)>,
    has_geometry: bool,
}

/// What is asked of a scene's casters, as tables on the device.
#[derive(Debug)]
pub(super) struct CasterTables {
    made_for: MadeFor,
    /// [`RunOnGpu`]s.
    pub(super) runs: wgpu::Buffer,
    pub(super) run_count: u32,
    /// [`CloudOnGpu`]s.
    pub(super) clouds: wgpu::Buffer,
    /// Of [`PIECE`] points of a cloud at most its number and the first, two u32.
    pub(super) pieces: wgpu::Buffer,
    pub(super) piece_count: u32,
    /// Of each point the triangle it lies on, and where, as `splats.wesl` reads it.
    pub(super) points: wgpu::Buffer,
    /// Triangles in all runs.
    pub(super) triangles: u64,
    /// Of the objects with masks.
    pub(super) masked: Arc<[Range<u32>]>,
}

/// The points of objects that are drawn.
#[derive(Debug, Default)]
pub(super) struct CloudTables {
    clouds: Vec<CloudOnGpu>,
    pieces: Vec<[u32; 2]>,
    points: Vec<[u32; 2]>,
    /// Per object.
    of_object: Vec<u32>,
}

impl CloudTables {
    /// Of those of `casters`, by their ids, that the scene marks.
    pub(super) fn new(scene: &Scene, casters: &[(u32, GpuObject)]) -> Self {
        let clouds = PointClouds::new(scene);
        let is_drawn = |object: usize| casters.binary_search_by_key(&(object as u32), |(id, _)| *id).is_ok();
        let mut tables = Self { of_object: vec![NO_CLOUD; scene.objects().len()], ..Self::default() };
        for cloud in clouds.clouds().iter().filter(|cloud| is_drawn(cloud.object)) {
            let (id, first) = (tables.clouds.len() as u32, tables.points.len() as u32);
            let bounds = scene.objects()[cloud.object].bounds;
            let count = cloud.points.len() as u32;
            tables.of_object[cloud.object] = id;
            tables.clouds.push(CloudOnGpu {
                low: bounds.min,
                first,
                high: bounds.max,
                count,
                area: cloud.area as f32,
                padding: [0; 3],
            });
            tables.pieces.extend((first..first + count).step_by(PIECE as usize).map(|point| [id, point]));
            let points = (0..).zip(&cloud.points).map(|(index, point)| {
                let [u, v] = along(cloud.object, index).map(|share| (share * 65_535.0).round() as u32);
                [point.triangle, u | v << 16]
            });
            tables.points.extend(points);
        }
        tables
    }
}

impl CasterTables {
    /// Of `casters`, by their ids, with `clouds` of those that are marked.
    pub(super) fn new(
        device: &wgpu::Device,
        scene: &GpuScene<'_>,
        casters: Vec<(u32, GpuObject)>,
        clouds: CloudTables,
    ) -> Result<Self, GpuError> {
        // More points than the device binds are drawn by their triangles.
        let fits = size_of_val(clouds.points.as_slice()) as u64 <= binding_limit(device);
        let tables = if fits { clouds } else { CloudTables::default() };
        let is_masked = |object: &GpuObject| object.has_mask && scene.cutouts.is_some();
        let mut objects: Vec<_> = casters.iter().collect();
        objects.sort_unstable_by_key(|(_, object)| object.triangles.start);
        let (masked, solid): (Vec<_>, Vec<_>) =
            objects.into_iter().partition(|(_, object)| is_masked(object));
        let cloud_of = |id: u32| tables.of_object.get(id as usize).copied().unwrap_or(NO_CLOUD);
        let solid: Vec<_> = solid.into_iter().map(|(id, object)| (object, cloud_of(*id))).collect();
        let runs = runs(scene, &solid);
        Ok(Self {
            run_count: runs.len() as u32,
            runs: storage_buffer(device, "runs of casters", bytemuck::cast_slice(&runs))?,
            clouds: storage_buffer(device, "clouds", bytemuck::cast_slice(&tables.clouds))?,
            piece_count: tables.pieces.len() as u32,
            pieces: storage_buffer(device, "pieces of clouds", bytemuck::cast_slice(&tables.pieces))?,
            points: storage_buffer(device, "points", bytemuck::cast_slice(&tables.points))?,
            triangles: runs.iter().map(|run| u64::from(run.end - run.first)).sum(),
            masked: masked.into_iter().map(|(_, object)| object.triangles.clone()).collect(),
            made_for: MadeFor {
                buffers: GeometryBuffers::new(scene),
                casters,
                has_geometry: scene.geometry.is_some(),
            },
        })
    }

    /// Whether they are those of these `casters` of `scene`, too.
    pub(super) fn are_of(&self, scene: &GpuScene<'_>, casters: &[(u32, GpuObject)]) -> bool {
        let MadeFor { buffers, casters: known, has_geometry } = &self.made_for;
        buffers.are_of(scene) && known == casters && *has_geometry == scene.geometry.is_some()
    }

    /// Bytes held on the device.
    pub(super) fn bytes(&self) -> u64 {
        [&self.runs, &self.clouds, &self.pieces, &self.points].into_iter().map(wgpu::Buffer::size).sum()
    }
}

/// Triangles of `solid`, in their order, by runs: small objects that follow one another share one if both fit into it.
fn runs(scene: &GpuScene<'_>, solid: &[(&GpuObject, u32)]) -> Vec<RunOnGpu> {
    let mut runs: Vec<RunOnGpu> = Vec::new();
    for (object, cloud) in solid {
        let Range { start, end } = object.triangles.clone();
        let Aabb { min, max } = object.bounds;
        if let Some(last) = runs.last_mut()
            && (last.end, last.cloud) == (start, *cloud)
            && end - last.first <= RUN
        {
            (last.end, last.low, last.high) = (end, last.low.min(min), last.high.max(max));
            continue;
        }
        runs.extend((start..end).step_by(RUN as usize).map(|first| RunOnGpu {
            low: min,
            first,
            high: max,
            end: end.min(first + RUN),
            cloud: *cloud,
            padding: [0; 3],
        }));
    }
    if let Some(geometry) = scene.geometry {
        runs.par_iter_mut().for_each(|run| {
            // Of triangles that the geometry does not have the object's bounds are known.
            let Some(triangles) = geometry.triangles().get(run.first as usize..run.end as usize) else {
                return;
            };
            let corners = triangles.iter().flatten();
            let bounds = Aabb::from_points(corners.map(|&i| geometry.positions()[i as usize]));
            (run.low, run.high) = (bounds.min, bounds.max);
        });
    }
    runs
}
