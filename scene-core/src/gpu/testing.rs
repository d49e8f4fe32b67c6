//! For tests of GPU code: a device or an explicit skip, a kernel runner for unit tests of shader functions, and
//! the layout of a shader's structs, to hold Rust's against ([`assert_layout!`](crate::assert_layout)).

use bytemuck::Pod;
use wgpu::naga;

use super::pipeline::{made, shader_module};
use super::storage::filled_buffer;
use super::{Gpu, GpuError, GpuShadowTechnique, HeadlessError, HeadlessRun};
use crate::{Camera, GBuffer, Light, Scene};

/// Pipelines and layouts of bind groups that this thread has made so far by the parts of [`gpu`](super): what a frame adds is
/// what it did not reuse.
pub fn pipelines_and_layouts_made() -> [u64; 2] {
    made()
}

/// The device of a test. `None`, and a word on standard error, only where `GNOMON_GPU=off` asks for that.
///
/// # Panics
/// If there is no device: a test that would silently check nothing fails instead.
pub fn gpu() -> Option<Gpu> {
    gpu_within(|_| ())
}

/// The same with limits lower than the adapter's, as a smaller one would have: `lower` takes from them.
///
/// # Panics
/// As [`gpu`].
pub fn gpu_within(lower: impl FnOnce(&mut wgpu::Limits)) -> Option<Gpu> {
    match Gpu::open_asked_for(lower) {
        Ok(gpu) => Some(gpu),
        Err(GpuError::TurnedOff) => {
            eprintln!("skipped: GNOMON_GPU=off");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// As [`gpu`], a device that binds no more than so many `bytes` of a storage buffer in one piece, and has WebGPU's limits by default
/// besides: what scenes too large for most tests meet, small ones meet there.
///
/// # Panics
/// As [`gpu`].
pub fn gpu_that_binds(bytes: u64) -> Option<Gpu> {
    gpu_within(|limits| {
        *limits = wgpu::Limits { max_storage_buffer_binding_size: bytes, ..wgpu::Limits::default() };
    })
}

/// As [`gpu`], a device that binds no more than so many `bytes` of a storage buffer in one piece, and whose textures are of so many
/// texels a side and so many layers: [`Pages`](super::Pages) hold no more than that.
///
/// # Panics
/// As [`gpu`].
pub fn gpu_with_pages(bytes: u64, side: u32, layers: u32) -> Option<Gpu> {
    gpu_within(|limits| {
        limits.max_storage_buffer_binding_size = bytes;
        limits.max_texture_dimension_2d = side;
        limits.max_texture_array_layers = layers;
    })
}

/// A technique's first frame over a G-buffer that the CPU drew, so that both backends are asked about the same surfaces.
///
/// # Errors
/// What the device or the technique objects to.
pub fn run_over(
    gpu: &Gpu,
    gbuffer: &GBuffer,
    (scene, camera, light): (&Scene, &Camera, &Light),
    technique: &mut dyn GpuShadowTechnique,
) -> Result<HeadlessRun, HeadlessError> {
    let mut view = gpu.view(scene, camera)?;
    view.upload_gbuffer(gbuffer)?;
    view.run(technique, light, gbuffer)
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
        let input =
            filled_buffer(&gpu.device, "inputs", bytemuck::cast_slice(inputs), wgpu::BufferUsages::STORAGE);
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

fn parsed(wgsl: &str) -> naga::Module {
    naga::front::wgsl::parse_str(wgsl).unwrap_or_else(|error| panic!("{error}"))
}

/// Name and offset of each member of a struct in linked WGSL, and its size in bytes. Linking puts a module's path before
/// names, so `name` is the end of one.
///
/// # Panics
/// If `wgsl` does not parse or has no such struct.
pub fn struct_layout(wgsl: &str, name: &str) -> (Vec<(String, usize)>, usize) {
    let module = parsed(wgsl);
    let is_it = |ty: &naga::Type| ty.name.as_deref().is_some_and(|linked| linked.ends_with(name));
    let found = module.types.iter().find(|(_, ty)| is_it(ty)).map(|(_, ty)| &ty.inner);
    let Some(naga::TypeInner::Struct { members, span }) = found else { panic!("there is no struct {name}") };
    let listed = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize));
    (listed.collect(), *span as usize)
}

/// Asserts that constants of linked WGSL have these values, those of f32 rounded to it. A constant of an imported module is named by
/// module and name, `fitted_ROUNDS`.
///
/// # Panics
/// If one has another value; if `wgsl` does not parse, or has no such number.
pub fn assert_constants(wgsl: &str, expected: &[(&str, f64)]) {
    let module = parsed(wgsl);
    // Linking puts modules before a name, and the count of its underscores before each that has some.
    let unmarked = |part: &str| part.trim_start_matches(|c: char| c.is_ascii_digit()).to_owned();
    let linked = |name: &str| name.split("__").map(unmarked).collect::<Vec<_>>().join("_");
    let constants = module.constants.iter().map(|(_, constant)| constant);
    let named: Vec<_> = constants.map(|c| (linked(c.name.as_deref().unwrap_or_default()), c)).collect();
    for &(name, value) in expected {
        let imported = format!("_{name}");
        let own = named.iter().find(|(linked, _)| linked == name);
        let found = own.or_else(|| named.iter().find(|(linked, _)| linked.ends_with(&imported)));
        let Some((_, constant)) = found else { panic!("there is no constant {name}") };
        let (found, value) = match module.global_expressions[constant.init] {
            naga::Expression::Literal(naga::Literal::F32(found)) => {
                (f64::from(found), f64::from(value as f32))
            }
            naga::Expression::Literal(naga::Literal::U32(found)) => (f64::from(found), value),
            naga::Expression::Literal(naga::Literal::I32(found)) => (f64::from(found), value),
            ref other => panic!("{name} is no number: {other:?}"),
        };
        assert_eq!(found, value, "{name}");
    }
}

/// Asserts that a Rust struct has size and offsets of the struct of this name in linked WGSL: `assert_layout!(CameraUniform,
/// shaders::CAMERA, "Camera", [eye, far])`, all members of the shader's in their order. Padding is not named.
#[macro_export]
macro_rules! assert_layout {
    ($rust:ty, $wgsl:expr, $name:literal, [$($field:ident),* $(,)?]) => {
        let (members, size) = $crate::gpu::testing::struct_layout($wgsl, $name);
        let expected = [$((stringify!($field).to_owned(), ::core::mem::offset_of!($rust, $field))),*];
        assert_eq!(members, expected, "{}", $name);
        assert_eq!(size, ::core::mem::size_of::<$rust>(), "{}", $name);
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    const WGSL: &str = "const STEPS: u32 = 4u; const package__1the_module__1MOST_STEPS: u32 = 8u; \
        const package_other_STEPS: u32 = 9u; const LEAST: f32 = 0.1; const LOW: i32 = -2;";

    #[test]
    fn constants_are_found_by_their_module_and_name() {
        let expected = [
            ("STEPS", 4.0),
            ("the_module_MOST_STEPS", 8.0),
            ("other_STEPS", 9.0),
            ("LEAST", 0.1),
            ("LOW", -2.0),
        ];
        assert_constants(WGSL, &expected);
    }

    #[test]
    #[should_panic(expected = "STEPS")]
    fn a_constant_of_another_value_is_told() {
        assert_constants(WGSL, &[("STEPS", 8.0)]);
    }

    #[test]
    #[should_panic(expected = "there is no constant MOST")]
    fn a_constant_that_is_not_there_is_told() {
        assert_constants(WGSL, &[("MOST", 8.0)]);
    }
}
