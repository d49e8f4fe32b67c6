//! Baking into a file, and rendering from it.

use crate::workbench::Workbench;

const BAKE: [&str; 8] =
    ["bake", "quads", "--set", "views=4", "--set", "map_size=32", "--set", "pdsm_size=32"];

fn render<'a>(file: &'a str, scene: &'a str) -> [&'a str; 8] {
    ["render", scene, "--baked", file, "--size", "32x24", "--out", "out"]
}

#[test]
fn what_was_baked_is_rendered() {
    let bench = Workbench::new();
    let said = bench.done(&[&BAKE[..], &["-o", "quads.pdsm", "--json"]].concat());
    let report: serde_json::Value = serde_json::from_str(&said.stdout).unwrap();
    let length = std::fs::metadata(bench.path("quads.pdsm")).unwrap().len();
    assert_eq!((report["file_bytes"].as_u64(), report["technique"].as_str()), (Some(length), Some("pdsm")));
    assert_eq!(bench.names("."), ["quads.pdsm"]);
    bench.done(&render("quads.pdsm", "quads"));
    let settings = &bench.json("out/report.json")["settings"];
    assert_eq!((settings["views"].as_u64(), settings["pdsm_size"].as_u64()), (Some(4), Some(32)));
    let (_, baked) = bench.npy::<f32>("out/visibility.npy");
    let built = ["render", "quads", "--technique", "pdsm", "--size", "32x24", "--out", "built"];
    bench.done(&[&built[..], &BAKE[2..]].concat());
    let (_, built) = bench.npy::<f32>("built/visibility.npy");
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&baked), bits(&built));
}

/// The ball may move, and nothing else is before the ground.
#[test]
fn an_empty_file_is_told() {
    let bench = Workbench::new();
    let said = bench.done(&["bake", "ball", "-o", "ball.pdsm"]);
    assert!(said.stderr.contains("nothing that stands still"), "{}", said.stderr);
    bench.done(&render("ball.pdsm", "ball"));
}

#[test]
fn what_does_not_fit_is_told() {
    let bench = Workbench::new();
    bench.done(&[&BAKE[..], &["-o", "quads.pdsm"]].concat());
    let mut bytes = std::fs::read(bench.path("quads.pdsm")).unwrap();
    bench.write("short.pdsm", &bytes[..bytes.len() / 2]);
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    bench.write("altered.pdsm", &bytes);
    bench.write("other.pdsm", b"something else");
    for (file, scene, fault) in [
        ("short.pdsm", "quads", "cut short"),
        ("altered.pdsm", "quads", "altered"),
        ("other.pdsm", "quads", "not a baked PDSM"),
        ("none.pdsm", "quads", "none.pdsm"),
        ("quads.pdsm", "ball", "another light"),
        ("quads.pdsm", "quads:squares=2", "other casters"),
    ] {
        let said = bench.run(&render(file, scene));
        assert_eq!((said.code, said.stdout.as_str()), (2, ""), "{file}: {}", said.stderr);
        assert!(said.stderr.contains(fault), "{file}: {}", said.stderr);
    }
    assert!(!bench.path("out").exists());
}
