//! Why a command could not do its work, and the exit code of each reason.

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use scene_core::camera::CameraError;
#[cfg(feature = "gpu")]
use scene_core::gpu::{GpuError, HeadlessError};
use scene_core::io::write::WriteError;
use scene_core::metrics::MetricsError;
use scene_core::reference::{Cancelled, ExactError};
use scene_core::technique::{SettingsError, TechniqueError};
use thiserror::Error;

use crate::console;
use crate::scene_source::SceneSourceError;

/// A process exit code with a meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Exit(u8);

/// A check failed.
const FAILED: Exit = Exit(1);
/// Bad usage or input.
pub(crate) const BAD_INPUT: Exit = Exit(2);
/// A GPU was required and there is none.
const NO_GPU: Exit = Exit(3);
/// Whoever read stdout has gone: not a fault.
const QUIET: Exit = Exit(0);

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.0)
    }
}

/// Why a command could not do its work.
#[derive(Debug, Error)]
pub(crate) enum CliError {
    #[error(transparent)]
    Scene(#[from] SceneSourceError),
    #[error("{scene} has {}, counted from 0: there is no light {index}", count_of(*.lights, "light"))]
    NoSuchLight { scene: String, index: usize, lights: usize },
    #[error(transparent)]
    Camera(#[from] CameraError),
    #[error("there is no technique '{name}': there is {}", known.join(", "))]
    NoSuchTechnique { name: String, known: Vec<&'static str> },
    #[error("--cells: no scene of this test has {} in its name", names.join(" or "))]
    NoSuchCells { names: Vec<String> },
    #[error("there is nothing to compare: --techniques names none")]
    NoTechniques,
    #[error(transparent)]
    Settings(#[from] SettingsError),
    #[error(transparent)]
    Technique(#[from] TechniqueError),
    #[error("--backend gpu: {technique} has no GPU path with these settings; take --backend cpu or auto")]
    NoGpuPath { technique: &'static str },
    #[cfg(feature = "gpu")]
    #[error("--backend gpu: {0}")]
    Gpu(#[source] GpuError),
    #[cfg(not(feature = "gpu"))]
    #[error(
        "--backend gpu: this build leaves GPUs out; take --backend cpu or auto, or build with the feature 'gpu'"
    )]
    NoGpuInBuild,
    #[error("{}", path.display())]
    Baked {
        path: PathBuf,
        #[source]
        source: gnomon_pdsm::baked::BakedError,
    },
    #[error("the technique's image cannot be compared with ground truth")]
    Metrics(#[from] MetricsError),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    #[error("--exact")]
    Exact(#[from] ExactError),
    #[error("cannot start the threads: {0}")]
    Threads(String),
    #[error("cannot encode {what}")]
    Encode {
        what: &'static str,
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    #[error("cannot read {}: is it a folder that `gnomon bench` wrote?", path.display())]
    ReadRecords {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("{}:{line} is no record of this version; --fresh begins anew", path.display())]
    Record {
        path: PathBuf,
        line: usize,
        #[source]
        source: serde_json::Error,
    },
    #[error("{} holds no measurements of this version: it should be the recommend.csv of a `gnomon bench`", path.display())]
    Measurements {
        path: PathBuf,
        #[source]
        source: csv::Error,
    },
    #[error("no technique takes this scene and is in the measurements; `gnomon compare` tries all")]
    NothingToRecommend,
    #[error("{0}")]
    CheckFailed(String),
    #[error("a trial cannot be built: {0}")]
    Trial(String),
    #[error("cannot draw a chart: {0}")]
    Chart(String),
    #[error("cannot write {}", path.display())]
    Write {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error(transparent)]
    Size(#[from] WriteError),
    #[error("cannot write to stdout")]
    Stdout(#[source] io::Error),
}

impl CliError {
    /// The one place where a reason becomes an exit code.
    fn exit(&self) -> Exit {
        match self {
            Self::Stdout(error) if error.kind() == io::ErrorKind::BrokenPipe => QUIET,
            Self::CheckFailed(_) => FAILED,
            Self::NoGpuPath { .. } => NO_GPU,
            #[cfg(feature = "gpu")]
            Self::Gpu(error) => exit_of_gpu(error),
            #[cfg(not(feature = "gpu"))]
            Self::NoGpuInBuild => NO_GPU,
            _ => BAD_INPUT,
        }
    }

    /// Whether the GPU is at fault, so that the CPU may do instead.
    pub(crate) fn is_of_gpu(&self) -> bool {
        #[cfg(feature = "gpu")]
        return matches!(self, Self::Gpu(_));
        #[cfg(not(feature = "gpu"))]
        false
    }

    /// Tells the user in one line, causes after colons, and gives the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        let exit = self.exit();
        if exit != QUIET {
            console::stderr_line(&format!("gnomon: {}", chain(self)));
        }
        exit.into()
    }
}

/// No GPU, or none any more, is told apart from one for which the input or the settings are too much.
#[cfg(feature = "gpu")]
fn exit_of_gpu(error: &GpuError) -> Exit {
    match error {
        GpuError::TurnedOff
        | GpuError::NoAdapter
        | GpuError::NoSuchAdapter { .. }
        | GpuError::Device { .. }
        | GpuError::Lost { .. }
        | GpuError::Timeout { .. } => NO_GPU,
        GpuError::OutOfMemory { .. }
        | GpuError::TooLarge { .. }
        | GpuError::Beyond { .. }
        | GpuError::Validation { .. } => BAD_INPUT,
    }
}

#[cfg(feature = "gpu")]
impl From<GpuError> for CliError {
    fn from(error: GpuError) -> Self {
        Self::Gpu(error)
    }
}

#[cfg(feature = "gpu")]
impl From<HeadlessError> for CliError {
    fn from(error: HeadlessError) -> Self {
        match error {
            HeadlessError::Gpu(error) | HeadlessError::Technique(TechniqueError::Gpu(error)) => {
                Self::Gpu(error)
            }
            HeadlessError::Technique(error) => Self::Technique(error),
        }
    }
}

/// An error and its causes in one line. A cause that its effect already quotes is not said twice.
fn chain(error: &dyn std::error::Error) -> String {
    let mut line = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let text = error.to_string();
        if !line.contains(&text) {
            line.push_str(": ");
            line.push_str(&text);
        }
        cause = error.source();
    }
    line.replace('\n', " ")
}

/// "1 light", "2 lights".
pub(crate) fn count_of(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_is_one_line() {
        let source = io::Error::other("disk\nfull");
        let error = CliError::Write { path: "a.png".into(), source };
        assert_eq!(chain(&error), "cannot write a.png: disk full");
    }

    #[test]
    fn exit_codes() {
        assert_eq!(CliError::NoGpuPath { technique: "psm" }.exit(), Exit(3));
        assert_eq!(CliError::Camera(CameraError::NoUp).exit(), Exit(2));
        let gone = io::Error::from(io::ErrorKind::BrokenPipe);
        assert_eq!(CliError::Stdout(gone).exit(), Exit(0));
    }
    #[cfg(feature = "gpu")]
    #[test]
    fn a_gpu_that_is_gone_and_one_that_is_too_small() {
        let text = || "maps".to_owned();
        for (error, code) in [
            (GpuError::NoAdapter, 3),
            (GpuError::Lost { message: text() }, 3),
            (GpuError::Timeout { seconds: 300 }, 3),
            (GpuError::OutOfMemory { what: text() }, 2),
            (GpuError::TooLarge { what: "triangles", bytes: 9, limit: 8 }, 2),
            (GpuError::Beyond { what: "maps", value: 9, limit: 8 }, 2),
            (GpuError::Validation { what: text(), message: text() }, 2),
        ] {
            let told = CliError::from(HeadlessError::Technique(TechniqueError::Gpu(error.clone())));
            assert!(told.is_of_gpu() && told.exit() == Exit(code), "{told}");
            let text = chain(&told);
            assert!(
                text.starts_with("--backend gpu: ") && text.matches(&error.to_string()).count() == 1,
                "{text}"
            );
        }
    }
}
