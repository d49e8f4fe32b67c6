//! What this crate's page claims, measured in one run: `cargo bench -p gnomon-pdsm --bench claims [PART…] [SCENE]`, where PART is
//! `construction`, `shading` or `emission`; all of them without one.
//!
//! Prints construction time against the number of maps beside the paper's, peak memory, emission beside the paper's walk
//! at every resolution, lookups on one thread, and shading beside 64 shadow rays a pixel. SCENE is a built-in scene or a
//! file; the knot of 200,000 triangles without one.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use gnomon_pdsm::compression::Segments;
use gnomon_pdsm::crossings::Crossings;
use gnomon_pdsm::emission::{EmissionScratch, emit_events};
use gnomon_pdsm::events::EventStrips;
use gnomon_pdsm::grid::{DepthGrid, PixelGrid};
use gnomon_pdsm::layout::{Fit, Layout};
use gnomon_pdsm::maps::{MapCasters, Target};
use gnomon_pdsm::walk::walk_events;
use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::bvh::Bvh;
use scene_core::reference::{ReferenceSettings, no_progress, reference};
use scene_core::{SceneSetup, VisibilityImage, io, raster, relevance, scenes};

/// Construction of the paper's dragon, on its machine, in milliseconds.
const PAPER_MS: f64 = 33_000.0;

/// What can be measured alone.
const PARTS: [&str; 3] = ["construction", "shading", "emission"];

fn milliseconds<T>(work: impl FnOnce() -> T) -> f64 {
    let start = Instant::now();
    black_box(work());
    start.elapsed().as_secs_f64() * 1e3
}

/// The fastest of a few runs, after one that warms up.
fn fastest<T>(runs: usize, mut work: impl FnMut() -> T) -> f64 {
    work();
    (0..runs).map(|_| milliseconds(&mut work)).fold(f64::INFINITY, f64::min)
}

/// Peak of resident memory since the last call, in MiB; `None` where the system does not tell.
fn peak_since_last_call() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    std::fs::write("/proc/self/clear_refs", "5").ok()?;
    Some(kib / 1024.0)
}

fn params(views: u32) -> PdsmParams {
    PdsmParams { views, max_error: 0.02, ..Default::default() }
}

fn fewest(views: u32) -> PdsmParams {
    PdsmParams { segments: Segments::Fewest, ..params(views) }
}

fn construction(setup: &SceneSetup) {
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    println!("\nConstruction, {} triangles, maps and PDSM of 512²:", scene.triangles().len());
    println!(
        "| maps | ms | ms a map | maps and events | functions | events | peak above start, MiB | of it not events |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for views in [16, 32, 64, 128, 256] {
        let mut report = None;
        peak_since_last_call();
        let before = peak_since_last_call();
        report.replace(Pdsm::new(params(views)).prepare(scene, light).1);
        let peak = before.zip(peak_since_last_call()).map(|(before, after)| after - before);
        let (pdsm, _) = Pdsm::new(params(views)).prepare(scene, light);
        let events: u64 = pdsm.windows().iter().map(|window| window.functions.statistics().events).sum();
        drop(pdsm);
        // Stages of the fastest run.
        let mut ms = f64::INFINITY;
        for _ in 0..if views > 64 { 1 } else { 5 } {
            let run = Pdsm::new(params(views)).prepare(scene, light).1;
            if run.total_ms("prepare.") < ms {
                ms = run.total_ms("prepare.");
                report = Some(run);
            }
        }
        let Some(report) = report else { continue };
        // 8 bytes an event while they are collected.
        let kept = events as f64 * 8.0 / f64::from(1 << 20);
        println!(
            "| {views} | {ms:.0} | {:.2} | {:.0} | {:.0} | {events} | {} | {} |",
            ms / f64::from(views),
            report.stages_ms["prepare.events"],
            report.stages_ms["prepare.functions"],
            peak.map_or("–".to_owned(), |peak| format!("{peak:.0}")),
            peak.map_or("–".to_owned(), |peak| format!("{:.0}", peak - kept)),
        );
        if views == 64 {
            println!("64 maps: {:.0} × faster than the paper's 33 s", PAPER_MS / ms);
        }
    }
}

/// The casters' window over maps of `size`².
fn layout(setup: &SceneSetup, size: u32) -> (Layout, Option<MapCasters>) {
    let light = &setup.lights[0];
    let casters = relevance::told_apart(&setup.scene, light, 1e-4).drawn;
    let fit = Fit { scene: &setup.scene, light, views: 4, map_size: size, seed: 0 };
    let layout = fit.layouts(&casters).0.swap_remove(0);
    let drawn = MapCasters::new(&setup.scene, &casters, &layout);
    (layout, drawn)
}

fn emission(setup: &SceneSetup) {
    println!("\nEvents of one map, PDSM of as many pixels, one thread:");
    println!("| m | cells a ray | events | walk, ms | emission, ms | ratio |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for size in [128, 256, 512, 1024, 2048] {
        let (layout, drawn) = layout(setup, size);
        let Some(drawn) = drawn else { return println!("the casters are not drawn many views at once") };
        let step = layout.steps().next().expect("a sample");
        let mut map = DepthGrid::default();
        map.clear(size);
        let stride = size as i32 + 2;
        let target = Target { size: size as i32, start: stride + 1, stride };
        drawn.draw(&[step], target, &mut [map.bordered_mut()]);
        map.drawn();
        let crossings = Crossings::new(step, layout.t_range());
        let grid = PixelGrid { size, ratio: 1 };
        let mut scratch = EmissionScratch::default();
        let mut count = 0;
        let emission = fastest(if size > 512 { 5 } else { 20 }, || {
            let mut events = EventStrips::new(size);
            emit_events(&map, grid, &crossings, true, &mut scratch, &mut events);
            count = events.len();
        });
        let mut walked = 0;
        let mut walk = || {
            let mut events = EventStrips::new(size);
            walk_events(&map, grid, &crossings, &mut events);
            walked = events.len();
        };
        let walk = if size > 512 { milliseconds(&mut walk) } else { fastest(3, &mut walk) };
        assert_eq!(walked, count);
        println!(
            "| {size} | {} | {count} | {walk:.2} | {emission:.3} | {:.1} |",
            crossings.cells().count(),
            walk / emission
        );
    }
}

fn shading(setup: &SceneSetup) -> Result<(), Box<dyn std::error::Error>> {
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let mut camera = setup.camera;
    (camera.width, camera.height) = (512, 512);
    let gbuffer = raster::render_gbuffer(scene, &camera);
    let seen = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)).count();
    let bvh = Bvh::casters(scene);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    println!("\nShading 512², {seen} pixels seen:");
    println!("| functions | MiB | ns a pixel seen, one thread | ms, all threads | 64 rays / it |");
    println!("| --- | --- | --- | --- | --- |");
    let settings = ReferenceSettings { samples: 64, skip: false, ..Default::default() };
    let rays = fastest(2, || reference(scene, &bvh, light, &gbuffer, &settings, &no_progress).is_ok());
    for (name, params) in [
        ("ε .01", PdsmParams::default()),
        ("ε .02", params(64)),
        ("ε .02, fewest", fewest(64)),
        ("ε .02, fewest, half", PdsmParams { precision: gnomon_pdsm::Precision::Half, ..fewest(64) }),
        ("ε .02, surfaces", PdsmParams { only_surfaces: true, ..params(64) }),
        ("ε .02, nearest", PdsmParams { bilinear: false, ..params(64) }),
    ] {
        let (pdsm, report) = Pdsm::new(params).prepare(scene, light);
        let mut image = VisibilityImage::new(512, 512);
        let single = one.install(|| fastest(7, || pdsm.shade(&gbuffer, &mut image)));
        let all = fastest(7, || pdsm.shade(&gbuffer, &mut image));
        println!(
            "| {name} | {:.1} | {:.1} | {all:.2} | {:.0} |",
            report.bytes as f64 / f64::from(1 << 20),
            single * 1e6 / seen as f64,
            rays / all
        );
    }
    println!("64 shadow rays a pixel: {rays:.0} ms, all threads");
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo hands `--bench` over, too.
    let words: Vec<_> = std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).collect();
    let (parts, names): (Vec<_>, Vec<_>) = words.into_iter().partition(|word| PARTS.contains(&word.as_str()));
    let is_asked = |part: &str| parts.is_empty() || parts.iter().any(|word| word == part);
    let name = names.first().map_or("knot:sides=79", String::as_str);
    let setup =
        if Path::new(name).exists() { io::load_setup(Path::new(name))? } else { scenes::build(name, 0.0)? };
    println!("{name}, {} threads", rayon::current_num_threads());
    if is_asked("construction") {
        construction(&setup);
    }
    if is_asked("shading") {
        shading(&setup)?;
    }
    if is_asked("emission") {
        emission(&setup);
    }
    Ok(())
}
