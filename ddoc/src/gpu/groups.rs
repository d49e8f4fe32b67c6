//! Receivers that go through long lists together, in compute passes.
//!
//! Mesa's software drivers end all loops of eight threads together after 65,535 rounds in sum, and say nothing: where threads go through
//! lists of their own, a round that any of the eight takes counts for all. `shade.penumbra` goes through lists in common here, counts rounds
//! as a workgroup, and leaves pixels to `shade.rest` while all is well. How many passes of that it takes at worst is known from the
//! longest list.

use scene_core::gpu::{
    Bound, ComputePass, GpuError, HeldGroup, Receivers, Recorder, SceneBindings, SceneGroups, VisibilityPass,
    VisibilityPassParts, WorkBuffer, binding,
};

use super::{MOST_TURNS, shaders};

/// Entries that `shade.rest` looks at, or counts, in a round; points of the light that are counted at once; rounds beside those,
/// for each time that the lists are gone through.
pub(super) const THREADS: u32 = 64;
const POINTS_AT_ONCE: u32 = 64;
const TURNS_BESIDE: u32 = 300;

/// Pixels of a workgroup, and a side of them.
const PIXELS: u32 = 64;
pub(super) const TILE: u32 = 8;

/// How many receivers a workgroup of `shade.rest` answers, if `longest` are the most edges and faces over one tile of each view.
///
/// # Errors
/// None can be answered.
pub(super) fn answered_at_once(longest: &[[u32; 2]], points: usize) -> Result<u32, GpuError> {
    let rounds = (points as u32).div_ceil(POINTS_AT_ONCE);
    let turns = longest.iter().map(|[edges, faces]| {
        let edges = 2 * (edges / THREADS) + TURNS_BESIDE;
        edges.saturating_mul(rounds).saturating_add(faces / THREADS)
    });
    let turns = turns.max().unwrap_or(0);
    GpuError::within("turns for edges and faces over one tile", turns, MOST_TURNS)?;
    Ok(MOST_TURNS / turns.max(1))
}

/// The passes on one device.
#[derive(Debug)]
pub(super) struct Groups {
    own: HeldGroup,
    written: HeldGroup,
    values: WorkBuffer,
    penumbra: ComputePass,
    rest: ComputePass,
    write: VisibilityPass,
}

/// What all passes are recorded with.
pub(super) struct Frame<'a> {
    /// All that group 0 binds but V.
    pub(super) bound: &'a [Bound],
    /// The scene's groups.
    pub(super) scene: &'a SceneGroups,
    /// The receivers'.
    pub(super) receivers: &'a wgpu::BindGroup,
    /// Pixels of the image.
    pub(super) size: [u32; 2],
    /// Receivers that a workgroup of `shade.rest` answers.
    pub(super) at_once: u32,
}

impl Groups {
    /// Makes the pipelines of two shaders, `shade.penumbra`'s and `shade.rest`'s, which bind `types` and V. `visibility` is the
    /// format of the texture that V is written to.
    pub(super) fn new(
        device: &wgpu::Device,
        [penumbra, rest]: [&str; 2],
        types: &[wgpu::BindingType],
        scene: &SceneBindings,
        receivers: &Receivers,
        visibility: wgpu::TextureFormat,
    ) -> Self {
        let types = [types, &[binding::STORAGE_WRITE]].concat();
        let own = HeldGroup::new(device, "ddoc groups", wgpu::ShaderStages::COMPUTE, &types);
        let written = HeldGroup::new(device, "ddoc write", wgpu::ShaderStages::FRAGMENT, &[binding::STORAGE]);
        let groups = [Some(own.layout()), Some(&scene.triangles_layout), None, Some(receivers.layout())];
        let penumbra = ComputePass::new(device, "ddoc groups", penumbra, "shade_groups", &groups);
        let rest = ComputePass::new(device, "ddoc rest", rest, "shade_rest", &groups);
        let write = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "ddoc write",
                wgsl: shaders::WRITE,
                fragment: "write",
                own: written.layout(),
                scene,
                receivers,
                format: visibility,
            },
        );
        Self { own, written, values: WorkBuffer::new("V of pixels"), penumbra, rest, write }
    }

    /// As `Reader::give_back`.
    pub(super) fn give_back(&mut self) {
        self.own = self.own.another();
    }

    /// Records the passes that write V of every pixel. Gives the bytes that they work in.
    ///
    /// # Errors
    /// More pixels than the device binds values of.
    pub(super) fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        frame: &Frame<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<u64, GpuError> {
        let Frame { bound, scene, receivers, size, at_once } = *frame;
        let device = recorder.device;
        let values = self.values.get(device, 4 * u64::from(size[0]) * u64::from(size[1]))?;
        let mut bound = bound.to_vec();
        bound.push(values.clone().into());
        let own = self.own.get(device, &bound);
        let groups = [Some(&own), Some(&scene.triangles), None, Some(receivers)];
        let [columns, rows] = size.map(|pixels| pixels.div_ceil(TILE));
        self.penumbra.record(recorder, "shade.penumbra", &groups, [columns, rows, 1]);
        for _ in 0..PIXELS.div_ceil(at_once) {
            self.rest.record(recorder, "shade.rest", &groups, [columns, rows, 1]);
        }
        let written = self.written.get(device, &[values.into()]);
        self.write.record(recorder, "shade.write", &written, scene, receivers, visibility);
        Ok(self.values.bytes())
    }
}
