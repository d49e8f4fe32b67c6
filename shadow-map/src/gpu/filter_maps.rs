//! What filters read beside the maps, on the GPU: depths as numbers in a buffer, and the nearest of every rectangle. Twin of
//! [`filter_maps`](crate::filter_maps) and [`depth_pyramid`](crate::depth_pyramid).

use scene_core::gpu::{ComputePass, GpuError, HeldBuffer, HeldGroup, Recorder, WorkBuffer, binding};

use super::layout::LevelUniform;
use super::light_maps::DrawnMaps;
use super::shaders;

/// Texels a side of a workgroup.
const GROUP: u32 = 8;

/// Where the levels of a map lie in a view's depths, the map itself first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LevelTable {
    /// Texels a side and place of the first, one a level.
    pub levels: Vec<(u32, u32)>,
    /// Numbers of all levels.
    pub layer: u32,
}

impl LevelTable {
    /// Levels above a map of `size` texels a side: sides are halved and rounded up until one texel is left.
    pub fn new(size: u32) -> Self {
        let mut table = Self::default();
        let mut side = size.max(1);
        loop {
            table.levels.push((side, table.layer));
            table.layer += side * side;
            if side == 1 {
                return table;
            }
            side = side.div_ceil(2);
        }
    }
}

/// Makes the depths of maps that were drawn.
#[derive(Debug)]
pub struct FilterMapsOnGpu {
    table: LevelTable,
    depths: WorkBuffer,
    /// What was recorded last.
    recorded: Option<wgpu::Buffer>,
    store: ComputePass,
    next: ComputePass,
    levels: Vec<(HeldBuffer, HeldGroup)>,
}

impl FilterMapsOnGpu {
    /// Makes the pipelines, for maps of `size` texels a side. `scene` is the layout of group 1.
    pub fn new(device: &wgpu::Device, size: u32, scene: &wgpu::BindGroupLayout) -> Self {
        let table = LevelTable::new(size);
        let stages = wgpu::ShaderStages::COMPUTE;
        let types = [
            binding::UNIFORM,
            binding::STORAGE,
            binding::ID_LAYERS,
            binding::STORAGE_WRITE,
            binding::UNIFORM,
        ];
        let group = HeldGroup::new(device, "depths", stages, &types);
        let groups = [Some(group.layout()), Some(scene)];
        let pass = |label, entry| ComputePass::new(device, label, shaders::PREPARE_DEPTHS, entry, &groups);
        let levels = table.levels.iter().map(|_| (HeldBuffer::uniform("level"), group.another())).collect();
        let (store, next) = (pass("store depths", "store_depths"), pass("next level", "next_level"));
        Self { table, depths: WorkBuffer::new("depths of maps"), recorded: None, store, next, levels }
    }

    /// `prepare.filter`: records the passes; gives the buffer of depths.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if the device binds less than the depths of all maps in one piece.
    pub fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        drawn: &DrawnMaps,
        scene: &wgpu::BindGroup,
    ) -> Result<wgpu::Buffer, GpuError> {
        let device = recorder.device;
        let bytes = u64::from(self.table.layer) * 4 * u64::from(drawn.count.max(1));
        let depths = self.depths.get(device, bytes)?;
        self.recorded = Some(depths.clone());
        let mut below = (0, 0);
        for (level, (uniform, group)) in self.levels.iter_mut().enumerate() {
            let (side, start) = self.table.levels[level];
            let content = LevelUniform { side, side_below: below.0, start, start_below: below.1 };
            let uniform = uniform.get(device, bytemuck::bytes_of(&content));
            let bound = [
                drawn.maps.clone().into(),
                drawn.views.clone().into(),
                drawn.ids.clone(),
                depths.clone().into(),
                uniform.into(),
            ];
            let group = group.get(device, &bound);
            let groups = side.div_ceil(GROUP);
            let pass = if level == 0 { &self.store } else { &self.next };
            let bound = [Some(&group), Some(scene)];
            pass.record(recorder, "prepare.filter", &bound, [groups, groups, drawn.count]);
            below = (side, start);
        }
        Ok(depths)
    }

    /// The depths recorded last, with as many numbers a view: the map row by row, reversed depth and 0 where there is
    /// nothing, then its levels.
    pub fn depths(&self) -> Option<(&wgpu::Buffer, u32)> {
        self.recorded.as_ref().map(|depths| (depths, self.table.layer))
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        self.depths.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_halve_and_follow_one_another() {
        assert_eq!(LevelTable::new(5).levels, [(5, 0), (3, 25), (2, 34), (1, 38)]);
        assert_eq!(LevelTable::new(5).layer, 39);
        assert_eq!(LevelTable::new(1).levels, [(1, 0)]);
        assert_eq!(LevelTable::new(16_384).levels.len(), 15);
    }
}
