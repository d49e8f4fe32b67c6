//! Packages of Debian and Ubuntu that checks need beyond Rust.

use std::process::Command;

use crate::shell::CheckError;

/// Installs `package` where that takes no password.
///
/// # Errors
/// `missing`, what to do by hand, where it does.
pub(crate) fn install(package: &str, missing: &str) -> Result<(), CheckError> {
    let prints = |program: &str, arguments: &[&str]| {
        Command::new(program).args(arguments).output().ok().filter(|output| output.status.success())
    };
    let is_root = prints("id", &["-u"]).is_some_and(|output| output.stdout.trim_ascii() == b"0");
    if !is_root || prints("apt-get", &["--version"]).is_none() {
        return Err(CheckError::Failed(missing.to_owned()));
    }
    eprintln!("==> {package} is missing: installing it");
    for arguments in [&["update"][..], &["install", "--yes", "--no-install-recommends", package]] {
        let line = format!("apt-get {}", arguments.join(" "));
        let status = Command::new("apt-get")
            .args(arguments)
            .env("DEBIAN_FRONTEND", "noninteractive")
            .status()
            .map_err(|source| CheckError::Start { program: "apt-get".to_owned(), source })?;
        if !status.success() {
            return Err(CheckError::Failed(format!("{line}\n{missing}")));
        }
    }
    Ok(())
}
