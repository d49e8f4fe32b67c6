//! What a cell came to: one line of `results.jsonl` each, written as soon as it is known.
//!
//! A run that is interrupted, by whatever, loses the cell at work and nothing else: the next run reads the lines, does
//! not repeat what they hold, and drops a last line that was cut short.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use scene_core::io::write;
use scene_core::metrics::{Errors, Shares};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::machine::Machine;
use super::station::Point;
use crate::error::CliError;
use crate::measure::Repeated;
use crate::recommend::features::Features;
use crate::recommend::preview::Tried;

/// The file of records in a folder.
pub(crate) const FILE: &str = "results.jsonl";

/// One cell, measured or refused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    /// Station, contender and backend: differs from every other cell's.
    pub(crate) key: String,
    pub(crate) scene: String,
    /// The place on a cost curve; none for a scene as it is.
    pub(crate) point: Option<Point>,
    pub(crate) light: String,
    /// Whether the light throws penumbrae.
    pub(crate) extended: bool,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) triangles: usize,
    /// Shares of compared pixels.
    pub(crate) lit: f64,
    pub(crate) penumbra: f64,
    pub(crate) umbra: f64,
    /// Samples a pixel of ground truth, and its own root mean square error, estimated.
    pub(crate) truth_samples: u32,
    pub(crate) truth_noise: f64,
    pub(crate) label: String,
    pub(crate) technique: String,
    pub(crate) variant: String,
    pub(crate) preset: Option<String>,
    /// Whether no setting was touched.
    pub(crate) is_default: bool,
    pub(crate) backend: String,
    pub(crate) adapter: Option<String>,
    pub(crate) settings: Value,
    pub(crate) seed: u64,
    pub(crate) machine: Machine,
    /// What the scene is like, and what the contender came to on a small picture of it: what `recommend` learns from. None on
    /// cost curves, the latter for rays and on the GPU, too.
    pub(crate) features: Option<Features>,
    pub(crate) tried: Option<Tried>,
    pub(crate) outcome: Outcome,
}

/// Figures, or why there are none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Outcome {
    Measured(Measured),
    /// The technique does not take this input, and says why.
    Refused(String),
}

/// Times are medians over runs after one to warm up; spreads are distances between quartiles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Measured {
    pub(crate) runs: usize,
    pub(crate) prepare_ms: f64,
    pub(crate) prepare_spread_ms: f64,
    pub(crate) shade_ms: f64,
    pub(crate) shade_spread_ms: f64,
    /// Whether what was prepared still holds when only the camera moves.
    pub(crate) survives_camera: bool,
    pub(crate) bytes: u64,
    pub(crate) mae: f64,
    pub(crate) rmse: f64,
    pub(crate) p99: f64,
    /// None where no pixel lies in penumbra.
    pub(crate) pen_rmse: Option<f64>,
    /// What was left out, and how many of it.
    pub(crate) skipped: BTreeMap<String, u64>,
}

impl Measured {
    /// The figures of repeated runs.
    pub(crate) fn new(repeated: &Repeated, errors: &Errors) -> Self {
        let times = &repeated.times_ms;
        // The first warms up; where there was time for it alone it has to do.
        let counted = if times.len() > 1 { &times[1..] } else { &times[..] };
        let (prepare_ms, prepare_spread_ms) = median_and_spread(counted.iter().map(|t| t.0).collect());
        let (shade_ms, shade_spread_ms) = median_and_spread(counted.iter().map(|t| t.1).collect());
        let report = &repeated.fastest.report;
        Self {
            runs: counted.len(),
            prepare_ms,
            prepare_spread_ms,
            shade_ms,
            shade_spread_ms,
            survives_camera: report.survives_camera,
            bytes: report.bytes,
            mae: errors.mae,
            rmse: errors.rmse,
            p99: errors.p99,
            pen_rmse: (errors.penumbra > 0).then_some(errors.pen_rmse),
            skipped: report.skipped.clone(),
        }
    }

    /// Everything: prepare and shade.
    pub(crate) fn whole_ms(&self) -> f64 {
        self.prepare_ms + self.shade_ms
    }

    /// A frame while only the camera moves: what survives it is not prepared again.
    pub(crate) fn frame_ms(&self) -> f64 {
        if self.survives_camera { self.shade_ms } else { self.whole_ms() }
    }
}

impl Record {
    /// The figures, if there are any.
    pub(crate) fn measured(&self) -> Option<&Measured> {
        match &self.outcome {
            Outcome::Measured(measured) => Some(measured),
            Outcome::Refused(_) => None,
        }
    }

    /// Label and backend, the latter only where it is not the CPU.
    pub(crate) fn name(&self) -> String {
        if self.backend == "cpu" { self.label.clone() } else { format!("{} ({})", self.label, self.backend) }
    }

    /// Shares as a comparison prints them.
    pub(crate) fn shares(&self) -> Shares {
        Shares { lit: self.lit, penumbra: self.penumbra, umbra: self.umbra }
    }
}

/// The median; NaN for no value.
pub(crate) fn median(values: Vec<f64>) -> f64 {
    median_and_spread(values).0
}

/// Median, and third quartile minus first, linear between neighbours. NaN for no value.
fn median_and_spread(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    let at = |fraction: f64| {
        let place = fraction * (values.len().saturating_sub(1)) as f64;
        let (low, high) = (place.floor() as usize, place.ceil() as usize);
        match (values.get(low), values.get(high)) {
            (Some(a), Some(b)) => a + (b - a) * place.fract(),
            _ => f64::NAN,
        }
    };
    (at(0.5), at(0.75) - at(0.25))
}

/// The records of a folder.
#[derive(Debug)]
pub(crate) struct Records {
    path: PathBuf,
    file: File,
    /// By key; a later line takes the place of an earlier one.
    by_key: BTreeMap<String, Record>,
}

impl Records {
    /// Opens the folder's records, or begins them; `fresh` drops those that are there.
    pub(crate) fn open(folder: &Path, fresh: bool) -> Result<Self, CliError> {
        let path = folder.join(FILE);
        let fault = |source| CliError::Write { path: path.clone(), source };
        fs::create_dir_all(folder).map_err(fault)?;
        let text = if fresh || !path.exists() { String::new() } else { load(&path)? };
        // A line cut short is taken away before the next one follows it; whole lines stay as they are.
        let whole = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
        let by_key = parse(&path, whole)?;
        if fresh || whole.len() < text.len() {
            write::bytes(&path, whole.as_bytes())?;
        }
        let file = OpenOptions::new().create(true).append(true).open(&path).map_err(fault)?;
        Ok(Self { path, file, by_key })
    }

    /// Whether the cell was measured on this machine with this seed and ground truth.
    pub(crate) fn holds(&self, key: &str, machine: &Machine, seed: u64, truth_samples: u32) -> bool {
        self.by_key.get(key).is_some_and(|record| {
            record.machine == *machine && record.seed == seed && record.truth_samples == truth_samples
        })
    }

    /// Adds a cell, on disk at once.
    pub(crate) fn add(&mut self, record: Record) -> Result<(), CliError> {
        let fault = |source| CliError::Write { path: self.path.clone(), source };
        self.file.write_all(&line(&record)?).and_then(|()| self.file.sync_data()).map_err(fault)?;
        self.by_key.insert(record.key.clone(), record);
        Ok(())
    }

    /// All of them, by key.
    pub(crate) fn into_all(self) -> Vec<Record> {
        self.by_key.into_values().collect()
    }
}

/// The records of several folders as one; of equal keys the last folder's counts.
pub(crate) fn merge(folders: &[PathBuf]) -> Result<Vec<Record>, CliError> {
    let mut by_key = BTreeMap::new();
    for folder in folders {
        let path = folder.join(FILE);
        by_key.extend(parse(&path, &load(&path)?)?);
    }
    Ok(by_key.into_values().collect())
}

/// Writes the records as a folder's own.
pub(crate) fn write_all(folder: &Path, records: &[Record]) -> Result<(), CliError> {
    let mut text = Vec::new();
    for record in records {
        text.extend(line(record)?);
    }
    Ok(write::bytes(&folder.join(FILE), &text)?)
}

fn line(record: &Record) -> Result<Vec<u8>, CliError> {
    let mut line = serde_json::to_vec(record)
        .map_err(|source| CliError::Encode { what: FILE, source: source.into() })?;
    line.push(b'\n');
    Ok(line)
}

fn load(path: &Path) -> Result<String, CliError> {
    fs::read_to_string(path).map_err(|source| CliError::ReadRecords { path: path.to_owned(), source })
}

/// The records in a file's text; of equal keys the last line's counts.
fn parse(path: &Path, text: &str) -> Result<BTreeMap<String, Record>, CliError> {
    let mut by_key = BTreeMap::new();
    for (number, line) in text.split_inclusive('\n').enumerate() {
        // A line without its end was cut short: the cell is measured again.
        let Some(line) = line.strip_suffix('\n') else { break };
        let record: Record = serde_json::from_str(line).map_err(|source| CliError::Record {
            path: path.to_owned(),
            line: number + 1,
            source,
        })?;
        by_key.insert(record.key.clone(), record);
    }
    Ok(by_key)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A record with these figures, for tests of what is made of them.
    pub(crate) fn record(scene: &str, label: &str, ms: f64, rmse: f64) -> Record {
        let (technique, variant) = label.split_once(' ').unwrap();
        Record {
            key: format!("{scene} {label}"),
            scene: scene.into(),
            point: None,
            light: "rect".into(),
            extended: true,
            width: 8,
            height: 8,
            triangles: 10,
            lit: 0.5,
            penumbra: 0.25,
            umbra: 0.25,
            truth_samples: 1024,
            truth_noise: 0.001,
            label: label.into(),
            technique: technique.into(),
            variant: variant.into(),
            preset: None,
            is_default: true,
            backend: "cpu".into(),
            adapter: None,
            settings: Value::Null,
            seed: 0,
            machine: Machine::this(),
            features: None,
            tried: None,
            outcome: Outcome::Measured(Measured {
                runs: 3,
                prepare_ms: ms / 2.0,
                prepare_spread_ms: 0.0,
                shade_ms: ms / 2.0,
                shade_spread_ms: 0.0,
                survives_camera: true,
                bytes: 1000,
                mae: rmse / 2.0,
                rmse,
                p99: rmse * 3.0,
                pen_rmse: Some(2.0 * rmse),
                skipped: BTreeMap::new(),
            }),
        }
    }

    #[test]
    fn medians_and_quartiles() {
        assert_eq!(median_and_spread(vec![3.0, 1.0, 2.0, 5.0, 4.0]), (3.0, 2.0));
        assert_eq!(median_and_spread(vec![2.0]), (2.0, 0.0));
        assert!(median_and_spread(Vec::new()).0.is_nan());
    }

    #[test]
    fn an_interrupted_run_goes_on_where_it_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["rays 4", "rays 16"].map(|label| record("ball", label, 2.0, 0.1));
        let mut records = Records::open(folder.path(), false).unwrap();
        records.add(a.clone()).unwrap();
        records.add(b.clone()).unwrap();
        // The second line is cut short.
        let path = folder.path().join(FILE);
        let text = fs::read(&path).unwrap();
        fs::write(&path, &text[..text.len() - 10]).unwrap();
        let mut records = Records::open(folder.path(), false).unwrap();
        let holds = |records: &Records, r: &Record| records.holds(&r.key, &r.machine, 0, 1024);
        assert!(holds(&records, &a) && !holds(&records, &b));
        assert!(!records.holds(&a.key, &a.machine, 1, 1024), "another seed is another cell");
        records.add(b.clone()).unwrap();
        assert_eq!(merge(&[folder.path().to_owned()]).unwrap(), [b, a]);
        assert!(Records::open(folder.path(), true).unwrap().into_all().is_empty());
    }

    #[test]
    fn a_line_that_is_no_record_is_named() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(FILE), "{\"key\": 1}\n").unwrap();
        let error = Records::open(folder.path(), false).unwrap_err();
        assert!(matches!(error, CliError::Record { line: 1, .. }), "{error}");
    }
}
