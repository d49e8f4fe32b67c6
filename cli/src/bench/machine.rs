//! What a run was measured on. Times of different machines are not compared.

use serde::{Deserialize, Serialize};

/// Processor, threads and version: what a time depends on beside the work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Machine {
    /// Its model, where the system tells it; else the architecture.
    pub(crate) processor: String,
    /// Threads that computed.
    pub(crate) threads: usize,
    /// The operating system.
    pub(crate) system: String,
    /// Gnomon's.
    pub(crate) version: String,
}

impl Machine {
    /// This one.
    pub(crate) fn this() -> Self {
        let about = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model = about
            .lines()
            .find_map(|line| Some(line.strip_prefix("model name")?.split_once(':')?.1.trim().to_owned()));
        Self {
            processor: model.unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            threads: rayon::current_num_threads(),
            system: std::env::consts::OS.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }
}

impl std::fmt::Display for Machine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { processor, threads, system, version } = self;
        write!(f, "{processor}, {threads} threads, {system}, gnomon {version}")
    }
}
