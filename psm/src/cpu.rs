//! The stages on the CPU.

use std::ops::Range;

use gnomon_shadow_map::cpu::shade_pixels;
use scene_core::raster::{DepthMap, DepthOptions, RasterScratch, render_depth_and_triangles_into};
use scene_core::relevance::{Backdrops, CasterChunks, CasterRegion, relevant_casters};
use scene_core::{GBuffer, Report, Scene, VisibilityImage};

use crate::params::Show;
use crate::points::PointClouds;
use crate::views::MapView;
use crate::{PreparedPsm, PsmMap, PsmParams};

/// `prepare.maps`: draws what each map can hold: triangles, and over them the objects that are drawn as points.
pub fn render_maps(
    scene: &Scene,
    casters: &Backdrops<'_>,
    clouds: &PointClouds,
    views: Vec<MapView>,
    params: &PsmParams,
    report: &mut Report,
) -> Vec<PsmMap> {
    let size = params.map_size;
    // Depth tells which triangle is nearest and is then done with.
    let mut depth = DepthMap { width: size, height: size, depth: Vec::new() };
    let mut scratch = RasterScratch::new();
    views
        .into_iter()
        .map(|view| {
            let points = clouds.chosen(scene, &view, size);
            let drawn = drawn(casters, &points.objects(), scene);
            let ranges = if params.skip { inside_map(scene, &drawn, &view, report) } else { drawn.ranges };
            report.count("caster triangles drawn", ranges.iter().map(|range| range.len() as u64).sum());
            report.count("points drawn", points.count() as u64);
            let options = DepthOptions { triangles: Some(&ranges), ..Default::default() };
            let mut triangles = Vec::new();
            render_depth_and_triangles_into(
                scene,
                view.clip_from_world,
                &options,
                &mut scratch,
                &mut depth,
                &mut triangles,
            );
            points.draw(&view, size, &depth.depth, &mut triangles);
            PsmMap { view, size, triangles }
        })
        .collect()
}

/// Objects that are drawn by their triangles.
struct Drawn {
    /// Of each object in the scene, whether it is one.
    is_drawn: Vec<bool>,
    ranges: Vec<Range<usize>>,
}

/// The casters that are neither backdrops nor `points`, ids of objects.
fn drawn(casters: &Backdrops<'_>, points: &[usize], scene: &Scene) -> Drawn {
    let mut is_drawn = vec![true; scene.objects().len()];
    points.iter().for_each(|&id| is_drawn[id] = false);
    for (object, is_drawn) in scene.objects().iter().zip(&mut is_drawn) {
        *is_drawn &= object.flags.casts && !casters.backdrops.iter().any(|b| std::ptr::eq(*b, object));
    }
    let objects = scene.objects().iter().zip(&is_drawn).filter(|(_, is_drawn)| **is_drawn);
    let ranges = objects.map(|(object, _)| object.triangles.clone()).collect();
    Drawn { is_drawn, ranges }
}

/// Those of them that are not wholly beside a map: the others are in no texel of it.
fn inside_map(scene: &Scene, drawn: &Drawn, view: &MapView, report: &mut Report) -> Vec<Range<usize>> {
    let region = CasterRegion::inside(scene, &view.sides());
    let kept = relevant_casters(scene, &region, &CasterChunks::default(), |id| drawn.is_drawn[id as usize]);
    kept.book(report);
    kept.ranges
}

/// `shade.lookup`: V of every pixel that sees a surface, NaN elsewhere; or what [`Show`] asks for.
pub fn shade(prepared: &PreparedPsm<'_>, gbuffer: &GBuffer, visibility: &mut VisibilityImage) {
    let surroundings = prepared.surroundings();
    shade_pixels(&prepared.questions, gbuffer, visibility, |receiver| {
        let Some((map, texel)) = prepared.map_of(receiver.point) else { return 1.0 };
        match prepared.params.show {
            Show::Visibility => f32::from(u8::from(!map.shadows(&surroundings, receiver, texel))),
            Show::Texels => {
                let (point, normal) = (receiver.point.as_dvec3(), receiver.normal.as_dvec3());
                let d = map.view.texel_in_pixels(map.size, &prepared.frame, point, normal);
                (1.0 / d).min(1.0) as f32
            }
        }
    });
}
