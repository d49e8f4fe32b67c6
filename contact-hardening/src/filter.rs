//! Step 3 of [`physical`](crate::physical), pass 4 of the paper: V as the share of the light's points that nothing blocks.
//!
//! With `blocker = each` a point is asked at several distances, layers, between the nearest and the farthest blocker: it is dark
//! if the line to it passes a stored blocker, or goes from above to below stored ones, between two of them.
//!
//! Where even the farthest blocker's penumbra is too narrow for neighbours to be [averaged](crate::smoothing), twice as many points are
//! asked. The pyramid tells how far that is: what a search finds would make it a matter of chance.
//!
//! What the map answers is answered by texels. Where the footprint is narrower than one, they answer all of the light alike, and an S
//! that another technique found for the very pixel says more: it is taken there.

use glam::{Vec2, Vec3};

use crate::look_up::{BATCH, Blocker, Lines, Met, Place, Texel, batches};
use crate::params::Blocker as Which;
use crate::physical::{Physical, Site};
use crate::search::Blockers;

/// Most distances that a point is asked at.
pub(crate) const MAX_LAYERS: usize = 8;

/// What is known of a point of the light at some distance.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Probe {
    Lit,
    Blocked(Blocker),
    Unknown,
}

/// What answers for a point that the image does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fill {
    /// Nothing does.
    Nothing,
    /// The map is proved to hold nothing there.
    Lit,
    /// The pixel's own S, where the footprint is narrower than a texel.
    Pixel,
    /// The map.
    Map,
}

/// The distances that points are asked at.
#[derive(Clone, Copy, Debug)]
struct Layers {
    t: [f32; MAX_LAYERS],
    count: usize,
    /// How far from a layer stored blockers count as passed there: logarithm of a ratio.
    half: f32,
}

/// Blockers within so much of a step are one layer: some thousand times what rounding tells apart where a caster is flat.
pub(crate) const CLOSE: f32 = 1.0 / 1024.0;

impl Layers {
    fn new(which: Which, blockers: &Blockers, mean: f32) -> Self {
        let mut layers = Self { t: [mean; MAX_LAYERS], count: 1, half: f32::INFINITY };
        match which {
            Which::Average => {}
            Which::Minimum => layers.t[0] = blockers.least,
            Which::Each => {
                // A step widens the footprint by at most √2. Half a step to each side leaves no gap between layers; wider
                // windows would count what another layer's footprint answers for.
                let ratio = blockers.greatest / blockers.least;
                layers.count =
                    1 + (2.0 * ratio.log2() - CLOSE).ceil().clamp(0.0, (MAX_LAYERS - 1) as f32) as usize;
                let last = (layers.count - 1).max(1) as f32;
                for (index, t) in layers.t[..layers.count].iter_mut().enumerate() {
                    *t = blockers.least * ratio.powf(index as f32 / last);
                }
                if layers.count > 1 {
                    // However a power is rounded: on the GPU it is by some units.
                    layers.t[layers.count - 1] = blockers.greatest;
                    layers.half = 0.5 * ratio.ln() / last;
                }
            }
        }
        layers
    }
}

/// How far the line to a point of the light is known.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    /// Logarithm of a stored blocker's distance over the last layer's; 0 if there is none.
    before: f32,
    known: bool,
    blocked: bool,
}

impl Physical<'_> {
    /// Step 3: V. Counts in `clear` the layers of the map that were proved empty.
    pub fn filter(
        &self,
        site: &Site,
        lines: &Lines<'_, '_>,
        blockers: &Blockers,
        mean: f32,
        clear: &mut u64,
    ) -> f32 {
        if site.is_umbra() {
            // All that can be asked is shadowed: this is the umbra that the pyramid proves.
            return 0.0;
        }
        let layers = Layers::new(self.params.blocker, blockers, mean);
        let mut fill = [Fill::Nothing; MAX_LAYERS];
        for (fill, &t) in fill.iter_mut().zip(&layers.t[..layers.count]) {
            *fill = self.fill(lines, t, clear);
        }
        let map_first = self.asks_map_first(site, lines, mean);
        let asker = Asker { physical: self, site, lines, map_first, fill: &fill, layers: &layers };
        let (mut dark, mut all) = (0.0, 0.0);
        let mut states = [State::default(); BATCH];
        let is_fine = self.is_narrow(site, site.t);
        let kernel = if is_fine { self.fine } else { self.kernel };
        let mut weights = kernel.weights.iter();
        batches(self.points_of(kernel, site).map(|(at, _)| at), |points| {
            let states = &mut states[..points.len()];
            states.fill(State::default());
            for layer in 0..layers.count {
                asker.pass(points, layer, states);
            }
            for (state, &weight) in states.iter().zip(&mut weights) {
                if state.known {
                    all += weight;
                    dark += if state.blocked { weight } else { 0.0 };
                }
            }
        });
        if all > 0.0 { 1.0 - dark / all } else { 1.0 - self.distance.shadow[self.own(site)] }
    }

    /// What answers for points of the layer `t` that the image does not.
    fn fill(&self, lines: &Lines<'_, '_>, t: f32, clear: &mut u64) -> Fill {
        let resolves = || lines.width(self.kernel.reach, t).is_none_or(|texels| texels > 1.0);
        if !self.params.fill {
            Fill::Nothing
        } else if self.has_source && !resolves() {
            Fill::Pixel
        } else if self.is_clear(lines, t, clear) {
            Fill::Lit
        } else {
            Fill::Map
        }
    }
}

/// What points of the light are asked with.
#[derive(Clone, Copy)]
struct Asker<'a> {
    physical: &'a Physical<'a>,
    site: &'a Site,
    lines: &'a Lines<'a, 'a>,
    map_first: bool,
    /// Of each layer.
    fill: &'a [Fill; MAX_LAYERS],
    layers: &'a Layers,
}

impl Asker<'_> {
    /// Asks the points that nothing blocks so far at one more layer.
    fn pass(&self, points: &[Vec2], layer: usize, states: &mut [State]) {
        let t = self.layers.t[layer];
        let (is_first, is_last) = (layer == 0, layer + 1 == self.layers.count);
        let half = self.layers.half;
        let mut texels = [Texel::default(); BATCH];
        let from_map = self.map_first && self.fill[layer] == Fill::Map;
        if from_map {
            self.lines.read(points, |index| (!states[index].blocked).then_some(t), &mut texels);
        }
        for ((&at, state), texel) in points.iter().zip(states).zip(&texels) {
            if state.blocked {
                continue;
            }
            let probe = if from_map { met(self.lines.meet(texel, at, t)) } else { self.probe(at, layer) };
            state.known |= probe != Probe::Unknown;
            let Probe::Blocked(blocker) = probe else {
                state.before = 0.0;
                continue;
            };
            let located = blocker.located;
            let above = (located.z / t).ln();
            // The search finds some blockers: others may be nearer than the first layer, where they stand in the cone,
            // or beyond the last.
            let stands_in_cone = || is_first && self.site.cone.contains(located);
            let is_within = if half.is_infinite() {
                // One layer is asked for all, but what a pixel holds may lie behind the receiver.
                located.z > 0.0
            } else if above >= 0.0 && (above <= half || is_last) {
                // The layer lies in the window, or below the last: whatever the far side is.
                true
            } else if above >= -half || stands_in_cone() {
                // From its far side to the near one a blocker is passed; a thinner one than a step is widened to a step, for no
                // layer may lie within. A layer that lies on a side of one holds it, however it is rounded.
                let back = || (self.lines.far_side(&blocker).max(f32::MIN_POSITIVE) / t).ln();
                let slack = |back: f32| (half - 0.5 * (above - back)).max(half.min(CLOSE));
                if above > half {
                    let back = back();
                    back <= slack(back)
                } else {
                    // The far side is farther down still.
                    stands_in_cone() || above >= -slack(back())
                }
            } else {
                false
            };
            state.blocked = is_within || above * state.before < 0.0;
            state.before = above;
        }
    }

    #[inline]
    fn probe(&self, at: Vec2, layer: usize) -> Probe {
        let Self { physical, site, .. } = self;
        let t = self.layers.t[layer];
        // A blocker that no map holds: on the line itself.
        let on_line = || thin(Vec3::new(at.x * t, at.y * t, t));
        if !self.map_first
            && let Some(pixel) = physical.pixel(site.footprint.pixel(at, t))
            && physical.knows(site, at, t, pixel)
        {
            return match physical.distance.shadow[pixel] {
                0.0 => Probe::Lit,
                _ if physical.distance.distance[pixel] == 0.0 => on_line(),
                _ => {
                    let blocker = physical.blocker(pixel);
                    let located = site.cone.locate(blocker);
                    Probe::Blocked(Blocker { located, place: Place::Point(blocker) })
                }
            };
        }
        let own = physical.own(site);
        match self.fill[layer] {
            Fill::Nothing => Probe::Unknown,
            Fill::Lit => Probe::Lit,
            Fill::Pixel if physical.distance.shadow[own] == 0.0 => Probe::Lit,
            Fill::Pixel if physical.distance.distance[own] == 0.0 => on_line(),
            // On the line to the light's centre.
            Fill::Pixel => thin(Vec3::new(0.0, 0.0, physical.distance.distance[own])),
            Fill::Map => met(self.lines.look_up(at, t)),
        }
    }
}

fn met(met: Met) -> Probe {
    match met {
        Met::Nothing => Probe::Lit,
        Met::Blocker(blocker) => Probe::Blocked(blocker),
    }
}

fn thin(located: Vec3) -> Probe {
    Probe::Blocked(Blocker { located, place: Place::Thin })
}
