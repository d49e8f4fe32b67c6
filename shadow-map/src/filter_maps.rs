//! What filters read beside the maps: the plane of every triangle, turned to the light, and the nearest depth of
//! any rectangle of texels.

use glam::{Vec3, Vec4};
use rayon::prelude::*;
use scene_core::light::LightPoint;
use scene_core::{Report, Scene};

use crate::depth_pyramid::DepthPyramid;
use crate::light_maps::LightMaps;

/// Maps made ready for filters.
#[derive(Clone, Debug)]
pub struct FilterMaps<'a> {
    /// The maps.
    pub maps: LightMaps<'a>,
    /// Nearest depths, one pyramid a map.
    pub pyramids: Vec<DepthPyramid>,
    /// Leave out filters that have nothing to find.
    pub skip: bool,
    planes: Vec<Vec4>,
}

impl<'a> FilterMaps<'a> {
    /// `prepare.filter`.
    pub fn new(maps: LightMaps<'a>, skip: bool, report: &mut Report) -> Self {
        let (planes, pyramids) = report.time("prepare.filter", |_| {
            let planes = light_side_planes(&maps.scene, maps.light.center());
            (planes, maps.maps.iter().map(|view| DepthPyramid::new(&view.map)).collect::<Vec<_>>())
        });
        let bytes = pyramids.iter().map(DepthPyramid::bytes).sum::<u64>();
        report.bytes += bytes + size_of_val(planes.as_slice()) as u64;
        Self { maps, pyramids, skip, planes }
    }

    /// Question 2 of [`receiver_plane`](crate::receiver_plane), from stored planes: whether `point` lies behind
    /// `triangle` by more than `tolerance`.
    #[inline]
    pub fn is_behind(&self, triangle: usize, point: Vec3, tolerance: f32) -> bool {
        let plane = self.planes[triangle];
        plane.truncate().dot(point) + plane.w < -tolerance
    }
}

/// The plane n·x + w = 0 of each triangle with the unit normal n on the light's side; zero for a triangle without
/// area or seen edge-on, which hides nothing.
fn light_side_planes(scene: &Scene, light: LightPoint) -> Vec<Vec4> {
    (0..scene.triangles().len())
        .into_par_iter()
        .map(|triangle| {
            let [a, b, c] = scene.corners(triangle);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let side = normal.dot(light.ray_from(a).0);
            let normal = if side > 0.0 {
                normal
            } else if side < 0.0 {
                -normal
            } else {
                Vec3::ZERO
            };
            normal.extend(-normal.dot(a))
        })
        .collect()
}
