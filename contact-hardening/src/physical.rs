//! Passes 3 and 4 with `physical` scaling: V of one pixel, from the hard shadow around it and the light's size.
//!
//! 1. *Reach.* The pixels under the footprint of the farthest blocker that can matter, and those beside them: the whole
//!    image's first, cut by the pyramid's greatest D until it stays. Where none of them is shadowed, V is 1; where all
//!    are, V is 0.
//! 2. [`search`](crate::search), pass 3: the distances of the blockers between the receiver and the light.
//! 3. [`filter`](mod@crate::filter), pass 4: points of the light, answered where the [footprint](crate::footprint) of a blocker at
//!    such a distance puts them.
//!
//! Image and map both sample the shadow, and the finer of them is asked first: what the image cannot answer is left to the map,
//! and where the map's texels are narrower than pixels under a footprint, all of it is.

use glam::{Mat4, Vec2, Vec3};
use gnomon_shadow_map::light_cone::LightCone;
use gnomon_shadow_map::light_maps::{LightMaps, Receiver};
use gnomon_shadow_map::pixel_hash::pixel_numbers;
use scene_core::light::LightPoint;
use scene_core::{GBuffer, Light};

use crate::distance_map::{DistanceMap, to_light};
use crate::footprint::{Footprint, spread};
use crate::kernel::Kernel;
use crate::look_up::{Lines, LookUps};
use crate::params::ContactHardeningParams;
use crate::shadow_pyramid::{Extremes, PixelRect, ShadowPyramid};

/// Cuts of the reach; more gain little.
pub(crate) const CUTS: usize = 4;

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
    /// Twice as many, where neighbours are not averaged.
    pub fine: &'a Kernel,
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
    pub(crate) reach: PixelRect,
    /// The farthest blocker in reach.
    pub(crate) t: f32,
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

    /// Whether the map is proved to hold nothing at `t`; never asked where skipping is off.
    pub(crate) fn is_clear(&self, lines: &Lines<'_, '_>, t: f32, clear: &mut u64) -> bool {
        let is_clear = self.params.skip && lines.is_clear(self.kernel.reach, t);
        *clear += u64::from(is_clear);
        is_clear
    }

    /// Where the blocker of a shadowed pixel is, by its D.
    #[inline]
    pub(crate) fn blocker(&self, pixel: usize) -> Vec3 {
        let position = self.gbuffer.position[pixel];
        position + to_light(self.center(), position) * self.distance.distance[pixel]
    }

    /// Points of the light as this pixel sees them, and what they weigh.
    pub(crate) fn points(&self, site: &Site) -> impl Iterator<Item = (Vec2, f32)> + use<'_> {
        self.points_of(self.kernel, site)
    }

    /// The same of another kernel.
    pub(crate) fn points_of<'k>(
        &self,
        kernel: &'k Kernel,
        site: &Site,
    ) -> impl Iterator<Item = (Vec2, f32)> + use<'k> {
        let cone = site.cone;
        let turned = kernel.turned(pixel_numbers(site.receiver.pixel, self.params.seed));
        turned.map(move |(point, weight)| (cone.share(point), weight))
    }

    /// Whether a point with these coordinates lies between the receiver and the kernel.
    #[inline]
    pub(crate) fn covers(&self, site: &Site, located: Vec3) -> bool {
        let reach = self.kernel.reach;
        site.cone.contains(located / Vec3::new(reach, reach, 1.0))
    }

    /// The pixel at a place of the image.
    #[inline]
    pub(crate) fn pixel(&self, at: Option<Vec2>) -> Option<usize> {
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

    /// Whether the map is asked before the image: where its texels are nearer to each other than pixels are.
    pub fn asks_map_first(&self, site: &Site, lines: &Lines<'_, '_>, t: f32) -> bool {
        let is_finer = |pixels: f32| lines.width(self.kernel.reach, t).is_none_or(|texels| texels > pixels);
        self.params.fill && self.width(site, t).is_some_and(is_finer)
    }

    /// Whether the footprint at `t` is fewer pixels wide than the kernel has points a side.
    pub fn is_narrow(&self, site: &Site, t: f32) -> bool {
        let side = (self.kernel.points.len() as f32).sqrt();
        self.width(site, t).is_some_and(|pixels| pixels < side)
    }

    /// Pixels across the footprint at `t` where it is narrowest; `None` where it is unbounded.
    fn width(&self, site: &Site, t: f32) -> Option<f32> {
        let (min, max) = site.footprint.bounds(self.kernel.reach, t)?;
        Some((max - min).min_element())
    }

    /// The receiver's own pixel.
    pub(crate) fn own(&self, site: &Site) -> usize {
        let [x, y] = site.receiver.pixel.map(|at| at as usize);
        y * self.distance.width + x
    }

    /// Whether `pixel` has an S that [answers](Self::answers).
    #[inline]
    pub(crate) fn knows(&self, site: &Site, at: Vec2, t: f32, pixel: usize) -> bool {
        !self.distance.shadow[pixel].is_nan() && self.answers(site, at, t, pixel)
    }
}
