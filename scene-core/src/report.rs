//! What a step cost and what it left out.

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

/// Milliseconds per stage, bytes held, and what was skipped. Every step of a technique returns one.
///
/// Stages are named `prepare.*` and `shade.*`; a technique's CPU and GPU paths use the same names.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Report {
    /// Stage name → milliseconds of wall time (on the GPU: of the GPU, where timestamps are offered).
    pub stages_ms: BTreeMap<String, f64>,
    /// Bytes the technique holds for this light after the step.
    pub bytes: u64,
    /// What was skipped → how many of it.
    pub skipped: BTreeMap<String, u64>,
    /// What the cost grows with → how many of it: `penumbra pixels`, say.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub counted: BTreeMap<String, u64>,
    /// What it ran on; none on the CPU. Filled in by who owns the device.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gpu: Option<GpuUse>,
}

/// The GPU that did the work.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct GpuUse {
    /// Name, interface and driver.
    pub adapter: String,
    /// Features used beyond what every device has.
    pub features: Vec<String>,
}

impl Report {
    /// Runs `work` and books its wall time under `stage`; several runs of one stage add up.
    pub fn time<T>(&mut self, stage: &str, work: impl FnOnce(&mut Self) -> T) -> T {
        let start = Instant::now();
        let result = work(self);
        *self.stages_ms.entry(stage.to_owned()).or_default() += start.elapsed().as_secs_f64() * 1e3;
        result
    }

    /// Books `count` skipped things. Zero is booked too: it says that skipping was tried.
    pub fn skip(&mut self, what: &str, count: u64) {
        *self.skipped.entry(what.to_owned()).or_default() += count;
    }

    /// Books `number` things that the cost grows with.
    pub fn count(&mut self, what: &str, number: u64) {
        *self.counted.entry(what.to_owned()).or_default() += number;
    }

    /// Adds another step's times, skips and counts; the larger number of bytes stands.
    pub fn merge(&mut self, other: &Self) {
        for (stage, ms) in &other.stages_ms {
            *self.stages_ms.entry(stage.clone()).or_default() += ms;
        }
        for (what, count) in &other.skipped {
            self.skip(what, *count);
        }
        for (what, number) in &other.counted {
            self.count(what, *number);
        }
        self.bytes = self.bytes.max(other.bytes);
        if self.gpu.is_none() {
            self.gpu.clone_from(&other.gpu);
        }
    }

    /// [`merge`](Self::merge) of a step that holds its bytes beside this one's.
    pub fn merge_beside(&mut self, other: &Self) {
        let bytes = self.bytes + other.bytes;
        self.merge(other);
        self.bytes = bytes;
    }

    /// Milliseconds of all stages whose name starts with `prefix`.
    pub fn total_ms(&self, prefix: &str) -> f64 {
        self.stages_ms.iter().filter(|(stage, _)| stage.starts_with(prefix)).map(|(_, ms)| ms).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merging_adds_times_skips_and_counts() {
        let mut report = Report::default();
        assert_eq!(
            report.time("prepare.map", |r| {
                r.skip("faces", 2);
                7
            }),
            7
        );
        let mut other = Report { bytes: 9, ..Default::default() };
        other.stages_ms.insert("shade.lookup".into(), 3.0);
        other.skip("faces", 3);
        report.count("taps", 5);
        other.count("taps", 2);
        report.merge(&other);
        assert_eq!(report.counted["taps"], 7);
        assert_eq!(report.skipped["faces"], 5);
        assert_eq!(report.total_ms("shade."), 3.0);
        assert_eq!(report.bytes, 9);
    }
}
