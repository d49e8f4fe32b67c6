//! The errors of every variant, in snapshots: one that grows fails.
//!
//! What is kept is rmse and `pen_rmse` against ground truth. An error within [`GROWTH`] above and [`GAIN`] below what is kept counts as
//! that: processors round differently. Beyond that the snapshot differs; an error that became smaller is accepted like any
//! other change, and from then on guarded.

use std::collections::BTreeMap;

use crate::workbench::Workbench;

/// By how much an error may grow, and by how much shrink, before it is another one.
const GROWTH: f64 = 1.02;
const GAIN: f64 = 0.9;

/// What two processors' roundings may change: one pixel of this picture that goes from lit to dark.
const ONE_PIXEL: f64 = 1.0 / (SIDES.0 * SIDES.1) as f64;
const SIDES: (u32, u32) = (128, 96);

/// The figures of a scene, by label: rmse and `pen_rmse`.
fn measured(scene: &str) -> BTreeMap<String, [f64; 2]> {
    let work = Workbench::new();
    let size = format!("{}x{}", SIDES.0, SIDES.1);
    let line = ["compare", scene, "--variants", "--backend", "cpu", "--size", &size, "--out", "o"];
    work.done(&line);
    let report = work.json("o/report.json");
    let figure = |errors: &serde_json::Value, name: &str| errors[name].as_f64().unwrap_or(f64::NAN);
    let techniques = report["techniques"].as_array().unwrap().iter();
    techniques
        .map(|entry| {
            let errors = &entry["errors"];
            let label = entry["label"].as_str().unwrap().to_owned();
            (label, [figure(errors, "rmse"), figure(errors, "pen_rmse")])
        })
        .collect()
}

/// The figures that a snapshot keeps.
fn kept(scene: &str) -> BTreeMap<String, [f64; 2]> {
    let path = format!("{}/tests/cli/snapshots/cli__errors__{scene}.snap", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let figures = |line: &str| {
        let mut words = line.rsplitn(3, char::is_whitespace);
        let (pen_rmse, rmse) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
        Some((words.next()?.trim().to_owned(), [rmse, pen_rmse]))
    };
    text.lines().filter_map(figures).collect()
}

/// `now`, or what was kept if that is the same but for rounding.
fn stated(now: f64, before: f64) -> f64 {
    let grown = (now.powi(2) - ONE_PIXEL).max(0.0).sqrt() > before * GROWTH;
    let shrunk = (now.powi(2) + ONE_PIXEL).sqrt() < before * GAIN;
    if grown || shrunk || before.is_nan() { now } else { before }
}

fn table(scene: &str) -> String {
    let kept = kept(scene);
    let line = |(label, now): (String, [f64; 2])| {
        let before = kept.get(&label).copied().unwrap_or([f64::NAN; 2]);
        let [rmse, pen_rmse] = [0, 1].map(|i| stated(now[i], before[i]));
        format!("{label:<40} {rmse:.4} {pen_rmse:.4}\n")
    };
    measured(scene).into_iter().map(line).collect()
}

#[test]
fn errors_do_not_grow() {
    for scene in ["ball", "fence", "street"] {
        insta::assert_snapshot!(scene, table(scene));
    }
}

#[test]
fn an_error_that_grows_is_another_one() {
    assert_eq!(stated(0.0501, 0.05), 0.05);
    assert_eq!(stated(0.06, 0.05), 0.06);
    assert_eq!(stated(0.03, 0.05), 0.03);
    assert_eq!(stated(0.001, 0.0), 0.0);
    assert_eq!(stated(0.02, 0.0), 0.02);
}
