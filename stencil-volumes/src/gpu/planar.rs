//! Planar shadows on the GPU: the casters drawn once for each flat receiver, straight into V.
//!
//! The hardware clips what the CPU path clips by hand: behind the light the image's w is negative, under the receiver its
//! depth is. A pixel darkened twice is as dark as one darkened once, so no stencil is needed to keep a shadow single; that a
//! pixel is on the receiver is asked of the G-buffer.

use glam::{DMat4, DVec3};
use scene_core::gpu::{
    GpuGBuffer, GpuObject, GpuShadowQuery, HeldBuffer, HeldGroup, Receivers, Recorder, SceneBindings,
    SceneGroups, VisibilityPass, VisibilityPassParts, binding,
};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Light, Report, Scene};

use super::layout::ProjectionUniform;
use super::shaders;
use crate::VolumeParams;
use crate::crossing::HomogeneousLight;
use crate::planar::clip_from_caster;
use crate::receivers::{FlatReceivers, Receiver};

/// Planar shadows on one device.
#[derive(Debug)]
pub struct PlanarOnGpu {
    scene: SceneBindings,
    receivers: Receivers,
    own: HeldGroup,
    none: HeldBuffer,
    ask: VisibilityPass,
    solid: wgpu::RenderPipeline,
    masked: wgpu::RenderPipeline,
    /// A uniform and its group for each receiver.
    drawn: Vec<(HeldBuffer, HeldGroup)>,
    prepared: Option<Prepared>,
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    flat: Vec<Receiver>,
    light: Light,
    /// With their ids.
    casters: Vec<(u32, GpuObject)>,
    scene: SceneGroups,
}

impl PlanarOnGpu {
    /// Makes the pipelines. `visibility` is the format of the texture that V is written to.
    pub fn new(device: &wgpu::Device, visibility: wgpu::TextureFormat) -> Self {
        let stages = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let scene = SceneBindings::new(device, stages);
        let receivers = Receivers::new(device);
        let own = HeldGroup::new(device, "planar", stages, &[binding::UNIFORM]);
        let ask = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "planar ask",
                wgsl: shaders::PLANAR,
                fragment: "ask_planar",
                own: own.layout(),
                scene: &scene,
                receivers: &receivers,
                format: visibility,
            },
        );
        let groups = [own.layout(), &scene.triangles_layout, &scene.cutouts_layout, receivers.layout()];
        let solid = projection_pipeline(device, groups, false, visibility);
        let masked = projection_pipeline(device, groups, true, visibility);
        let none = HeldBuffer::uniform("no receiver");
        Self { scene, receivers, own, none, ask, solid, masked, drawn: Vec::new(), prepared: None }
    }

    /// Finds the flat receivers.
    pub(super) fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
        geometry: &Scene,
    ) -> Result<Report, TechniqueError> {
        let mut report = Report::default();
        let flat = report.time("prepare.receivers", |_| FlatReceivers::new(geometry, query.light)).receivers;
        self.receivers.prepare(recorder, query);
        let casters = (0..).zip(query.scene.objects.iter().cloned());
        let casters = casters.filter(|(_, o)| o.flags.casts && !o.triangles.is_empty()).collect();
        let scene = self.scene.groups(recorder.device, &query.scene);
        self.prepared = Some(Prepared { flat, light: *query.light, casters, scene });
        Ok(report)
    }

    /// `shade.ask` and, for each receiver, `shade.stencil`.
    pub(super) fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        let not_prepared = || TechniqueError::NotPrepared { technique: VolumeParams::TECHNIQUE };
        let prepared = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let device = recorder.device;
        let receivers = self.receivers.group(device, camera, gbuffer).ok_or_else(not_prepared)?;
        let none = self.none.get(device, &[0; size_of::<ProjectionUniform>()]);
        let own = self.own.get(device, &[none.into()]);
        self.ask.record(recorder, "shade.ask", &own, &prepared.scene, &receivers, visibility);
        let light = HomogeneousLight::from(prepared.light.center());
        for (index, receiver) in prepared.flat.iter().enumerate() {
            if index == self.drawn.len() {
                self.drawn.push((HeldBuffer::uniform("flat receiver"), self.own.another()));
            }
            let (uniform, group) = &mut self.drawn[index];
            let contents = projection_of(receiver, &light, camera);
            let uniform = uniform.get(device, bytemuck::bytes_of(&contents));
            let group = group.get(device, &[uniform.into()]);
            let span = recorder.stage("shade.stencil");
            let mut pass = recorder.encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("planar stencil"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: visibility,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
                })],
                timestamp_writes: span.render(),
                ..Default::default()
            });
            pass.set_bind_group(0, &group, &[]);
            pass.set_bind_group(1, &prepared.scene.triangles, &[]);
            pass.set_bind_group(3, &receivers, &[]);
            for has_mask in [false, true] {
                match (&prepared.scene.cutouts, has_mask) {
                    (Some(cutouts), true) => {
                        pass.set_pipeline(&self.masked);
                        pass.set_bind_group(2, cutouts, &[]);
                    }
                    _ => pass.set_pipeline(&self.solid),
                }
                for (id, object) in prepared.casters.iter().filter(|(_, o)| o.has_mask == has_mask) {
                    pass.draw(3 * object.triangles.start..3 * object.triangles.end, *id..id + 1);
                }
            }
        }
        Ok(Report::default())
    }
}

/// The matrix of a receiver, multiplied in f64 and relative to the eye, so that nothing is lost far from the origin.
fn projection_of(receiver: &Receiver, light: &HomogeneousLight, camera: &Camera) -> ProjectionUniform {
    let origin: DVec3 = camera.eye.as_dvec3();
    let clip = clip_from_caster(receiver, light, camera) * DMat4::from_translation(origin);
    let height = receiver.plane.dot(origin.extend(1.0));
    ProjectionUniform {
        clip_from_relative: clip.as_mat4(),
        plane: receiver.plane.truncate().extend(height).as_vec4(),
        origin: camera.eye,
        tolerance: receiver.tolerance as f32,
        object: receiver.object,
        padding: [0; 3],
    }
}

/// Draws casters as the group 0 of `groups` projects them; group 2 is bound for those with masks.
fn projection_pipeline(
    device: &wgpu::Device,
    [own, triangles, cutouts, receivers]: [&wgpu::BindGroupLayout; 4],
    masked: bool,
    visibility: wgpu::TextureFormat,
) -> wgpu::RenderPipeline {
    let label = Some("planar stencil");
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label,
        source: wgpu::ShaderSource::Wgsl(shaders::PLANAR.into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(own), Some(triangles), masked.then_some(cutouts), Some(receivers)],
        immediate_size: 0,
    });
    let [vertex, fragment] =
        if masked { ["project_masked", "stencil_masked"] } else { ["project", "stencil"] };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some(vertex),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: None,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(fragment),
            compilation_options: Default::default(),
            targets: &[Some(visibility.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
