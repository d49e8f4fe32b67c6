//! `shade.pyramid`: extremes of S and D by tiles, on the GPU.

use scene_core::gpu::{ComputePass, GpuError, HeldBuffer, HeldGroup, Recorder, WorkBuffer, binding};

use super::layout::levels;
use super::shaders;

/// Tiles a side of a workgroup.
const GROUP: u32 = 8;

/// Bytes of a tile: four floats.
const TILE_BYTES: u64 = 16;

/// Writes the pyramid above a distance map.
#[derive(Debug)]
pub(super) struct PyramidOnGpu {
    tiles: WorkBuffer,
    group: HeldGroup,
    first: ComputePass,
    next: ComputePass,
    held: Vec<(HeldBuffer, HeldGroup)>,
}

impl PyramidOnGpu {
    /// Makes the pipelines.
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let stages = wgpu::ShaderStages::COMPUTE;
        let types = [binding::UNIFORM, binding::FLOATS, binding::STORAGE_WRITE];
        let group = HeldGroup::new(device, "shadow pyramid", stages, &types);
        let pass =
            |label, entry| ComputePass::new(device, label, shaders::PYRAMID, entry, &[Some(group.layout())]);
        let (first, next) = (pass("first level", "first_level"), pass("next level", "next_level"));
        Self { tiles: WorkBuffer::new("shadow pyramid"), group, first, next, held: Vec::new() }
    }

    /// The buffer of an image's pyramid, which [`record`](Self::record) writes.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if the device binds less in one piece.
    pub(super) fn buffer(&mut self, device: &wgpu::Device, size: [u32; 2]) -> Result<wgpu::Buffer, GpuError> {
        let tiles: u64 =
            levels(size).iter().map(|level| level.tiles.map(u64::from).iter().product::<u64>()).sum();
        self.tiles.get(device, tiles * TILE_BYTES)
    }

    /// Records the passes above `distance_map`.
    ///
    /// # Errors
    /// As [`buffer`](Self::buffer).
    pub(super) fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        distance_map: &wgpu::TextureView,
        size: [u32; 2],
    ) -> Result<(), GpuError> {
        let tiles = self.buffer(recorder.device, size)?;
        for (index, level) in levels(size).iter().enumerate() {
            if index == self.held.len() {
                self.held.push((HeldBuffer::uniform("level"), self.group.another()));
            }
            let (uniform, group) = &mut self.held[index];
            let uniform = uniform.get(recorder.device, bytemuck::bytes_of(level));
            let bound = [uniform.into(), distance_map.into(), tiles.clone().into()];
            let group = group.get(recorder.device, &bound);
            let pass = if index == 0 { &self.first } else { &self.next };
            let [columns, rows] = level.tiles.map(|side| side.div_ceil(GROUP));
            pass.record(recorder, "shade.pyramid", &[Some(&group)], [columns, rows, 1]);
        }
        Ok(())
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        self.tiles.bytes()
    }
}
