//! `multi-pass` with `physical` scaling: D counts Gaussian passes down.
//!
//! A pixel takes as many passes as its footprint is pixels wide in radius, up to `passes`; variances add up, so each of
//! n passes has a kernel 1/√n as wide as the whole. Pixels that are done are left alone and keep answering for others.
//! A pixel is left out of a pass if all that the pass can reach is equal: it would get that value.
//!
//! Passes ask pixels, each of which is lit or shadowed as a whole. With `fill`, a footprint narrower than the kernel's
//! points are many takes no passes if the map is finer than pixels: it answers at once, as for `gaussian`, and shadows thinner
//! than pixels stay. To others such a pixel answers with the S of pass 2.

use glam::Vec2;
use rayon::iter::Either;
use rayon::prelude::*;

use crate::distance_map::DistanceMap;
use crate::physical::{Physical, Site};
use crate::shadow_pyramid::{PixelRect, ShadowPyramid};

/// A pixel in penumbra.
#[derive(Clone, Copy, Debug)]
struct Active {
    site: Site,
    pixel: usize,
    t: f32,
    passes: u32,
}

/// Blurs S of `physical.distance`, in place of which the result is returned; counts the blurs left out.
pub fn multi_pass(physical: &Physical<'_>, sites: &[Site]) -> (Vec<f32>, u64) {
    let width = physical.distance.width;
    // A pixel to blur, or one whose S is known.
    let plan = |site: &Site| {
        let lines = physical.look_ups.lines(&site.receiver, &site.cone);
        let blockers = physical.search(site, &lines, &mut 0);
        let t = blockers.mean()?;
        let (min, max) = site.footprint.bounds(1.0, t)?;
        let radius = 0.5 * (max - min).max_element();
        let passes = (radius.ceil() as u32).clamp(1, physical.params.passes);
        let [x, y] = site.receiver.pixel.map(|at| at as usize);
        let pixel = y * width + x;
        if physical.is_narrow(site, t) && physical.asks_map_first(site, &lines, t) {
            return Some(Either::Right((pixel, 1.0 - physical.filter(site, &lines, &blockers, t, &mut 0))));
        }
        Some(Either::Left(Active { site: *site, pixel, t, passes }))
    };
    let (mut active, known): (Vec<Active>, Vec<(usize, f32)>) =
        sites.par_iter().filter_map(plan).partition_map(|plan| plan);
    let mut map = DistanceMap { distance: physical.distance.distance.clone(), ..DistanceMap::default() };
    map.shadow.clone_from(&physical.distance.shadow);
    (map.width, map.height) = (width, physical.distance.height);
    let (mut pass, mut skipped) = (0, 0);
    while !active.is_empty() {
        let pyramid = physical.params.skip.then(|| ShadowPyramid::new(&map));
        let blurred: Vec<Option<f32>> = active
            .par_iter()
            .map(|active| {
                let equal = pyramid.as_ref().is_some_and(|pyramid| is_equal(&map, pyramid, physical, active));
                if equal { None } else { Some(blur(physical, &map, active)) }
            })
            .collect();
        for (active, value) in active.iter().zip(blurred) {
            match value {
                Some(value) => map.shadow[active.pixel] = value,
                None => skipped += 1,
            }
        }
        pass += 1;
        active.retain(|active| active.passes > pass);
    }
    for (pixel, shadow) in known {
        map.shadow[pixel] = shadow;
    }
    (map.shadow, skipped)
}

/// Whether a pass finds 0 alone, or 1 alone.
fn is_equal(map: &DistanceMap, pyramid: &ShadowPyramid, physical: &Physical<'_>, active: &Active) -> bool {
    let reach = physical.kernel.reach / (active.passes as f32).sqrt();
    let Some((min, max)) = active.site.footprint.bounds(reach, active.t) else { return false };
    let own = active.site.receiver.pixel.map(|at| at as usize);
    let end = [map.width - 1, map.height - 1];
    // Bounds are rounded; a pixel more on each side holds every place that is asked.
    let cut = |at: f32, axis: usize| (at.max(0.0) as usize).min(end[axis]);
    let rect = PixelRect {
        first: [0, 1].map(|axis| cut(min[axis] - 1.0, axis).min(own[axis])),
        last: [0, 1].map(|axis| cut(max[axis] + 1.0, axis).max(own[axis])),
    };
    let extremes = pyramid.of(rect);
    extremes.least == 1.0 || extremes.greatest == 0.0
}

fn blur(physical: &Physical<'_>, map: &DistanceMap, active: &Active) -> f32 {
    let Active { site, t, passes, .. } = active;
    let scale = 1.0 / (*passes as f32).sqrt();
    let own = map.shadow[active.pixel];
    let (mut dark, mut all) = (0.0, 0.0);
    let size = Vec2::new(map.width as f32, map.height as f32);
    let numbers = gnomon_shadow_map::pixel_hash::pixel_numbers(site.receiver.pixel, physical.params.seed);
    for (point, weight) in physical.kernel.turned(numbers) {
        let at = point * scale;
        let Some(place) = site.footprint.pixel(at, *t) else { continue };
        if place.cmplt(Vec2::ZERO).any() || place.cmpge(size).any() {
            continue;
        }
        let pixel = place.y as usize * map.width + place.x as usize;
        let shadow = map.shadow[pixel];
        if !shadow.is_nan() && physical.answers(site, at, *t, pixel) {
            dark += weight * shadow;
            all += weight;
        }
    }
    if all > 0.0 { dark / all } else { own }
}
