//! `hard`, `pcf`, `object-id` and `pcss` on the GPU: maps drawn once, then one full-screen pass.

use scene_core::gpu::{
    DepthLayers, GpuGBuffer, GpuScene, GpuShadowQuery, HeldBuffer, HeldGroup, Receivers, Recorder,
    SceneBindings, SceneGroups, VisibilityPass, VisibilityPassParts, binding,
};
use scene_core::technique::TechniqueError;
use scene_core::{Camera, Report};

use super::filter_maps::FilterMapsOnGpu;
use super::layout::{FilterUniform, SoftUniform};
use super::light_maps::LightMapsOnGpu;
use super::{VariantOnGpu, not_prepared, shaders};
use crate::{ShadowMapParams, Variant};

/// The variants that look up one set of maps.
#[derive(Debug)]
pub(super) struct Lookup {
    params: ShadowMapParams,
    maps: LightMapsOnGpu,
    /// What filters read beside the maps; `hard` has none.
    filter: Option<FilterMapsOnGpu>,
    settings: HeldBuffer,
    objects: HeldBuffer,
    own: HeldGroup,
    scene: SceneBindings,
    receivers: Receivers,
    pass: VisibilityPass,
    prepared: Option<Prepared>,
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    own: wgpu::BindGroup,
    scene: SceneGroups,
}

impl Lookup {
    pub(super) fn new(
        device: &wgpu::Device,
        params: ShadowMapParams,
        visibility: wgpu::TextureFormat,
    ) -> Self {
        let (label, wgsl, fragment, beside): (_, _, _, &[_]) = match params.variant {
            Variant::Pcf | Variant::ObjectId => (
                "shadow-map pcf",
                shaders::PCF,
                "shade_pcf",
                &[binding::STORAGE, binding::UNIFORM, binding::STORAGE],
            ),
            Variant::Pcss => {
                ("shadow-map pcss", shaders::PCSS, "shade_pcss", &[binding::STORAGE, binding::UNIFORM])
            }
            _ => ("shadow-map hard", shaders::HARD, "shade_hard", &[]),
        };
        let fragment_stage = wgpu::ShaderStages::FRAGMENT;
        let mut types = vec![binding::UNIFORM, binding::STORAGE, binding::ID_LAYERS];
        types.extend(beside);
        let own = HeldGroup::new(device, "shadow maps", fragment_stage, &types);
        let scene = SceneBindings::new(device, fragment_stage | wgpu::ShaderStages::COMPUTE);
        let filter = (!beside.is_empty())
            .then(|| FilterMapsOnGpu::new(device, params.map_size, &scene.triangles_layout));
        let receivers = Receivers::new(device);
        let pass = VisibilityPass::new(
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
        Self {
            params,
            maps: LightMapsOnGpu::new(device, params),
            filter,
            settings: HeldBuffer::uniform("filter"),
            objects: HeldBuffer::storage("triangles of objects"),
            own,
            scene,
            receivers,
            pass,
            prepared: None,
        }
    }

    pub(super) fn bytes(&self) -> u64 {
        self.maps.layers().bytes() + self.filter.as_ref().map_or(0, FilterMapsOnGpu::bytes)
    }
}

/// First triangle of each object, and the one behind its last.
fn triangles_of_objects(scene: &GpuScene<'_>) -> Vec<[u32; 2]> {
    scene.objects.iter().map(|object| [object.triangles.start, object.triangles.end]).collect()
}

impl VariantOnGpu for Lookup {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        let mut report = Report::default();
        self.prepared = None;
        let device = recorder.device;
        let plan = report.time("prepare.views", |report| {
            self.maps.plan_for_view(&query.scene, query.light, query.camera, report)
        });
        let drawn = self.maps.draw(recorder, &query.scene, &plan, "prepare.maps")?;
        if let Some(drawn) = drawn {
            let scene = self.scene.groups(device, &query.scene);
            let mut bound = vec![drawn.maps.clone().into(), drawn.views.clone().into(), drawn.ids.clone()];
            if let Some(filter) = &mut self.filter {
                bound.push(filter.record(recorder, &drawn, &scene.triangles)?.into());
                let soft = self.params.variant == Variant::Pcss;
                let settings = if soft {
                    bytemuck::bytes_of(&SoftUniform::new(query.light, &self.params)).to_vec()
                } else {
                    bytemuck::bytes_of(&FilterUniform::new(&self.params)).to_vec()
                };
                bound.push(self.settings.get(device, &settings).into());
                if !soft {
                    let objects = triangles_of_objects(&query.scene);
                    bound.push(self.objects.get(device, bytemuck::cast_slice(&objects)).into());
                }
            }
            self.prepared = Some(Prepared { own: self.own.get(device, &bound), scene });
        }
        self.receivers.prepare(recorder, query);
        report.bytes = self.bytes();
        Ok(report)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        let prepared = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let receivers = self.receivers.group(recorder.device, camera, gbuffer).ok_or_else(not_prepared)?;
        let stage = if self.filter.is_some() { "shade.filter" } else { "shade.lookup" };
        self.pass.record(recorder, stage, &prepared.own, &prepared.scene, &receivers, visibility);
        Ok(Report { bytes: self.bytes(), ..Default::default() })
    }

    fn layers(&self) -> &DepthLayers {
        self.maps.layers()
    }

    fn depths(&self) -> Option<(&wgpu::Buffer, u32)> {
        self.filter.as_ref().and_then(FilterMapsOnGpu::depths)
    }
}
