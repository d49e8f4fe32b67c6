//! For tests of GPU code: a device or an explicit skip, and a kernel runner for unit tests of shader functions.

use bytemuck::Pod;
use wgpu::util::DeviceExt as _;

use super::pipeline::shader_module;
use super::{Gpu, GpuError};

/// The device of a test. `None`, and a word on standard error, only where `GNOMON_GPU=off` asks for that.
///
/// # Panics
/// If there is no device: a test that would silently check nothing fails instead.
pub fn gpu() -> Option<Gpu> {
    match Gpu::open() {
        Ok(gpu) => Some(gpu),
        Err(GpuError::TurnedOff) => {
            eprintln!("skipped: GNOMON_GPU=off");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// Runs the compute entry point `main` of `wgsl`, one workgroup of `@workgroup_size(64)` for every 64 `inputs`,
/// and returns as many outputs.
///
/// The kernel reads `@group(0) @binding(0) var<storage, read> inputs: array<…>` and writes
/// `@group(0) @binding(1) var<storage, read_write> outputs: array<…>`. It must bind both.
///
/// # Errors
/// What the device objects to: a broken kernel, for one.
pub fn run_kernel<I: Pod, O: Pod>(gpu: &Gpu, wgsl: &str, inputs: &[I]) -> Result<Vec<O>, GpuError> {
    if inputs.is_empty() {
        return Ok(Vec::new());
    }
    let (encoder, outputs) = gpu.scoped("a test kernel", || {
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("test kernel"),
            layout: None,
            module: &shader_module(&gpu.device, "test kernel", wgsl),
            entry_point: Some("main"),
            compilation_options: Default::default(),
            cache: None,
        });
        let input = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("inputs"),
            contents: bytemuck::cast_slice(inputs),
            usage: wgpu::BufferUsages::STORAGE,
        });
        let outputs = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("outputs"),
            size: (inputs.len() * size_of::<O>()) as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("test kernel"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: input.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: outputs.as_entire_binding() },
            ],
        });
        let mut encoder = gpu.encoder();
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(inputs.len().div_ceil(64) as u32, 1, 1);
        drop(pass);
        (encoder, outputs)
    })?;
    gpu.submit(encoder)?;
    gpu.read_buffer(&outputs)
}
