//! The GPU that the tests run on: what there is, or Mesa's software Vulkan, chosen explicitly.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use crate::apt;
use crate::shell::CheckError;

/// Mesa's software Vulkan on Debian and Ubuntu.
const PACKAGE: &str = "mesa-vulkan-drivers";

/// Where the loader looks for drivers on Linux, besides `XDG_DATA_DIRS`.
const DRIVER_FOLDERS: [&str; 3] =
    ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"];

/// Environment that tests on the GPU need: `VK_DRIVER_FILES` where there is no GPU, so that the software driver
/// is chosen by name and not by what the loader finds first. Installs it if there is no driver at all and that
/// is possible.
///
/// # Errors
/// What to install, if there is no driver.
pub(crate) fn environment() -> Result<Vec<(&'static str, String)>, CheckError> {
    let off = env::var("GNOMON_GPU").is_ok_and(|value| value.eq_ignore_ascii_case("off"));
    if off {
        eprintln!("==> GPU: tests are skipped, GNOMON_GPU=off");
        return Ok(Vec::new());
    }
    // Other systems have their own drivers; a caller who chose one is believed.
    let is_chosen =
        ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "GNOMON_ADAPTER"].iter().any(|v| env::var_os(v).is_some());
    if !cfg!(target_os = "linux") || is_chosen {
        return Ok(Vec::new());
    }
    let mut drivers = drivers();
    if drivers.is_empty() {
        install()?;
        drivers = self::drivers();
    }
    match choose(&drivers, has_gpu()) {
        Choice::Loader => Ok(Vec::new()),
        Choice::Software(driver) => {
            eprintln!("==> GPU: none; software Vulkan by {}", driver.display());
            // Mesa's layer that chooses between GPUs has nothing to choose, and complains where there is no desktop.
            let no_layer = ("NODEVICE_SELECT", "1".to_owned());
            Ok(vec![("VK_DRIVER_FILES", driver.display().to_string()), no_layer])
        }
        Choice::Nothing => Err(CheckError::Failed(missing())),
    }
}

#[derive(Debug, PartialEq, Eq)]
enum Choice {
    /// There is a GPU: the loader knows best.
    Loader,
    /// This driver.
    Software(PathBuf),
    Nothing,
}

fn choose(drivers: &[PathBuf], has_gpu: bool) -> Choice {
    let is_software =
        |path: &&PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("lvp_icd"));
    match drivers.iter().find(is_software) {
        _ if drivers.is_empty() => Choice::Nothing,
        Some(driver) if !has_gpu => Choice::Software(driver.clone()),
        None if !has_gpu => Choice::Nothing,
        _ => Choice::Loader,
    }
}

/// Driver manifests that the loader would find.
fn drivers() -> Vec<PathBuf> {
    let data = env::var_os("XDG_DATA_DIRS").unwrap_or_default();
    let folders = DRIVER_FOLDERS.iter().map(PathBuf::from);
    let folders = folders.chain(env::split_paths(&data).map(|folder| folder.join("vulkan/icd.d")));
    // A folder that is not there holds no driver.
    let entries = folders.filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let files =
        entries.map(|entry| entry.path()).filter(|path| path.extension().is_some_and(|e| e == "json"));
    // 32-bit drivers stand beside the others and cannot be loaded.
    let arch = env::consts::ARCH;
    let fits = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        name.contains(arch)
            || !["x86_64", "i686", "aarch64", "armv7"].iter().any(|other| name.contains(other))
    };
    let mut drivers: Vec<_> = files.filter(fits).collect();
    drivers.sort();
    drivers
}

/// Whether the kernel shows a GPU: a render node, NVIDIA's device or Windows' under WSL.
fn has_gpu() -> bool {
    let render_node = fs::read_dir("/dev/dri").is_ok_and(|entries| {
        entries.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with("renderD"))
    });
    render_node || Path::new("/dev/nvidia0").exists() || Path::new("/dev/dxg").exists()
}

/// Installs the software driver where that takes no password.
fn install() -> Result<(), CheckError> {
    apt::install(PACKAGE, &missing())
}

fn missing() -> String {
    format!(
        "no Vulkan driver for the GPU tests: install {PACKAGE} (Debian, Ubuntu, Fedora) or vulkan-swrast (Arch), \
         or go without by GNOMON_GPU=off"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_software_driver_is_named_where_there_is_no_gpu() {
        let drivers = ["/d/intel_icd.x86_64.json", "/d/lvp_icd.x86_64.json"].map(PathBuf::from);
        assert_eq!(choose(&drivers, false), Choice::Software(drivers[1].clone()));
        assert_eq!(choose(&drivers, true), Choice::Loader);
        assert_eq!(choose(&drivers[..1], true), Choice::Loader);
        assert_eq!(choose(&drivers[..1], false), Choice::Nothing);
        assert_eq!(choose(&[], false), Choice::Nothing);
        assert_eq!(choose(&[], true), Choice::Nothing);
        assert!(missing().contains("mesa-vulkan-drivers") && missing().contains("GNOMON_GPU=off"));
    }
}
