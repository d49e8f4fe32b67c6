//! The README's tables: held to the bars that they are there for, and some of their rows found again.

use gnomon_ddoc::{Ddoc, DdocParams, Variant};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant as MapVariant};
use scene_core::bvh::Bvh;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::technique::{ShadowQuery, ShadowTechnique};
use scene_core::{VisibilityImage, metrics, raster, scenes};

const README: &str = include_str!("../README.md");

/// Rays a pixel that the table of cases is made with.
const SAMPLES: u32 = 64;

/// By how much an error found again may differ: tables have four digits, and a pixel that another processor's rounding moves by
/// as much as 1 changes the rmse of a 640×480 image by less than 1/(2·0.0085·307,200) = 0.0002 where it is 0.0085.
const SAME: f64 = 0.0003;

/// The cells of a table's rows, without its header.
fn table(header: &str) -> Vec<Vec<&'static str>> {
    let lines = README.lines().skip_while(|line| !line.starts_with(header)).skip(2);
    let cells = |line: &'static str| line.trim_matches('|').split('|').map(str::trim).collect();
    lines.take_while(|line| line.starts_with('|')).map(cells).collect()
}

/// Errors of a case as printed.
#[derive(Debug)]
struct Row {
    scene: &'static str,
    rmse: f64,
    pen_rmse: f64,
    smoothies: f64,
    penumbra_map: f64,
    pcss: (u32, u32),
    pcss_rmse: f64,
}

fn cases() -> Vec<Row> {
    let number = |cell: &str| cell.parse().unwrap_or_else(|_| panic!("{cell} is no error"));
    let row = |cells: Vec<&'static str>| {
        let [scene, _, rmse, pen_rmse, smoothies, penumbra_map, pcss, _, pcss_rmse] = cells[..] else {
            panic!("{cells:?}")
        };
        let (map, taps) = pcss.split_once("², ").expect("a map and taps");
        let taps = taps.strip_suffix(" taps").expect("taps");
        Row {
            scene,
            rmse: number(rmse),
            pen_rmse: number(pen_rmse),
            smoothies: number(smoothies),
            penumbra_map: number(penumbra_map),
            pcss: (map.parse().expect("a map"), taps.parse().expect("taps")),
            pcss_rmse: number(pcss_rmse),
        }
    };
    table("| scene | ddoc, ms |").into_iter().map(row).collect()
}

#[test]
fn the_table_of_cases_meets_its_bars() {
    let rows = cases();
    for row in &rows {
        assert!(row.rmse < row.smoothies && row.rmse < row.penumbra_map, "{row:?}");
    }
    let won = rows.iter().filter(|row| row.rmse < row.pcss_rmse).count();
    assert!(3 * won >= 2 * rows.len(), "{won} of {}", rows.len());
    // All built-in scenes that have a light for it, and the files.
    let built_in: Vec<_> = scenes::all().iter().map(|scene| scene.name).collect();
    let files = rows.iter().filter(|row| !built_in.contains(&row.scene)).count();
    assert_eq!(files, 25);
    for name in built_in {
        let is_soft =
            scenes::build(name, 0.0).expect("built in").lights.iter().any(|light| light.is_extended());
        assert_eq!(rows.iter().filter(|row| row.scene == name).count(), usize::from(is_soft), "{name}");
    }
}

#[test]
fn rows_of_built_in_scenes_are_found_again() {
    for row in cases().iter().filter(|row| ["cornell", "quads", "ball", "edges"].contains(&row.scene)) {
        let setup = scenes::build(row.scene, 0.0).expect("built in");
        let light = setup.lights.iter().find(|light| light.is_extended()).expect("a light of some extent");
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let sampling = ReferenceSettings { samples: SAMPLES, ..Default::default() };
        let casters = Bvh::casters(&setup.scene);
        let truth = reference::reference(&setup.scene, &casters, light, &gbuffer, &sampling, &no_progress)
            .expect("nobody cancels");
        let valid = reference::valid_pixels(&gbuffer, light);
        let errors = |technique: &dyn ShadowTechnique| {
            let query = ShadowQuery { scene: &setup.scene, light, camera: &setup.camera };
            let (prepared, _) = technique.prepare(&query).expect("few triangles");
            let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
            prepared.shade(&gbuffer, &mut image).expect("an image of the G-buffer's size");
            metrics::errors(&image, &truth.visibility, &valid).expect("images of one size")
        };
        let of = |variant: Variant| errors(&Ddoc::new(DdocParams { variant, ..Default::default() }));
        let ddoc = of(Variant::Ddoc);
        let (map_size, taps) = row.pcss;
        let pcss = ShadowMapParams { variant: MapVariant::Pcss, map_size, taps, ..Default::default() };
        let found = [
            (ddoc.rmse, row.rmse),
            (ddoc.pen_rmse, row.pen_rmse),
            (of(Variant::Smoothies).rmse, row.smoothies),
            (of(Variant::PenumbraMap).rmse, row.penumbra_map),
            (errors(&ShadowMap::new(pcss)).rmse, row.pcss_rmse),
        ];
        for (now, printed) in found {
            assert!((now - printed).abs() <= SAME, "{row:?}: {found:?}");
        }
    }
}

/// The best tuned engine's `pen_rmse` on three cases, as the README prints it, and half of that.
#[test]
fn penumbrae_are_better_than_those_of_the_best_tuned_engine() {
    let rows = table("| case | `ddoc` |");
    assert_eq!(rows.len(), 3);
    for cells in rows {
        let number = |cell: &str| cell.parse::<f64>().unwrap_or_else(|_| panic!("{cell} is no error"));
        let (ours, engine) = (number(cells[1]), number(cells[cells.len() - 1]));
        assert!(ours < 0.5 * engine, "{cells:?}");
    }
}
