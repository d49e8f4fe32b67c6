//! `cascaded` on the GPU: the depths that the G-buffer holds are split there, and the maps' projections are written by a
//! shader, so that nothing is read back.
//!
//! Casters are not chosen by cascade: which ones a part needs is known on the GPU only. A part that nobody sees still has its
//! pass, which draws nothing.

use std::ops::Range;

use glam::Mat3;
use scene_core::gpu::{
    ComputePass, DepthIds, DepthLayers, DepthPass, GpuGBuffer, GpuShadowQuery, HeldBuffer, HeldGroup,
    Receivers, Recorder, SceneBindings, SceneHandles, VisibilityPass, VisibilityPassParts, WorkBuffer,
    WrittenProjection, binding,
};
use scene_core::light::LightPoint;
use scene_core::technique::TechniqueError;
use scene_core::{Camera, Report};

use super::filter_maps::LevelTable;
use super::layout::{FitUniform, MapsUniform, ViewUniform};
use super::lookup::Lookup;
use super::{VariantOnGpu, not_prepared, shaders};
use crate::cascaded::drawn_bounds;
use crate::cascades::MAX_CASCADES;
use crate::receiver_plane::plane_tolerance;
use crate::{ShadowMapParams, Variant};

/// Pixels a side of a workgroup.
const GROUP: u32 = 8;
/// `State` of `cascades.wesl`: two depths, eight ends, five words for each of eight parts.
const STATE_BYTES: u64 = 4 * (2 + 8 + 8 * 5);
/// How far apart projections lie: what every device aligns uniforms to.
const PROJECTION_STRIDE: u64 = 256;

/// The variant on one device.
#[derive(Debug)]
pub(super) struct Cascaded {
    params: ShadowMapParams,
    depth: DepthPass,
    layers: DepthLayers,
    fit: HeldBuffer,
    state: WorkBuffer,
    views: WorkBuffer,
    projections: WorkBuffer,
    fit_group: HeldGroup,
    /// Each with whether it runs over all pixels.
    fits: Vec<(ComputePass, bool)>,
    maps: HeldBuffer,
    own: HeldGroup,
    pass: VisibilityPass,
    scene: SceneBindings,
    receivers: Receivers,
    prepared: Option<Prepared>,
    /// Lights at a place have no cascades. Made with the rest: a frame whose light is of the other kind makes no pipelines.
    hard: Lookup,
    /// Whether that is what was prepared last.
    is_hard: bool,
}

/// What `prepare` leaves to `shade`, for a directional light.
#[derive(Debug)]
struct Prepared {
    scene: SceneHandles,
    casters: Vec<Range<u32>>,
    fit: wgpu::Buffer,
    maps: wgpu::Buffer,
}

impl Cascaded {
    pub(super) fn new(
        device: &wgpu::Device,
        params: ShadowMapParams,
        visibility: wgpu::TextureFormat,
    ) -> Self {
        let compute = wgpu::ShaderStages::COMPUTE;
        let scene = SceneBindings::new(device, compute | wgpu::ShaderStages::FRAGMENT);
        let receivers = Receivers::new(device);
        let types =
            [binding::UNIFORM, binding::STORAGE_WRITE, binding::STORAGE_WRITE, binding::STORAGE_WRITE];
        let fit_group = HeldGroup::new(device, "cascades", compute, &types);
        let groups = [Some(fit_group.layout()), None, None, Some(receivers.layout())];
        let fits = [
            ("begin", false),
            ("find_range", true),
            ("find_splits", false),
            ("find_bounds", true),
            ("find_windows", false),
        ]
        .map(|(entry, over_pixels)| {
            (ComputePass::new(device, entry, shaders::CASCADES, entry, &groups), over_pixels)
        });
        let types = [binding::UNIFORM, binding::STORAGE, binding::ID_LAYERS, binding::STORAGE];
        let own = HeldGroup::new(device, "cascades", wgpu::ShaderStages::FRAGMENT, &types);
        let pass = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "shadow-map cascaded",
                wgsl: shaders::CASCADED,
                fragment: "shade_cascaded",
                own: own.layout(),
                scene: &scene,
                receivers: &receivers,
                format: visibility,
            },
        );
        Self {
            params,
            depth: DepthPass::new(device, DepthIds::Triangle, None),
            layers: DepthLayers::new(DepthIds::Triangle),
            fit: HeldBuffer::uniform("fit of cascades"),
            state: WorkBuffer::new("cascades"),
            views: WorkBuffer::new("views of cascades"),
            projections: WorkBuffer::with_usage("projections of cascades", wgpu::BufferUsages::UNIFORM),
            fit_group,
            fits: fits.into(),
            maps: HeldBuffer::uniform("maps"),
            own,
            pass,
            scene,
            receivers,
            prepared: None,
            hard: Lookup::new(device, ShadowMapParams { variant: Variant::Hard, ..params }, visibility),
            is_hard: false,
        }
    }

    fn count(&self) -> u32 {
        self.params.cascades.clamp(1, MAX_CASCADES as u32)
    }

    /// Maps of either kind of light are kept while the other one's are in use.
    fn bytes(&self) -> u64 {
        self.layers.bytes() + self.hard.bytes()
    }
}

impl VariantOnGpu for Cascaded {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        let device = recorder.device;
        let center = query.light.center();
        self.is_hard = matches!(center, LightPoint::At(_));
        let LightPoint::Towards(to_light) = center else {
            self.prepared = None;
            let report = self.hard.prepare(recorder, query)?;
            return Ok(Report { bytes: self.bytes(), ..report });
        };
        let mut report = Report::default();
        let geometry = query.scene.geometry_or_boxes();
        let tolerance = plane_tolerance(geometry.bounds(), query.light);
        let (x, y) = to_light.any_orthonormal_pair();
        let axes = Mat3::from_cols(x, y, to_light);
        let (casters, bounds) =
            report.time("prepare.views", |_| drawn_bounds(&geometry, query.light, tolerance, axes));
        report.skip("casters", casters.backdrops.len() as u64);
        let is_drawn = |id: usize| {
            let object = &geometry.objects()[id];
            !casters.backdrops.iter().any(|backdrop| std::ptr::eq(*backdrop, object))
        };
        let objects = query.scene.objects.iter().enumerate().filter(|(id, _)| is_drawn(*id));
        let ranges = objects.map(|(_, object)| object.triangles.clone()).collect();
        let middle = query.scene.bounds.center();
        let fit = FitUniform {
            x,
            count: self.count(),
            y,
            size: self.params.map_size as f32,
            z: to_light,
            border: crate::cascaded::BORDER,
            casters_min: bounds.min,
            casters_max: bounds.max,
            origin: if middle.is_finite() { middle } else { glam::Vec3::ZERO },
            ..bytemuck::Zeroable::zeroed()
        };
        let table = LevelTable::new(self.params.map_size);
        let maps = MapsUniform::new(self.count(), tolerance, &self.params, &table);
        self.prepared = Some(Prepared {
            scene: SceneHandles::new(&query.scene),
            casters: ranges,
            fit: self.fit.get(device, bytemuck::bytes_of(&fit)),
            maps: self.maps.get(device, bytemuck::bytes_of(&maps)),
        });
        self.receivers.prepare(recorder, query);
        Ok(report)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        if self.is_hard {
            let report = self.hard.shade(recorder, camera, gbuffer, visibility)?;
            return Ok(Report { bytes: self.bytes(), ..report });
        }
        let count = self.count();
        let device = recorder.device;
        let prepared = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let receivers = self.receivers.group(device, camera, gbuffer).ok_or_else(not_prepared)?;
        let state = self.state.get(device, STATE_BYTES)?;
        let views = self.views.get(device, u64::from(count) * size_of::<ViewUniform>() as u64)?;
        let projections = self.projections.get(device, u64::from(count) * PROJECTION_STRIDE)?;
        let bound = [
            prepared.fit.clone().into(),
            state.clone().into(),
            views.clone().into(),
            projections.clone().into(),
        ];
        let own = self.fit_group.get(device, &bound);
        let all = [camera.width.div_ceil(GROUP), camera.height.div_ceil(GROUP), 1];
        for (fit, over_pixels) in &self.fits {
            let groups = [Some(&own), None, None, Some(&receivers)];
            fit.record(recorder, "shade.cascades", &groups, if *over_pixels { all } else { [1; 3] });
        }

        self.layers.resize(device, self.params.map_size, count)?;
        let scene = prepared.scene.view();
        let unused = (0..count).map(|_| glam::Mat4::IDENTITY);
        let mut targets = self.layers.targets(unused, Some(&prepared.casters));
        for (target, cascade) in targets.iter_mut().zip(0..) {
            target.written =
                Some(WrittenProjection { buffer: &projections, offset: cascade * PROJECTION_STRIDE });
        }
        self.depth.record(recorder, "shade.maps", &scene, &targets);

        let ids = self.layers.bound_ids().ok_or_else(not_prepared)?;
        let own = self.own.get(device, &[prepared.maps.clone().into(), views.into(), ids, state.into()]);
        let groups = self.scene.groups(device, &scene);
        self.pass.record(recorder, "shade.lookup", &own, &groups, &receivers, visibility);
        Ok(Report { bytes: self.bytes(), ..Default::default() })
    }

    fn layers(&self) -> &DepthLayers {
        if self.is_hard { self.hard.layers() } else { &self.layers }
    }
}
