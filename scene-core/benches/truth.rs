//! Ground truth at 256 samples a pixel: every sample of every pixel traced ray by ray, the same in packets, and pixels
//! proved lit or dark left out. How many million rays a second each traces, and how many times as fast the last is.
//!
//! All built-in scenes, and those of `../shared/scenes/cases` where that folder exists; arguments pick those whose
//! name holds one of them, name scene files to measure instead (`*.json`), or set the picture's width (a number). One thread; processor time where the
//! system tells, the least of two interleaved runs. All must give the same image, bit for bit.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use glam::Vec3;
use gnomon_scene_core::bvh::Bvh;
use gnomon_scene_core::light::LightPoint;
use gnomon_scene_core::reference::{Occlusion, ReferenceSettings, no_progress, reference};
use gnomon_scene_core::{SceneSetup, io, raster, scenes};

/// Seconds this thread has spent on a processor, where the system tells: other programs do not disturb it.
fn processor_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    stat.split_whitespace().next()?.parse::<f64>().ok().map(|nanoseconds| nanoseconds * 1e-9)
}

fn time<R>(run: impl FnOnce() -> R) -> (f64, R) {
    let (start, processor) = (Instant::now(), processor_seconds());
    let result = black_box(run());
    let wall = start.elapsed().as_secs_f64();
    (processor_seconds().zip(processor).map_or(wall, |(end, start)| end - start), result)
}

/// Whether each light sample of a pixel is blocked, one ray at a time: what tracing costs without packets.
struct Singly<'a>(&'a Bvh);

impl Occlusion for Singly<'_> {
    fn occluded_from(&self, origin: Vec3, targets: &[LightPoint], blocked: &mut [bool]) {
        for (&target, blocked) in targets.iter().zip(blocked) {
            *blocked = self.0.is_occluded(origin, target);
        }
    }
}

fn row(name: &str, mut setup: SceneSetup, width: u32) {
    let aspect = f64::from(setup.camera.height) / f64::from(setup.camera.width);
    setup.camera.width = width;
    setup.camera.height = (f64::from(width) * aspect).round().max(1.0) as u32;
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let bvh = Bvh::casters(&setup.scene);
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let settings = |skip| ReferenceSettings { samples: 256, seed: 0, skip };
    let (mut least, mut truths) = ([f64::INFINITY; 3], [None, None, None]);
    for _ in 0..2 {
        for way in 0..3 {
            let (seconds, truth) = time(|| match way {
                0 => reference(scene, &Singly(&bvh), light, &gbuffer, &settings(false), &no_progress),
                1 => reference(scene, &bvh, light, &gbuffer, &settings(false), &no_progress),
                _ => reference(scene, &bvh, light, &gbuffer, &settings(true), &no_progress),
            });
            least[way] = least[way].min(seconds);
            truths[way] = truth.ok();
        }
    }
    let [Some(singly), Some(packets), Some(skipping)] = truths else { return };
    assert!(singly.visibility.bits() == packets.visibility.bits(), "{name}: packets change nothing");
    assert!(packets.visibility.bits() == skipping.visibility.bits(), "{name}: leaving out changes nothing");
    let all = packets.work.sampled.max(1) as f64;
    let share = |count: u64| 100.0 * count as f64 / all;
    let partly = packets.visibility.values.iter().filter(|&&v| v > 0.0 && v < 1.0).count() as u64;
    let mega_rays = |way: usize| packets.work.rays as f64 * 1e-6 / least[way];
    println!(
        "| {name:20} | {:11} | {:7.3} | {:5.1} | {:5.1} | {:5.1} | {:5.1} | {:5.1} | {:5.1} | {:5.1} | {:5.1} |",
        light.kind(),
        least[0],
        mega_rays(0),
        mega_rays(1),
        least[0] / least[2],
        least[1] / least[2],
        share(skipping.work.proved_lit),
        share(skipping.work.proved_dark),
        share(skipping.work.sampled),
        share(partly),
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let width = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(256_u32).max(1);
    let is_file = |a: &str| Path::new(a).extension().is_some_and(|e| e == "json");
    let files: Vec<_> = arguments.iter().filter(|a| is_file(a)).map(std::path::PathBuf::from).collect();
    let picks: Vec<_> = arguments.iter().filter(|a| a.parse::<u32>().is_err() && !is_file(a)).collect();
    let picked = |name: &str| {
        picks.is_empty() && files.is_empty() || picks.iter().any(|pick| name.contains(pick.as_str()))
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    pool.install(|| {
        println!(
            "| scene                | light       | singly s | Mrays/s singly | in packets | skip / singly | skip / packets | lit % | dark % | rest % | V in (0,1) % |"
        );
        println!("|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
        for scene in scenes::all().iter().filter(|scene| picked(scene.name)) {
            match scenes::build(scene.name, 0.0) {
                Ok(setup) => row(scene.name, setup, width),
                Err(error) => println!("{}: {error}", scene.name),
            }
        }
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes/cases");
        let mut cases: Vec<_> =
            std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
        cases.retain(|path| is_file(&path.to_string_lossy()));
        cases.sort();
        for path in cases.iter().chain(&files) {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            if picked(&name) || files.contains(path) {
                match io::load_setup(path) {
                    Ok(setup) => row(&name, setup, width),
                    Err(error) => println!("{name}: {error}"),
                }
            }
        }
    });
}
