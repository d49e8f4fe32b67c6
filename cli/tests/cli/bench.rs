//! `gnomon bench`: what it writes, that it goes on where it stopped, and that shards fit together.

use std::collections::BTreeSet;

use crate::workbench::Workbench;

const BENCH: [&str; 10] = [
    "bench",
    "quads",
    "--techniques",
    "shadow-map",
    "--defaults",
    "--runs",
    "1",
    "--samples",
    "16",
    "--backend",
];

fn bench(bench: &Workbench, more: &[&str]) {
    let line: Vec<&str> = BENCH.iter().chain(&["cpu", "--size", "24x16"]).chain(more).copied().collect();
    bench.done(&line);
}

fn keys(bench: &Workbench, path: &str) -> BTreeSet<String> {
    let results = bench.json(path);
    results.as_array().unwrap().iter().map(|r| r["key"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn every_figure_is_written_and_what_is_measured_is_not_measured_again() {
    let work = Workbench::new();
    bench(&work, &["--out", "b"]);
    let names = work.names("b");
    for file in ["index.html", "results.csv", "results.json", "results.jsonl", "quads-24x16-rmse.svg"] {
        assert!(names.iter().any(|name| name == file), "{file} is not in {names:?}");
    }
    // One technique, and ray tracing with five counts, plain and skipping.
    assert_eq!(keys(&work, "b/results.json").len(), 1 + 2 * 5);
    let lines = std::fs::read_to_string(work.path("b/results.jsonl")).unwrap();
    bench(&work, &["--out", "b"]);
    let times = |text: &str| -> BTreeSet<String> { text.lines().map(str::to_owned).collect() };
    assert_eq!(times(&lines), times(&std::fs::read_to_string(work.path("b/results.jsonl")).unwrap()));
}

#[test]
fn shards_fit_together() {
    let work = Workbench::new();
    bench(&work, &["--out", "whole"]);
    bench(&work, &["--shard", "1/2", "--out", "one"]);
    bench(&work, &["--shard", "2/2", "--out", "two"]);
    work.done(&["bench", "--merge", "one,two", "--out", "merged"]);
    assert_eq!(keys(&work, "merged/results.json"), keys(&work, "whole/results.json"));
    assert!(keys(&work, "one/results.json").is_disjoint(&keys(&work, "two/results.json")));
}
