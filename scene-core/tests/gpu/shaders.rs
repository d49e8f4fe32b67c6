//! Every linked shader of this crate is valid.

use gnomon_scene_core::gpu::shaders;
use wgpu::naga;

#[test]
fn every_shader_is_valid() {
    assert!(!shaders::ALL.is_empty());
    let mut broken = Vec::new();
    for (name, source) in shaders::ALL {
        let module = match naga::front::wgsl::parse_str(source) {
            Ok(module) => module,
            Err(error) => {
                broken.push(format!("{name}: {}", error.emit_to_string(source)));
                continue;
            }
        };
        // No capability beyond WebGPU's core, which is all that devices are asked for.
        let flags = naga::valid::ValidationFlags::all();
        let mut validator = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty());
        if let Err(error) = validator.validate(&module) {
            broken.push(format!("{name}: {}", error.emit_to_string(source)));
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}
