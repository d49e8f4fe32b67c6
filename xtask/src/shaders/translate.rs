//! Translation of each entry point to the languages of the drivers.

use naga::back::{glsl, hlsl, msl, spv};
use naga::valid::ModuleInfo;
use naga::{Module, ShaderStage};

/// What a valid module's entry points cannot be translated to.
pub(super) fn faults(module: &Module, info: &ModuleInfo) -> Vec<String> {
    let mut faults = Vec::new();
    for entry in &module.entry_points {
        let stage = entry.stage;
        let results = [
            ("SPIR-V", spirv(module, info, stage, &entry.name)),
            ("MSL", metal(module, info, stage, &entry.name)),
            ("HLSL", direct3d(module, info, stage, &entry.name)),
            ("GLSL", opengl(module, info, stage, &entry.name)),
        ];
        for (language, result) in results {
            if let Err(error) = result {
                faults
                    .push(format!("entry point '{}' does not translate to {language}: {error}", entry.name));
            }
        }
    }
    faults
}

fn spirv(module: &Module, info: &ModuleInfo, stage: ShaderStage, name: &str) -> Result<(), String> {
    let pipeline = spv::PipelineOptions { shader_stage: stage, entry_point: name.to_owned() };
    spv::write_vec(module, info, &spv::Options::default(), Some(&pipeline))
        .map(drop)
        .map_err(|error| error.to_string())
}

fn metal(module: &Module, info: &ModuleInfo, stage: ShaderStage, name: &str) -> Result<(), String> {
    // The oldest version that wgpu uses; resources are bound by the pipeline, which is not there yet.
    let options = msl::Options { lang_version: (2, 0), fake_missing_bindings: true, ..Default::default() };
    let pipeline = msl::PipelineOptions { entry_point: Some((stage, name.to_owned())), ..Default::default() };
    let (_, translation) =
        msl::write_string(module, info, &options, &pipeline).map_err(|error| error.to_string())?;
    translation.entry_point_names.into_iter().try_for_each(|name| name.map(drop)).map_err(|e| e.to_string())
}

fn direct3d(module: &Module, info: &ModuleInfo, stage: ShaderStage, name: &str) -> Result<(), String> {
    let pipeline = hlsl::PipelineOptions { entry_point: Some((stage, name.to_owned())) };
    let options = hlsl::Options::default();
    let mut text = String::new();
    let reflection = hlsl::Writer::new(&mut text, &options, &pipeline)
        .write(module, info, None)
        .map_err(|error| error.to_string())?;
    reflection.entry_point_names.into_iter().try_for_each(|name| name.map(drop)).map_err(|e| e.to_string())
}

fn opengl(module: &Module, info: &ModuleInfo, stage: ShaderStage, name: &str) -> Result<(), String> {
    let options = glsl::Options::default();
    let pipeline =
        glsl::PipelineOptions { shader_stage: stage, entry_point: name.to_owned(), multiview: None };
    let mut text = String::new();
    glsl::Writer::new(&mut text, module, info, &options, &pipeline, Default::default())
        .and_then(|mut writer| writer.write())
        .map(drop)
        .map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::*;

    #[test]
    fn what_a_language_lacks_is_a_fault() {
        let translated = |source: &str| {
            let module = naga::front::wgsl::parse_str(source).unwrap();
            let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
            let info = validator.validate(&module).unwrap();
            faults(&module, &info)
        };
        let plain = "@vertex fn main() -> @builtin(position) vec4f { return vec4f(0.0); }";
        assert!(translated(plain).is_empty());
        // Metal 2.0 has no invariant positions.
        let invariant = translated(&plain.replace("@builtin", "@invariant @builtin"));
        assert!(
            invariant.len() == 1 && invariant[0].contains("'main' does not translate to MSL"),
            "{invariant:?}"
        );
    }
}
