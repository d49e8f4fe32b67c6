//! Rules of the project about shaders, checked on naga's representation.
//!
//! | rule | why |
//! | --- | --- |
//! | no implicit derivatives | shadow lookups jump at every edge: derivatives there choose wrong levels |
//! | at most 256 invocations a workgroup and 16,384 bytes that they share, 8 storage buffers a stage, bind groups 0 to 3 | WebGPU's defaults |

use naga::proc::Layouter;
use naga::{AddressSpace, Expression, Function, Module, SampleLevel, Span};

/// Rules that `module` breaks, each with where.
pub(super) fn broken(module: &Module) -> Vec<(Option<Span>, String)> {
    let mut broken = Vec::new();
    let functions = module.functions.iter().map(|(_, function)| function);
    for function in functions.chain(module.entry_points.iter().map(|entry| &entry.function)) {
        implicit_derivatives(function, &mut broken);
    }
    for entry in &module.entry_points {
        let invocations: u32 = entry.workgroup_size.iter().product();
        if invocations > 256 {
            let why = format!("'{}': {invocations} invocations a workgroup, at most 256", entry.name);
            broken.push((None, why));
        }
    }
    let mut storage = 0;
    for (handle, variable) in module.global_variables.iter() {
        storage += u32::from(matches!(variable.space, AddressSpace::Storage { .. }));
        if variable.binding.is_some_and(|binding| binding.group > 3) {
            broken
                .push((Some(module.global_variables.get_span(handle)), "bind groups are 0 to 3".to_owned()));
        }
    }
    let shared = shared_bytes(module);
    if shared > 16_384 {
        broken.push((None, format!("{shared} bytes shared by a workgroup, at most 16384")));
    }
    if storage > 8 {
        broken.push((None, format!("{storage} storage buffers, at most 8")));
    }
    broken
}

/// Bytes that a workgroup shares, as WebGPU counts them: each variable in pieces of 16.
fn shared_bytes(module: &Module) -> u32 {
    let mut layouts = Layouter::default();
    if layouts.update(module.to_ctx()).is_err() {
        return 0;
    }
    let variables = module.global_variables.iter().map(|(_, variable)| variable);
    let shared = variables.filter(|variable| variable.space == AddressSpace::WorkGroup);
    shared.map(|variable| layouts[variable.ty].size.next_multiple_of(16)).sum()
}

fn implicit_derivatives(function: &Function, broken: &mut Vec<(Option<Span>, String)>) {
    for (handle, expression) in function.expressions.iter() {
        let why = match expression {
            Expression::ImageSample {
                gather: None, level: SampleLevel::Auto | SampleLevel::Bias(_), ..
            } => {
                "sampling by implicit derivatives: use textureSampleLevel, textureSampleGrad or textureSampleCompareLevel"
            }
            Expression::Derivative { .. } => "derivatives across pixels: compute them from the surface",
            _ => continue,
        };
        broken.push((Some(function.expressions.get_span(handle)), why.to_owned()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rules(source: &str) -> Vec<String> {
        let module = naga::front::wgsl::parse_str(source).unwrap();
        broken(&module).into_iter().map(|(_, rule)| rule).collect()
    }

    const BINDINGS: &str = "@group(0) @binding(0) var map: texture_depth_2d;
@group(0) @binding(1) var nearest: sampler_comparison;
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var plain: sampler;
@fragment fn main(@location(0) uv: vec2f) -> @location(0) vec4f { return vec4f(";

    #[test]
    fn explicit_levels_are_accepted() {
        for call in [
            "textureSampleCompareLevel(map, nearest, uv, 0.5)",
            "textureSampleLevel(color, plain, uv, 0.0)",
            "textureSampleGrad(color, plain, uv, vec2f(0.0), vec2f(0.0))",
            "textureGather(0, color, plain, uv)",
            "textureLoad(map, vec2i(uv), 0)",
        ] {
            assert_eq!(rules(&format!("{BINDINGS}{call}); }}")), Vec::<String>::new(), "{call}");
        }
    }

    #[test]
    fn implicit_derivatives_are_rejected() {
        for call in [
            "textureSampleCompare(map, nearest, uv, 0.5)",
            "textureSample(color, plain, uv)",
            "textureSampleBias(color, plain, uv, 1.0)",
            "dpdx(uv.x)",
            "fwidth(uv.x)",
        ] {
            assert_eq!(rules(&format!("{BINDINGS}{call}); }}")).len(), 1, "{call}");
        }
    }

    #[test]
    fn limits_of_webgpu_are_kept() {
        assert!(rules("@compute @workgroup_size(16, 16) fn main() {}").is_empty());
        assert_eq!(rules("@compute @workgroup_size(16, 17) fn main() {}").len(), 1);
        let buffers = |count, group| -> String {
            (0..count)
                .map(|i| format!("@group({group}) @binding({i}) var<storage, read> b{i}: array<u32>;\n"))
                .collect()
        };
        assert!(rules(&buffers(8, 3)).is_empty());
        assert_eq!(rules(&buffers(9, 0)).len(), 1);
        assert_eq!(rules(&buffers(1, 4)).len(), 1);
        let shared =
            |floats: u32| format!("var<workgroup> one: u32;\nvar<workgroup> all: array<f32, {floats}>;\n");
        assert!(rules(&shared(4092)).is_empty());
        assert_eq!(rules(&shared(4093)).len(), 1);
    }
}
