//! Links the WESL shaders of a crate to plain WGSL, in its build script.
//!
//! A crate with shaders keeps them in `shaders/*.wesl` and calls [`build`] from `build.rs`. Every module is
//! linked with what it imports into one WGSL text, and a table of them is written for the crate to include:
//!
//! ```text
//! # Cargo.toml
//! [features]
//! gpu = ["scene-core/gpu", "dep:gnomon-shader-build"]
//! [build-dependencies]
//! gnomon-shader-build = { workspace = true, optional = true }
//!
//! // build.rs
//! fn main() {
//!     #[cfg(feature = "gpu")]
//!     gnomon_shader_build::build();
//! }
//! // src/gpu/shaders.rs
//! include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
//! ```
//!
//! Kernels for unit tests of shader functions lie in `tests/shaders/*.wesl`, may import `package::…` too, and have
//! a table of their own, `test_shaders.rs`.
//!
//! The table holds one constant per module with an entry point (`gbuffer_pass.wesl` → `GBUFFER_PASS`), and
//! `ALL`, name and WGSL of every module, those without entry points too, so that a test reaches each.
//!
//! # Variants
//!
//! Where one thing is done in two ways, modules hold both, behind `@if(feature)` and `@if(!feature)`. A module with an entry
//! point that uses what is held so is linked without the feature and with it: `shade.wesl` → `SHADE` and `SHADE_PAGED`.
//!
//! # Shared modules
//!
//! Modules of `gnomon-scene-core` are imported as `scene_core::camera::…`, by itself and by technique crates
//! alike. Technique crates find them by Cargo's `links` metadata: scene-core's build script tells the folder
//! its own sources lie in, and Cargo hands that to the build script of every crate that depends on it. So
//! the WGSL always comes from the very scene-core whose Rust structs fill its buffers; it works from the
//! workspace, from a registry and from a vendored tree; and nothing is copied. A build-dependency holding the
//! sources would be found as easily, but could be of another version than the structs. The price is that a
//! dependency graph holds one scene-core at a time, which its types, met in every signature, ask for anyway.
//!
//! # Why WESL
//!
//! Imports have namespaces, are resolved at build time, and what ships is plain WGSL.

mod error;
mod link;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

pub use error::{LinkError, Place};
pub use link::{Declaration, LinkedShader, link_file, link_variants, modules};

/// The value of `links` in scene-core's manifest.
const SCENE_CORE_LINKS: &str = "gnomon_scene_core";

/// The variable that Cargo makes of scene-core's `shaders` metadata.
const SHARED_VARIABLE: &str = "DEP_GNOMON_SCENE_CORE_SHADERS";

/// Links the calling crate's `shaders/*.wesl` and `tests/shaders/*.wesl`, and writes `shaders.rs`,
/// `test_shaders.rs` and the WGSL files to `OUT_DIR`. For build scripts only: a failure is told to Cargo as an error
/// with file and line, and ends the build.
pub fn build() {
    if let Err(error) = try_build() {
        for line in error.to_string().lines() {
            println!("cargo::error={line}");
        }
    }
}

fn try_build() -> Result<(), LinkError> {
    let variable = |name: &'static str| env::var_os(name).ok_or(LinkError::NotABuildScript { name });
    let manifest = PathBuf::from(variable("CARGO_MANIFEST_DIR")?);
    let own = manifest.join("shaders");
    let out = PathBuf::from(variable("OUT_DIR")?);
    println!("cargo::rerun-if-changed={}", own.display());
    let shared = if env::var("CARGO_MANIFEST_LINKS").is_ok_and(|links| links == SCENE_CORE_LINKS) {
        println!("cargo::metadata=shaders={}", own.display());
        own.clone()
    } else {
        let shared = PathBuf::from(variable(SHARED_VARIABLE)?);
        println!("cargo::rerun-if-changed={}", shared.display());
        shared
    };
    write_table("shaders", &own, &own, &shared, &out)?;
    // Packages may leave their tests out.
    let tests = manifest.join("tests").join("shaders");
    if tests.is_dir() {
        println!("cargo::rerun-if-changed={}", tests.display());
        write_table("test_shaders", &tests, &own, &shared, &out)?;
    }
    Ok(())
}

/// Links the modules of `folder`, and writes them and their table, `{name}.rs`, to `out`.
fn write_table(
    name: &'static str,
    folder: &Path,
    own: &Path,
    shared: &Path,
    out: &Path,
) -> Result<(), LinkError> {
    let linked_folder = out.join(name);
    fs::create_dir_all(&linked_folder)
        .map_err(|source| LinkError::File { path: linked_folder.clone(), source })?;
    let mut shaders = Vec::new();
    for file in modules(folder)? {
        for shader in link_variants(&file, own, shared)? {
            write(&linked_folder.join(format!("{}.wgsl", shader.name)), &shader.wgsl)?;
            shaders.push(shader);
        }
    }
    write(&out.join(format!("{name}.rs")), &table(name, &shaders))
}

fn write(path: &Path, text: &str) -> Result<(), LinkError> {
    fs::write(path, text).map_err(|source| LinkError::File { path: path.to_owned(), source })
}

/// The Rust source of a crate's shader table.
fn table(folder: &str, shaders: &[LinkedShader]) -> String {
    let mut text = String::new();
    let mut all = String::new();
    for shader in shaders {
        let name = &shader.name;
        let source = format!("include_str!(concat!(env!(\"OUT_DIR\"), \"/{folder}/{name}.wgsl\"))");
        if shader.has_entry_point {
            let constant = name.to_uppercase();
            // Writing to a String cannot fail.
            let _ = writeln!(text, "/// `{name}.wesl`, linked.\npub const {constant}: &str = {source};");
            let _ = writeln!(all, "    (\"{name}\", {constant}),");
        } else {
            let _ = writeln!(all, "    (\"{name}\", {source}),");
        }
    }
    let _ = writeln!(
        text,
        "/// Name and linked WGSL of every module.\npub const ALL: &[(&str, &str)] = &[\n{all}];"
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_names_every_module() {
        let shader = |name: &str, has_entry_point| LinkedShader {
            name: name.to_owned(),
            has_entry_point,
            ..LinkedShader::default()
        };
        let text = table("shaders", &[shader("camera", false), shader("gbuffer_pass", true)]);
        assert!(text.contains("pub const GBUFFER_PASS: &str"), "{text}");
        assert!(!text.contains("pub const CAMERA"), "{text}");
        assert!(
            text.contains("(\"camera\", include_str!") && text.contains("(\"gbuffer_pass\", GBUFFER_PASS)")
        );
    }
}
