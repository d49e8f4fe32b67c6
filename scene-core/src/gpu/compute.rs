//! Compute passes: a pipeline an entry point, recorded as one pass a dispatch.

use super::pipeline::{count_pipeline, shader_module};
use super::{GpuError, Recorder, binding_limit};

/// One entry point of a compute shader.
#[derive(Debug)]
pub struct ComputePass {
    label: &'static str,
    pipeline: wgpu::ComputePipeline,
}

impl ComputePass {
    /// Makes the pipeline. `groups` holds the layout of bind group i at place i, none where the shader has none.
    pub fn new(
        device: &wgpu::Device,
        label: &'static str,
        wgsl: &str,
        entry: &str,
        groups: &[Option<&wgpu::BindGroupLayout>],
    ) -> Self {
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: groups,
            immediate_size: 0,
        });
        count_pipeline();
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: Some(&layout),
            module: &shader_module(device, label, wgsl),
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        });
        Self { label, pipeline }
    }

    /// Records a pass of `workgroups`, timed as `stage`. Nothing is recorded if one of the three numbers is 0.
    pub fn record(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        groups: &[Option<&wgpu::BindGroup>],
        workgroups: [u32; 3],
    ) {
        if workgroups.contains(&0) {
            return;
        }
        let [x, y, z] = workgroups;
        self.record_as(recorder, stage, groups, |pass| pass.dispatch_workgroups(x, y, z));
    }

    /// As [`record`](Self::record), of as many workgroups as the first three words of a buffer say when it runs.
    pub fn record_indirect(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        groups: &[Option<&wgpu::BindGroup>],
        workgroups: &wgpu::Buffer,
    ) {
        self.record_as(recorder, stage, groups, |pass| pass.dispatch_workgroups_indirect(workgroups, 0));
    }

    fn record_as(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        groups: &[Option<&wgpu::BindGroup>],
        dispatch: impl FnOnce(&mut wgpu::ComputePass<'_>),
    ) {
        let span = recorder.stage(stage);
        let mut pass = recorder.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(self.label),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipeline);
        for (index, group) in (0..).zip(groups) {
            if let Some(group) = group {
                pass.set_bind_group(index, *group, &[]);
            }
        }
        dispatch(&mut pass);
    }
}

/// A storage buffer that shaders write and read, kept from frame to frame and made anew only to grow. What it holds at
/// the start of a frame is what the last one left.
#[derive(Debug)]
pub struct WorkBuffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    held: Option<wgpu::Buffer>,
}

impl WorkBuffer {
    /// No buffer yet; `label` is what it holds, for errors and messages of the driver.
    pub fn new(label: &'static str) -> Self {
        Self::with_usage(label, wgpu::BufferUsages::empty())
    }

    /// As [`new`](Self::new), for what later passes read in another way: as uniforms, for one.
    pub fn with_usage(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        let own = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        Self { label, usage: usage | own, held: None }
    }

    /// The buffer, with room for `bytes` (16 at least): usages `STORAGE`, `COPY_SRC`, `COPY_DST` and what was asked for.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if the device binds less in one piece.
    pub fn get(&mut self, device: &wgpu::Device, bytes: u64) -> Result<wgpu::Buffer, GpuError> {
        let limit = binding_limit(device);
        let bytes = bytes.max(16).next_multiple_of(4);
        if bytes > limit {
            return Err(GpuError::TooLarge { what: self.label, bytes, limit });
        }
        if let Some(buffer) = self.held.as_ref().filter(|buffer| buffer.size() >= bytes) {
            return Ok(buffer.clone());
        }
        // What was there is given back first: both together may not fit.
        self.held = None;
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(self.label),
            size: bytes,
            usage: self.usage,
            mapped_at_creation: false,
        });
        self.held = Some(buffer.clone());
        Ok(buffer)
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        self.held.as_ref().map_or(0, wgpu::Buffer::size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{HeldGroup, binding, testing};

    #[test]
    fn passes_follow_one_another_and_buffers_grow_only() {
        let Some(gpu) = testing::gpu() else { return };
        let wgsl = "@group(0) @binding(0) var<storage, read_write> words: array<u32>;
            @compute @workgroup_size(4)
            fn double(@builtin(global_invocation_id) id: vec3u) { words[id.x] = 2u * words[id.x] + id.x; }";
        let mut group =
            HeldGroup::new(&gpu.device, "test", wgpu::ShaderStages::COMPUTE, &[binding::STORAGE_WRITE]);
        let pass = ComputePass::new(&gpu.device, "double", wgsl, "double", &[Some(group.layout())]);
        let mut work = WorkBuffer::new("words");
        let buffer = work.get(&gpu.device, 32).unwrap();
        let mut encoder = gpu.encoder();
        let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
        let bound = group.get(&gpu.device, &[buffer.clone().into()]);
        for workgroups in [[2, 1, 1], [0, 1, 1], [2, 1, 1]] {
            pass.record(&mut recorder, "shade.test", &[Some(&bound)], workgroups);
        }
        gpu.submit(encoder).unwrap();
        assert_eq!(gpu.read_buffer::<u32>(&buffer).unwrap(), [0, 3, 6, 9, 12, 15, 18, 21]);
        assert_eq!(work.get(&gpu.device, 8).unwrap(), buffer);
        let larger = work.get(&gpu.device, 64).unwrap();
        assert!(larger != buffer && work.bytes() == 64);
        let too_large = work.get(&gpu.device, u64::MAX - 8).unwrap_err();
        assert!(matches!(too_large, GpuError::TooLarge { what: "words", .. }), "{too_large}");
    }
}
