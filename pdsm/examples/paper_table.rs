//! The table of section 5 of the paper, ours beside theirs: `cargo run --release -p gnomon-pdsm --example paper_table
//! [SCENE…]`, where SCENE may also be a mesh or scene file. The paper's machine was an Athlon 64 3500+ of 2004.

use std::path::Path;
use std::time::Instant;

use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::{SceneSetup, VisibilityImage, io, raster, scenes};

/// Scene, views, resolution of maps and PDSM, the paper's construction in seconds where it has one.
const ROWS: [(&str, u32, u32, Option<f64>); 4] = [
    ("cylinder", 64, 512, Some(30.0)),
    ("quads", 144, 512, Some(67.0)),
    ("knot:sides=79", 64, 512, Some(33.0)),
    ("park", 64, 1024, Some(161.0)),
];

fn row(name: &str, mut setup: SceneSetup, views: u32, size: u32, paper: Option<f64>) {
    (setup.camera.width, setup.camera.height) = (512, 512);
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let params = PdsmParams { views, map_size: size, pdsm_size: size, max_error: 0.02, ..Default::default() };
    let start = Instant::now();
    let (pdsm, report) = Pdsm::new(params).prepare(scene, light);
    let seconds = start.elapsed().as_secs_f64();
    let gbuffer = raster::render_gbuffer(scene, &setup.camera);
    let mut image = VisibilityImage::new(512, 512);
    let start = Instant::now();
    pdsm.shade(&gbuffer, &mut image);
    let lookup = start.elapsed().as_secs_f64() * 1e3;
    let pixels = f64::from(size) * f64::from(size) * pdsm.windows().len().max(1) as f64;
    let sum = |of: fn(&gnomon_pdsm::functions::Functions) -> u64| {
        pdsm.windows().iter().map(|window| of(&window.functions)).sum::<u64>()
    };
    let most = |of: fn(&gnomon_pdsm::functions::Functions) -> u32| {
        pdsm.windows().iter().map(|window| of(&window.functions)).max().unwrap_or(0)
    };
    let paper =
        paper.map_or_else(|| "–".to_owned(), |paper| format!("{paper:.0} s, {:.0}×", paper / seconds));
    println!(
        "| {name:22} | {:7} | {views:4} | {size:4}² | {seconds:6.3} | {paper:11} | {:5.1} / {:4.1} | {:4} / {:3} | {:6.1} | {lookup:6.1} |",
        scene.triangles().len(),
        sum(|f| f.statistics().events) as f64 / pixels,
        sum(|f| f.nodes().len() as u64) as f64 / pixels,
        most(|f| f.statistics().most_events),
        most(|f| f.statistics().most_nodes),
        report.bytes as f64 / f64::from(1 << 20),
    );
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "| scene | triangles | views | maps | s | paper | events, mean: all / kept | most | MiB | lookup 512², ms |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    if arguments.is_empty() {
        for (name, views, size, paper) in ROWS {
            row(name, scenes::build(name, 0.0)?, views, size, paper);
        }
    }
    for argument in &arguments {
        let setup = if Path::new(argument).exists() {
            io::load_setup(Path::new(argument))?
        } else {
            scenes::build(argument, 0.0)?
        };
        row(argument, setup, 64, 512, None);
    }
    Ok(())
}
