//! The maps of one light on the GPU: twin of [`light_maps`](crate::light_maps), with a layer a view.

use std::ops::Range;

use scene_core::gpu::{Bound, DepthIds, DepthLayers, DepthPass, GpuError, GpuScene, HeldBuffer, Recorder};
use scene_core::{Light, Report, relevance};

use super::filter_maps::LevelTable;
use super::layout::{MapsUniform, ViewUniform};
use crate::light_views::{LightView, light_views};
use crate::receiver_plane::plane_tolerance;
use crate::{ShadowMapParams, Variant};

/// Draws the maps of a light, and keeps their textures and what shaders must know of them.
#[derive(Debug)]
pub struct LightMapsOnGpu {
    params: ShadowMapParams,
    depth: DepthPass,
    layers: DepthLayers,
    maps: HeldBuffer,
    views: HeldBuffer,
}

/// What is to be drawn for a light.
#[derive(Clone, Debug)]
pub struct MapsPlan {
    /// A map each.
    pub views: Vec<LightView>,
    /// Ranges of triangles.
    pub casters: Vec<Range<u32>>,
    /// [`plane_tolerance`].
    pub tolerance: f32,
}

/// What [`LightMapsOnGpu::draw`] recorded: the first three bindings of every lookup, and how many views there are.
#[derive(Clone, Debug)]
pub struct DrawnMaps {
    /// `Maps` of `light_views.wesl`.
    pub maps: wgpu::Buffer,
    /// A table of `LightView`.
    pub views: wgpu::Buffer,
    /// The triangle of every texel, a layer a view.
    pub ids: Bound,
    /// Views.
    pub count: u32,
}

impl LightMapsOnGpu {
    /// Makes the pipelines.
    pub fn new(device: &wgpu::Device, params: ShadowMapParams) -> Self {
        Self {
            params,
            depth: DepthPass::new(device, DepthIds::Triangle, None),
            layers: DepthLayers::new(DepthIds::Triangle),
            maps: HeldBuffer::uniform("maps"),
            views: HeldBuffer::storage("views of the light"),
        }
    }

    /// Chooses the views of `light` and what is drawn into them. Nothing is recorded.
    pub fn plan(&self, scene: &GpuScene<'_>, light: &Light, report: &mut Report) -> MapsPlan {
        let geometry = scene.geometry_or_boxes();
        let tolerance = plane_tolerance(geometry.bounds(), light);
        // A box in the place of an object may be convex where the object is not.
        let has_solids = self.params.variant == Variant::MultiView && scene.geometry.is_some();
        let told_apart = if has_solids { relevance::told_apart_with_solids } else { relevance::told_apart };
        let casters = told_apart(&geometry, light, tolerance);
        let views = light_views(&geometry, light, &casters.drawn, self.params.skips_faces());
        report.skip("casters", casters.backdrops.len() as u64);
        report.skip("faces", views.skipped_faces);
        let is_drawn = |id: usize| {
            let object = &geometry.objects()[id];
            !casters.backdrops.iter().any(|backdrop| std::ptr::eq(*backdrop, object))
        };
        let objects = scene.objects.iter().enumerate().filter(|(id, _)| is_drawn(*id));
        let casters = objects.map(|(_, object)| object.triangles.clone()).collect();
        MapsPlan { views: views.views, casters, tolerance }
    }

    /// Records the drawing of the maps, timed as `stage`. A light without casters has no views, and a map that is not
    /// looked up.
    ///
    /// # Errors
    /// More maps or texels than the device has.
    pub fn draw(
        &mut self,
        recorder: &mut Recorder<'_>,
        scene: &GpuScene<'_>,
        plan: &MapsPlan,
        stage: &str,
    ) -> Result<Option<DrawnMaps>, GpuError> {
        let count = plan.views.len() as u32;
        self.layers.resize(recorder.device, self.params.map_size, count)?;
        let projections = plan.views.iter().map(|view| view.projection_from_world);
        let targets = self.layers.targets(projections, Some(&plan.casters));
        self.depth.record(recorder, stage, scene, &targets);

        let device = recorder.device;
        let table = LevelTable::new(self.params.map_size);
        let maps = MapsUniform::new(count, plan.tolerance, &self.params, &table);
        let uniforms: Vec<_> = plan.views.iter().map(ViewUniform::new).collect();
        let maps = self.maps.get(device, bytemuck::bytes_of(&maps));
        let views = self.views.get(device, bytemuck::cast_slice(&uniforms));
        Ok(self.layers.bound_ids().map(|ids| DrawnMaps { maps, views, ids, count }))
    }

    /// The maps, one a layer, and the triangles they see.
    pub fn layers(&self) -> &DepthLayers {
        &self.layers
    }
}
