//! The CPU path of planar shadows: a drawing a receiver, kept where the receiver itself is seen.

use glam::Mat4;
use rayon::prelude::*;
use scene_core::raster::{DepthMap, DepthOptions, RasterScratch, render_depth_into};
use scene_core::{Camera, Report, VisibilityImage};

use super::{Asked, Receivers};
use crate::crossing::HomogeneousLight;
use crate::planar::{Clipped, clip_from_caster};
use crate::receivers::FlatReceivers;

/// Fills `visibility`: V where a surface is seen, NaN elsewhere. Only `flat` receivers show shadows. Those that nobody
/// sees are left out if `skip`.
pub fn shade(
    flat: &FlatReceivers,
    receivers: &Receivers<'_>,
    camera: &Camera,
    skip: bool,
    report: &mut Report,
    visibility: &mut VisibilityImage,
) {
    let (scene, gbuffer) = (receivers.scene, receivers.gbuffer);
    let asked: Vec<Asked> = report.time("shade.ask", |_| {
        (0..gbuffer.pixel_count())
            .into_par_iter()
            .with_min_len(4096)
            .map(|pixel| receivers.ask(pixel))
            .collect()
    });
    visibility.values.par_iter_mut().zip(&asked).with_min_len(4096).for_each(|(value, asked)| {
        *value = match asked {
            Asked::Nothing => f32::NAN,
            Asked::Dark => 0.0,
            Asked::Lit | Asked::Yes => 1.0,
        };
    });
    // The place of each asked pixel's receiver, if it has one.
    let on: Vec<u32> = (gbuffer.triangle.iter().zip(&asked))
        .map(|(&triangle, asked)| match asked {
            Asked::Yes => flat.of_triangle[triangle as usize],
            _ => FlatReceivers::NONE,
        })
        .collect();
    let mut seen = vec![false; flat.receivers.len()];
    for &index in on.iter().filter(|&&index| index != FlatReceivers::NONE) {
        seen[index as usize] = true;
    }
    let light = HomogeneousLight::from(receivers.light.center());
    let mut scratch = RasterScratch::new();
    let mut stencil = DepthMap { width: gbuffer.width, height: gbuffer.height, depth: Vec::new() };
    let mut unseen = 0;
    for (index, receiver) in (0_u32..).zip(&flat.receivers) {
        if skip && !seen[index as usize] {
            unseen += 1;
            continue;
        }
        let casters = report.time("shade.clip", |_| Clipped::new(scene, receiver, &light));
        let clip = clip_from_caster(receiver, &light, camera).as_mat4();
        for (scene, triangles) in [(scene, Some(&casters.whole[..])), (&casters.cut, None)] {
            if triangles.map_or(scene.triangles().is_empty(), <[_]>::is_empty) || clip == Mat4::ZERO {
                continue;
            }
            report.time("shade.stencil", |_| {
                let options = DepthOptions { triangles, ..Default::default() };
                render_depth_into(scene, clip, &options, &mut scratch, &mut stencil);
                let pixels = visibility.values.par_iter_mut().zip(&stencil.depth).zip(&on);
                pixels.with_min_len(4096).for_each(|((value, &depth), &on)| {
                    if depth > 0.0 && on == index {
                        *value = 0.0;
                    }
                });
            });
        }
    }
    report.skip("receivers nobody sees", unseen);
}
