//! The table of section 5 of the paper, ours beside theirs: `cargo run --release -p gnomon-pdsm --example paper_table
//! [SCENE…]`, where SCENE may also be a mesh or scene file. The paper's machine was an Athlon 64 3500+ of 2004 with a
//! `GeForce` 6800 GT; its dragon and park are other meshes than the knot and the park here.

use std::path::Path;
use std::time::Instant;

use gnomon_pdsm::compression::Segments;
use gnomon_pdsm::functions::Functions;
use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::{SceneSetup, VisibilityImage, io, raster, scenes};

/// What the paper has of a scene.
struct Paper {
    seconds: f64,
    frames_a_second: f64,
    /// Events a ray, all and kept: on average and at most.
    events: Option<[[u32; 2]; 2]>,
}

/// Scene, views, resolution of maps and PDSM, the paper's row.
const ROWS: [(&str, u32, u32, Paper); 4] = [
    ("cylinder", 64, 512, Paper { seconds: 30.0, frames_a_second: 1150.0, events: None }),
    ("quads", 144, 512, Paper { seconds: 67.0, frames_a_second: 840.0, events: None }),
    ("knot:sides=79", 64, 512, Paper { seconds: 33.0, frames_a_second: 80.0, events: None }),
    ("park", 64, 1024, Paper { seconds: 161.0, frames_a_second: 40.0, events: Some([[63, 5], [482, 40]]) }),
];

/// Peak of resident memory since the last call, in MiB, where the system tells.
fn peak_since_last_call() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    std::fs::write("/proc/self/clear_refs", "5").ok()?;
    Some(kib / 1024.0)
}

fn row(
    name: &str,
    mut setup: SceneSetup,
    [views, size]: [u32; 2],
    segments: Segments,
    paper: Option<&Paper>,
    one: &rayon::ThreadPool,
) {
    (setup.camera.width, setup.camera.height) = (512, 512);
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let params = PdsmParams {
        views,
        map_size: size,
        pdsm_size: size,
        max_error: 0.02,
        segments,
        ..Default::default()
    };
    peak_since_last_call();
    let before = peak_since_last_call();
    let (_, first) = Pdsm::new(params).prepare(scene, light);
    let peak = before.zip(peak_since_last_call()).map(|(before, after)| after - before);
    let start = Instant::now();
    let (pdsm, report) = Pdsm::new(params).prepare(scene, light);
    // The first run pays for fresh memory.
    let seconds = start.elapsed().as_secs_f64().min(first.total_ms("prepare.") * 1e-3);
    let gbuffer = raster::render_gbuffer(scene, &setup.camera);
    let mut image = VisibilityImage::new(512, 512);
    let mut lookup = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        pdsm.shade(&gbuffer, &mut image);
        lookup = lookup.min(start.elapsed().as_secs_f64() * 1e3);
    }
    let seen = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)).count();
    let mut alone = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        one.install(|| pdsm.shade(&gbuffer, &mut image));
        alone = alone.min(start.elapsed().as_secs_f64() * 1e9 / seen.max(1) as f64);
    }
    let pixels = f64::from(size) * f64::from(size) * pdsm.windows().len().max(1) as f64;
    let sum =
        |of: fn(&Functions) -> u64| pdsm.windows().iter().map(|window| of(&window.functions)).sum::<u64>();
    let most = |of: fn(&Functions) -> u32| {
        pdsm.windows().iter().map(|window| of(&window.functions)).max().unwrap_or(0)
    };
    let none = || "–".to_owned();
    println!(
        "| {name}, {segments:?} | {} | {views} | {size}² | {seconds:.3} s | {} | {:.1} / {:.1} | {} / {} | {} | {:.1} | {} | {lookup:.1} ms | {} | {alone:.0} |",
        scene.triangles().len(),
        paper.map_or_else(none, |p| format!("{:.0} s, {:.0}×", p.seconds, p.seconds / seconds)),
        sum(|f| f.statistics().events) as f64 / pixels,
        sum(|f| f.nodes().len() as u64) as f64 / pixels,
        most(|f| f.statistics().most_events),
        most(|f| f.statistics().most_nodes),
        paper.and_then(|p| p.events).map_or_else(none, |[[a, b], [c, d]]| format!("{a} / {b}, {c} / {d}")),
        report.bytes as f64 / f64::from(1 << 20),
        peak.map_or_else(none, |peak| format!("{peak:.0}")),
        paper.map_or_else(none, |p| format!("{:.1} ms", 1000.0 / p.frames_a_second)),
    );
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "| scene | triangles | maps | of | construction | the paper's | events a ray, all / kept | most | the paper's | MiB | peak MiB | shading 512² | the paper's frame | lookup, ns a pixel, one thread |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    if arguments.is_empty() {
        for (name, views, size, paper) in &ROWS {
            for segments in [Segments::Greedy, Segments::Fewest] {
                row(name, scenes::build(name, 0.0)?, [*views, *size], segments, Some(paper), &one);
            }
        }
    }
    for argument in &arguments {
        let setup = if Path::new(argument).exists() {
            io::load_setup(Path::new(argument))?
        } else {
            scenes::build(argument, 0.0)?
        };
        row(argument, setup, [64, 512], Segments::Fewest, None, &one);
    }
    Ok(())
}
