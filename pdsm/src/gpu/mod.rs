//! The GPU path: functions built by the CPU path's own code, uploaded as they lie in memory (figure 6), and looked up in
//! one full-screen pass, in the order and with the names of [`cpu`](crate::cpu).
//!
//! V differs from the CPU's by rounding alone: the G-buffer's positions are found again from their depths, and a depth
//! that is a step of a function falls before or after it.

pub mod layout;
pub mod shaders;

use scene_core::gpu::{
    GpuError, GpuGBuffer, GpuShadowQuery, HeldBuffer, HeldGroup, Receivers, Recorder, SceneBindings,
    SceneGroups, VisibilityPass, VisibilityPassParts, binding, binding_limit, storage_buffer,
};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Origin, Report};

use crate::baked::{self, Baked};
use crate::{Pdsm, PdsmParams, PreparedPdsm};
use layout::{MOST_WINDOWS, PdsmUniform, WindowUniform};

/// The technique on one device: pipelines, and the functions of the light prepared last.
#[derive(Debug)]
pub struct PdsmOnGpu {
    source: Source,
    uniform: HeldBuffer,
    own: HeldGroup,
    scene: SceneBindings,
    receivers: Receivers,
    lookup: VisibilityPass,
    prepared: Option<Prepared>,
}

/// Where functions come from.
#[derive(Debug)]
enum Source {
    Built(Pdsm),
    Baked(Box<Baked>),
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    own: wgpu::BindGroup,
    scene: SceneGroups,
    bytes: u64,
    survives_camera: bool,
}

impl PdsmOnGpu {
    /// Makes the pipelines. `visibility` is the format of the texture that V is written to.
    pub fn new(device: &wgpu::Device, params: PdsmParams, visibility: wgpu::TextureFormat) -> Self {
        Self::from_source(device, Source::Built(Pdsm::new(params)), visibility)
    }

    /// [`new`](Self::new), for functions that are there already.
    pub fn from_baked(device: &wgpu::Device, baked: Baked, visibility: wgpu::TextureFormat) -> Self {
        Self::from_source(device, Source::Baked(Box::new(baked)), visibility)
    }

    fn from_source(device: &wgpu::Device, source: Source, visibility: wgpu::TextureFormat) -> Self {
        let stages = wgpu::ShaderStages::FRAGMENT;
        let types = [binding::UNIFORM, binding::STORAGE, binding::STORAGE, binding::STORAGE];
        let own = HeldGroup::new(device, "penumbra deep shadow map", stages, &types);
        let scene = SceneBindings::new(device, stages);
        let receivers = Receivers::new(device);
        let lookup = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "pdsm",
                wgsl: shaders::SHADE,
                fragment: "shade_pdsm",
                own: own.layout(),
                scene: &scene,
                receivers: &receivers,
                format: visibility,
            },
        );
        Self { source, uniform: HeldBuffer::uniform("pdsm"), own, scene, receivers, lookup, prepared: None }
    }

    /// Builds the PDSM of the query's light on the CPU, or takes the baked one, and copies it to the device. It holds for
    /// any camera, but for windows of what the query's camera sees. Of those the farthest are left out where the device does
    /// not bind the functions of all in one piece: their surfaces are answered by the scene's own window.
    ///
    /// # Errors
    /// A light or a scene that functions were not baked for; a scene without [`GpuScene::geometry`](scene_core::gpu::GpuScene::geometry); more functions than the device binds
    /// in one piece.
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        self.prepared = None;
        let geometry = query.scene.geometry.ok_or_else(|| TechniqueError::Unsupported {
            technique: PdsmParams::TECHNIQUE,
            input: "a scene on the GPU alone".to_owned(),
            why: "its maps are drawn on the CPU: hand over the geometry in memory, too".to_owned(),
        })?;
        let (mut pdsm, mut report) = match &self.source {
            // Receivers come from the G-buffer pass in world space.
            Source::Built(technique) => {
                technique.counted_from(Origin::WORLD, geometry, query.light, Some(query.camera))
            }
            Source::Baked(baked) => baked.prepare(geometry, query.light).map_err(baked::refused)?,
        };
        let most = binding_limit(recorder.device);
        report.skip("windows beyond the device's memory", pdsm.leave_out_parts(most));
        report.time("prepare.upload", |_| self.upload(recorder.device, query, &pdsm))?;
        Ok(report)
    }

    /// `prepare.upload`: functions that are there already, built or read from a file, are copied to the device.
    ///
    /// # Errors
    /// More functions than the device binds in one piece.
    pub fn upload(
        &mut self,
        device: &wgpu::Device,
        query: &GpuShadowQuery<'_>,
        pdsm: &PreparedPdsm<'_>,
    ) -> Result<(), TechniqueError> {
        self.prepared = None;
        let mut uniform = PdsmUniform {
            count: (pdsm.windows.len() + pdsm.moving.len()) as u32,
            still: pdsm.windows.len() as u32,
            tolerance: pdsm.tolerance,
            radius: pdsm.radius(),
            ..bytemuck::Zeroable::zeroed()
        };
        GpuError::within("windows", uniform.count, MOST_WINDOWS as u32)?;
        let (mut index, mut nodes, mut offsets) = (Vec::new(), Vec::new(), Vec::new());
        for (into, window) in uniform.windows.iter_mut().zip(pdsm.windows.iter().chain(pdsm.moving.iter())) {
            // Far below u32's end: what the device binds in one piece, checked below, is less.
            *into = WindowUniform::new(window, index.len() as u32, offsets.len() as u32, nodes.len() as u32);
            index.extend_from_slice(window.functions.index());
            nodes.extend_from_slice(window.functions.nodes().words());
            offsets.extend_from_slice(&window.layout.offsets);
        }
        let index = storage_buffer(device, "index of functions", bytemuck::cast_slice(&index))?;
        let nodes = storage_buffer(device, "nodes of functions", bytemuck::cast_slice(&nodes))?;
        let offsets = storage_buffer(device, "samples of the light", bytemuck::cast_slice(&offsets))?;
        let bytes = index.size() + nodes.size() + offsets.size();
        let uniform = self.uniform.get(device, bytemuck::bytes_of(&uniform));
        let bound = [uniform.into(), index.into(), nodes.into(), offsets.into()];
        let own = self.own.get(device, &bound);
        let (scene, survives_camera) = (self.scene.groups(device, &query.scene), pdsm.survives_camera());
        self.prepared = Some(Prepared { own, scene, bytes, survives_camera });
        self.receivers.prepare(device, query);
        Ok(())
    }

    /// Whether what was prepared last would be the same for any other camera.
    pub fn survives_camera(&self) -> bool {
        self.prepared.as_ref().is_none_or(|prepared| prepared.survives_camera)
    }

    /// `shade.lookup`: records the pass that writes V of every pixel, 1 where nothing is seen.
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
        let not_prepared = || TechniqueError::NotPrepared { technique: PdsmParams::TECHNIQUE };
        let prepared = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let receivers = self.receivers.group(recorder.device, camera, gbuffer).ok_or_else(not_prepared)?;
        self.lookup.record(recorder, "shade.lookup", &prepared.own, &prepared.scene, &receivers, visibility);
        Ok(Report { bytes: prepared.bytes, ..Default::default() })
    }
}
