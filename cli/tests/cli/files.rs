//! What `render` and `reference` write.

use std::collections::BTreeSet;

use crate::workbench::Workbench;

const SIZE: [u64; 2] = [24, 32];

fn render(bench: &Workbench, more: &[&str]) {
    let command = ["render", "quads", "--technique", "shadow-map", "--size", "32x24", "--out", "out/r"];
    bench.done(&[&command[..], more].concat());
}

fn reference(bench: &Workbench, more: &[&str]) {
    let command = ["reference", "quads", "--size", "32x24", "--samples", "16", "--out", "out/t"];
    bench.done(&[&command[..], more].concat());
}

#[test]
fn render_writes_pictures_values_and_a_report() {
    let bench = Workbench::new();
    render(&bench, &[]);
    assert_eq!(bench.names("."), ["out"]);
    assert_eq!(bench.names("out"), ["r"]);
    assert_eq!(bench.names("out/r"), ["image.png", "report.json", "visibility.npy", "visibility.png"]);

    let (shape, values) = bench.npy::<f32>("out/r/visibility.npy");
    assert_eq!(shape, SIZE);
    assert!(values.iter().all(|v| v.is_nan() || (0.0..=1.0).contains(v)));
    assert!(values.contains(&0.0) && values.contains(&1.0), "no shadow, or no light");

    let grey = image::open(bench.path("out/r/visibility.png")).unwrap().into_luma_alpha8();
    assert_eq!(grey.dimensions(), (32, 24));
    for (pixel, v) in grey.pixels().zip(&values) {
        let expected = if v.is_nan() { [0, 0] } else { [(v * 255.0).round() as u8, 255] };
        assert_eq!(pixel.0, expected);
    }
    let shaded = image::open(bench.path("out/r/image.png")).unwrap().into_rgb8();
    let colours: BTreeSet<_> = shaded.pixels().map(|p| p.0).collect();
    assert!(shaded.dimensions() == (32, 24) && colours.len() > 20, "a picture has more colours");
}

#[test]
fn a_report_has_exactly_its_keys() {
    let bench = Workbench::new();
    render(&bench, &[]);
    reference(&bench, &[]);
    for name in ["out/r/report.json", "out/t/report.json"] {
        let report = bench.json(name);
        let keys: BTreeSet<&str> = report.as_object().unwrap().keys().map(String::as_str).collect();
        let expected = [
            "adapter",
            "backend",
            "bytes",
            "features",
            "height",
            "light",
            "prepare_ms",
            "scene",
            "settings",
            "shade_ms",
            "skipped",
            "stages_ms",
            "survives_camera",
            "technique",
            "triangles",
            "variant",
            "width",
        ];
        assert_eq!(keys, BTreeSet::from(expected), "{name}");
        assert_eq!((&report["width"], &report["height"]), (&32.into(), &24.into()));
        assert_eq!((&report["scene"], &report["backend"]), (&"quads".into(), &"cpu".into()));
        assert_eq!((&report["light"]["index"], &report["light"]["kind"]), (&0.into(), &"rect".into()));
        assert!(report["adapter"].is_null() && report["triangles"].as_u64().unwrap() > 4);
        let stages = report["stages_ms"].as_object().unwrap();
        assert!(stages.keys().all(|stage| stage.starts_with("prepare.") || stage.starts_with("shade.")));
        assert!(report["prepare_ms"].as_f64().unwrap() > 0.0 && report["shade_ms"].as_f64().unwrap() > 0.0);
    }
    assert_eq!(bench.json("out/t/report.json")["settings"]["samples"], 16);
}

#[test]
fn settings_reach_the_technique() {
    let bench = Workbench::new();
    render(&bench, &["--set", "map_size=128"]);
    assert_eq!(bench.json("out/r/report.json")["settings"]["map_size"], 128);
}

#[test]
fn reference_writes_values_that_belong_together() {
    let bench = Workbench::new();
    reference(&bench, &[]);
    assert_eq!(
        bench.names("out/t"),
        [
            "image.png",
            "position.npy",
            "report.json",
            "std_error.npy",
            "valid.npy",
            "visibility.npy",
            "visibility.png"
        ]
    );
    let (shape, v) = bench.npy::<f32>("out/t/visibility.npy");
    let (error_shape, error) = bench.npy::<f32>("out/t/std_error.npy");
    let (valid_shape, valid) = bench.npy::<bool>("out/t/valid.npy");
    let (position_shape, position) = bench.npy::<f32>("out/t/position.npy");
    assert_eq!((&shape[..], &error_shape[..], &valid_shape[..]), (&SIZE[..], &SIZE[..], &SIZE[..]));
    assert_eq!(position_shape, [SIZE[0], SIZE[1], 3]);
    for pixel in 0..v.len() {
        let seen = !v[pixel].is_nan();
        assert_eq!(seen, !error[pixel].is_nan());
        assert!(position[3 * pixel..3 * pixel + 3].iter().all(|c| c.is_finite() == seen));
        assert!(seen || !valid[pixel]);
        // Sixteen rays a pixel leave sixteenths.
        assert!(!seen || (v[pixel] * 16.0).fract() == 0.0);
    }
    assert!(valid.contains(&true) && v.iter().any(|v| *v > 0.0 && *v < 1.0), "no penumbra");
}

#[test]
fn truth_to_an_error_reaches_it_with_fewer_samples() {
    let bench = Workbench::new();
    let command = ["reference", "layers", "--size", "48x36", "--out"];
    bench.done(&[&command[..], &["exact", "--exact"]].concat());
    bench.done(&[&command[..], &["found", "--max-error", "0.02", "--samples", "4096"]].concat());
    let (_, exact) = bench.npy::<f32>("exact/visibility.npy");
    let (_, found) = bench.npy::<f32>("found/visibility.npy");
    let seen: Vec<usize> = (0..exact.len()).filter(|&pixel| !exact[pixel].is_nan()).collect();
    let partly = seen.iter().filter(|&&pixel| exact[pixel] > 0.0 && exact[pixel] < 1.0).count() as f32;
    let squares: f32 = seen.iter().map(|&pixel| (found[pixel] - exact[pixel]).powi(2)).sum();
    assert!(partly > 50.0 && (squares / partly).sqrt() < 0.02, "{squares} {partly}");
    assert_eq!(bench.json("found/report.json")["settings"]["max_error"], 0.02_f32);
}

#[test]
fn exact_truth_is_what_sampled_truth_tends_to() {
    let bench = Workbench::new();
    let command = ["reference", "quads", "--size", "32x24", "--out"];
    bench.done(&[&command[..], &["exact", "--exact"]].concat());
    bench.done(&[&command[..], &["sampled", "--samples", "1024"]].concat());
    let (_, exact) = bench.npy::<f32>("exact/visibility.npy");
    let (_, sampled) = bench.npy::<f32>("sampled/visibility.npy");
    let (_, error) = bench.npy::<f32>("sampled/std_error.npy");
    let (_, valid) = bench.npy::<bool>("exact/valid.npy");
    for pixel in (0..exact.len()).filter(|&pixel| valid[pixel]) {
        // Six standard errors: a false alarm once in 10⁸ pixels. A pixel proved wholly lit or dark has none; areas
        // are sums in f64, so what exact truth leaves there is below the rounding of 1 in f32.
        let difference = (exact[pixel] - sampled[pixel]).abs();
        let bound = 6.0 * error[pixel] + f32::EPSILON;
        assert!(difference <= bound, "pixel {pixel}: {difference} at {}", error[pixel]);
    }
    assert_eq!(bench.json("exact/report.json")["variant"], "exact");
}

#[test]
fn exact_truth_says_what_masks_leave_to_samples() {
    let bench = Workbench::new();
    let command = ["reference", "fence", "--size", "24x24", "--exact", "--samples", "16", "--out", "exact"];
    let out = bench.done(&command);
    let settings = &bench.json("exact/report.json")["settings"];
    let sampled = settings["sampled_pixels"].as_u64().unwrap();
    assert_eq!(settings["samples"], 16);
    assert!(
        out.stderr.contains(&format!("cut-out masks leave {sampled} pixels to sampling, 16 samples")),
        "{}",
        out.stderr
    );
    let (_, error) = bench.npy::<f32>("exact/std_error.npy");
    assert_eq!(error.iter().filter(|&&e| e > 0.0).count() as u64, sampled);
}

#[test]
fn truth_depends_on_the_seed_and_not_on_threads() {
    let bench = Workbench::new();
    let values = |more: &[&str]| {
        reference(&bench, more);
        std::fs::read(bench.path("out/t/visibility.npy")).unwrap()
    };
    let one = values(&["--threads", "1"]);
    assert_eq!(one, values(&["--threads", "3"]));
    assert_ne!(one, values(&["--seed", "1"]));
}

#[test]
fn files_of_the_user_stay() {
    let bench = Workbench::new();
    std::fs::create_dir_all(bench.path("out/r")).unwrap();
    bench.write("out/r/notes.txt", "mine");
    bench.write("out/r/report.json", "old");
    render(&bench, &[]);
    assert_eq!(bench.text("out/r/notes.txt"), "mine");
    assert!(bench.json("out/r/report.json").is_object());
    assert_eq!(bench.names("out/r").len(), 5);
}

#[test]
fn what_moves_has_moved() {
    let bench = Workbench::new();
    let values = |time: &str| {
        let command =
            ["reference", "ball", "--size", "32x24", "--samples", "4", "--out", "o", "--time", time];
        bench.done(&command);
        std::fs::read(bench.path("o/position.npy")).unwrap()
    };
    assert_eq!(values("0"), values("0"));
    assert_ne!(values("0"), values("0.3"));
}
