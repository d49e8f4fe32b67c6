//! `multi-view` on the GPU: a map from each point of the light, one after the other, and a sum a pixel. Every pass writes V as of
//! the points so far.
//!
//! Points, their views and casters are chosen in `prepare`, from the scene alone; maps are drawn in `shade`, all into the same
//! texture. Casters that no receiver needs are drawn, too, unless maps are `view_dependent`.

use scene_core::gpu::{
    DepthLayers, GpuGBuffer, GpuShadowQuery, HeldBuffer, HeldGroup, Receivers, Recorder, SceneBindings,
    SceneHandles, VisibilityPass, VisibilityPassParts, WorkBuffer, binding,
};
use scene_core::technique::TechniqueError;
use scene_core::{Camera, Light, Report};

use super::layout::PointUniform;
use super::light_maps::{LightMapsOnGpu, MapsPlan};
use super::{VariantOnGpu, not_prepared, shaders};
use crate::ShadowMapParams;
use crate::light_points::light_points;

/// The variant on one device.
#[derive(Debug)]
pub(super) struct MultiView {
    params: ShadowMapParams,
    maps: LightMapsOnGpu,
    sums: WorkBuffer,
    point: HeldBuffer,
    own: HeldGroup,
    pass: VisibilityPass,
    scene: SceneBindings,
    /// Of the point at hand.
    receivers: Receivers,
    prepared: Option<Prepared>,
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    scene: SceneHandles,
    light: Light,
    points: Vec<(Light, MapsPlan)>,
}

impl MultiView {
    pub(super) fn new(
        device: &wgpu::Device,
        params: ShadowMapParams,
        visibility: wgpu::TextureFormat,
    ) -> Self {
        let scene = SceneBindings::new(device, wgpu::ShaderStages::FRAGMENT);
        let receivers = Receivers::new(device);
        let types = [
            binding::UNIFORM,
            binding::STORAGE,
            binding::ID_LAYERS,
            binding::STORAGE_WRITE,
            binding::STORAGE,
        ];
        let own = HeldGroup::new(device, "a point of the light", wgpu::ShaderStages::FRAGMENT, &types);
        let pass = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "shadow-map multi-view",
                wgsl: shaders::MULTI_VIEW,
                fragment: "shade_multi_view",
                own: own.layout(),
                scene: &scene,
                receivers: &receivers,
                format: visibility,
            },
        );
        Self {
            params,
            maps: LightMapsOnGpu::new(device, params),
            sums: WorkBuffer::new("sums of pixels"),
            point: HeldBuffer::storage("point"),
            own,
            pass,
            scene,
            receivers,
            prepared: None,
        }
    }
}

impl VariantOnGpu for MultiView {
    fn prepare(
        &mut self,
        _recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        let mut report = Report::default();
        let points = report.time("prepare.views", |report| {
            let ShadowMapParams { views, seed, .. } = self.params;
            let points = light_points(query.light, query.scene.bounds, views, seed);
            let plan = |point| {
                let light = query.light.reduced_to(point);
                (light, self.maps.plan_for_view(&query.scene, &light, query.camera, report))
            };
            points.into_iter().map(plan).collect()
        });
        self.prepared =
            Some(Prepared { scene: SceneHandles::new(&query.scene), light: *query.light, points });
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
        let device = recorder.device;
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        let sums = self.sums.get(device, pixels * 8)?;
        let scene = prepared.scene.view();
        let groups = self.scene.groups(device, &scene);
        for (index, (light, plan)) in prepared.points.iter().enumerate() {
            let drawn = self.maps.draw(recorder, &scene, plan, "shade.maps")?.ok_or_else(not_prepared)?;
            let point = PointUniform::new(&prepared.light, index == 0);
            let point = self.point.get(device, bytemuck::bytes_of(&point));
            let bound = [drawn.maps.into(), drawn.views.into(), drawn.ids, sums.clone().into(), point.into()];
            let own = self.own.get(device, &bound);
            self.receivers.prepare(recorder, &GpuShadowQuery { scene, light, camera });
            let receivers = self.receivers.group(device, camera, gbuffer).ok_or_else(not_prepared)?;
            self.pass.record(recorder, "shade.lookup", &own, &groups, &receivers, visibility);
        }
        Ok(Report { bytes: self.maps.layers().bytes() + self.sums.bytes(), ..Default::default() })
    }

    fn layers(&self) -> &DepthLayers {
        self.maps.layers()
    }
}
