//! Time and error of every contender on a scene that it was never measured on.

use std::collections::BTreeMap;

use super::data::{Data, Line};
use super::features::Features;
use super::preview::Tried;
use super::regression::Regression;
use crate::bench::front::Time;

/// An error of a thousandth more changes nothing that one sees, and keeps logarithms of small errors from ruling a fit.
const ERROR_FLOOR: f64 = 1e-3;

/// What is expected of a contender.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Expected {
    /// Milliseconds on the machine of the data.
    pub(crate) ms: f64,
    pub(crate) rmse: f64,
    /// Factor by which time or error are off, typically: the exponential of the deviations of their logarithms.
    pub(crate) ms_factor: f64,
    pub(crate) rmse_factor: f64,
}

/// Regressions of the logarithms of time and error.
#[derive(Clone, Debug)]
struct Fit {
    ms: Regression,
    rmse: Regression,
}

/// One contender's.
#[derive(Clone, Debug)]
struct OfContender {
    /// From the scene's features alone.
    at_sight: Fit,
    /// From these and what it came to on the preview.
    tried: Option<Fit>,
}

/// Fitted to measurements.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    contenders: BTreeMap<String, OfContender>,
}

impl Model {
    /// Fits `data`, all of it or all but the scene `left_out`.
    pub(crate) fn new(data: &Data, time: Time, left_out: Option<&str>) -> Self {
        let mut lines: BTreeMap<String, Vec<&Line>> = BTreeMap::new();
        for (_, of_scene) in data.scenes.iter().filter(|(scene, _)| Some(scene.as_str()) != left_out) {
            for line in of_scene {
                lines.entry(line.label()).or_default().push(line);
            }
        }
        let fitted = lines.into_iter().filter_map(|(label, lines)| {
            let at_sight = fit(&lines, time, |line| Some([features_of(line), features_of(line)]))?;
            let tried = fit(&lines, time, |line| Some(with_tried(&features_of(line), &line.tried()?, time)));
            Some((label, OfContender { at_sight, tried }))
        });
        Self { contenders: fitted.collect() }
    }

    /// Every contender that was measured often enough, from features alone.
    pub(crate) fn at_sight(&self, features: &Features) -> Vec<(&str, Expected)> {
        let features = features.logarithms();
        let expected = |of: &OfContender| of.at_sight.at(&features, &features);
        self.contenders.iter().map(|(label, of)| (label.as_str(), expected(of))).collect()
    }

    /// A contender that was tried on the preview.
    pub(crate) fn after_trial(
        &self,
        label: &str,
        features: &Features,
        tried: &Tried,
        time: Time,
    ) -> Option<Expected> {
        let of = self.contenders.get(label)?;
        let features = features.logarithms();
        Some(match &of.tried {
            None => of.at_sight.at(&features, &features),
            Some(fit) => {
                let [ms, rmse] = with_tried(&features, tried, time);
                fit.at(&ms, &rmse)
            }
        })
    }
}

fn features_of(line: &Line) -> Vec<f64> {
    line.features().logarithms()
}

/// Features with what a trial says of time, and with what it says of the error.
fn with_tried(features: &[f64], tried: &Tried, time: Time) -> [Vec<f64>; 2] {
    let with = |last: f64| features.iter().copied().chain([last]).collect();
    [with(tried.ms(time).max(1e-3).ln()), with((tried.rmse + ERROR_FLOOR).ln())]
}

/// Fits time and error to the lines that have features.
fn fit(lines: &[&Line], time: Time, features: impl Fn(&Line) -> Option<[Vec<f64>; 2]>) -> Option<Fit> {
    let (mut ms_rows, mut rmse_rows, mut ms, mut rmse) = (vec![], vec![], vec![], vec![]);
    for line in lines {
        if let Some([ms_row, rmse_row]) = features(line) {
            ms_rows.push(ms_row);
            rmse_rows.push(rmse_row);
            ms.push(line.ms(time).max(1e-3).ln());
            rmse.push((line.rmse + ERROR_FLOOR).ln());
        }
    }
    Some(Fit { ms: Regression::new(&ms_rows, &ms)?, rmse: Regression::new(&rmse_rows, &rmse)? })
}

impl Fit {
    fn at(&self, ms_features: &[f64], rmse_features: &[f64]) -> Expected {
        Expected {
            ms: self.ms.at(ms_features).exp(),
            rmse: (self.rmse.at(rmse_features).exp() - ERROR_FLOOR).max(0.0),
            ms_factor: self.ms.deviation.exp(),
            rmse_factor: self.rmse.deviation.exp(),
        }
    }
}
