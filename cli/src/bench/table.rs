//! `results.csv`, and the table for a terminal.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::front::{Error, Place, Time, by_scene, pareto, places, rays_ms_at, soft_means, soft_scenes};
use super::record::{Outcome, Record};
use super::station::Axis;
use crate::compare::table::{aligned, error_text, milliseconds};
use crate::error::CliError;

/// A row of `results.csv`: a record without what JSON alone can hold.
#[derive(Serialize)]
struct CsvRow<'a> {
    scene: &'a str,
    axis: Option<&'static str>,
    axis_value: Option<f64>,
    light: &'a str,
    width: u32,
    height: u32,
    triangles: usize,
    penumbra: f64,
    label: &'a str,
    technique: &'a str,
    variant: &'a str,
    preset: &'a str,
    backend: &'a str,
    adapter: &'a str,
    prepare_ms: Option<f64>,
    prepare_spread_ms: Option<f64>,
    shade_ms: Option<f64>,
    shade_spread_ms: Option<f64>,
    survives_camera: Option<bool>,
    bytes: Option<u64>,
    mae: Option<f64>,
    rmse: Option<f64>,
    p99: Option<f64>,
    pen_rmse: Option<f64>,
    truth_samples: u32,
    truth_noise: f64,
    seed: u64,
    processor: &'a str,
    threads: usize,
    version: &'a str,
    refused: &'a str,
}

/// `results.csv`.
pub(crate) fn csv(records: &[Record]) -> Result<Vec<u8>, CliError> {
    let encode =
        |source: Box<dyn std::error::Error + Send + Sync>| CliError::Encode { what: "results.csv", source };
    let mut writer = csv::Writer::from_writer(Vec::new());
    for record in records {
        let measured = record.measured();
        let row = CsvRow {
            scene: &record.scene,
            axis: record.point.map(|point| point.axis.label()),
            axis_value: record.point.map(|point| point.value),
            light: &record.light,
            width: record.width,
            height: record.height,
            triangles: record.triangles,
            penumbra: record.penumbra,
            label: &record.label,
            technique: &record.technique,
            variant: &record.variant,
            preset: record.preset.as_deref().unwrap_or_default(),
            backend: &record.backend,
            adapter: record.adapter.as_deref().unwrap_or_default(),
            prepare_ms: measured.map(|m| m.prepare_ms),
            prepare_spread_ms: measured.map(|m| m.prepare_spread_ms),
            shade_ms: measured.map(|m| m.shade_ms),
            shade_spread_ms: measured.map(|m| m.shade_spread_ms),
            survives_camera: measured.map(|m| m.survives_camera),
            bytes: measured.map(|m| m.bytes),
            mae: measured.map(|m| m.mae),
            rmse: measured.map(|m| m.rmse),
            p99: measured.map(|m| m.p99),
            pen_rmse: measured.and_then(|m| m.pen_rmse),
            truth_samples: record.truth_samples,
            truth_noise: record.truth_noise,
            seed: record.seed,
            processor: &record.machine.processor,
            threads: record.machine.threads,
            version: &record.machine.version,
            refused: match &record.outcome {
                Outcome::Refused(why) => why,
                Outcome::Measured(_) => "",
            },
        };
        writer.serialize(row).map_err(|error| encode(error.into()))?;
    }
    writer.into_inner().map_err(|error| encode(error.to_string().into()))
}

/// For a terminal: the means over soft scenes, the Pareto front of every scene, fastest first, and the cost curves.
pub(crate) fn text(records: &[Record]) -> String {
    let mut text = overall(records);
    text.push_str(&fronts(records));
    for (scene, records) in by_scene(records) {
        let places = places(records.iter().copied(), Time::Whole, Error::Rmse);
        text.push_str(&format!("{scene}\n{}\n", front(&places)));
    }
    for axis in [Axis::Triangles, Axis::Image, Axis::Map, Axis::Light] {
        text.push_str(&curve(axis, records));
    }
    text
}

/// The front of the geometric means over soft scenes, whole and while only the camera moves.
fn overall(records: &[Record]) -> String {
    let soft = soft_scenes(records);
    if soft.len() < 2 {
        return String::new();
    }
    let mut text = String::new();
    for (time, what) in
        [(Time::Whole, "prepare and shade"), (Time::Frame, "a frame while only the camera moves")]
    {
        let means = soft_means(&soft, time, Error::Rmse);
        text.push_str(&format!("{} soft scenes, geometric means, {what}\n{}\n", soft.len(), front(&means)));
    }
    text
}

/// On the front of how many scenes each technique is with one of its contenders, whole and while only the camera moves, and of
/// which one it is with the most.
fn fronts(records: &[Record]) -> String {
    let scenes = by_scene(records);
    if scenes.len() < 2 {
        return String::new();
    }
    let heading = ["on the front of so many scenes", "whole", "frame", "mostly on"];
    let mut lines = vec![heading.map(str::to_owned)];
    let mut on: BTreeMap<&str, [BTreeMap<&str, usize>; 2]> = BTreeMap::new();
    for record in records {
        on.entry(&record.technique).or_default();
    }
    for (scene, records) in &scenes {
        for (index, time) in [Time::Whole, Time::Frame].into_iter().enumerate() {
            for place in pareto(&places(records.iter().copied(), time, Error::Rmse)) {
                if let Some(scenes) = on.get_mut(&*place.technique) {
                    *scenes[index].entry(scene).or_insert(0) += 1;
                }
            }
        }
    }
    for (technique, [whole, frame]) in &on {
        let most = whole.iter().chain(frame).max_by_key(|(_, count)| **count);
        let most = most.map_or("-", |(scene, _)| scene);
        let of = |on: &BTreeMap<&str, usize>| format!("{} of {}", on.len(), scenes.len());
        lines.push([format!("  {technique}"), of(whole), of(frame), most.to_owned()]);
    }
    format!("{}\n", aligned(&lines))
}

/// The places that nothing beats, beside what ray tracing takes for the same error, plain and with skipping.
fn front(places: &[Place]) -> String {
    let heading = ["  nothing is both faster and closer than", "ms", "rmse", "plain rays / it", "rays / it"];
    let mut lines = vec![heading.map(str::to_owned)];
    for place in pareto(places) {
        let rays = |skipping: bool| {
            rays_ms_at(places, place.error, skipping)
                .filter(|_| !place.is_rays())
                .map_or_else(|| "-".to_owned(), |ms| format!("{:.1}x", ms / place.ms))
        };
        lines.push([
            format!("  {}", place.name),
            milliseconds(place.ms),
            error_text(place.error),
            rays(false),
            rays(true),
        ]);
    }
    aligned(&lines)
}

/// Milliseconds of every contender over one axis; nothing where it was not measured.
fn curve(axis: Axis, records: &[Record]) -> String {
    let mut rows: BTreeMap<String, BTreeMap<u64, f64>> = BTreeMap::new();
    for record in records {
        if let (Some(point), Some(measured)) = (record.point.filter(|p| p.axis == axis), record.measured()) {
            // Bits of positive numbers are in the order of the numbers.
            rows.entry(record.name()).or_default().insert(point.value.to_bits(), measured.whole_ms());
        }
    }
    let values: BTreeSet<u64> = rows.values().flat_map(|row| row.keys().copied()).collect();
    if values.is_empty() {
        return String::new();
    }
    let mut text = format!("{:<36}", format!("ms by {}", axis.label()));
    for value in &values {
        text.push_str(&format!(" {:>9}", f64::from_bits(*value)));
    }
    text.push('\n');
    for (name, row) in rows {
        text.push_str(&format!("  {name:<34}"));
        for value in &values {
            let cell = row.get(value).map_or_else(|| "-".to_owned(), |ms| milliseconds(*ms));
            text.push_str(&format!(" {cell:>9}"));
        }
        text.push('\n');
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::super::record::tests::record;
    use super::*;

    #[test]
    fn one_line_a_record_and_one_front_a_scene() {
        let records = [
            record("ball", "rays 4", 2.0, 0.1),
            record("ball", "shadow-map hard", 1.0, 0.2),
            record("quads", "rays 4", 2.0, 0.1),
            record("quads", "shadow-map hard", 3.0, 0.2),
        ];
        let csv = String::from_utf8(csv(&records).unwrap()).unwrap();
        assert_eq!(csv.lines().count(), 5);
        assert!(csv.starts_with("scene,axis,axis_value,light,"));
        let text = text(&records);
        // On one of the two scenes, and in both means.
        assert_eq!(text.matches("  shadow-map hard ").count(), 3, "{text}");
        let of = |technique: &str| {
            let mut lines = text.lines().skip_while(|line| !line.contains("on the front"));
            let line = lines.find(|line| line.trim_start().starts_with(technique)).unwrap();
            line.split_whitespace().skip(1).take(6).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(
            (of("shadow-map "), of("rays ")),
            ("1 of 2 1 of 2".into(), "2 of 2 2 of 2".into()),
            "{text}"
        );
        assert!(text.matches("  rays 4 ").count() >= 2, "{text}");
        assert!(text.contains("2 soft scenes"), "{text}");
    }
}
