//! Running cargo and reading the tree.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
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
    /// A file could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
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

/// The build folder.
pub(crate) fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |folder| root().join(folder))
}

fn cargo_program() -> String {
    std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned())
}

/// Runs `cargo` in the workspace with `arguments` and extra environment, and prints how long it took.
pub(crate) fn cargo(arguments: &[&str], environment: &[(&str, &str)]) -> Result<(), CheckError> {
    cargo_at(root(), arguments, environment)
}

/// [`cargo`] in another folder.
pub(crate) fn cargo_at(
    folder: &Path,
    arguments: &[&str],
    environment: &[(&str, &str)],
) -> Result<(), CheckError> {
    let line = format!("cargo {}", arguments.join(" "));
    eprintln!("\n==> {line}");
    let start = Instant::now();
    let program = cargo_program();
    let status = Command::new(&program)
        .args(arguments)
        .envs(environment.iter().copied())
        .current_dir(folder)
        .status()
        .map_err(|source| CheckError::Start { program, source })?;
    eprintln!("    {:.1} s", start.elapsed().as_secs_f64());
    if status.success() { Ok(()) } else { Err(CheckError::Failed(line)) }
}

/// Runs a program of ours in the workspace, its stdout left out.
pub(crate) fn run_program(program: &Path, arguments: &[&str]) -> Result<(), CheckError> {
    let name = program.display().to_string();
    output_of(&name, arguments).map(drop)
}

/// What `cargo` prints on stdout; its messages go to where ours go.
pub(crate) fn cargo_output(arguments: &[&str]) -> Result<String, CheckError> {
    output_of(&cargo_program(), arguments)
}

/// What a program prints on stdout, run in the workspace.
pub(crate) fn output_of(program: &str, arguments: &[&str]) -> Result<String, CheckError> {
    let output = captured(program, arguments, &[])?;
    if !output.status.success() {
        return Err(CheckError::Failed(format!("{program} {}", arguments.join(" "))));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// [`output_of`] with extra environment. A program that prints and then fails has said why: its status is put below.
pub(crate) fn output_even_if_failed(
    program: &str,
    arguments: &[&str],
    environment: &[(&str, String)],
) -> Result<String, CheckError> {
    let output = captured(program, arguments, environment)?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    match (output.status.success(), text.trim().is_empty()) {
        (true, _) => Ok(text),
        (false, false) => Ok(format!("{text}\n({})", output.status)),
        (false, true) => Err(CheckError::Failed(format!("{program} {}", arguments.join(" ")))),
    }
}

/// Runs a program in the workspace; what it says on stderr goes to where ours goes.
fn captured(program: &str, arguments: &[&str], environment: &[(&str, String)]) -> Result<Output, CheckError> {
    Command::new(program)
        .args(arguments)
        .envs(environment.iter().map(|(name, value)| (name, value)))
        .current_dir(root())
        .stderr(Stdio::inherit())
        .output()
        .map_err(|source| CheckError::Start { program: program.to_owned(), source })
}
