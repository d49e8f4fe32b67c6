//! `cargo xtask package`: every crate packs, has complete metadata, and builds from its package.
//!
//! The packages are unpacked into a workspace of their own, where each finds its sisters as it would find them on a
//! registry: by version, among the other packages, never in this tree. So a file that a package lacks (a shader, a
//! picture in a page) breaks the build here, and build scripts find scene-core's shaders by Cargo's metadata or not at
//! all. Dependencies from outside are those that the other checks have built; code is checked, not generated: that is
//! the same as in the tests. Needs Cargo 1.90, the first that packs crates that depend on each other before they are
//! published.

mod metadata;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

pub(crate) use self::metadata::{Package, packages};
use crate::shell::{CheckError, cargo, cargo_at, root, target};

/// What a registry takes at most.
const MAX_BYTES: u64 = 10 << 20;

pub(crate) fn run() -> Result<(), CheckError> {
    let packages = packages()?;
    let faults: Vec<String> = packages.iter().flat_map(Package::faults).collect();
    if !faults.is_empty() {
        return Err(CheckError::Rules(faults));
    }
    // Uncommitted files are the developer's business; a clean checkout has none.
    let mut arguments = vec!["package", "--quiet", "--no-verify", "--allow-dirty"];
    arguments.extend(packages.iter().flat_map(|package| ["--package", &package.name]));
    cargo(&arguments, &[])?;
    let folder = target().join("package").join("unpacked");
    unpack(&packages, &folder)?;
    let place = target().display().to_string();
    cargo_at(&folder, &["check", "--quiet", "--workspace", "--target-dir", &place], &[])
}

/// Unpacks the packages into a workspace.
fn unpack(packages: &[Package], folder: &Path) -> Result<(), CheckError> {
    let fail = |source| CheckError::Write { path: folder.to_owned(), source };
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(fail)?;
    }
    fs::create_dir_all(folder).map_err(fail)?;
    for package in packages {
        let file = target().join("package").join(format!("{}.crate", package.folder()));
        let bytes =
            fs::metadata(&file).map_err(|source| CheckError::Read { path: file.clone(), source })?.len();
        if bytes > MAX_BYTES {
            return Err(CheckError::Failed(format!(
                "{}: {bytes} bytes, at most {MAX_BYTES}",
                file.display()
            )));
        }
        eprintln!("    {}: {} KiB", package.folder(), bytes.div_ceil(1024));
        let status = Command::new("tar")
            .arg("-xzf")
            .arg(&file)
            .arg("-C")
            .arg(folder)
            .status()
            .map_err(|source| CheckError::Start { program: "tar".to_owned(), source })?;
        if !status.success() {
            return Err(CheckError::Failed(format!("tar -xzf {}", file.display())));
        }
    }
    fs::write(folder.join("Cargo.toml"), workspace(packages)).map_err(fail)?;
    fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).map_err(fail)?;
    Ok(())
}

/// The manifest of a workspace of unpacked packages that stand in for the registry's.
fn workspace(packages: &[Package]) -> String {
    let folders: Vec<String> = packages.iter().map(Package::folder).collect();
    let mut text = format!("[workspace]\nresolver = \"3\"\nmembers = {folders:?}\n\n[patch.crates-io]\n");
    let is_asked_for = |name: &String| packages.iter().any(|other| other.sisters.contains(name));
    for (package, folder) in packages.iter().zip(&folders).filter(|(package, _)| is_asked_for(&package.name))
    {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{} = {{ path = {folder:?} }}", package.name);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_stand_in_for_the_registrys() {
        let package = |name: &str, sisters: &[&str]| Package {
            name: name.into(),
            version: "0.1.0".into(),
            sisters: sisters.iter().map(|&sister| sister.into()).collect(),
            ..Package::default()
        };
        let text = workspace(&[package("gnomon-psm", &[]), package("gnomon", &["gnomon-psm"])]);
        // Nobody depends on the command.
        assert!(!text.contains("gnomon = "), "{text}");
        assert!(text.contains("members = [\"gnomon-psm-0.1.0\", \"gnomon-0.1.0\"]"), "{text}");
        assert!(text.contains("gnomon-psm = { path = \"gnomon-psm-0.1.0\" }"), "{text}");
    }
}
