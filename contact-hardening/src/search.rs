//! Step 2 of [`physical`](crate::physical), pass 3 of the paper: how far the blockers between a receiver and the light are. It stands for
//! the dilation of D to both sides of an edge.
//!
//! A shadowed pixel's blocker counts if it stands in the cone from the receiver to the light. What the image does not show, and all
//! where the map is finer, is searched in the map.
//!
//! Every point of the kernel is asked at the farthest blocker's distance, t. A nearer one has a narrower footprint, which few points
//! of the wide one hit: so every second point is asked nearer, too, at shares of t that are spread evenly.

use gnomon_shadow_map::light_maps::Receiver;
use gnomon_shadow_map::receiver_plane::rises_above;

use crate::footprint::spread;
use crate::look_up::{BATCH, Lines, Met, Texel, batches};
use crate::physical::{Physical, Site};
use crate::shadow_pyramid::PixelRect;

/// How far from one to the next nearer distance it is, in 64ths: the golden section of 64, odd. Its multiples are spread evenly
/// however many they are, and floats hold them exactly.
pub(crate) const GOLDEN: usize = 39;

/// Distances of the blockers in a cone, as D.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blockers {
    weight: f32,
    sum: f32,
    /// Nearest to the receiver.
    pub least: f32,
    /// Farthest.
    pub greatest: f32,
}

impl Blockers {
    const NONE: Self = Self { weight: 0.0, sum: 0.0, least: f32::INFINITY, greatest: 0.0 };

    /// A pixel's blocker hides a share of the light that falls with the square of its footprint's width.
    fn add(&mut self, t: f32, parallel: bool) {
        let wide = spread(t, parallel);
        let weight = 1.0 / (wide * wide);
        if t > 0.0 && weight > 0.0 && weight.is_finite() {
            self.weight += weight;
            self.sum += t * weight;
            (self.least, self.greatest) = (self.least.min(t), self.greatest.max(t));
        }
    }

    /// Their mean; `None` if there are none.
    pub fn mean(&self) -> Option<f32> {
        (self.weight > 0.0).then(|| self.sum / self.weight)
    }
}

/// Where a point of the light, the `index`th, is asked for blockers up to `t`, beside `t` itself.
#[inline]
fn nearer(index: usize, t: f32) -> Option<f32> {
    (index % 2 == 1).then(|| t * (((index * GOLDEN % 64) as f32 + 0.5) / 64.0))
}

impl Physical<'_> {
    /// Step 2. Counts in `clear` the searches of the map that were proved empty.
    pub fn search(&self, site: &Site, lines: &Lines<'_, '_>, clear: &mut u64) -> Blockers {
        let mut blockers = Blockers::NONE;
        self.ask(site, self.own(site), &mut blockers);
        if site.is_lit() {
            return blockers;
        }
        let map_first = self.asks_map_first(site, lines, site.t);
        if !map_first && site.reach.count() <= self.kernel.points.len() {
            let width = self.distance.width;
            let PixelRect { first, last } = site.reach;
            for row in first[1]..=last[1] {
                for column in first[0]..=last[0] {
                    self.ask(site, row * width + column, &mut blockers);
                }
            }
            return blockers;
        }
        let fill = self.params.fill && !self.is_clear(lines, site.t, clear);
        if map_first {
            if fill {
                self.search_map(site, lines, &mut blockers);
            }
            return blockers;
        }
        for (index, (at, _)) in self.points(site).enumerate() {
            for t in [Some(site.t), nearer(index, site.t)].into_iter().flatten() {
                // Shadows may be thinner than pixels are.
                let mut seen = false;
                if let Some(pixel) = self.pixel(site.footprint.pixel(at, t)) {
                    self.ask(site, pixel, &mut blockers);
                    seen = fill && self.knows(site, at, t, pixel);
                }
                if fill
                    && !seen
                    && let Met::Blocker(found) = lines.look_up(at, t)
                {
                    blockers.add(found.located.z, self.is_parallel());
                }
            }
        }
        blockers
    }

    /// The same in the map alone.
    fn search_map(&self, site: &Site, lines: &Lines<'_, '_>, blockers: &mut Blockers) {
        let mut texels = [Texel::default(); BATCH];
        let mut first = 0;
        batches(self.points(site).map(|(at, _)| at), |points| {
            for is_nearer in [false, true] {
                let t = |index: usize| if is_nearer { nearer(first + index, site.t) } else { Some(site.t) };
                lines.read(points, t, &mut texels);
                for (index, (&at, texel)) in points.iter().zip(&texels).enumerate() {
                    if let Some(t) = t(index)
                        && let Met::Blocker(found) = lines.meet(texel, at, t)
                    {
                        blockers.add(found.located.z, self.is_parallel());
                    }
                }
            }
            first += points.len();
        });
    }

    /// Counts the blocker of `pixel`, if it has one between the receiver and the light.
    #[inline]
    fn ask(&self, site: &Site, pixel: usize, blockers: &mut Blockers) {
        if self.distance.shadow[pixel] != 1.0 || self.distance.distance[pixel] == 0.0 {
            return;
        }
        let Receiver { point, normal, tolerance, .. } = site.receiver;
        let blocker = self.blocker(pixel);
        let located = site.cone.locate(blocker);
        if self.covers(site, located) && rises_above(blocker, point, normal, tolerance) {
            blockers.add(located.z, self.is_parallel());
        }
    }
}
