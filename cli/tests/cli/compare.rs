//! What `compare` writes.

use crate::workbench::Workbench;

fn compare(bench: &Workbench, more: &[&str]) {
    bench.done(&[&["compare", "quads", "--size", "48x32", "--samples", "16"][..], more].concat());
}

#[test]
fn one_folder_holds_everything() {
    let bench = Workbench::new();
    compare(&bench, &[]);
    assert_eq!(
        bench.names("out/quads"),
        ["contact-sheet.png", "index.html", "report.json", "strip.png", "table.csv"]
    );
    let sheet = image::open(bench.path("out/quads/contact-sheet.png")).unwrap();
    // Three columns of the smallest cell, and a row for ground truth and for the technique.
    assert!(sheet.width() >= 3 * 256 && sheet.height() >= 2 * 170, "{} x {}", sheet.width(), sheet.height());
}

#[test]
fn the_table_says_what_the_report_says() {
    let bench = Workbench::new();
    compare(&bench, &["--techniques", "shadow-map", "--out", "o"]);
    let report = bench.json("o/report.json");
    let mut table = csv::Reader::from_path(bench.path("o/table.csv")).unwrap();
    let columns: Vec<String> = table.headers().unwrap().iter().map(str::to_owned).collect();
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    let cell = |row: usize, column: &str| {
        let place = columns.iter().position(|c| c == column).unwrap_or_else(|| panic!("no {column}"));
        rows[row][place].to_owned()
    };
    let techniques = report["techniques"].as_array().unwrap();
    assert_eq!(rows.len(), 1 + techniques.len());
    assert_eq!((cell(0, "technique"), cell(0, "rmse")), ("reference".to_owned(), String::new()));
    for (i, technique) in techniques.iter().enumerate() {
        for (column, expected) in [
            ("mae", &technique["errors"]["mae"]),
            ("rmse", &technique["errors"]["rmse"]),
            ("p99", &technique["errors"]["p99"]),
            ("pen_rmse", &technique["errors"]["pen_rmse"]),
            ("umbra", &technique["shares"]["umbra"]),
            ("prepare_ms", &technique["prepare_ms"]),
        ] {
            // Both are the shortest text of the same number, but serde_json reads it back to within two ulps only.
            match (cell(i + 1, column).parse::<f64>().ok(), expected.as_f64()) {
                (Some(in_table), Some(in_report)) => {
                    let ulp = in_report.abs() * f64::EPSILON;
                    assert!((in_table - in_report).abs() <= 2.0 * ulp, "{column}: {in_table}, {in_report}");
                }
                (in_table, in_report) => assert_eq!(in_table, in_report, "{column}"),
            }
        }
        assert_eq!(cell(i + 1, "variant"), technique["variant"].as_str().unwrap());
    }
    // A hard technique under an extended light is wrong in the penumbra, and only there.
    let errors = &techniques[0]["errors"];
    assert!(errors["pen_rmse"].as_f64() > errors["rmse"].as_f64() && errors["rmse"].as_f64() > Some(0.0));
    let shares = &report["reference"]["shares"];
    let total: f64 = ["lit", "penumbra", "umbra"].iter().map(|s| shares[s].as_f64().unwrap()).sum();
    assert!((total - 1.0).abs() < 1e-9);
    assert!(report["reference"]["noise_rmse"].as_f64().unwrap() > 0.0);
}

#[test]
fn the_page_needs_no_network_and_every_image_has_words() {
    let bench = Workbench::new();
    compare(&bench, &["--out", "o"]);
    let page = bench.text("o/index.html");
    for external in ["http:", "https:", "<link", "@import", "url(", "{{"] {
        assert!(!page.contains(external), "{external}");
    }
    let entries = bench.json("o/report.json")["techniques"].as_array().unwrap().len();
    let figures: Vec<&str> = page.split("<figure>").skip(1).collect();
    assert_eq!(figures.len(), 2 + 3 * entries);
    for figure in figures {
        assert!(figure.contains("src=\"data:image/png;base64,") && !figure.contains("alt=\"\""));
    }
    for word in ["<title>quads", "Ground truth", "pen_rmse", "lang=\"en\"", "type=\"range\""] {
        assert!(page.contains(word), "{word}");
    }
}

#[test]
fn a_technique_named_twice_runs_once_and_presets_have_rows() {
    let bench = Workbench::new();
    let list = bench.done(&["techniques", "shadow-map", "--json"]).json();
    let preset = list["techniques"][0]["preset_order"][0].as_str().expect("a preset").to_owned();
    let words = format!("shadow-map@{preset},shadow-map@{preset},shadow-map");
    compare(&bench, &["--techniques", &words, "--out", "o"]);
    let report = bench.json("o/report.json");
    let labels: Vec<&str> =
        report["techniques"].as_array().unwrap().iter().map(|t| t["label"].as_str().unwrap()).collect();
    let with_preset =
        labels.iter().filter(|label| label.starts_with(&format!("shadow-map@{preset} "))).count();
    assert_eq!(with_preset, 1, "{labels:?}");
    assert!(labels.iter().any(|label| label.starts_with("shadow-map ")), "{labels:?}");
}

#[test]
fn a_scene_nobody_can_see_is_told_and_compared_all_the_same() {
    let bench = Workbench::new();
    bench.write("mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
    bench.write(
        "away.toml",
        "meshes = [\"mesh.obj\"]\n[camera]\neye = [0, 5, 5]\ntarget = [0, 10, 10]\nup = [0, 1, 0]\nfov_y_deg = 40\n\
         width = 16\nheight = 16\n[light]\nkind = \"point\"\nposition = [0, 5, 0]\n",
    );
    let said = bench.done(&["compare", "away.toml", "--out", "o"]);
    assert!(said.stderr.contains("no pixel can be compared"), "{}", said.stderr);
    let report = bench.json("o/report.json");
    assert_eq!((&report["valid_pixels"], &report["seen_pixels"]), (&0.into(), &0.into()));
}
