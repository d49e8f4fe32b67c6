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
use crate::patches::Form;
use crate::pcf::Filter;
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

    fn answer(&self, receiver: &Receiver, outcomes: Option<&TexelOutcomes>, lit: &mut u64) -> f32 {
        self.filter.answer(&self.maps, receiver, outcomes, lit, |taps, stored| {
            self.objects[stored.view][stored.index] != receiver.object && taps.is_behind(stored)
        })
    }
}

impl PreparedVariant for ObjectId<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        self.filter.shade(
            &self.maps,
            gbuffer,
            visibility,
            Form::Ids,
            |view, index| self.objects[view][index],
            |receiver, outcomes, lit| self.answer(receiver, outcomes, lit),
            report,
        );
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32], report: &mut Report) {
        report.time("shade.filter", |_| {
            cpu::filter_points(&self.maps.maps, points, visibility, |receiver| {
                self.answer(receiver, None, &mut 0)
            });
        });
    }

    fn maps(&self) -> &[ShadowMapView] {
        &self.maps.maps.maps
    }
}
