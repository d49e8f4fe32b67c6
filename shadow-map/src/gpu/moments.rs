//! `moments` on the GPU: windows of depths blurred by two compute passes a view, then four windows a pixel.
//!
//! Moments of all views lie in one buffer, 16 bytes a texel: with the 128 MiB that WebGPU promises to bind, one map of 2,894²
//! texels or six of 1,180² at most.

use scene_core::gpu::{
    Bound, ComputePass, DepthLayers, GpuError, GpuGBuffer, GpuShadowQuery, HeldBuffer, HeldGroup, Receivers,
    Recorder, SceneBindings, SceneGroups, VisibilityPass, VisibilityPassParts, WorkBuffer, binding,
};
use scene_core::technique::TechniqueError;
use scene_core::{Camera, Report};

use super::filter_maps::FilterMapsOnGpu;
use super::layout::{BlurUniform, BoundUniform};
use super::light_maps::{DrawnMaps, LightMapsOnGpu};
use super::{VariantOnGpu, not_prepared, shaders};
use crate::ShadowMapParams;

/// Texels a side of a workgroup.
const GROUP: u32 = 8;

/// The variant on one device.
#[derive(Debug)]
pub(super) struct Moments {
    params: ShadowMapParams,
    maps: LightMapsOnGpu,
    depths: FilterMapsOnGpu,
    lines: WorkBuffer,
    moments: WorkBuffer,
    blur_group: HeldGroup,
    /// One a view.
    blurs: Vec<(HeldBuffer, HeldGroup)>,
    rows: ComputePass,
    columns: ComputePass,
    bound: HeldBuffer,
    own: HeldGroup,
    pass: VisibilityPass,
    scene: SceneBindings,
    receivers: Receivers,
    prepared: Option<(wgpu::BindGroup, SceneGroups)>,
}

impl Moments {
    pub(super) fn new(
        device: &wgpu::Device,
        params: ShadowMapParams,
        visibility: wgpu::TextureFormat,
    ) -> Self {
        let (compute, fragment) = (wgpu::ShaderStages::COMPUTE, wgpu::ShaderStages::FRAGMENT);
        let scene = SceneBindings::new(device, compute | fragment);
        let receivers = Receivers::new(device);
        let types = [
            binding::UNIFORM,
            binding::STORAGE,
            binding::ID_LAYERS,
            binding::STORAGE,
            binding::UNIFORM,
            binding::STORAGE_WRITE,
            binding::STORAGE_WRITE,
        ];
        let blur_group = HeldGroup::new(device, "blur", compute, &types);
        let groups = [Some(blur_group.layout())];
        let step = |entry| ComputePass::new(device, entry, shaders::PREPARE_MOMENTS, entry, &groups);
        let types =
            [binding::UNIFORM, binding::STORAGE, binding::ID_LAYERS, binding::UNIFORM, binding::STORAGE];
        let own = HeldGroup::new(device, "moments", fragment, &types);
        let pass = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "shadow-map moments",
                wgsl: shaders::MOMENTS,
                fragment: "shade_moments",
                own: own.layout(),
                scene: &scene,
                receivers: &receivers,
                format: visibility,
            },
        );
        Self {
            params,
            maps: LightMapsOnGpu::new(device, params),
            depths: FilterMapsOnGpu::new(device, params.map_size, &scene.triangles_layout),
            lines: WorkBuffer::new("rows of moments"),
            moments: WorkBuffer::new("moments"),
            rows: step("blur_rows"),
            columns: step("blur_columns"),
            blur_group,
            blurs: Vec::new(),
            bound: HeldBuffer::uniform("bound"),
            own,
            pass,
            scene,
            receivers,
            prepared: None,
        }
    }

    /// `prepare.moments`: gives the buffer of moments.
    fn blur(
        &mut self,
        recorder: &mut Recorder<'_>,
        drawn: &DrawnMaps,
        depths: &wgpu::Buffer,
    ) -> Result<wgpu::Buffer, GpuError> {
        let device = recorder.device;
        let (size, window) = (self.params.map_size, self.params.filter);
        let half = window / 2;
        let (border, side) = (half + 1, size + 2);
        let wide = size + 2 * border;
        let texels = |width: u32, height: u32| u64::from(width) * u64::from(height) * 16;
        let views = u64::from(drawn.count.max(1));
        let lines = self.lines.get(device, texels(side, wide))?;
        let moments = self.moments.get(device, views * texels(side, side))?;
        for view in 0..drawn.count {
            if self.blurs.len() <= view as usize {
                self.blurs.push((HeldBuffer::uniform("blur"), self.blur_group.another()));
            }
            let (uniform, group) = &mut self.blurs[view as usize];
            let start = view * side * side;
            let blur = BlurUniform { view, window, half, border, side, wide, start, padding: 0 };
            let uniform = uniform.get(device, bytemuck::bytes_of(&blur));
            let bound: [Bound; 7] = [
                drawn.maps.clone().into(),
                drawn.views.clone().into(),
                drawn.ids.clone(),
                depths.clone().into(),
                uniform.into(),
                lines.clone().into(),
                moments.clone().into(),
            ];
            let group = group.get(device, &bound);
            let groups = |texels: u32| texels.div_ceil(GROUP);
            for (pass, workgroups) in [
                (&self.rows, [groups(side), groups(wide), 1]),
                (&self.columns, [groups(side), groups(side), 1]),
            ] {
                pass.record(recorder, "prepare.moments", &[Some(&group)], workgroups);
            }
        }
        Ok(moments)
    }

    fn bytes(&self) -> u64 {
        let blurred = self.lines.bytes() + self.moments.bytes();
        self.maps.layers().bytes() + self.depths.bytes() + blurred
    }
}

impl VariantOnGpu for Moments {
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
        if let Some(drawn) = self.maps.draw(recorder, &query.scene, &plan, "prepare.maps")? {
            let scene = self.scene.groups(device, &query.scene);
            let depths = self.depths.record(recorder, &drawn, &scene.triangles)?;
            let moments = self.blur(recorder, &drawn, &depths)?;
            let bound = BoundUniform {
                window: self.params.filter as f32,
                moments: if self.params.moments == 4 { 4 } else { 2 },
                light_bleeding: self.params.light_bleeding,
                side: self.params.map_size + 2,
            };
            let bound = self.bound.get(device, bytemuck::bytes_of(&bound));
            let own = [drawn.maps.into(), drawn.views.into(), drawn.ids, bound.into(), moments.into()];
            self.prepared = Some((self.own.get(device, &own), scene));
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
        let (own, scene) = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let receivers = self.receivers.group(recorder.device, camera, gbuffer).ok_or_else(not_prepared)?;
        self.pass.record(recorder, "shade.lookup", own, scene, &receivers, visibility);
        Ok(Report { bytes: self.bytes(), ..Default::default() })
    }

    fn layers(&self) -> &DepthLayers {
        self.maps.layers()
    }

    fn depths(&self) -> Option<(&wgpu::Buffer, u32)> {
        self.depths.depths()
    }
}
