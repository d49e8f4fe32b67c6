//! The stages on the CPU.

use std::ops::Range;

use gnomon_shadow_map::cpu::shade_pixels;
use gnomon_shadow_map::light_maps::LightMaps;
use scene_core::raster::{DepthMap, DepthOptions, RasterScratch, render_depth_and_triangles_into};
use scene_core::relevance::{Backdrops, CasterChunks, CasterRegion, relevant_casters};
use scene_core::{GBuffer, Report, Scene, VisibilityImage};

use crate::params::Show;
use crate::views::MapView;
use crate::{PreparedPsm, PsmMap, PsmParams};

/// `prepare.maps`: draws what each map can hold.
pub fn render_maps(
    scene: &Scene,
    casters: &Backdrops<'_>,
    views: Vec<MapView>,
    params: &PsmParams,
    report: &mut Report,
) -> Vec<PsmMap> {
    let size = params.map_size;
    // Depth tells which triangle is nearest and is then done with.
    let mut depth = DepthMap { width: size, height: size, depth: Vec::new() };
    let mut scratch = RasterScratch::new();
    let everything: Vec<_> = casters.drawn.iter().map(|object| object.triangles.clone()).collect();
    views
        .into_iter()
        .map(|view| {
            let inside = params.skip.then(|| inside_map(scene, casters, &view, report));
            let options = DepthOptions {
                triangles: Some(inside.as_ref().unwrap_or(&everything)),
                ..Default::default()
            };
            let mut triangles = Vec::new();
            render_depth_and_triangles_into(
                scene,
                view.clip_from_world,
                &options,
                &mut scratch,
                &mut depth,
                &mut triangles,
            );
            PsmMap { view, size, triangles }
        })
        .collect()
}

/// The casters that are not wholly beside a map: the others are in no texel of it.
fn inside_map(
    scene: &Scene,
    casters: &Backdrops<'_>,
    view: &MapView,
    report: &mut Report,
) -> Vec<Range<usize>> {
    let region = CasterRegion::inside(scene, &view.sides());
    let kept = relevant_casters(scene, &region, &CasterChunks::default(), |id| {
        let object = &scene.objects()[id as usize];
        !casters.backdrops.iter().any(|backdrop| std::ptr::eq(*backdrop, object))
    });
    kept.book(report);
    kept.ranges
}

/// `shade.lookup`: V of every pixel that sees a surface, NaN elsewhere; or what [`Show`] asks for.
pub fn shade(prepared: &PreparedPsm<'_>, gbuffer: &GBuffer, visibility: &mut VisibilityImage) {
    let LightMaps { scene, light, .. } = &prepared.questions;
    shade_pixels(&prepared.questions, gbuffer, visibility, |receiver| {
        let Some((map, texel)) = prepared.map_of(receiver.point) else { return 1.0 };
        match prepared.params.show {
            Show::Visibility => f32::from(u8::from(!map.shadows(scene, light, receiver, texel))),
            Show::Texels => {
                let (point, normal) = (receiver.point.as_dvec3(), receiver.normal.as_dvec3());
                let d = map.view.texel_in_pixels(map.size, &prepared.frame, point, normal);
                (1.0 / d).min(1.0) as f32
            }
        }
    });
}
