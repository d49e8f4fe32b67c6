//! Who may write to which stream.

use std::process::Stdio;

use crate::workbench::Workbench;

#[test]
fn json_is_one_object_and_messages_go_elsewhere() {
    let bench = Workbench::new();
    let tiny = ["--size", "8x8", "--out", "out", "--json"];
    let with_tiny = |command: &[&'static str]| [command, &tiny[..]].concat();
    for command in [
        with_tiny(&["render", "quads", "--technique", "shadow-map"]),
        with_tiny(&["reference", "quads", "--samples", "2"]),
        with_tiny(&["compare", "quads", "--samples", "2"]),
        vec!["--json", "techniques"],
        vec!["--json", "scenes"],
    ] {
        bench.done(&command).json();
    }
    assert_eq!(
        bench.done(&with_tiny(&["compare", "quads", "--samples", "2"])).json(),
        bench.json("out/report.json")
    );
}

#[test]
fn no_progress_bar_in_a_pipe() {
    let bench = Workbench::new();
    let said = bench.done(&["compare", "quads", "--size", "8x8", "--samples", "2", "--out", "out"]);
    assert!(!said.stderr.contains('\u{1b}') && !said.stderr.contains('\r'), "{}", said.stderr);
    assert!(said.stdout.contains("pen_rmse") && said.stdout.contains("shadow-map"));
    let place = bench.path("out").join("index.html");
    assert!(place.exists() && said.stderr.contains("index.html"));
}

#[test]
fn a_reader_that_has_gone_is_no_fault() {
    let bench = Workbench::new();
    for arguments in [&["scenes"][..], &["techniques", "--json"], &["--help"], &["--version"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = bench.command(arguments);
        let output = command.stdout(writer).stderr(Stdio::piped()).output().unwrap();
        assert_eq!((output.status.code(), &output.stderr[..]), (Some(0), &b""[..]), "{arguments:?}");
    }
}

#[test]
fn a_closed_stderr_stops_nothing() {
    let bench = Workbench::new();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut command = bench.command(&["compare", "quads", "--size", "8x8", "--samples", "2", "--out", "out"]);
    assert!(command.stdout(Stdio::null()).stderr(writer).status().unwrap().success());
    assert!(bench.path("out/index.html").exists());
}
