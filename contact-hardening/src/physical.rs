//! Passes 3 and 4 with `physical` scaling: V of one pixel, from the hard shadow around it and the light's size.
//!
//! 1. *Reach.* The pixels under the footprint of the farthest blocker that can matter, and those beside them: the whole
//!    image's first, cut by the pyramid's greatest D until it stays. Where none of them is shadowed, V is 1; where all
//!    are, V is 0.
//! 2. *Search* (pass 3, the dilation of D to both sides of an edge). A shadowed pixel's blocker counts if it stands
//!    in the cone from the receiver to the light. A footprint narrower than its points are many, and
//!    what the image does not show of it, is searched in the map.
//! 3. *Filter* (pass 4). Points of the light are answered by S where the [footprint](crate::footprint) puts them.
//!
//! Image and map both sample the shadow. What is left to the map is answered by texels; where the footprint is narrower than
//! one, they answer all of the light alike, and an S that a technique of its own found for the very pixel says more. So with
//! such a source the image is asked first where texels are wider than pixels, and the pixel's own S is taken where the
//! map cannot resolve the footprint.
//!
//! With `blocker = each` a point is asked at several distances between the nearest and the farthest blocker: it is dark
//! if the line to it passes a stored blocker, or goes from above to below stored ones, between two of them.

use glam::{Mat4, Vec2, Vec3};
use gnomon_shadow_map::light_cone::LightCone;
use gnomon_shadow_map::light_maps::{LightMaps, Receiver};
use gnomon_shadow_map::pixel_hash::pixel_numbers;
use gnomon_shadow_map::receiver_plane::rises_above;
use scene_core::light::LightPoint;
use scene_core::{GBuffer, Light};

use crate::distance_map::{DistanceMap, to_light};
use crate::footprint::{Footprint, spread};
use crate::kernel::Kernel;
use crate::look_up::{Lines, LookUps, Met};
use crate::params::{Blocker, ContactHardeningParams};
use crate::shadow_pyramid::{Extremes, PixelRect, ShadowPyramid};

/// Cuts of the reach; more gain little.
const CUTS: usize = 4;

/// Most distances that a point is asked at.
const MAX_LAYERS: usize = 8;

/// What pixels are answered from.
#[derive(Clone, Copy, Debug)]
pub struct Physical<'a> {
    /// Settings.
    pub params: &'a ContactHardeningParams,
    /// Pass 1.
    pub maps: &'a LightMaps<'a>,
    /// Its look-ups.
    pub look_ups: &'a LookUps<'a>,
    /// Surfaces.
    pub gbuffer: &'a GBuffer,
    /// Pass 2.
    pub distance: &'a DistanceMap,
    /// Above it.
    pub pyramid: &'a ShadowPyramid,
    /// Points of pass 4.
    pub kernel: &'a Kernel,
    /// World to the camera's clip space.
    pub clip_from_world: Mat4,
    /// Whether S is another technique's, and not the map's.
    pub has_source: bool,
}

/// A pixel whose surroundings are not proved equal.
#[derive(Clone, Copy, Debug)]
pub struct Site {
    /// The surface.
    pub receiver: Receiver,
    /// From it to the light.
    pub cone: LightCone,
    /// The kernel on its plane.
    pub footprint: Footprint,
    reach: PixelRect,
    /// The farthest blocker in reach.
    t: f32,
    extremes: Extremes,
}

impl Site {
    /// Whether all that is seen in reach is lit.
    pub fn is_lit(&self) -> bool {
        self.extremes.greatest == 0.0
    }

    /// Whether all that is seen in reach is shadowed.
    pub fn is_umbra(&self) -> bool {
        self.extremes.least == 1.0
    }
}

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

/// What is known of a point of the light at some distance.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Probe {
    Lit,
    /// The stored blocker's distance from the receiver.
    Blocked(f32),
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

impl Physical<'_> {
    /// Whether the light is infinitely far.
    pub fn is_parallel(&self) -> bool {
        matches!(self.maps.light, Light::Directional { .. })
    }

    fn center(&self) -> LightPoint {
        self.maps.light.center()
    }

    /// Step 1. `None` where the light has no extent.
    pub fn site(&self, receiver: Receiver) -> Option<Site> {
        let cone = LightCone::new(&self.maps.light, receiver.point)?;
        let size = Vec2::new(self.distance.width as f32, self.distance.height as f32);
        let (point, normal) = (receiver.point, receiver.normal);
        let footprint =
            Footprint::new(&cone, point, normal, self.is_parallel(), &self.clip_from_world, size)?;
        let end = [self.distance.width - 1, self.distance.height - 1];
        let mut reach = PixelRect { first: [0; 2], last: end };
        let mut extremes = self.pyramid.of(reach);
        let mut t = extremes.distance;
        for _ in 0..CUTS {
            let Some((min, max)) = footprint.bounds(self.kernel.reach, t) else { break };
            let own = receiver.pixel.map(|at| at as usize);
            let cut = |at: f32, axis: usize| (at.max(0.0) as usize).min(end[axis]);
            reach = PixelRect {
                first: [0, 1].map(|axis| cut(min[axis] - 1.0, axis).min(own[axis])),
                last: [0, 1].map(|axis| cut(max[axis] + 1.0, axis).max(own[axis])),
            };
            extremes = self.pyramid.of(reach);
            if extremes.distance >= t || extremes.distance == 0.0 {
                break;
            }
            t = extremes.distance;
        }
        Some(Site { receiver, cone, footprint, reach, t, extremes })
    }

    /// Step 2. Counts in `clear` the searches of the map that were proved empty.
    pub fn search(&self, site: &Site, lines: &Lines<'_, '_>, clear: &mut u64) -> Blockers {
        let mut blockers = Blockers::NONE;
        let width = self.distance.width;
        let [x, y] = site.receiver.pixel.map(|at| at as usize);
        self.ask(site, y * width + x, &mut blockers);
        if site.is_lit() {
            return blockers;
        }
        let PixelRect { first, last } = site.reach;
        let is_narrow = self.params.fill && self.is_narrow(site, lines, site.t);
        if !is_narrow && site.reach.count() <= self.kernel.points.len() {
            for row in first[1]..=last[1] {
                for column in first[0]..=last[0] {
                    self.ask(site, row * width + column, &mut blockers);
                }
            }
            return blockers;
        }
        let fill = self.params.fill && !self.is_clear(lines, site.t, clear);
        if is_narrow && !fill {
            return blockers;
        }
        for (point, _) in self.kernel.turned(self.numbers(site)) {
            let at = site.cone.share(point);
            // Shadows may be thinner than pixels are.
            let mut seen = false;
            if !is_narrow && let Some(pixel) = self.pixel(site.footprint.pixel(at, site.t)) {
                self.ask(site, pixel, &mut blockers);
                seen = fill && self.knows(site, at, site.t, pixel);
            }
            if fill
                && !seen
                && let Met::Blocker(t) = lines.look_up(at, site.t)
            {
                blockers.add(t, self.is_parallel());
            }
        }
        blockers
    }

    /// Whether the map is proved to hold nothing at `t`; never asked where skipping is off.
    fn is_clear(&self, lines: &Lines<'_, '_>, t: f32, clear: &mut u64) -> bool {
        let is_clear = self.params.skip && lines.is_clear(self.kernel.reach, t);
        *clear += u64::from(is_clear);
        is_clear
    }

    /// Counts the blocker of `pixel`, if it has one between the receiver and the light.
    #[inline]
    fn ask(&self, site: &Site, pixel: usize, blockers: &mut Blockers) {
        if self.distance.shadow[pixel] != 1.0 || self.distance.distance[pixel] == 0.0 {
            return;
        }
        let Receiver { point, normal, tolerance, .. } = site.receiver;
        let blocker = self.blocker(pixel);
        let located = site.cone.locate(blocker) / Vec3::new(self.kernel.reach, self.kernel.reach, 1.0);
        if site.cone.contains(located) && rises_above(blocker, point, normal, tolerance) {
            blockers.add(located.z, self.is_parallel());
        }
    }

    /// Where the blocker of a shadowed pixel is, by its D.
    #[inline]
    fn blocker(&self, pixel: usize) -> Vec3 {
        let position = self.gbuffer.position[pixel];
        position + to_light(self.center(), position) * self.distance.distance[pixel]
    }

    fn numbers(&self, site: &Site) -> [f32; 2] {
        pixel_numbers(site.receiver.pixel, self.params.seed)
    }

    /// The pixel at a place of the image.
    #[inline]
    fn pixel(&self, at: Option<Vec2>) -> Option<usize> {
        let at = at?;
        let (width, height) = (self.distance.width, self.distance.height);
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < width as f32 && at.y < height as f32;
        inside.then(|| at.y as usize * width + at.x as usize)
    }

    /// Whether the surface at `pixel` may answer for the receiver's plane at p′, for blockers at `t`.
    ///
    /// One that lies off the plane is as good as a point of the plane beside p′, where its line to the light's centre
    /// crosses it. A point of the kernel stands for a cell of the light 2/√n half axes wide: the point beside must lie
    /// within the cell's footprint, and the surface must be nearer to the plane than the blocker by the same share.
    #[inline]
    pub fn answers(&self, site: &Site, at: Vec2, t: f32, pixel: usize) -> bool {
        if !self.params.geometry {
            return true;
        }
        let Receiver { point, normal, tolerance, .. } = site.receiver;
        let cell = 1.0 / (self.kernel.points.len() as f32).sqrt();
        let from_receiver = self.gbuffer.position[pixel] - point;
        let rise = normal.dot(from_receiver);
        let share = rise / normal.dot(site.cone.w);
        let beside = from_receiver - site.footprint.offset(at, t) - site.cone.w * share;
        let axis = site.cone.u.length().max(site.cone.v.length());
        let on_plane = rise.abs() <= tolerance;
        on_plane
            || share.abs() <= t * cell && beside.length() <= 2.0 * cell * axis * spread(t, self.is_parallel())
    }

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
        let mut layers = [mean; MAX_LAYERS];
        let mut count = 1;
        match self.params.blocker {
            Blocker::Average => {}
            Blocker::Minimum => layers[0] = blockers.least,
            Blocker::Each => {
                // A step widens the footprint by at most √2.
                let ratio = blockers.greatest / blockers.least;
                count = 1 + (2.0 * ratio.log2()).ceil().min((MAX_LAYERS - 1) as f32) as usize;
                if count > 1 {
                    for (index, layer) in layers[..count].iter_mut().enumerate() {
                        *layer = blockers.least * ratio.powf(index as f32 / (count - 1) as f32);
                    }
                }
            }
        }
        let layers = &layers[..count];
        let narrow = self.params.fill && self.is_narrow(site, lines, mean);
        let mut fill = [Fill::Nothing; MAX_LAYERS];
        for (fill, &t) in fill.iter_mut().zip(layers) {
            *fill = self.fill(lines, t, clear);
        }
        let asker = Asker { physical: self, site, lines, narrow, fill: &fill };
        let (mut dark, mut all) = (0.0, 0.0);
        for (point, weight) in self.kernel.turned(self.numbers(site)) {
            let at = site.cone.share(point);
            let blocked = match layers {
                [t] => match asker.probe(at, 0, *t) {
                    Probe::Lit => Some(false),
                    Probe::Blocked(_) => Some(true),
                    Probe::Unknown => None,
                },
                _ => asker.passes(at, layers),
            };
            if let Some(blocked) = blocked {
                all += weight;
                dark += if blocked { weight } else { 0.0 };
            }
        }
        if all > 0.0 { 1.0 - dark / all } else { 1.0 - self.own_shadow(site) }
    }

    /// Whether the map is asked before the image: where pixels are farther from each other than the kernel's points are,
    /// and than texels are, if those have not made S.
    pub fn is_narrow(&self, site: &Site, lines: &Lines<'_, '_>, t: f32) -> bool {
        let (side, reach) = ((self.kernel.points.len() as f32).sqrt(), self.kernel.reach);
        site.footprint.bounds(reach, t).is_some_and(|(min, max)| {
            let pixels = (max - min).min_element();
            let is_finer = || lines.width(reach, t).is_none_or(|texels| texels > pixels);
            pixels < side && (!self.has_source || is_finer())
        })
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

    /// S of the receiver's own pixel.
    fn own_shadow(&self, site: &Site) -> f32 {
        let [x, y] = site.receiver.pixel.map(|at| at as usize);
        self.distance.shadow[y * self.distance.width + x]
    }

    /// Whether `pixel` has an S that [answers](Self::answers).
    #[inline]
    fn knows(&self, site: &Site, at: Vec2, t: f32, pixel: usize) -> bool {
        !self.distance.shadow[pixel].is_nan() && self.answers(site, at, t, pixel)
    }
}

/// What step 3 asks points of the light with.
#[derive(Clone, Copy)]
struct Asker<'a> {
    physical: &'a Physical<'a>,
    site: &'a Site,
    lines: &'a Lines<'a, 'a>,
    /// Whether the map is asked at once.
    narrow: bool,
    /// Of each layer.
    fill: &'a [Fill; MAX_LAYERS],
}

impl Asker<'_> {
    /// Whether the line to the light's point `at` is blocked anywhere between the layers; `None` if no layer knows.
    fn passes(&self, at: Vec2, layers: &[f32]) -> Option<bool> {
        let half = 0.5 * (layers[1] / layers[0]).ln();
        let (mut before, mut known) = (0.0f32, false);
        for (index, &t) in layers.iter().enumerate() {
            match self.probe(at, index, t) {
                Probe::Unknown => before = 0.0,
                Probe::Lit => {
                    known = true;
                    before = 0.0;
                }
                Probe::Blocked(stored) => {
                    known = true;
                    // The search finds some blockers: others may be nearer than the first layer, or beyond the last.
                    let above = (stored / t).ln();
                    let from = if index == 0 { f32::NEG_INFINITY } else { -half };
                    let to = if index + 1 == layers.len() { f32::INFINITY } else { half };
                    if (from..=to).contains(&above) || above * before < 0.0 {
                        return Some(true);
                    }
                    before = above;
                }
            }
        }
        known.then_some(false)
    }

    #[inline]
    fn probe(&self, at: Vec2, layer: usize, t: f32) -> Probe {
        let Self { physical, site, .. } = self;
        if !self.narrow
            && let Some(pixel) = physical.pixel(site.footprint.pixel(at, t))
            && physical.knows(site, at, t, pixel)
        {
            return match physical.distance.shadow[pixel] {
                0.0 => Probe::Lit,
                _ if physical.distance.distance[pixel] == 0.0 => Probe::Blocked(t),
                _ => Probe::Blocked(site.cone.share_of(physical.blocker(pixel))),
            };
        }
        match self.fill[layer] {
            Fill::Nothing => Probe::Unknown,
            Fill::Lit => Probe::Lit,
            Fill::Pixel if physical.own_shadow(site) == 0.0 => Probe::Lit,
            Fill::Pixel => Probe::Blocked(t),
            Fill::Map => match self.lines.look_up(at, t) {
                Met::Nothing => Probe::Lit,
                Met::Blocker(share) => Probe::Blocked(share),
            },
        }
    }
}
