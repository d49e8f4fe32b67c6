//! The GPU path: the map and the edges of the CPU path's own code, uploaded, and passes that look them up.
//!
//! | stage | what is done |
//! | --- | --- |
//! | `prepare.map`, `prepare.silhouettes` | the CPU's own code |
//! | `prepare.splat` | the CPU's own code, over all surfaces of the scene that receive shadows |
//! | `prepare.upload` | lists and edges are copied |
//! | `shade.penumbra` | V of every pixel, which goes through the lists over it |
//!
//! Where a list is too long for one thread's loop, three passes take the place of that one (module `groups`):
//!
//! | stage | what is done |
//! | --- | --- |
//! | `shade.penumbra` | V of every pixel, a workgroup for 8 × 8 of them: those in one tile of the light's image go through its lists together, each thread looks at other entries, and pixels ask what reaches into their beam |
//! | `shade.rest` | V of pixels that would take too many rounds so, one after the other, each by all threads of its workgroup |
//! | `shade.write` | V is copied to the texture |
//!
//! Where lists or edges are more than the device binds in one piece, both lie in [`Pages`], and passes of the same shaders read those.
//!
//! Where the CPU splats over what is seen, splats here reach whatever the scene holds: they are made once a light and hold
//! for any camera, so that a frame costs the CPU one recorded pass. Neither changes the image.
//!
//! V differs from the CPU's by rounding alone: the G-buffer's positions are found again from their depths, and a point of
//! the light may fall to the other side of an edge, each a step of 1/`taps`.

mod groups;
pub mod layout;
pub mod shaders;

use gnomon_shadow_map::gpu::layout::ViewUniform;
use scene_core::gpu::{
    Bound, GpuError, GpuGBuffer, GpuShadowQuery, HeldBuffer, HeldGroup, Pages, Readers, Receivers, Recorder,
    SceneBindings, SceneGroups, VisibilityPass, VisibilityPassParts, binding_limit, storage_buffer,
};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Origin, Report};

use crate::params::Variant;
use crate::{Ddoc, DdocParams, cpu};
use groups::{Frame, Groups, answered_at_once};
use layout::{MOST_VIEWS, Tables};

/// Rounds of loops that a thread may take, `MOST_TURNS` of `groups.wesl`: Mesa's software driver ends all loops of eight threads
/// together after 65,535 rounds in sum, and a wrong image is worse than none. What takes rounds beside edges and faces is far less
/// than the rest.
const MOST_TURNS: u32 = 60_000;

/// Edges that `shade.wesl` looks at in a round; points of the light that are counted at once.
const LOOKED_AT_ONCE: u32 = 2;
const POINTS_AT_ONCE: u32 = 64;

/// Pixels whose loops that driver counts together.
const TOGETHER: u32 = 8;

/// What is looked up.
const LISTS: &str = "lists over tiles";
const EDGES: &str = "edges";

/// Things that lists can name.
const MOST_LISTED: u32 = 1 << 27;

/// The technique on one device: pipelines, and the edges of the light prepared last.
#[derive(Debug)]
pub struct DdocOnGpu {
    technique: Ddoc,
    uniform: HeldBuffer,
    views: HeldBuffer,
    scene: SceneBindings,
    receivers: Receivers,
    visibility: wgpu::TextureFormat,
    readers: Readers<Reader>,
    always_groups: bool,
    prepared: Option<Prepared>,
}

/// Passes that look edges up, and what they bind.
#[derive(Debug)]
struct Reader {
    are_paged: bool,
    own: HeldGroup,
    pass: VisibilityPass,
    /// Made for the first light whose lists are long.
    groups: Option<Groups>,
}

impl Reader {
    fn new(
        device: &wgpu::Device,
        are_paged: bool,
        scene: &SceneBindings,
        receivers: &Receivers,
        visibility: wgpu::TextureFormat,
    ) -> Self {
        let types = Tables::bindings(are_paged);
        let own = HeldGroup::new(device, "ddoc", wgpu::ShaderStages::FRAGMENT, &types);
        let pass = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "ddoc",
                wgsl: if are_paged { shaders::SHADE_PAGED } else { shaders::SHADE },
                fragment: "shade_ddoc",
                own: own.layout(),
                scene,
                receivers,
                format: visibility,
            },
        );
        Self { are_paged, own, pass, groups: None }
    }

    /// Lets go of what was bound last: memory need not hold both.
    fn give_back(&mut self) {
        self.own = self.own.another();
        if let Some(groups) = &mut self.groups {
            groups.give_back();
        }
    }

    /// Makes the passes in groups, if they are not there.
    fn make_groups(
        &mut self,
        device: &wgpu::Device,
        scene: &SceneBindings,
        receivers: &Receivers,
        visibility: wgpu::TextureFormat,
    ) {
        let wgsl = match self.are_paged {
            false => [shaders::GROUPS, shaders::REST],
            true => [shaders::GROUPS_PAGED, shaders::REST_PAGED],
        };
        let types = Tables::bindings(self.are_paged);
        self.groups.get_or_insert_with(|| Groups::new(device, wgsl, &types, scene, receivers, visibility));
    }
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    /// What group 0 binds; passes of groups V, too.
    bound: Vec<Bound>,
    scene: SceneGroups,
    bytes: u64,
    /// Where lists are long, receivers that a workgroup of `shade.rest` answers.
    at_once: Option<u32>,
}

/// Whether the longest lists, of edges and faces over one tile of each view, are too long for `shade.wesl`.
fn are_long(longest: &[[u32; 2]], variant: Variant, points: usize) -> bool {
    let rounds = (points as u32).div_ceil(POINTS_AT_ONCE);
    longest.iter().any(|&[edges, faces]| {
        // At worst every edge that is looked at is counted.
        let turns = match variant {
            Variant::Smoothies | Variant::PenumbraMap => edges,
            _ => (edges / LOOKED_AT_ONCE + edges).saturating_mul(rounds),
        };
        // Rounds add up over eight pixels that diverge: all that is known of one is that some pixel goes on in it.
        turns.saturating_add(faces).saturating_mul(TOGETHER) > MOST_TURNS
    })
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
        let scene = SceneBindings::new(device, wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::COMPUTE);
        let receivers = Receivers::new(device);
        let from_buffers = Reader::new(device, false, &scene, &receivers, visibility);
        Ok(Self {
            technique: Ddoc::new(params),
            uniform: HeldBuffer::uniform("ddoc"),
            views: HeldBuffer::storage("views of the light"),
            scene,
            receivers,
            visibility,
            readers: Readers::new(from_buffers),
            always_groups: false,
            prepared: None,
        })
    }

    /// From the next light on receivers go through lists in groups, however short those are. The image is the same.
    pub fn always_in_groups(&mut self) {
        self.always_groups = true;
    }

    /// Finds the edges of the query's light on the CPU and copies them to the device. They hold for any camera.
    ///
    /// # Errors
    /// A scene without [`GpuScene::geometry`](scene_core::gpu::GpuScene::geometry); more triangles than edges can be counted
    /// of; more lists or edges than [`Pages`] hold; longer lists over one tile than a pixel may go through.
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        self.prepared = None;
        self.readers.each().for_each(Reader::give_back);
        let Recorder { device, queue, .. } = *recorder;
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
        GpuError::within("triangles", geometry.triangles().len() as u32, MOST_LISTED)?;
        GpuError::within("edges", prepared.edges.len() as u32, MOST_LISTED)?;
        let longest: Vec<_> = splats
            .iter()
            .zip(&prepared.faces)
            .map(|(splats, faces)| [splats.longest(), faces.lists().longest()])
            .collect();
        let points = prepared.points.len();
        let in_groups = self.always_groups || are_long(&longest, prepared.variant, points);
        let at_once = in_groups.then(|| answered_at_once(&longest, points)).transpose()?;
        let (bound, are_paged, bytes) = report.time("prepare.upload", |_| {
            let mut tables = Tables::new(&prepared, &splats);
            tables.uniform.alone = at_once.unwrap_or(0);
            let views: Vec<_> =
                prepared.layers.iter().map(|layers| ViewUniform::new(&layers.image.view)).collect();
            let bytes = size_of_val(&*tables.words).max(size_of_val(&*tables.edges)) as u64;
            let are_paged = bytes > binding_limit(device);
            let (looked_up, bytes): ([Bound; 2], _) = if are_paged {
                let (words, edges) = (Pages::of(device), Pages::of(device));
                let (words, of_words) = words.texture(device, queue, LISTS, &[&tables.words])?;
                let (edges, of_edges) = edges.texture(device, queue, EDGES, &[&tables.edges])?;
                ([(&words).into(), (&edges).into()], of_words + of_edges)
            } else {
                let words = storage_buffer(device, LISTS, bytemuck::cast_slice(&tables.words))?;
                let edges = storage_buffer(device, EDGES, bytemuck::cast_slice(&tables.edges))?;
                let bytes = words.size() + edges.size();
                ([words.into(), edges.into()], bytes)
            };
            let uniform = self.uniform.get(device, bytemuck::bytes_of(&tables.uniform));
            let views = self.views.get(device, bytemuck::cast_slice(&views));
            let bound = [[uniform.into(), views.into()], looked_up].concat();
            Ok::<_, GpuError>((bound, are_paged, bytes))
        })?;
        report.bytes = bytes;
        let (scene, receivers, format) = (&self.scene, &self.receivers, self.visibility);
        let of_pages = || Reader::new(device, true, scene, receivers, format);
        let reader = self.readers.choose(are_paged, of_pages);
        if in_groups {
            reader.make_groups(device, scene, receivers, format);
        }
        let scene = self.scene.groups(device, &query.scene);
        self.prepared = Some(Prepared { bound, scene, bytes, at_once });
        self.receivers.prepare(recorder, query);
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
        let Prepared { bound, scene, bytes, at_once } = prepared;
        let mut report = Report { bytes: *bytes, ..Default::default() };
        let reader = self.readers.chosen();
        if let (Some(at_once), Some(groups)) = (*at_once, &mut reader.groups) {
            let size = [camera.width, camera.height];
            let frame = Frame { bound, scene, receivers: &receivers, size, at_once };
            report.bytes += groups.record(recorder, &frame, visibility)?;
        } else {
            let own = reader.own.get(recorder.device, bound);
            reader.pass.record(recorder, "shade.penumbra", &own, scene, &receivers, visibility);
        }
        Ok(report)
    }
}
