//! Running cargo and reading the tree.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use thiserror::Error;

/// Why a check failed.
#[derive(Debug, Error)]
pub(crate) enum CheckError {
    /// A program could not be started.
    #[error("cannot run {program}: {source}")]
    Start {
        /// The program.
        program: String,
        /// Why not.
        source: std::io::Error,
    },
    /// A program ran and failed; its own output is above.
    #[error("failed: {0}")]
    Failed(String),
    /// A file could not be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// Project rules are broken, one a line.
    #[error("{} project rules broken:\n{}", .0.len(), .0.join("\n"))]
    Rules(Vec<String>),
    /// Shaders are broken, one fault a line.
    #[error("{} faults in shaders:\n{}", .0.len(), .0.join("\n"))]
    Shaders(Vec<String>),
}

/// The workspace's folder.
pub(crate) fn root() -> &'static Path {
    // xtask is a direct child of the root.
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."))
}

/// Runs `cargo` in the workspace with `arguments` and extra environment, and prints how long it took.
pub(crate) fn cargo(arguments: &[&str], environment: &[(&str, &str)]) -> Result<(), CheckError> {
    let line = format!("cargo {}", arguments.join(" "));
    eprintln!("\n==> {line}");
    let start = Instant::now();
    let program = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let status = Command::new(&program)
        .args(arguments)
        .envs(environment.iter().copied())
        .current_dir(root())
        .status()
        .map_err(|source| CheckError::Start { program, source })?;
    eprintln!("    {:.1} s", start.elapsed().as_secs_f64());
    if status.success() { Ok(()) } else { Err(CheckError::Failed(line)) }
}
