//! Who is ahead: Pareto fronts of time and error, means over scenes, and what ray tracing would take for the same error.

use std::collections::BTreeMap;

use super::contender::SKIPPING;
use super::record::{Measured, Record};

/// Which time counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Time {
    /// Prepare and shade.
    Whole,
    /// A frame while only the camera moves: what survives that is not prepared again.
    Frame,
}

/// Which error counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Error {
    Rmse,
    PenRmse,
}

impl Time {
    pub(crate) fn of(self, measured: &Measured) -> f64 {
        match self {
            Self::Whole => measured.whole_ms(),
            Self::Frame => measured.frame_ms(),
        }
    }
}

impl Error {
    /// None where there is no penumbra.
    pub(crate) fn of(self, measured: &Measured) -> Option<f64> {
        match self {
            Self::Rmse => Some(measured.rmse),
            Self::PenRmse => measured.pen_rmse,
        }
    }

    /// Its name in tables.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Rmse => "rmse",
            Self::PenRmse => "pen_rmse",
        }
    }
}

/// A contender's place: milliseconds and error.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Place {
    pub(crate) name: String,
    pub(crate) technique: String,
    pub(crate) ms: f64,
    pub(crate) error: f64,
}

impl Place {
    /// Whether it is a row of ray tracing.
    pub(crate) fn is_rays(&self) -> bool {
        self.technique == RAYS
    }

    /// Whether it is a row of ray tracing with, or else without, proofs that leave rays out.
    pub(crate) fn is_rays_with(&self, skipping: bool) -> bool {
        self.is_rays() && self.name.ends_with(SKIPPING) == skipping
    }
}

/// What rows of ray tracing are called.
pub(crate) const RAYS: &str = "rays";

/// The places on one scene. An error below the noise of ground truth counts as that noise: nothing finer is known.
pub(crate) fn places<'a>(
    records: impl IntoIterator<Item = &'a Record>,
    time: Time,
    error: Error,
) -> Vec<Place> {
    let place = |record: &Record| {
        let measured = record.measured()?;
        Some(Place {
            name: record.name(),
            technique: record.technique.clone(),
            ms: time.of(measured),
            error: error.of(measured)?.max(record.truth_noise).max(f64::MIN_POSITIVE),
        })
    };
    records.into_iter().filter_map(place).collect()
}

/// Geometric means over scenes, of the contenders that were measured on every one of them.
fn geometric_means(scenes: &[Vec<Place>]) -> Vec<Place> {
    let mut sums: BTreeMap<&str, (usize, f64, f64, &str)> = BTreeMap::new();
    for place in scenes.iter().flatten() {
        let sum = sums.entry(&place.name).or_insert((0, 0.0, 0.0, &place.technique));
        *sum = (sum.0 + 1, sum.1 + place.ms.ln(), sum.2 + place.error.ln(), sum.3);
    }
    let everywhere = sums.into_iter().filter(|(_, sum)| sum.0 == scenes.len());
    let mean = |(name, (count, ms, error, technique)): (&str, (usize, f64, f64, &str))| Place {
        name: name.to_owned(),
        technique: technique.to_owned(),
        ms: (ms / count as f64).exp(),
        error: (error / count as f64).exp(),
    };
    everywhere.map(mean).collect()
}

/// The places that no other one beats in time and error at once, fastest first.
pub(crate) fn pareto(places: &[Place]) -> Vec<&Place> {
    let mut sorted: Vec<&Place> = places.iter().collect();
    sorted.sort_by(|a, b| a.ms.total_cmp(&b.ms).then(a.error.total_cmp(&b.error)));
    let mut best = f64::INFINITY;
    sorted.retain(|place| {
        let is_ahead = place.error < best;
        best = best.min(place.error);
        is_ahead
    });
    sorted
}

/// Milliseconds that ray tracing takes to an error: between its rows on a straight line in logarithms, beyond them on
/// the last such line; above the error of its fewest samples as long as these take. None without rows.
pub(crate) fn rays_ms_at(places: &[Place], error: f64, skipping: bool) -> Option<f64> {
    let mut rows: Vec<(f64, f64)> = places
        .iter()
        .filter(|place| place.is_rays_with(skipping))
        .map(|place| (place.error.ln(), place.ms.ln()))
        .collect();
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    rows.dedup_by(|a, b| a.0 == b.0);
    let wanted = error.ln();
    let first = rows.first()?;
    if rows.len() < 2 || wanted >= first.0 {
        return Some(first.1.exp());
    }
    let segment = rows.windows(2).find(|pair| wanted >= pair[1].0).unwrap_or(&rows[rows.len() - 2..]);
    let (a, b) = (segment[0], segment[1]);
    Some((a.1 + (b.1 - a.1) * (wanted - a.0) / (b.0 - a.0)).exp())
}

/// Records by scene, in order of names; points of cost curves are left out.
pub(crate) fn by_scene(records: &[Record]) -> BTreeMap<String, Vec<&Record>> {
    let mut scenes: BTreeMap<String, Vec<&Record>> = BTreeMap::new();
    for record in records.iter().filter(|record| record.point.is_none()) {
        let name = format!("{} {}x{}", record.scene, record.width, record.height);
        scenes.entry(name).or_default().push(record);
    }
    scenes
}

/// Scenes whose light throws penumbrae.
pub(crate) fn soft_scenes(records: &[Record]) -> Vec<Vec<&Record>> {
    let scenes = by_scene(records).into_values();
    scenes.filter(|records| records.iter().all(|r| r.extended && r.penumbra > 0.0)).collect()
}

/// Geometric means over soft scenes.
pub(crate) fn soft_means(soft: &[Vec<&Record>], time: Time, error: Error) -> Vec<Place> {
    let each: Vec<Vec<Place>> =
        soft.iter().map(|records| places(records.iter().copied(), time, error)).collect();
    geometric_means(&each)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(name: &str, ms: f64, error: f64) -> Place {
        let technique = name.split(' ').next().unwrap().to_owned();
        Place { name: name.to_owned(), technique, ms, error }
    }

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let places = [place("a", 1.0, 0.5), place("b", 2.0, 0.6), place("c", 3.0, 0.1), place("d", 3.0, 0.2)];
        let names: Vec<&str> = pareto(&places).iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["a", "c"]);
    }

    #[test]
    fn means_are_geometric_and_of_those_everywhere() {
        let scenes = [vec![place("a", 1.0, 0.1), place("b", 1.0, 1.0)], vec![place("a", 100.0, 0.001)]];
        let means = geometric_means(&scenes);
        assert_eq!(means.len(), 1);
        assert!((means[0].ms - 10.0).abs() < 1e-9 && (means[0].error - 0.01).abs() < 1e-9);
    }

    #[test]
    fn rays_are_interpolated_in_logarithms() {
        let rows =
            [place("rays 4", 1.0, 0.1), place("rays 16", 4.0, 0.025), place("rays 4 skipping", 0.5, 0.1)];
        let at = |error| rays_ms_at(&rows, error, false).unwrap();
        assert!((at(0.05) - 2.0).abs() < 1e-9);
        // Beyond its rows by the same law, above them as fast as the fewest samples.
        assert!((at(0.0125) - 8.0).abs() < 1e-9 && (at(0.9) - 1.0).abs() < 1e-9);
        assert_eq!(rays_ms_at(&rows, 0.01, true), Some(0.5));
        assert_eq!(rays_ms_at(&[], 0.1, true), None);
    }
}
