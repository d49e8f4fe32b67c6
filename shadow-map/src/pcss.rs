//! `pcss`: percentage-closer soft shadows (Fernando, SIGGRAPH sketches 2005), from the light's true size and shape.
//!
//! 1. *Search.* Blockers are looked for in the texels that can hold any ([`search_region`](crate::search_region)). A
//!    stored point counts if the line from the receiver through it meets the light
//!    ([`LightCone`](crate::light_cone::LightCone)): the receiver's own surface, which lies at its horizon, never does.
//! 2. *Penumbra.* Their mean distance gives one plane that stands for all of them. With t the share of the way to the
//!    light, the line to the light's point s crosses it at p + t·(s − p), and a map from the light's centre holds that
//!    point t/(1 − t)·s beside the receiver, s counted from the centre: the penumbra formula `w·(z_r − z_b)/z_b`.
//! 3. *Filter.* Points of the light, in equal shares of V, are looked up there: the filter has the light's shape, and is
//!    as wide as the penumbra is. Each is moved within a texel at random, which blurs the map's own steps.
//!
//! Limits: blockers at several distances are filtered as if all were at their mean; what the light's centre does not
//! see cannot block. A light without extent, or a receiver within it, has the hard shadow of its centre.

use glam::{Vec2, Vec3};
use scene_core::light::sampling::{SampleKey, sobol};
use scene_core::{GBuffer, Light, Report, VisibilityImage};

use crate::PreparedVariant;
use crate::cpu;
use crate::filter_maps::FilterMaps;
use crate::light_cone::LightCone;
use crate::light_maps::{LightMaps, Receiver, ShadowMapView};
use crate::params::ShadowMapParams;
use crate::pixel_hash::pixel_numbers;
use crate::poisson_disk::poisson_disk;
use crate::search_region::{ClipCone, SearchRegion, search_region};
use crate::taps::{Stored, Taps};

/// The variant: maps and the points of a light.
#[derive(Debug)]
pub(crate) struct Pcss<'a> {
    maps: FilterMaps<'a>,
    /// Points of the light: in the unit disk if it is round, in the unit square otherwise.
    points: Vec<Vec2>,
    /// Where in a texel each of them is looked up, from its middle.
    jitter: Vec<Vec2>,
    seed: u32,
    /// Whether the light is infinitely far.
    parallel: bool,
}

/// Mean of what blocks the light, each stored point weighing as much of the light as its texel hides: a blocker's
/// shadow of the light grows with t/(1 − t), so a texel hides a share that falls with its square.
#[derive(Clone, Copy, Debug, Default)]
struct Blockers {
    weight: f32,
    sum: f32,
}

impl Blockers {
    /// Adds a blocker at `t`, a share of the way to the light or, `parallel`, a distance.
    fn add(&mut self, t: f32, parallel: bool) {
        let spread = if parallel { t } else { t / (1.0 - t) };
        let weight = 1.0 / (spread * spread);
        if t > 0.0 && weight.is_finite() && weight > 0.0 {
            self.weight += weight;
            self.sum += t * weight;
        }
    }

    fn mean(&self) -> Option<f32> {
        (self.weight > 0.0).then(|| self.sum / self.weight)
    }
}

/// Points that stand for a light, in the unit disk if it is round and in the unit square otherwise, and where in a texel
/// each of them is looked up, from its middle.
pub(crate) fn light_pattern(light: &Light, params: &ShadowMapParams) -> (Vec<Vec2>, Vec<Vec2>) {
    let square = |number: u64| {
        let key = SampleKey::new(u64::from(params.seed), number);
        (0..params.taps).map(move |index| sobol(index, key))
    };
    let is_round = !matches!(light, Light::Rect { .. });
    let points = if is_round { poisson_disk(params.taps, params.seed) } else { square(0).collect() };
    (points, square(1).map(|point| point - 0.5).collect())
}

impl<'a> Pcss<'a> {
    pub(crate) fn new(maps: LightMaps<'a>, params: &ShadowMapParams, report: &mut Report) -> Self {
        let (points, jitter) = light_pattern(&maps.light, params);
        let parallel = matches!(maps.light, Light::Directional { .. });
        Self { maps: FilterMaps::new(maps, params.skip, report), points, jitter, seed: params.seed, parallel }
    }

    fn answer(&self, receiver: &Receiver, lit: &mut u64) -> f32 {
        let Some(taps) = Taps::new(&self.maps, receiver) else {
            return 1.0;
        };
        let Some(cone) = LightCone::new(&self.maps.maps.light, receiver.point) else {
            return if taps.is_blocked() { 0.0 } else { 1.0 };
        };
        let clip = ClipCone::new(&taps, &cone);
        let region = search_region(&taps, &clip);
        if self.maps.skip && region == SearchRegion::Clear {
            *lit += 1;
            return 1.0;
        }
        let sampler = Sampler::new(self, receiver, &cone);
        match self.mean_blocker(&taps, &cone, &clip, region, &sampler) {
            Some(mean) => self.filter(&taps, &cone, &clip, mean, &sampler),
            None => 1.0,
        }
    }

    /// The mean share of the way to the light at which it is blocked.
    fn mean_blocker(
        &self,
        taps: &Taps<'_>,
        cone: &LightCone,
        clip: &ClipCone,
        region: SearchRegion,
        sampler: &Sampler<'_>,
    ) -> Option<f32> {
        let mut blockers = Blockers::default();
        let mut ask = |stored: Option<Stored>| {
            let located = stored.map(|stored| cone.locate(taps.point(&stored)));
            if let Some(located) = located.filter(|&located| cone.contains(located)) {
                blockers.add(located.z, self.parallel);
            }
        };
        match region {
            SearchRegion::Clear => return None,
            SearchRegion::Texels { first, last, nearest } => {
                let [columns, rows] = [0, 1].map(|axis| (last[axis] - first[axis] + 1) as usize);
                if columns * rows <= self.points.len() {
                    for row in first[1]..=last[1] {
                        for column in first[0]..=last[0] {
                            ask(taps.risen(column, row));
                        }
                    }
                } else {
                    let size = taps.map().map.width as f32;
                    for point in sampler.points() {
                        let direction = clip.direction(point.x, point.y);
                        let t = clip.reach(direction, nearest);
                        if let Some(at) = clip.texel(direction, t, size) {
                            let [column, row] = at.map(|at| at.floor() as i32);
                            if (first[0]..=last[0]).contains(&column) && (first[1]..=last[1]).contains(&row) {
                                ask(taps.risen(column, row));
                            }
                        }
                    }
                }
            }
            SearchRegion::Unbounded => {
                let count = self.points.len() as f32;
                for (point, share) in sampler.points().zip(0u16..) {
                    let t = (f32::from(share) + 0.5) / count;
                    let direction = cone.direction(point);
                    ask(taps.risen_at(taps.receiver.point + direction * t));
                }
            }
        }
        // A cone narrower than a texel may hold no texel's centre.
        if blockers.weight == 0.0
            && let Some(own) = taps.own_blocker()
        {
            blockers.add(cone.locate(taps.point(&own)).z, self.parallel);
        }
        blockers.mean()
    }

    /// V as the share of the light's points that no texel blocks, as if all blockers were at `mean`.
    fn filter(
        &self,
        taps: &Taps<'_>,
        cone: &LightCone,
        clip: &ClipCone,
        mean: f32,
        sampler: &Sampler<'_>,
    ) -> f32 {
        let size = taps.map().map.width;
        let inside = 0.0..size as f32;
        let lone = taps.is_lone();
        let mut dark = 0;
        for (point, jitter) in sampler.points().zip(&self.jitter) {
            let at = clip.texel(clip.direction(point.x, point.y), mean, size as f32);
            let at = at.map(|at| Vec2::from(at) + *jitter);
            let stored = match at {
                Some(at) if inside.contains(&at.x) && inside.contains(&at.y) => {
                    taps.risen(at.x as i32, at.y as i32)
                }
                _ if lone => None,
                _ => taps.risen_at(taps.receiver.point + cone.direction(point) * mean),
            };
            dark += u32::from(stored.is_some_and(|stored| taps.is_behind(&stored)));
        }
        1.0 - dark as f32 / self.points.len() as f32
    }
}

/// A pixel's points of the light.
struct Sampler<'p> {
    points: &'p [Vec2],
    cone: LightCone,
    rotation: Vec2,
    shift: Vec2,
}

impl<'p> Sampler<'p> {
    fn new(pcss: &'p Pcss<'_>, receiver: &Receiver, cone: &LightCone) -> Self {
        let numbers = Vec2::from(pixel_numbers(receiver.pixel, pcss.seed));
        let rotation = Vec2::from_angle(numbers.x * std::f32::consts::TAU);
        Self { points: &pcss.points, cone: *cone, rotation, shift: numbers }
    }

    /// The points (a, b), each for an equal share of V: turned at random on a round light, shifted in a rect.
    #[inline]
    fn points(&self) -> impl Iterator<Item = Vec2> + '_ {
        self.points.iter().map(|&point| {
            if self.cone.is_round {
                self.cone.share(self.rotation.rotate(point))
            } else {
                (point + self.shift).fract() * 2.0 - 1.0
            }
        })
    }
}

impl PreparedVariant for Pcss<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        let lit = report.time("shade.filter", |_| {
            cpu::filter_pixels(&self.maps.maps, gbuffer, visibility, |receiver, lit| {
                self.answer(receiver, lit)
            })
        });
        report.skip("filters", lit);
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32], report: &mut Report) {
        report.time("shade.filter", |_| {
            cpu::filter_points(&self.maps.maps, points, visibility, |receiver| self.answer(receiver, &mut 0));
        });
    }

    fn maps(&self) -> &[ShadowMapView] {
        &self.maps.maps.maps
    }
}
