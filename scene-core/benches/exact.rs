//! Exact ground truth against 256 samples a pixel: time of both, and the error of the samples.
//!
//! The scenes of `../shared/scenes/cases` that have rect lights, where that folder exists, and the built-in ones with rect or disk lights;
//! arguments pick those whose name holds one of them, or set the picture's width (a number, 128). One thread; processor time where the system
//! tells. Errors are over the pixels in penumbra that are exact: rmse, its ratio to the standard errors that are claimed, and the
//! mean, which is 0 but for its own error if both ways see the same.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use gnomon_scene_core::bvh::Bvh;
use gnomon_scene_core::reference::{ReferenceSettings, exact_reference, no_progress, reference};
use gnomon_scene_core::{Light, SceneSetup, io, raster, scenes};

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

fn row(name: &str, mut setup: SceneSetup, width: u32) {
    let light = &setup.lights[0];
    if !matches!(light, Light::Rect { .. } | Light::Disk { .. }) {
        return;
    }
    let aspect = f64::from(setup.camera.height) / f64::from(setup.camera.width);
    setup.camera.width = width;
    setup.camera.height = (f64::from(width) * aspect).round().max(1.0) as u32;
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let bvh = Bvh::casters(&setup.scene);
    let settings = ReferenceSettings { samples: 256, ..Default::default() };
    let (sampled_seconds, sampled) =
        time(|| reference(&setup.scene, &bvh, light, &gbuffer, &settings, &no_progress));
    let (exact_seconds, exact) =
        time(|| exact_reference(&setup.scene, &bvh, light, &gbuffer, &settings, &no_progress));
    let (Ok(sampled), Ok(exact)) = (sampled, exact) else { return };
    let (mut squares, mut variances, mut sum, mut count) = (0.0, 0.0, 0.0, 0.0_f64);
    for pixel in 0..gbuffer.pixel_count() {
        let (v, expected) = (sampled.visibility.values[pixel], exact.visibility.values[pixel]);
        if expected > 0.0 && expected < 1.0 && exact.std_error[pixel] == 0.0 {
            let difference = f64::from(v - expected);
            squares += difference * difference;
            variances += f64::from(sampled.std_error[pixel]).powi(2);
            sum += difference;
            count += 1.0;
        }
    }
    let rmse = (squares / count).sqrt();
    println!(
        "| {name:20} | {:8} | {exact_seconds:7.3} | {:7.1} | {sampled_seconds:7.3} | {:6.2} | {:5.1} | {:5.1} | {rmse:8.5} | {:5.2} | {:9.1e} ± {:.1e} |",
        bvh.triangle_count(),
        1e6 * exact_seconds / exact.work.exact.max(1) as f64,
        exact_seconds / sampled_seconds,
        100.0 * exact.work.exact as f64 / gbuffer.pixel_count() as f64,
        100.0 * exact.work.sampled as f64 / gbuffer.pixel_count() as f64,
        (squares / variances).sqrt(),
        sum / count,
        variances.sqrt() / count,
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let width = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(128_u32).max(1);
    let picks: Vec<_> = arguments.iter().filter(|a| a.parse::<u32>().is_err()).collect();
    let picked = |name: &str| picks.is_empty() || picks.iter().any(|pick| name.contains(pick.as_str()));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    pool.install(|| {
        println!(
            "| scene                | triangles | exact s | µs each | 256 s | times | exact % | sampled % | rmse of 256 | in std errors | their mean error |"
        );
        println!("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
        for scene in scenes::all().iter().filter(|scene| picked(scene.name)) {
            match scenes::build(scene.name, 0.0) {
                Ok(setup) => row(scene.name, setup, width),
                Err(error) => println!("{}: {error}", scene.name),
            }
        }
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes/cases");
        let mut cases: Vec<_> =
            std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
        cases.retain(|path| path.extension().is_some_and(|e| e == "json"));
        cases.sort();
        for path in cases {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            if picked(&name) && (name.ends_with("-rect") || picks.iter().any(|pick| name == pick.as_str())) {
                match io::load_setup(&path) {
                    Ok(setup) => row(&name, setup, width),
                    Err(error) => println!("{name}: {error}"),
                }
            }
        }
    });
}
