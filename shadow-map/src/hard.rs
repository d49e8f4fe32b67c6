//! `hard`: one comparison a receiver (Williams 1978), by the questions of [`receiver_plane`](crate::receiver_plane).
//!
//! Limits: V is 0 or 1, an extended light is taken for its centre, and shadow edges are jagged by the map's
//! texels.

use glam::Vec3;
use scene_core::raster::DEPTH_POSITION_ERROR;
use scene_core::{GBuffer, Report, VisibilityImage};

use crate::PreparedVariant;
use crate::cpu;
use crate::light_maps::{LightMaps, Receiver, ShadowMapView};
use crate::patches::{Form, Outcome, PatchRow, patches_of};
use crate::receiver_plane::{is_behind, is_near, meets, rises_above};
use crate::shade_patches::{Known, PatchLookup, TilePixels, shade_patches};
use crate::texel_outcomes::{TexelOutcomes, bits_of, patches_pay};

impl LightMaps<'_> {
    /// V of one receiver, 0 or 1.
    #[inline]
    pub fn hard(&self, receiver: &Receiver) -> f32 {
        let Receiver { point, normal, tolerance, .. } = *receiver;
        let light = self.light.center();
        let shadowed = self.occluder(point).is_some_and(|occluder| {
            let corners = self.scene.corners(occluder.triangle);
            let snapping = occluder.texel * DEPTH_POSITION_ERROR;
            rises_above(occluder.point, point, normal, tolerance + snapping)
                && is_behind(corners, point, light, tolerance)
                && (!is_near(occluder.point, point, normal, light, occluder.texel)
                    || meets(corners, point, light)
                    || self.meets_beside(point, tolerance))
        });
        if shadowed { 0.0 } else { 1.0 }
    }

    /// V at a free point, which has no surface of its own: shadowed if the stored surface is nearer to the
    /// light and the point lies behind it. NaN for a point that is not finite.
    pub fn hard_at(&self, point: Vec3) -> f32 {
        if !point.is_finite() {
            return f32::NAN;
        }
        if !self.light.reaches(point) {
            return 0.0;
        }
        let (to_light, _) = self.light.center().ray_from(point);
        let shadowed = self.occluder(point).is_some_and(|occluder| {
            (occluder.point - point).dot(to_light) > 0.0
                && is_behind(
                    self.scene.corners(occluder.triangle),
                    point,
                    self.light.center(),
                    self.tolerance,
                )
        });
        if shadowed || self.is_behind_backdrop(point) { 0.0 } else { 1.0 }
    }
}

impl LightMaps<'_> {
    /// [`hard`](Self::hard) for every pixel, those of a patch together. Returns how many needed no lookup.
    pub fn shade_hard(&self, gbuffer: &GBuffer, patches: &[PatchRow], values: &mut [f32]) -> u64 {
        let [_, known] = shade_patches(self, gbuffer, patches, values, &HardLookup(self));
        known
    }
}

/// One comparison a pixel.
struct HardLookup<'m>(&'m LightMaps<'m>);

impl PatchLookup for HardLookup<'_> {
    const FORM: Form = Form::Hard;

    fn reach(&self) -> [f64; 2] {
        [0.0; 2]
    }

    fn constant(&self, outcome: Outcome) -> Option<f32> {
        match outcome {
            Outcome::Clear => Some(1.0),
            Outcome::Blocks => Some(0.0),
            _ => None,
        }
    }

    fn known(&self, outcomes: &TexelOutcomes, pixels: &TilePixels<'_>, values: &mut [f32; 64]) -> Known {
        let map = &self.0.maps[outcomes.view];
        let mut known = Known::default();
        for bit in bits_of(pixels.mask) {
            let texel = map.view.project(pixels.position(bit)).map(|ndc| map.texel(ndc));
            let v = texel.and_then(|[column, row]| self.constant(outcomes.at(column as i32, row as i32)));
            if let Some(v) = v {
                values[bit] = v;
                known.answered |= 1 << bit;
            }
        }
        known
    }

    fn answer(&self, _: Option<&TexelOutcomes>, receiver: &Receiver, _: &mut u64) -> f32 {
        self.0.hard(receiver)
    }
}

/// The variant: its maps are all there is to it.
#[derive(Debug)]
pub(crate) struct Hard<'a> {
    pub(crate) maps: LightMaps<'a>,
    pub(crate) skip: bool,
}

impl PreparedVariant for Hard<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        if self.skip && patches_pay(&self.maps, gbuffer, [0.0; 2]) {
            let known = report.time("shade.lookup", |_| {
                let patches = patches_of(&self.maps.scene, gbuffer);
                self.maps.shade_hard(gbuffer, &patches, &mut visibility.values)
            });
            report.skip("lookups", known);
        } else {
            report.time("shade.lookup", |_| {
                cpu::shade_pixels(&self.maps, gbuffer, visibility, |receiver| self.maps.hard(receiver));
            });
            report.skip("lookups", 0);
        }
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32], report: &mut Report) {
        let answer = |point| self.maps.hard_at(point);
        report.time("shade.lookup", |_| cpu::answer_points(points, visibility, answer));
    }

    fn maps(&self) -> &[ShadowMapView] {
        &self.maps.maps
    }
}
