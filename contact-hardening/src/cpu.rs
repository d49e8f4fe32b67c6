//! The CPU path: one function a stage after pass 2.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use scene_core::{GBuffer, Report, VisibilityImage};

use gnomon_shadow_map::cpu::receiver;

use crate::distance_map::DistanceMap;
use crate::multi_pass::multi_pass;
use crate::paper::Paper;
use crate::params::Variant;
use crate::physical::{Physical, Site};
use crate::smoothing::{Role, role, smooth};

/// What a pixel is before pass 4.
enum Surroundings {
    Known,
    Lit,
    Umbra,
    Penumbra(Box<Site>),
}

/// The pixel's site, if pass 4 has to look at it.
fn surroundings(physical: &Physical<'_>, gbuffer: &GBuffer, pixel: usize) -> Surroundings {
    if physical.distance.shadow[pixel].is_nan() {
        return Surroundings::Known;
    }
    let Ok(receiver) = receiver(physical.maps, gbuffer, pixel) else { return Surroundings::Known };
    match physical.site(receiver) {
        None => Surroundings::Known,
        Some(site) if physical.params.skip && site.is_lit() => Surroundings::Lit,
        Some(site) if physical.params.skip && site.is_umbra() => Surroundings::Umbra,
        Some(site) => Surroundings::Penumbra(Box::new(site)),
    }
}

/// `shade.filter`: passes 3 and 4 with `physical` scaling. V of pass 2 stands where they change nothing.
pub fn filter(physical: &Physical<'_>, visibility: &mut VisibilityImage, report: &mut Report) {
    if physical.params.variant == Variant::MultiPass {
        filter_in_passes(physical, visibility, report);
        return;
    }
    let width = physical.distance.width;
    let mut roles = vec![Role::Apart; visibility.values.len()];
    let rows = visibility.values.par_chunks_mut(width).zip(roles.par_chunks_mut(width)).enumerate();
    let answer_row = |(row, (values, roles)): (usize, (&mut [f32], &mut [Role]))| {
        let (mut lit, mut umbra, mut clear) = (0u64, 0u64, 0u64);
        for (column, (value, role)) in values.iter_mut().zip(roles).enumerate() {
            match surroundings(physical, physical.gbuffer, row * width + column) {
                Surroundings::Known => {}
                Surroundings::Lit => {
                    lit += 1;
                    *role = Role::Certain;
                }
                Surroundings::Umbra => {
                    umbra += 1;
                    *role = Role::Certain;
                }
                Surroundings::Penumbra(site) => {
                    (*value, *role) = answer(physical, &site, *value, &mut clear);
                }
            }
        }
        [lit, umbra, clear]
    };
    let add = |a: [u64; 3], b: [u64; 3]| std::array::from_fn(|i| a[i] + b[i]);
    let [lit, umbra, clear] = rows.map(answer_row).reduce(|| [0; 3], add);
    report.skip("lit pixels", lit);
    report.skip("umbra pixels", umbra);
    report.skip("searches of the map", clear);
    if physical.params.smooth && roles.par_iter().any(|role| matches!(role, Role::Wide(_))) {
        report.time("shade.smooth", |_| smooth(physical.gbuffer, &roles, visibility));
    }
}

/// V of a pixel whose hard V is `hard`, and how it takes part in the averages.
fn answer(physical: &Physical<'_>, site: &Site, hard: f32, clear: &mut u64) -> (f32, Role) {
    let lines = physical.look_ups.lines(&site.receiver, &site.cone);
    let blockers = physical.search(site, &lines, clear);
    match blockers.mean() {
        // What the pyramid proves stands.
        Some(_) if site.is_umbra() => (0.0, Role::Certain),
        Some(mean) => {
            (physical.filter(site, &lines, &blockers, mean, clear), role(physical, site, &blockers))
        }
        None => (hard, if hard == 1.0 { Role::Certain } else { Role::Apart }),
    }
}

fn filter_in_passes(physical: &Physical<'_>, visibility: &mut VisibilityImage, report: &mut Report) {
    let pixels = physical.distance.shadow.len();
    let lit = AtomicU64::new(0);
    let sites: Vec<Site> = (0..pixels)
        .into_par_iter()
        .filter_map(|pixel| match surroundings(physical, physical.gbuffer, pixel) {
            Surroundings::Penumbra(site) => Some(*site),
            // Its neighbours may change in a pass and then change it.
            Surroundings::Umbra => receiver(physical.maps, physical.gbuffer, pixel)
                .ok()
                .and_then(|receiver| physical.site(receiver)),
            Surroundings::Lit => {
                lit.fetch_add(1, Ordering::Relaxed);
                None
            }
            Surroundings::Known => None,
        })
        .collect();
    let (shadow, skipped) = multi_pass(physical, &sites);
    write(&shadow, visibility);
    report.skip("lit pixels", lit.into_inner());
    report.skip("blurs", skipped);
}

/// `shade.filter`: passes 3 and 4 with `paper` scaling.
pub fn filter_as_published(
    paper: &Paper<'_>,
    map: &mut DistanceMap,
    visibility: &mut VisibilityImage,
    report: &mut Report,
) {
    paper.dilate(map);
    let skipped = paper.blur(map);
    write(&map.shadow, visibility);
    report.skip("blurs", skipped);
}

/// Pass 5: V = 1 − S where there is an S.
fn write(shadow: &[f32], visibility: &mut VisibilityImage) {
    for (value, shadow) in visibility.values.iter_mut().zip(shadow) {
        if !shadow.is_nan() {
            *value = 1.0 - shadow;
        }
    }
}
