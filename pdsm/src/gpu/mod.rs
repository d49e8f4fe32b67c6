//! The GPU path: functions built by the CPU path's own code, uploaded as they lie in memory (figure 6), and looked up in
//! one full-screen pass, in the order and with the names of [`cpu`](crate::cpu). Where they are more than the device binds in
//! one piece they lie in the layers of a texture, up to 2 GiB of them.
//!
//! V differs from the CPU's by rounding alone: the G-buffer's positions are found again from their depths, and a depth
//! that is a step of a function falls before or after it.

pub mod layout;
pub mod shaders;

use scene_core::gpu::{
    Bound, GpuError, GpuGBuffer, GpuShadowQuery, HeldBuffer, HeldGroup, Pages, Readers, Receivers, Recorder,
    SceneBindings, SceneGroups, VisibilityPass, VisibilityPassParts, binding, binding_limit, storage_buffer,
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
    scene: SceneBindings,
    receivers: Receivers,
    format: wgpu::TextureFormat,
    readers: Readers<Reader>,
    pages: Pages<u32>,
    prepared: Option<Prepared>,
}

/// What reads functions from one kind of memory.
#[derive(Debug)]
struct Reader {
    own: HeldGroup,
    lookup: VisibilityPass,
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
        let scene = SceneBindings::new(device, wgpu::ShaderStages::FRAGMENT);
        let receivers = Receivers::new(device);
        let from_buffers = Reader::of_buffers(device, &scene, &receivers, visibility);
        let uniform = HeldBuffer::uniform("pdsm");
        Self {
            source,
            uniform,
            scene,
            receivers,
            format: visibility,
            readers: Readers::new(from_buffers),
            pages: Pages::of(device),
            prepared: None,
        }
    }

    /// Builds the PDSM of the query's light on the CPU, or takes the baked one, and copies it to the device. It holds for
    /// any camera, but for windows of what the query's camera sees. Of those the farthest are left out where the functions of
    /// all are more than the device holds: their surfaces are answered by the scene's own window.
    ///
    /// # Errors
    /// A light or a scene that functions were not baked for; a scene without [`GpuScene::geometry`](scene_core::gpu::GpuScene::geometry); more functions than
    /// the device holds.
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        self.give_back();
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
        let [bound, paged] = [binding_limit(recorder.device), self.pages.most_bytes()];
        let holds = |[index, nodes]: [u64; 2]| index.max(nodes) <= bound || index + nodes <= paged;
        report.skip("windows beyond the device's memory", pdsm.leave_out_parts(holds));
        report.time("prepare.upload", |_| self.upload(recorder, query, &pdsm))?;
        Ok(report)
    }

    /// `prepare.upload`: functions that are there already, built or read from a file, are copied to the device.
    ///
    /// # Errors
    /// More functions than the device holds.
    pub fn upload(
        &mut self,
        recorder: &Recorder<'_>,
        query: &GpuShadowQuery<'_>,
        pdsm: &PreparedPdsm<'_>,
    ) -> Result<(), TechniqueError> {
        let Recorder { device, queue, .. } = *recorder;
        self.give_back();
        let windows = || pdsm.windows.iter().chain(pdsm.moving.iter());
        GpuError::within("windows", windows().count() as u32, MOST_WINDOWS as u32)?;
        let index: Vec<&[u32]> = windows().map(|window| window.functions.index()).collect();
        let nodes: Vec<&[u32]> = windows().map(|window| window.functions.nodes().words()).collect();
        let offsets: Vec<_> = windows().flat_map(|window| window.layout.offsets.iter().copied()).collect();
        let offsets = storage_buffer(device, "samples of the light", bytemuck::cast_slice(&offsets))?;
        let is_paged = bytes(&index).max(bytes(&nodes)) > binding_limit(device);
        let (functions, held, first_word): (Vec<Bound>, _, _) = if is_paged {
            let all = [&*index, &*nodes].concat();
            let (pages, held) = self.pages.texture(device, queue, "functions", &all)?;
            (vec![(&pages).into()], held, (bytes(&index) / 4) as u32)
        } else {
            let buffer = |what, pieces: &[&[u32]]| {
                storage_buffer(device, what, bytemuck::cast_slice(&pieces.concat()))
            };
            let (nodes, index) =
                (buffer("nodes of functions", &nodes)?, buffer("index of functions", &index)?);
            let held = nodes.size() + index.size();
            (vec![nodes.into(), index.into()], held, 0)
        };
        let mut uniform = PdsmUniform {
            count: windows().count() as u32,
            still: pdsm.windows.len() as u32,
            tolerance: pdsm.tolerance,
            radius: pdsm.radius(),
            ..bytemuck::Zeroable::zeroed()
        };
        // Far below u32's end, as what the device holds is.
        let mut firsts = [0, 0, first_word];
        for (into, window) in uniform.windows.iter_mut().zip(windows()) {
            *into = WindowUniform::new(window, firsts);
            let functions = &window.functions;
            let own = [functions.index().len(), window.layout.offsets.len(), functions.nodes().words().len()];
            firsts.iter_mut().zip(own).for_each(|(first, own)| *first += own as u32);
        }
        let uniform = self.uniform.get(device, bytemuck::bytes_of(&uniform));
        let bytes = held + offsets.size();
        let bound = [vec![uniform.into(), offsets.into()], functions].concat();
        let (scene, receivers, format) = (&self.scene, &self.receivers, self.format);
        let of_pages = || Reader::of_pages(device, scene, receivers, format);
        let reader = self.readers.choose(is_paged, of_pages);
        let own = reader.own.get(device, &bound);
        let (scene, survives_camera) = (self.scene.groups(device, &query.scene), pdsm.survives_camera());
        self.prepared = Some(Prepared { own, scene, bytes, survives_camera });
        self.receivers.prepare(recorder, query);
        Ok(())
    }

    /// Lets go of what was prepared last: memory need not hold both.
    fn give_back(&mut self) {
        self.prepared = None;
        self.readers.each().for_each(|reader| reader.own = reader.own.another());
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
        let lookup = &self.readers.chosen().lookup;
        lookup.record(recorder, "shade.lookup", &prepared.own, &prepared.scene, &receivers, visibility);
        Ok(Report { bytes: prepared.bytes, ..Default::default() })
    }
}

/// Bytes of all pieces.
fn bytes(pieces: &[&[u32]]) -> u64 {
    pieces.iter().map(|piece| size_of_val(*piece) as u64).sum()
}

impl Reader {
    /// Reads nodes and index from a buffer each.
    fn of_buffers(
        device: &wgpu::Device,
        scene: &SceneBindings,
        receivers: &Receivers,
        format: wgpu::TextureFormat,
    ) -> Self {
        let functions = [binding::STORAGE, binding::STORAGE];
        Self::new(device, scene, receivers, format, &functions, shaders::SHADE)
    }

    /// Reads both from [`Pages`].
    fn of_pages(
        device: &wgpu::Device,
        scene: &SceneBindings,
        receivers: &Receivers,
        format: wgpu::TextureFormat,
    ) -> Self {
        Self::new(device, scene, receivers, format, &[binding::ID_LAYERS], shaders::SHADE_PAGED)
    }

    fn new(
        device: &wgpu::Device,
        scene: &SceneBindings,
        receivers: &Receivers,
        format: wgpu::TextureFormat,
        functions: &[wgpu::BindingType],
        wgsl: &str,
    ) -> Self {
        let types = [&[binding::UNIFORM, binding::STORAGE][..], functions].concat();
        let own = HeldGroup::new(device, "penumbra deep shadow map", wgpu::ShaderStages::FRAGMENT, &types);
        let parts = VisibilityPassParts {
            label: "pdsm",
            wgsl,
            fragment: "shade_pdsm",
            own: own.layout(),
            scene,
            receivers,
            format,
        };
        let lookup = VisibilityPass::new(device, &parts);
        Self { own, lookup }
    }
}
