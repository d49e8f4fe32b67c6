//! What contenders came to on scenes: the measurements a model is fitted on, as a CSV file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::features::Features;
use super::preview::Tried;
use crate::bench::front::{Error, Place, RAYS, Time, by_scene, pareto, places};
use crate::bench::record::Record;
use crate::error::CliError;
use crate::techniques::label;

/// The measurements this build comes with.
const SHIPPED: &str = include_str!("data.csv");

/// The shipped file's name in messages.
const SHIPPED_NAME: &str = "the data of this build";

/// A contender never within this factor of a front, in time or in error, is left out of the file: it would never be picked.
const REACH: f64 = 1.5;

/// A line: one contender on one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Line {
    pub(crate) scene: String,
    triangles: f64,
    pixels: f64,
    hard_rmse: f64,
    penumbra: f64,
    width: f64,
    pub(crate) technique: String,
    pub(crate) preset: Option<String>,
    pub(crate) variant: String,
    prepare_ms: f64,
    shade_ms: f64,
    survives_camera: bool,
    pub(crate) rmse: f64,
    tried_prepare_ms: Option<f64>,
    tried_shade_ms: Option<f64>,
    tried_rmse: Option<f64>,
}

/// Measurements by scene. Times are of one machine.
#[derive(Clone, Debug)]
pub(crate) struct Data {
    pub(crate) scenes: BTreeMap<String, Vec<Line>>,
}

impl Line {
    fn new(record: &Record) -> Option<Self> {
        let (features, measured) = (record.features?, record.measured()?);
        let is_candidate = record.technique != RAYS && record.backend == "cpu" && record.extended;
        is_candidate.then(|| Self {
            scene: format!("{} {}x{}", record.scene, record.width, record.height),
            triangles: features.triangles,
            pixels: digits(features.pixels),
            hard_rmse: digits(features.hard_rmse),
            penumbra: digits(features.penumbra),
            width: digits(features.width),
            technique: record.technique.clone(),
            preset: record.preset.clone(),
            variant: record.variant.clone(),
            prepare_ms: digits(measured.prepare_ms),
            shade_ms: digits(measured.shade_ms),
            survives_camera: measured.survives_camera,
            rmse: digits(measured.rmse.max(record.truth_noise)),
            tried_prepare_ms: record.tried.map(|tried| digits(tried.prepare_ms)),
            tried_shade_ms: record.tried.map(|tried| digits(tried.shade_ms)),
            tried_rmse: record.tried.map(|tried| digits(tried.rmse)),
        })
    }

    /// What the scene is like.
    pub(crate) fn features(&self) -> Features {
        let &Self { triangles, pixels, hard_rmse, penumbra, width, .. } = self;
        Features { triangles, pixels, hard_rmse, penumbra, width }
    }

    /// Name, preset and variant.
    pub(crate) fn label(&self) -> String {
        label(&self.technique, self.preset.as_deref(), &self.variant)
    }

    /// Milliseconds, whole or of a frame while only the camera moves.
    pub(crate) fn ms(&self, time: Time) -> f64 {
        milliseconds(self.prepare_ms, self.shade_ms, self.survives_camera, time)
    }

    /// What it came to on the preview.
    pub(crate) fn tried(&self) -> Option<Tried> {
        Some(Tried {
            prepare_ms: self.tried_prepare_ms?,
            shade_ms: self.tried_shade_ms?,
            survives_camera: self.survives_camera,
            rmse: self.tried_rmse?,
        })
    }
}

impl Tried {
    /// Milliseconds, whole or of a frame while only the camera moves.
    pub(crate) fn ms(&self, time: Time) -> f64 {
        milliseconds(self.prepare_ms, self.shade_ms, self.survives_camera, time)
    }
}

fn milliseconds(prepare: f64, shade: f64, survives_camera: bool, time: Time) -> f64 {
    if time == Time::Frame && survives_camera { shade } else { prepare + shade }
}

/// Four significant digits: what a measurement has.
fn digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

impl Data {
    /// The measurements of `file`, or those this build comes with.
    pub(crate) fn load(file: Option<&Path>) -> Result<Self, CliError> {
        let Some(path) = file else { return Self::parse(SHIPPED, Path::new(SHIPPED_NAME)) };
        let text = std::fs::read_to_string(path)
            .map_err(|source| CliError::ReadRecords { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    fn parse(text: &str, path: &Path) -> Result<Self, CliError> {
        let mut scenes: BTreeMap<String, Vec<Line>> = BTreeMap::new();
        for line in csv::Reader::from_reader(text.as_bytes()).into_deserialize() {
            let line: Line =
                line.map_err(|source| CliError::Measurements { path: path.to_owned(), source })?;
            scenes.entry(line.scene.clone()).or_default().push(line);
        }
        Ok(Self { scenes })
    }

    /// What a model can learn from records: lines of contenders that come near a front somewhere.
    pub(crate) fn from_records(records: &[Record]) -> Self {
        let mut scenes: BTreeMap<String, Vec<Line>> = BTreeMap::new();
        let near = near_a_front(records);
        for line in records.iter().filter(|record| record.point.is_none()).filter_map(Line::new) {
            if near.contains(&line.label()) {
                scenes.entry(line.scene.clone()).or_default().push(line);
            }
        }
        Self { scenes }
    }

    /// As a CSV file.
    pub(crate) fn csv(&self) -> Result<Vec<u8>, CliError> {
        let encode = |source: Box<dyn std::error::Error + Send + Sync>| CliError::Encode {
            what: "recommend.csv",
            source,
        };
        let mut writer = csv::Writer::from_writer(Vec::new());
        for line in self.scenes.values().flatten() {
            writer.serialize(line).map_err(|error| encode(error.into()))?;
        }
        writer.into_inner().map_err(|error| encode(error.to_string().into()))
    }
}

/// Labels of techniques within [`REACH`] of the front of techniques on some scene, by either way of counting time.
fn near_a_front(records: &[Record]) -> BTreeSet<String> {
    let mut near = BTreeSet::new();
    for records in by_scene(records).into_values() {
        for time in [Time::Whole, Time::Frame] {
            let candidates = records.iter().copied().filter(|r| r.technique != RAYS && r.backend == "cpu");
            let places = places(candidates, time, Error::Rmse);
            let front = pareto(&places);
            let is_near = |place: &&Place| {
                !front.iter().any(|f| f.ms * REACH < place.ms && f.error < place.error)
                    || !front.iter().any(|f| f.ms < place.ms && f.error * REACH < place.error)
            };
            near.extend(places.iter().filter(is_near).map(|place| place.name.clone()));
        }
    }
    near
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let data = Data::load(None).unwrap();
        let text = data.csv().unwrap();
        let again = Data::parse(std::str::from_utf8(&text).unwrap(), Path::new("again")).unwrap();
        assert_eq!(data.scenes, again.scenes);
    }

    #[test]
    fn a_line_that_is_no_measurement_is_named() {
        let error = Data::parse("scene,triangles\nball,many\n", Path::new("x.csv")).unwrap_err();
        assert!(matches!(error, CliError::Measurements { .. }));
        assert!(error.to_string().contains("x.csv"), "{error}");
    }
}
