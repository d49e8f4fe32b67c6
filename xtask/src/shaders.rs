//! `cargo xtask shaders`: every shader of the workspace is linked, valid, follows the project's rules and
//! translates to what GPUs take.
//!
//! Shaders are found by walking the tree, so a new one cannot be forgotten: a `.wesl` or `.wgsl` file that no
//! crate's build script links into its `ALL` table is a failure, and so is finding none.

mod origin;
mod rules;
mod translate;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use gnomon_shader_build::{LinkedShader, link_variants};
use naga::valid::{Capabilities, ModuleInfo, ValidationError, ValidationFlags, Validator};

use crate::shell::{CheckError, root};
use crate::tidy::collect;

/// What devices are asked for: nothing beyond WebGPU's core.
const CAPABILITIES: Capabilities = Capabilities::empty();

pub(crate) fn run() -> Result<(), CheckError> {
    let checked = check_tree(root())?;
    if !checked.faults.is_empty() {
        return Err(CheckError::Shaders(checked.faults));
    }
    eprintln!(
        "==> shaders: {} modules, {} entry points, each to SPIR-V, MSL, HLSL and GLSL",
        checked.modules, checked.entry_points
    );
    Ok(())
}

#[derive(Debug, Default)]
struct Checked {
    modules: usize,
    entry_points: usize,
    /// One fault a line, each with file and line where it has one.
    faults: Vec<String>,
}

fn check_tree(root: &Path) -> Result<Checked, CheckError> {
    let mut files = Vec::new();
    collect(root, &mut files)?;
    files.retain(|file| file.extension().is_some_and(|ending| ending == "wesl" || ending == "wgsl"));
    let mut checked = Checked::default();
    if files.is_empty() {
        checked.faults.push("no shader was found: is this the workspace?".to_owned());
    }
    let shared = root.join("scene-core").join("shaders");
    let mut tables = BTreeMap::new();
    for file in &files {
        let name = file.strip_prefix(root).unwrap_or(file);
        let folder = file.parent().unwrap_or(root);
        let own = tables.entry(folder.to_owned()).or_insert_with(|| own_folder(folder));
        let Some(own) = own.as_ref().filter(|_| file.extension().is_some_and(|ending| ending == "wesl"))
        else {
            checked.faults.push(format!(
                "{}: in no shader table: a crate links what lies in `shaders` and `tests/shaders`, as .wesl, from \
                 its build script by gnomon_shader_build::build",
                name.display()
            ));
            continue;
        };
        match link_variants(file, own, &shared) {
            Ok(shaders) => shaders.iter().for_each(|shader| check_shader(shader, &mut checked)),
            Err(error) => checked.faults.push(error.to_string()),
        }
    }
    let prefix = format!("{}/", root.display());
    for fault in &mut checked.faults {
        *fault = fault.replace(&prefix, "");
    }
    Ok(checked)
}

/// The crate's own modules, for shaders of a folder that a build script links.
fn own_folder(folder: &Path) -> Option<PathBuf> {
    if folder.file_name()? != "shaders" {
        return None;
    }
    let parent = folder.parent()?;
    let member = if parent.file_name()? == "tests" { parent.parent()? } else { parent };
    let script = fs::read_to_string(member.join("build.rs")).ok()?;
    script.contains("gnomon_shader_build::build()").then(|| member.join("shaders"))
}

/// Books what is wrong with a linked shader.
fn check_shader(shader: &LinkedShader, checked: &mut Checked) {
    checked.modules += 1;
    match validate(shader) {
        Ok((module, info)) => {
            let name = shader.path.display();
            checked.faults.extend(rules::broken(&module).into_iter().map(|(line, rule)| {
                let place = origin::place(shader, line.map(|span| span.location(&shader.wgsl).line_number));
                format!("{place}: {rule}")
            }));
            checked.entry_points += module.entry_points.len();
            let faults = translate::faults(&module, &info);
            checked.faults.extend(faults.into_iter().map(|fault| format!("{name}: {fault}")));
        }
        Err(fault) => checked.faults.push(fault),
    }
}

fn validate(shader: &LinkedShader) -> Result<(naga::Module, ModuleInfo), String> {
    let told = |line: Option<u32>, message: String| {
        format!("{}: {}", origin::place(shader, line), message.trim_end())
    };
    let module = naga::front::wgsl::parse_str(&shader.wgsl).map_err(|error| {
        let line = error.location(&shader.wgsl).map(|location| location.line_number);
        told(line, error.emit_to_string(&shader.wgsl))
    })?;
    let info = Validator::new(ValidationFlags::all(), CAPABILITIES).validate(&module).map_err(|error| {
        // Of the places that the error names, the smallest: an expression and not the function around it.
        let spans = error.spans().map(|(span, _)| *span).filter(naga::Span::is_defined);
        let smallest = spans.min_by_key(|span| span.to_range().map_or(usize::MAX, |range| range.len()));
        let line = smallest.map(|span| span.location(&shader.wgsl).line_number);
        // Faults of entry points have no place, but a name.
        let line = line.or_else(|| match error.as_inner() {
            ValidationError::EntryPoint { name, .. } => origin::line_of(shader, name),
            _ => None,
        });
        told(line, error.emit_to_string(&shader.wgsl))
    })?;
    Ok((module, info))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shader_of_the_workspace_passes() {
        let checked = check_tree(root()).unwrap();
        assert!(checked.faults.is_empty(), "{}", checked.faults.join("\n"));
        assert!(checked.modules >= 6 && checked.entry_points >= 4, "{checked:?}");
    }

    /// A workspace of one crate, `scene-core`, with these shaders.
    fn tree(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        folder
    }

    const BUILD: (&str, &str) = ("scene-core/build.rs", "fn main() { gnomon_shader_build::build(); }");

    fn faults(shader: &str) -> Vec<String> {
        check_tree(tree(&[BUILD, ("scene-core/shaders/a.wesl", shader)]).path()).unwrap().faults
    }

    #[test]
    fn a_sound_shader_is_accepted() {
        let sound = "@compute @workgroup_size(64) fn main() {}\n";
        assert_eq!(faults(sound), Vec::<String>::new());
    }

    #[test]
    fn faults_name_file_and_line() {
        for (shader, line) in [
            // Syntax, names, types, and what only validation sees.
            ("fn f() {}\nfn g( {}\n", 2),
            ("// one\n// two\nfn f() -> f32 {\n    return nowhere;\n}\n", 4),
            ("fn f() -> f32 {\n    let a = 1.0;\n    return a + 1u;\n}\n", 3),
            ("\n@compute @workgroup_size(0) fn main() {}\n", 2),
        ] {
            let faults = faults(shader);
            assert_eq!(faults.len(), 1, "{faults:?}");
            let expected = format!("scene-core/shaders/a.wesl:{line}");
            assert!(faults[0].starts_with(&expected), "{expected}: {}", faults[0]);
        }
    }

    #[test]
    fn faults_of_imported_modules_name_their_file() {
        let tree = tree(&[
            BUILD,
            ("scene-core/shaders/maths.wesl", "// one\nfn half(x: f32) -> f32 {\n    return x * 1u;\n}\n"),
            (
                "psm/shaders/entry.wesl",
                "import scene_core::maths::half;\n@fragment fn main() -> @location(0) vec4f { return vec4f(half(1.0)); }\n",
            ),
            ("psm/build.rs", BUILD.1),
        ]);
        let faults = check_tree(tree.path()).unwrap().faults;
        assert_eq!(faults.len(), 2, "{faults:?}");
        assert!(faults.iter().all(|f| f.starts_with("scene-core/shaders/maths.wesl:3")), "{faults:?}");
    }

    #[test]
    fn kernels_of_tests_are_checked_too() {
        let kernel = "import package::a::half;\n@compute @workgroup_size(1) fn main() { _ = half(1u); }\n";
        let half = ("scene-core/shaders/a.wesl", "fn half(x: f32) -> f32 { return 0.5 * x; }\n");
        let faults =
            check_tree(tree(&[BUILD, half, ("scene-core/tests/shaders/kernel.wesl", kernel)]).path())
                .unwrap()
                .faults;
        assert!(
            faults.len() == 1 && faults[0].starts_with("scene-core/tests/shaders/kernel.wesl:2"),
            "{faults:?}"
        );
    }

    #[test]
    fn shaders_that_no_crate_links_are_faults() {
        let sound = "fn f() {}\n";
        for (files, fault) in [
            (vec![], "no shader was found"),
            (vec![("scene-core/shaders/a.wgsl", sound), BUILD], "in no shader table"),
            (vec![("scene-core/src/a.wesl", sound), BUILD], "in no shader table"),
            (vec![("psm/shaders/a.wesl", sound), BUILD], "in no shader table"),
        ] {
            let faults = check_tree(tree(&files).path()).unwrap().faults;
            assert!(faults.len() == 1 && faults[0].contains(fault), "{faults:?}");
        }
    }
}
