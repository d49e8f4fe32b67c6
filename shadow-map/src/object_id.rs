//! `object-id`: the caster's id beside its depth, so that a surface does not shadow itself (Hourcade and Nicolas:
//! *Algorithms for Antialiased Cast Shadows*, 1985; in the list of Szabó, *Hardware generated shadows*, 5.5).
//!
//! A texel that stores the receiver's own object shadows nothing. For others the first two questions of
//! [`taps`](crate::taps) decide; the third, which tells a surface from its own neighbours, is not needed. Filtered
//! as `pcf`.
//!
//! Limits: an object throws no shadow onto itself, whatever its shape. Good for scenes of many convex objects.

use glam::Vec3;
use scene_core::{GBuffer, Report, VisibilityImage};

use crate::PreparedVariant;
use crate::cpu;
use crate::filter_maps::FilterMaps;
use crate::light_maps::{LightMaps, Receiver, ShadowMapView};
use crate::params::ShadowMapParams;
use crate::patches::{Form, Outcome};
use crate::pcf::Filter;
use crate::shade_patches::{Known, PatchLookup, TilePixels};
use crate::texel_outcomes::TexelOutcomes;

/// The variant: maps, ids and a filter.
#[derive(Debug)]
pub(crate) struct ObjectId<'a> {
    maps: FilterMaps<'a>,
    filter: Filter,
    /// The object of every texel, one list a view.
    objects: Vec<Vec<u32>>,
}

impl<'a> ObjectId<'a> {
    pub(crate) fn new(maps: LightMaps<'a>, params: &ShadowMapParams, report: &mut Report) -> Self {
        let objects = report.time("prepare.ids", |_| cpu::object_ids(&maps.scene, &maps.maps));
        report.bytes += objects.iter().map(|ids| size_of_val(ids.as_slice()) as u64).sum::<u64>();
        Self { maps: FilterMaps::new(maps, params.skip, report), filter: Filter::new(params), objects }
    }
}

impl PatchLookup for ObjectId<'_> {
    const FORM: Form = Form::Ids;

    fn reach(&self) -> [f64; 2] {
        self.filter.reads()
    }

    fn object_of(&self, view: usize, index: usize) -> u32 {
        self.objects[view][index]
    }

    fn constant(&self, outcome: Outcome) -> Option<f32> {
        Filter::constant(outcome)
    }

    fn known(&self, outcomes: &TexelOutcomes, pixels: &TilePixels<'_>, values: &mut [f32; 64]) -> Known {
        self.filter.known(&self.maps, outcomes, pixels, values)
    }

    fn answer(&self, outcomes: Option<&TexelOutcomes>, receiver: &Receiver, lit: &mut u64) -> f32 {
        self.filter.answer(&self.maps, receiver, outcomes, lit, |taps, stored| {
            self.objects[stored.view][stored.index] != receiver.object && taps.is_behind(stored)
        })
    }
}

impl PreparedVariant for ObjectId<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        Filter::shade(&self.maps, gbuffer, visibility, self, report);
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32], report: &mut Report) {
        report.time("shade.filter", |_| {
            cpu::filter_points(&self.maps.maps, points, visibility, |receiver| {
                self.answer(None, receiver, &mut 0)
            });
        });
    }

    fn maps(&self) -> &[ShadowMapView] {
        &self.maps.maps.maps
    }
}
