//! Far sides of solid casters on the GPU: twin of [`backs`](crate::backs).

use std::ops::Range;

use gnomon_shadow_map::gpu::filter_maps::FilterMapsOnGpu;
use gnomon_shadow_map::gpu::light_maps::{DrawnMaps, MapsPlan};
use scene_core::gpu::{DepthIds, DepthLayers, DepthPass, DepthTarget, GpuError, GpuScene, Recorder};

use crate::solids::is_solid;

/// Draws them, in two passes: front faces of solids are left out, and nothing of other casters.
#[derive(Debug)]
pub(super) struct BacksOnGpu {
    map_size: u32,
    solid: DepthPass,
    thin: DepthPass,
    layers: DepthLayers,
    depths: FilterMapsOnGpu,
}

impl BacksOnGpu {
    /// Makes the pipelines, for maps of `size` texels a side. `scene` is the layout of group 1.
    pub(super) fn new(device: &wgpu::Device, size: u32, scene: &wgpu::BindGroupLayout) -> Self {
        Self {
            map_size: size,
            solid: DepthPass::new(device, DepthIds::Triangle, Some(wgpu::Face::Front)),
            thin: DepthPass::new(device, DepthIds::Triangle, None),
            layers: DepthLayers::new(DepthIds::Triangle),
            depths: FilterMapsOnGpu::new(device, size, scene),
        }
    }

    /// `prepare.backs`: records the passes; gives a buffer laid out as that of the map's own depths. `None` where no caster is known
    /// to be solid.
    ///
    /// # Errors
    /// More maps or texels than the device has.
    pub(super) fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        scene: &GpuScene<'_>,
        plan: &MapsPlan,
        drawn: &DrawnMaps,
        group: &wgpu::BindGroup,
    ) -> Result<Option<wgpu::Buffer>, GpuError> {
        let Some(geometry) = scene.geometry else { return Ok(None) };
        let is_solid = |casters: &Range<u32>| {
            let objects = geometry.objects().iter();
            let mut same = objects.filter(|object| {
                object.triangles.start == casters.start as usize
                    && object.triangles.end == casters.end as usize
            });
            same.any(|object| is_solid(geometry, object))
        };
        let (solid, thin): (Vec<_>, Vec<_>) = plan.casters.iter().cloned().partition(is_solid);
        if solid.is_empty() {
            return Ok(None);
        }
        self.layers.resize(recorder.device, self.map_size, drawn.count)?;
        let mut draw = |pass: &mut DepthPass, casters: &[Range<u32>], clear: bool| {
            let projections = plan.views.iter().map(|view| view.projection_from_world);
            let targets = self.layers.targets(projections, Some(casters));
            let targets: Vec<_> = targets.into_iter().map(|target| DepthTarget { clear, ..target }).collect();
            pass.record(recorder, "prepare.backs", scene, &targets);
        };
        draw(&mut self.solid, &solid, true);
        if !thin.is_empty() {
            draw(&mut self.thin, &thin, false);
        }
        let Some(ids) = self.layers.bound_ids() else { return Ok(None) };
        let backs = DrawnMaps { ids, ..drawn.clone() };
        self.depths.record(recorder, &backs, group).map(Some)
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        self.layers.bytes() + self.depths.bytes()
    }
}
