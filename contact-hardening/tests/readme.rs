//! The README's tables: held to the bars that they are there for, and some of their rows found again.

#[path = "../examples/shared/mod.rs"]
mod shared;

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant};
use scene_core::scenes;
use scene_core::technique::ShadowTechnique;
use shared::Case;

const README: &str = include_str!("../README.md");

/// Pixels a side and rays a pixel that the table is made with.
const SIDE: u32 = 160;
const SAMPLES: u32 = 256;

/// By how much an error found again may differ. Tables have four digits; one of 64 points that another processor's rounding lets fall
/// to the other side, at a pixel that is off by 0.1, changes the rmse of a 160×160 image by 0.1/(64·0.004·25,600) = 1.5·10⁻⁵ where that is
/// 0.004.
const SAME: f64 = 0.000_15;

/// The cells of a table's rows, without its header.
fn table(header: &str) -> Vec<Vec<&'static str>> {
    let lines = README.lines().skip_while(|line| !line.starts_with(header)).skip(2);
    let cells = |line: &'static str| line.trim_matches('|').split('|').map(str::trim).collect();
    lines.take_while(|line| line.starts_with('|')).map(cells).collect()
}

/// A row: errors and shares, maps' texels a side with PCF's filter and PCSS's points.
#[derive(Debug)]
struct Row {
    scene: &'static str,
    pcf: [u32; 2],
    pcf_rmse: f64,
    rmse: f64,
    share_of_pcf: f64,
    pcss: [u32; 2],
    pcss_rmse: f64,
    share_of_pcss: f64,
}

fn rows() -> Vec<Row> {
    let number = |cell: &str| cell.parse::<f64>().unwrap_or_else(|_| panic!("{cell} is no number"));
    // "512², 41" and, with its time behind, "2048², 64, 68 ms".
    let map = |cell: &str| {
        let (size, rest) = cell.split_once("², ").expect("a map");
        let count = rest.split(',').next().expect("a filter or points");
        [size, count].map(|word| word.parse().unwrap_or_else(|_| panic!("{cell}")))
    };
    let row = |cells: Vec<&'static str>| {
        let [scene, pcf, pcf_rmse, _, rmse, share_of_pcf, pcss, pcss_rmse, share_of_pcss] = cells[..] else {
            panic!("{cells:?}")
        };
        Row {
            scene,
            pcf: map(pcf),
            pcf_rmse: number(pcf_rmse),
            rmse: number(rmse),
            share_of_pcf: number(share_of_pcf),
            pcss: map(pcss),
            pcss_rmse: number(pcss_rmse),
            share_of_pcss: number(share_of_pcss),
        }
    };
    table("| scene | best kernel |").into_iter().map(row).collect()
}

#[test]
fn the_table_of_cases_meets_its_bars() {
    let rows = rows();
    for row in &rows {
        assert!(row.rmse <= 0.6 * row.pcf_rmse && row.rmse < row.pcss_rmse, "{row:?}");
        let shares = [row.rmse / row.pcf_rmse, row.rmse / row.pcss_rmse];
        for (share, printed) in shares.into_iter().zip([row.share_of_pcf, row.share_of_pcss]) {
            // Of errors of four digits, down to .003.
            assert!((share - printed).abs() <= 0.005 + 0.000_05 / 0.003 * share, "{row:?}");
        }
    }
    // All built-in scenes that have a light for it, and the files.
    let built_in: Vec<_> = scenes::all().iter().map(|scene| scene.name).collect();
    let files = rows.iter().filter(|row| !built_in.contains(&row.scene)).count();
    assert_eq!(files, 25);
    for name in built_in {
        let is_soft = scenes::build(name, 0.0).expect("built in").lights[0].is_extended();
        assert_eq!(rows.iter().filter(|row| row.scene == name).count(), usize::from(is_soft), "{name}");
    }
}

#[test]
fn rows_of_built_in_scenes_are_found_again() {
    let found_again = ["quads", "ball", "fence", "edges"];
    for row in rows().iter().filter(|row| found_again.contains(&row.scene)) {
        let case = Case::new(row.scene, [SIDE, SIDE], SAMPLES).expect("built in");
        let error = |technique: &dyn ShadowTechnique| {
            let (image, _) = case.run(technique).expect("few triangles");
            case.errors(&image).expect("images of one size").rmse
        };
        let [map_size, filter] = row.pcf;
        let pcf = ShadowMapParams { variant: Variant::Pcf, map_size, filter, ..Default::default() };
        let [map_size, taps] = row.pcss;
        let pcss = ShadowMapParams { variant: Variant::Pcss, map_size, taps, ..Default::default() };
        let found = [
            (error(&ShadowMap::new(pcf)), row.pcf_rmse),
            (error(&ContactHardening::new(ContactHardeningParams::default())), row.rmse),
            (error(&ShadowMap::new(pcss)), row.pcss_rmse),
        ];
        for (now, printed) in found {
            assert!((now - printed).abs() <= SAME, "{row:?}: {found:?}");
        }
    }
}

/// The best tuned engine's rmse on three cases, as the README prints it.
#[test]
fn errors_are_below_those_of_the_best_tuned_engine() {
    let rows = table("| scene | best tuned engine |");
    assert_eq!(rows.len(), 3);
    for cells in rows {
        let number = |cell: &str| cell.parse::<f64>().unwrap_or_else(|_| panic!("{cell} is no error"));
        assert!(number(cells[3]) <= number(cells[2]), "{cells:?}");
    }
}
