//! `alias-free` as a variant of the technique.

use glam::Vec3;
use scene_core::{GBuffer, Light, Report, Scene, VisibilityImage};

use super::AliasFree;
use crate::PreparedVariant;
use crate::light_maps::ShadowMapView;

/// A light's hard shadow without aliasing.
#[derive(Debug)]
pub(crate) struct Prepared<'a> {
    casters: AliasFree<'a>,
    light: Light,
}

impl<'a> Prepared<'a> {
    pub(crate) fn new(scene: &'a Scene, light: &Light, skip: bool, report: &mut Report) -> Self {
        let casters = report.time("prepare.chunks", |_| AliasFree::new(scene, skip));
        report.bytes += casters.bytes() as u64;
        Self { casters, light: *light }
    }
}

impl PreparedVariant for Prepared<'_> {
    fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage, report: &mut Report) {
        report.merge(&self.casters.shade(&self.light, gbuffer, visibility));
    }

    fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32], report: &mut Report) {
        let points = &points[..points.len().min(visibility.len())];
        let mut blocked = vec![false; points.len()];
        report.merge(&self.casters.occluded_packet(self.light.center(), points, &mut blocked));
        for ((value, point), blocked) in visibility.iter_mut().zip(points).zip(blocked) {
            *value = match point.is_finite() {
                false => f32::NAN,
                true if blocked || !self.light.reaches(*point) => 0.0,
                true => 1.0,
            };
        }
    }

    fn maps(&self) -> &[ShadowMapView] {
        &[]
    }
}
