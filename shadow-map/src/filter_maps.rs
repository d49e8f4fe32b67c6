//! What filters read beside the maps: the plane of every triangle, turned to the light, and the nearest depth of
//! any rectangle of texels.

use glam::{Vec3, Vec4};
use rayon::prelude::*;
use scene_core::light::LightPoint;
use scene_core::{GBuffer, Report, Scene};

use crate::depth_pyramid::DepthPyramid;
use crate::light_maps::{LightMaps, ShadowMapView};

/// Maps made ready for filters.
#[derive(Clone, Debug)]
pub struct FilterMaps<'a> {
    /// The maps.
    pub maps: LightMaps<'a>,
    /// Nearest depths, one pyramid a map.
    pub pyramids: Vec<DepthPyramid>,
    /// Leave out filters that have nothing to find.
    pub skip: bool,
    planes: Planes,
}

/// The planes of triangles, turned to the light.
#[derive(Clone, Debug)]
enum Planes {
    /// Of each.
    Triangles(Vec<Vec4>),
    /// Of those in the texels that are looked up, row by row of each map's window.
    Texels(Vec<Vec<Vec4>>),
}

impl<'a> FilterMaps<'a> {
    /// `prepare.filter`.
    pub fn new(maps: LightMaps<'a>, skip: bool, report: &mut Report) -> Self {
        let (planes, pyramids) = report.time("prepare.filter", |_| {
            let texels_of =
                |map: &ShadowMapView| map.window.iter().map(ExactSizeIterator::len).product::<usize>();
            let texels: usize = maps.maps.iter().map(texels_of).sum();
            // Who asks by triangle has maps that are drawn as a whole.
            let is_part = maps.maps.iter().any(|map| texels_of(map) < (map.map.width as usize).pow(2));
            let planes = if skip && is_part && texels < maps.scene.triangles().len() {
                Planes::Texels(maps.maps.iter().map(|map| planes_of_texels(&maps, map)).collect())
            } else {
                Planes::Triangles(light_side_planes(&maps.scene, maps.light.center()))
            };
            (
                planes,
                maps.maps.iter().map(|view| DepthPyramid::of(&view.map, &view.window[1])).collect::<Vec<_>>(),
            )
        });
        let bytes = pyramids.iter().map(DepthPyramid::bytes).sum::<u64>();
        let planes_held = match &planes {
            Planes::Triangles(planes) => planes.len(),
            Planes::Texels(maps) => maps.iter().map(Vec::len).sum(),
        };
        report.bytes += bytes + (planes_held * size_of::<Vec4>()) as u64;
        Self { maps, pyramids, skip, planes }
    }

    /// Question 2 of [`receiver_plane`](crate::receiver_plane), from stored planes: whether `point` lies behind
    /// `triangle` by more than `tolerance`.
    #[inline]
    pub fn is_behind(&self, triangle: usize, point: Vec3, tolerance: f32) -> bool {
        let plane = match &self.planes {
            Planes::Triangles(planes) => planes[triangle],
            Planes::Texels(_) => light_side_plane(&self.maps.scene, self.maps.light.center(), triangle),
        };
        lies_behind(plane, point, tolerance)
    }

    /// [`is_behind`](Self::is_behind) for the triangle in the texel `index` of a view.
    #[inline]
    pub fn is_behind_texel(&self, view: usize, index: usize, point: Vec3, tolerance: f32) -> bool {
        let map = &self.maps.maps[view];
        let plane = match &self.planes {
            Planes::Triangles(planes) => planes[map.triangles[index] as usize],
            Planes::Texels(maps) => {
                let ([columns, rows], width) = (&map.window, map.map.width as usize);
                let [column, row] =
                    [index % width - columns.start as usize, index / width - rows.start as usize];
                maps[view][row * columns.len() + column]
            }
        };
        lies_behind(plane, point, tolerance)
    }
}

#[inline]
fn lies_behind(plane: Vec4, point: Vec3, tolerance: f32) -> bool {
    plane.truncate().dot(point) + plane.w < -tolerance
}

/// The plane of each triangle.
fn light_side_planes(scene: &Scene, light: LightPoint) -> Vec<Vec4> {
    let triangles = (0..scene.triangles().len()).into_par_iter();
    triangles.map(|triangle| light_side_plane(scene, light, triangle)).collect()
}

/// The planes of the triangles in a map's window, zero where there is none.
fn planes_of_texels(maps: &LightMaps<'_>, map: &ShadowMapView) -> Vec<Vec4> {
    let [columns, rows] = map.window.clone().map(|side| side.start as usize..side.end as usize);
    let mut planes = vec![Vec4::ZERO; columns.len() * rows.len()];
    let lines = planes.par_chunks_mut(columns.len().max(1)).zip(rows);
    lines.for_each(|(planes, row)| {
        let start = row * map.map.width as usize;
        // Neighbours often see the same triangle.
        let (mut last, mut plane) = (GBuffer::NOTHING, Vec4::ZERO);
        for (to, texel) in planes.iter_mut().zip(start + columns.start..) {
            if map.map.depth[texel] > 0.0 {
                if map.triangles[texel] != last {
                    last = map.triangles[texel];
                    plane = light_side_plane(&maps.scene, maps.light.center(), last as usize);
                }
                *to = plane;
            }
        }
    });
    planes
}

/// The plane n·x + w = 0 of a triangle with the unit normal n on the light's side; zero for a triangle without
/// area or seen edge-on, which hides nothing.
fn light_side_plane(scene: &Scene, light: LightPoint, triangle: usize) -> Vec4 {
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
}
