//! The GPU path: the stages of [`cpu`](crate::cpu) under the same names, recorded into the caller's encoder.
//!
//! `prepare.views` is the CPU's own code. `prepare.maps` draws the casters, the nearest triangle a texel, into a layer
//! a view. `shade.lookup` asks the questions of [`receiver_plane`](crate::receiver_plane) in one full-screen pass, of one
//! texel for `hard`; `shade.filter` those of [`taps`](crate::taps), of as many as the filter has for `pcf` and `object-id`.
//!
//! `view_dependent` is not asked here: all casters are drawn, which costs time and changes no pixel.
//!
//! V differs from the CPU's only where the hardware's rasteriser gives a texel on a caster's outline to the other side
//! of it, or a receiver on the border of two texels to the other one.

pub mod layout;
pub mod shaders;

use std::ops::Range;

use scene_core::gpu::{
    DepthIds, DepthLayers, DepthPass, GpuError, GpuGBuffer, GpuShadowQuery, HeldBuffer, HeldGroup, Receivers,
    Recorder, SceneBindings, SceneGroups, VisibilityPass, VisibilityPassParts, binding,
};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Report, relevance};

use crate::light_views::{LightView, light_views};
use crate::receiver_plane::plane_tolerance;
use crate::{ShadowMapParams, Variant};
use layout::{FilterUniform, MapsUniform, ViewUniform};

/// The technique on one device: pipelines, and the maps of the light prepared last.
#[derive(Debug)]
pub struct ShadowMapOnGpu {
    params: ShadowMapParams,
    depth: DepthPass,
    layers: DepthLayers,
    maps: HeldBuffer,
    views: HeldBuffer,
    /// What filters read beside the maps; `hard` has none.
    filter: Option<FilterBuffers>,
    own: HeldGroup,
    scene: SceneBindings,
    receivers: Receivers,
    lookup: VisibilityPass,
    prepared: Option<Prepared>,
}

/// Settings of the filter, and the triangles of each object.
#[derive(Debug)]
struct FilterBuffers {
    settings: FilterUniform,
    uniform: HeldBuffer,
    objects: HeldBuffer,
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    own: wgpu::BindGroup,
    scene: SceneGroups,
}

impl ShadowMapOnGpu {
    /// Makes the pipelines. `visibility` is the format of the texture that V is written to.
    ///
    /// # Errors
    /// A `map_size` that the device has no texture of; a variant or number of taps that has no GPU path.
    pub fn new(
        device: &wgpu::Device,
        params: ShadowMapParams,
        visibility: wgpu::TextureFormat,
    ) -> Result<Self, TechniqueError> {
        GpuError::within(
            "texels a side of a map",
            params.map_size,
            device.limits().max_texture_dimension_2d,
        )?;
        if !params.variant.has_gpu_path() {
            return Err(TechniqueError::Unsupported {
                technique: ShadowMapParams::TECHNIQUE,
                input: format!("variant={} on a GPU", params.variant.name()),
                why: "this variant has a CPU path only".to_owned(),
            });
        }
        let stages = wgpu::ShaderStages::FRAGMENT;
        let mut types = vec![binding::UNIFORM, binding::STORAGE, binding::ID_LAYERS];
        let filter = (params.variant != Variant::Hard).then(|| {
            types.extend([binding::UNIFORM, binding::STORAGE]);
            FilterBuffers {
                settings: FilterUniform::new(&params),
                uniform: HeldBuffer::uniform("filter"),
                objects: HeldBuffer::storage("triangles of objects"),
            }
        });
        let (label, wgsl, fragment) = match params.variant {
            Variant::Hard => ("shadow-map hard", shaders::HARD, "shade_hard"),
            _ => ("shadow-map pcf", shaders::PCF, "shade_pcf"),
        };
        let own = HeldGroup::new(device, "shadow maps", stages, &types);
        let scene = SceneBindings::new(device, stages);
        let receivers = Receivers::new(device);
        let lookup = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label,
                wgsl,
                fragment,
                own: own.layout(),
                scene: &scene,
                receivers: &receivers,
                format: visibility,
            },
        );
        Ok(Self {
            params,
            depth: DepthPass::new(device, DepthIds::Triangle, None),
            layers: DepthLayers::new(DepthIds::Triangle),
            maps: HeldBuffer::uniform("maps"),
            views: HeldBuffer::storage("views of the light"),
            filter,
            own,
            scene,
            receivers,
            lookup,
            prepared: None,
        })
    }

    /// Records the drawing of the maps of the query's light. They hold for any camera, `view_dependent` or not.
    ///
    /// Without [`GpuScene::geometry`](scene_core::gpu::GpuScene::geometry) the views are fitted to the bounds of
    /// objects, which takes more texels than the vertices would.
    ///
    /// # Errors
    /// More maps or texels than the device has.
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        let mut report = Report::default();
        let geometry = query.scene.geometry_or_boxes();
        let tolerance = plane_tolerance(geometry.bounds(), query.light);
        let (casters, views) = report.time("prepare.views", |_| {
            let casters = relevance::told_apart(&geometry, query.light, tolerance);
            let views = light_views(&geometry, query.light, &casters.drawn, self.params.skips_faces());
            (casters, views)
        });
        report.skip("casters", casters.backdrops.len() as u64);
        report.skip("faces", views.skipped_faces);
        let is_drawn = |id: usize| {
            let object = &geometry.objects()[id];
            !casters.backdrops.iter().any(|backdrop| std::ptr::eq(*backdrop, object))
        };
        let objects = query.scene.objects.iter().enumerate().filter(|(id, _)| is_drawn(*id));
        let ranges: Vec<_> = objects.map(|(_, object)| object.triangles.clone()).collect();

        self.render_maps(recorder, query, &ranges, &views.views)?;
        report.bytes = self.layers.bytes();

        let device = recorder.device;
        let maps = MapsUniform { count: views.views.len() as u32, tolerance };
        let uniforms: Vec<_> = views.views.iter().map(ViewUniform::new).collect();
        let maps = self.maps.get(device, bytemuck::bytes_of(&maps));
        let views = self.views.get(device, bytemuck::cast_slice(&uniforms));
        self.prepared = None;
        if let Some(ids) = self.layers.bound_ids() {
            let mut bound = vec![maps.into(), views.into(), ids];
            if let Some(filter) = &mut self.filter {
                let objects: Vec<[u32; 2]> = query
                    .scene
                    .objects
                    .iter()
                    .map(|object| [object.triangles.start, object.triangles.end])
                    .collect();
                bound.push(filter.uniform.get(device, bytemuck::bytes_of(&filter.settings)).into());
                bound.push(filter.objects.get(device, bytemuck::cast_slice(&objects)).into());
            }
            let own = self.own.get(device, &bound);
            self.prepared = Some(Prepared { own, scene: self.scene.groups(device, &query.scene) });
        }
        self.receivers.prepare(device, query);
        Ok(report)
    }

    /// `prepare.maps`: draws the casters, ranges of triangles, as each view sees them.
    fn render_maps(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
        casters: &[Range<u32>],
        views: &[LightView],
    ) -> Result<(), GpuError> {
        self.layers.resize(recorder.device, self.params.map_size, views.len() as u32)?;
        let projections = views.iter().map(|view| view.projection_from_world);
        let targets = self.layers.targets(projections, Some(casters));
        self.depth.record(recorder, "prepare.maps", &query.scene, &targets);
        Ok(())
    }

    /// `shade.lookup` or `shade.filter`: records the pass that writes V of every pixel, 1 where nothing is seen.
    ///
    /// # Errors
    /// [`TechniqueError::NotPrepared`].
    pub fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        let not_prepared = || TechniqueError::NotPrepared { technique: ShadowMapParams::TECHNIQUE };
        let prepared = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let receivers = self.receivers.group(recorder.device, camera, gbuffer).ok_or_else(not_prepared)?;
        let stage = if self.filter.is_some() { "shade.filter" } else { "shade.lookup" };
        self.lookup.record(recorder, stage, &prepared.own, &prepared.scene, &receivers, visibility);
        Ok(Report { bytes: self.layers.bytes(), ..Default::default() })
    }

    /// The maps, one a layer, and the triangles they see; for tests and whoever else wants them.
    pub fn layers(&self) -> &DepthLayers {
        &self.layers
    }
}
