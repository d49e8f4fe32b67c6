//! The GPU path: the map and the edges of the CPU path's own code, uploaded, and one full-screen pass that looks them up.
//!
//! | stage | what is done |
//! | --- | --- |
//! | `prepare.map`, `prepare.silhouettes` | the CPU's own code |
//! | `prepare.splat` | the CPU's own code, over all surfaces of the scene that receive shadows |
//! | `prepare.upload` | lists and edges are copied |
//! | `shade.penumbra` | V of every pixel, those without a splat too |
//!
//! Where the CPU splats over what is seen, splats here reach whatever the scene holds: they are made once a light and hold
//! for any camera, so that a frame costs the CPU one recorded pass. Neither changes the image.
//!
//! V differs from the CPU's by rounding alone: the G-buffer's positions are found again from their depths, and a point of
//! the light may fall to the other side of an edge, each a step of 1/`taps`.

pub mod layout;
pub mod shaders;

use gnomon_shadow_map::gpu::layout::ViewUniform;
use scene_core::gpu::{
    GpuError, GpuGBuffer, GpuShadowQuery, HeldBuffer, HeldGroup, Receivers, Recorder, SceneBindings,
    SceneGroups, VisibilityPass, VisibilityPassParts, binding, storage_buffer,
};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Origin, Report};

use crate::params::Variant;
use crate::{Ddoc, DdocParams, cpu};
use layout::{MOST_VIEWS, Tables};

/// Turns of loops that a pixel may take: Mesa's software drivers end all loops of a pixel after 65,535 turns in sum, and a wrong
/// image is worse than none. What takes turns beside edges and faces is far less than the rest.
const MOST_TURNS: u32 = 60_000;

/// Edges that the shader looks at, edges that it counts and faces that it asks in a turn; edges in a turn of the variants that
/// keep one.
const LOOKED_AT_ONCE: u32 = 16;
const COUNTED_AT_ONCE: u32 = 8;
const OUTER_AT_ONCE: u32 = 8;
const FACES_AT_ONCE: u32 = 4;

/// Points of the light that the shader counts at once, `VECTORS` of four.
const POINTS_AT_ONCE: u32 = 64;

/// The technique on one device: pipelines, and the edges of the light prepared last.
#[derive(Debug)]
pub struct DdocOnGpu {
    technique: Ddoc,
    uniform: HeldBuffer,
    views: HeldBuffer,
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
    bytes: u64,
}

impl DdocOnGpu {
    /// Makes the pipelines. `visibility` is the format of the texture that V is written to.
    ///
    /// # Errors
    /// The variant `paper`, which has no GPU path.
    pub fn new(
        device: &wgpu::Device,
        params: DdocParams,
        visibility: wgpu::TextureFormat,
    ) -> Result<Self, TechniqueError> {
        if params.variant == Variant::Paper {
            return Err(TechniqueError::Unsupported {
                technique: DdocParams::TECHNIQUE,
                input: format!("variant={} on a GPU", params.variant.name()),
                why: "this variant has a CPU path only".to_owned(),
            });
        }
        let stages = wgpu::ShaderStages::FRAGMENT;
        let types = [binding::UNIFORM, binding::STORAGE, binding::STORAGE, binding::STORAGE];
        let own = HeldGroup::new(device, "ddoc", stages, &types);
        let scene = SceneBindings::new(device, stages);
        let receivers = Receivers::new(device);
        let pass = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "ddoc",
                wgsl: shaders::SHADE,
                fragment: "shade_ddoc",
                own: own.layout(),
                scene: &scene,
                receivers: &receivers,
                format: visibility,
            },
        );
        Ok(Self {
            technique: Ddoc::new(params),
            uniform: HeldBuffer::uniform("ddoc"),
            views: HeldBuffer::storage("views of the light"),
            own,
            scene,
            receivers,
            pass,
            prepared: None,
        })
    }

    /// Finds the edges of the query's light on the CPU and copies them to the device. They hold for any camera.
    ///
    /// # Errors
    /// A scene without [`GpuScene::geometry`](scene_core::gpu::GpuScene::geometry); more triangles than edges can be counted
    /// of; lists longer than the device binds in one piece, or over one tile than a pixel may go through.
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        self.prepared = None;
        let device = recorder.device;
        let geometry = query.scene.geometry.ok_or_else(|| TechniqueError::Unsupported {
            technique: DdocParams::TECHNIQUE,
            input: "a scene on the GPU alone".to_owned(),
            why: "its edges are found on the CPU: hand over the geometry in memory, too".to_owned(),
        })?;
        let (prepared, mut report) = self
            .technique
            // Receivers come from the G-buffer pass in world space.
            .prepare_with(Origin::WORLD, geometry, query.light, true)
            .map_err(|error| TechniqueError::Other(Box::new(error)))?;
        GpuError::within("views of a light", prepared.layers.len() as u32, MOST_VIEWS as u32)?;
        let splats = report.time("prepare.splat", |report| {
            let splats = cpu::splats_for_any_camera(&prepared);
            if prepared.skip {
                report.skip("splats", splats.iter().map(|splats| splats.left_out).sum());
            }
            splats
        });
        let rounds = (prepared.points.len() as u32).div_ceil(POINTS_AT_ONCE);
        for (splats, faces) in splats.iter().zip(&prepared.faces) {
            // At worst every edge that is looked at is counted. Counting is taken for twice its turns: where a trial came nearer to
            // the limit pixels were wrong, and why is not known.
            let edges = splats.longest();
            let turns = match prepared.variant {
                Variant::Smoothies | Variant::PenumbraMap => edges / OUTER_AT_ONCE,
                _ => (edges / LOOKED_AT_ONCE + 2 * (edges / COUNTED_AT_ONCE)).saturating_mul(rounds),
            };
            let turns = turns.saturating_add(faces.lists().longest() / FACES_AT_ONCE);
            GpuError::within("turns for edges and faces over one tile", turns, MOST_TURNS)?;
        }
        let own = report.time("prepare.upload", |_| {
            let tables = Tables::new(&prepared, &splats);
            let views: Vec<_> =
                prepared.layers.iter().map(|layers| ViewUniform::new(&layers.image.view)).collect();
            let lists = storage_buffer(device, "lists over tiles", bytemuck::cast_slice(&tables.words))?;
            let edges = storage_buffer(device, "edges", bytemuck::cast_slice(&tables.edges))?;
            let bytes = lists.size() + edges.size();
            let uniform = self.uniform.get(device, bytemuck::bytes_of(&tables.uniform));
            let views = self.views.get(device, bytemuck::cast_slice(&views));
            let bound = [uniform.into(), views.into(), lists.into(), edges.into()];
            Ok::<_, GpuError>((self.own.get(device, &bound), bytes))
        })?;
        let (own, bytes) = own;
        report.bytes = bytes;
        self.prepared = Some(Prepared { own, scene: self.scene.groups(device, &query.scene), bytes });
        self.receivers.prepare(device, query);
        Ok(report)
    }

    /// Records the pass that writes V of every pixel, 1 where nothing is seen.
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
        let not_prepared = || TechniqueError::NotPrepared { technique: DdocParams::TECHNIQUE };
        let prepared = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let receivers = self.receivers.group(recorder.device, camera, gbuffer).ok_or_else(not_prepared)?;
        self.pass.record(recorder, "shade.penumbra", &prepared.own, &prepared.scene, &receivers, visibility);
        Ok(Report { bytes: prepared.bytes, ..Default::default() })
    }
}
