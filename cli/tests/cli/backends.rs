//! `--backend`: where techniques run, and what happens where there is no GPU.

use serde_json::Value;

use crate::workbench::{Said, Workbench};

/// Runs a command with these variables, and without those that choose a GPU otherwise.
fn run(bench: &Workbench, variables: &[(&str, &str)], arguments: &[&str]) -> Said {
    let mut command = bench.command(arguments);
    command.env_remove("GNOMON_ADAPTER").envs(variables.iter().copied());
    let output = command.output().unwrap();
    Said {
        code: output.status.code().expect("the command was killed"),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Whether GPU tests are left out.
fn is_off() -> bool {
    cfg!(not(feature = "gpu"))
        || std::env::var("GNOMON_GPU").is_ok_and(|value| value.eq_ignore_ascii_case("off"))
}

const RENDER: [&str; 6] = ["render", "quads", "--technique", "shadow-map", "--size", "48x32"];
const COMPARE: [&str; 6] = ["compare", "quads", "--size", "48x32", "--samples", "4"];

#[test]
fn a_gpu_that_is_not_there() {
    let bench = Workbench::new();
    for command in [[&RENDER[..], &["--out", "o"]].concat(), [&COMPARE[..], &["--out", "o"]].concat()] {
        for (variables, words) in [
            ([("GNOMON_GPU", "off")], "GNOMON_GPU=off"),
            ([("GNOMON_ADAPTER", "no adapter has this name")], "no adapter has this name"),
            // No driver at all.
            ([("VK_DRIVER_FILES", "/nowhere.json")], "mesa-vulkan-drivers"),
        ] {
            if cfg!(not(feature = "gpu")) || (is_off() && variables[0].0 != "GNOMON_GPU") {
                continue;
            }
            // Other interfaces than Vulkan would be found all the same.
            if variables[0].0 == "VK_DRIVER_FILES" && !cfg!(target_os = "linux") {
                continue;
            }
            let said = run(&bench, &variables, &[&command[..], &["--backend", "gpu"]].concat());
            assert_eq!(said.code, 3, "{variables:?}: {}", said.stderr);
            assert!(said.stderr.contains(words) && said.stderr.contains("--backend gpu"), "{}", said.stderr);
            assert!(said.stdout.is_empty() && bench.names(".").is_empty());
            // Where it is not required it is not missed.
            let said = run(&bench, &variables, &[&command[..], &["--backend", "auto"]].concat());
            assert_eq!(said.code, 0, "{}", said.stderr);
            std::fs::remove_dir_all(bench.path("o")).unwrap();
        }
    }
}

#[test]
fn the_report_says_what_it_ran_on() {
    if is_off() {
        return;
    }
    let bench = Workbench::new();
    let said = run(&bench, &[], &[&RENDER[..], &["--backend", "gpu", "--out", "o", "--json"]].concat());
    assert_eq!(said.code, 0, "{}", said.stderr);
    let report = said.json();
    assert_eq!(report["backend"], "gpu");
    let adapter = report["adapter"].as_str().unwrap();
    assert!(!adapter.is_empty());
    let stages: Vec<&String> = report["stages_ms"].as_object().unwrap().keys().collect();
    for step in ["prepare.", "shade."] {
        assert!(stages.iter().any(|stage| stage.starts_with(step)), "{stages:?}");
    }
    assert!(report["features"].is_array());
    assert_eq!(bench.names("o"), ["image.png", "report.json", "visibility.npy", "visibility.png"]);
    // The adapter can be forced, by a part of its name.
    let name = adapter.split([' ', '(']).next().unwrap();
    let said = run(
        &bench,
        &[("GNOMON_ADAPTER", name)],
        &[&RENDER[..], &["--backend", "gpu", "--out", "p", "--json"]].concat(),
    );
    assert_eq!(said.json()["adapter"], *adapter);
}

#[test]
fn both_backends_side_by_side() {
    if is_off() {
        return;
    }
    let bench = Workbench::new();
    let only = ["--techniques", "shadow-map@low", "--out", "o"];
    let said = run(&bench, &[], &[&COMPARE[..], &only, &["--backend", "cpu,gpu,cpu"]].concat());
    assert_eq!(said.code, 0, "{}", said.stderr);
    let report = bench.json("o/report.json");
    let rows = report["techniques"].as_array().unwrap();
    let of = |key: &str| -> Vec<&Value> { rows.iter().map(|row| &row[key]).collect() };
    assert_eq!(of("backend"), ["cpu", "gpu"]);
    assert_eq!(of("label"), ["shadow-map@low hard", "shadow-map@low hard (gpu)"]);
    // The same answers, so the same errors, up to a pixel or two on an outline.
    let rmse = |row: &Value| row["errors"]["rmse"].as_f64().unwrap();
    assert!((rmse(&rows[0]) - rmse(&rows[1])).abs() < 0.01, "{rows:?}");
}
