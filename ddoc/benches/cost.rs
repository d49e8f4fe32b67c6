//! A frame of each variant against one of the hard shadow map: maps of 1024², `log-cabin` at 1280×720, on both backends.
//! `cargo bench -p gnomon-ddoc --bench cost [-- [--stages] [ROW…]]`, of rows whose backend and name begin so: `'cpu ddoc'`. A
//! frame of a moving light prepares and shades; one of a moving camera shades. `--stages` adds what each stage of the last
//! frame took, in milliseconds.

use std::time::Instant;

use gnomon_ddoc::{Ddoc, DdocParams, Variant};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams};
use scene_core::technique::{ShadowQuery, ShadowTechnique};
use scene_core::{Report, SceneSetup, VisibilityImage, raster, scenes};

/// Frames of which the median is taken.
const FRAMES: usize = 5;

type Error = Box<dyn std::error::Error>;

/// Milliseconds of preparing and of shading.
type Frame = [f64; 2];

/// Runs a technique on one backend; what the last frame reports, too.
type Run = fn(&SceneSetup, &dyn ShadowTechnique) -> Result<(Frame, Report), Error>;

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn medians(frames: &[Frame]) -> Frame {
    [0, 1].map(|part| median(frames.iter().map(|frame| frame[part]).collect()))
}

fn on_cpu(setup: &SceneSetup, technique: &dyn ShadowTechnique) -> Result<(Frame, Report), Error> {
    let (scene, light, camera) = (&setup.scene, &setup.lights[0], &setup.camera);
    let gbuffer = raster::render_gbuffer(scene, camera);
    let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
    let (mut frames, mut report) = (Vec::new(), Report::default());
    for _ in 0..=FRAMES {
        let begin = Instant::now();
        let (prepared, prepare_report) = technique.prepare(&ShadowQuery { scene, light, camera })?;
        let prepare = begin.elapsed();
        let begin = Instant::now();
        let shade_report = prepared.shade(&gbuffer, &mut image)?;
        frames.push([prepare, begin.elapsed()].map(|time| time.as_secs_f64() * 1e3));
        report = prepare_report;
        report.merge(&shade_report);
    }
    // The first one warms up.
    Ok((medians(&frames[1..]), report))
}

#[cfg(feature = "gpu")]
fn on_gpu(setup: &SceneSetup, technique: &dyn ShadowTechnique) -> Result<(Frame, Report), Error> {
    let gpu = scene_core::gpu::Gpu::open()?;
    let mut view = gpu.view(&setup.scene, &setup.camera)?;
    let mut on_gpu = view.technique(technique)?;
    let (gbuffer, _) = view.draw_gbuffer()?;
    let (mut frames, mut report) = (Vec::new(), Report::default());
    for _ in 0..=FRAMES {
        let run = view.run(on_gpu.as_mut(), &setup.lights[0], &gbuffer)?;
        frames.push([run.prepare_ms, run.shade_ms]);
        report = run.report;
    }
    Ok((medians(&frames[1..]), report))
}

#[cfg(not(feature = "gpu"))]
fn on_gpu(_: &SceneSetup, _: &dyn ShadowTechnique) -> Result<(Frame, Report), Error> {
    Err("built without the feature 'gpu'".into())
}

fn main() -> Result<(), Error> {
    let mut wanted: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let stages = wanted.contains(&"--stages".to_owned());
    wanted.retain(|word| word != "--stages");
    let mut setup = scenes::build("log-cabin", 0.0)?;
    (setup.camera.width, setup.camera.height) = (1280, 720);
    let hard = ShadowMap::new(ShadowMapParams { map_size: 1024, ..Default::default() });
    let mut rows: Vec<(String, Box<dyn ShadowTechnique>)> = vec![("hard map".to_owned(), Box::new(hard))];
    for variant in Variant::ALL {
        for taps in [16, 64] {
            let params = DdocParams { variant, taps, map_size: 1024, ..Default::default() };
            rows.push((format!("{} taps={taps}", variant.name()), Box::new(Ddoc::new(params))));
        }
    }
    println!("backend variant prepare_ms shade_ms of_hard_moving_light of_hard_moving_camera");
    let backends: [(&str, Run); 2] = [("cpu", on_cpu), ("gpu", on_gpu)];
    for (backend, run) in backends {
        let mut base = None;
        for (row, (name, technique)) in rows.iter().enumerate() {
            let of = |wanted: &String| {
                let label = format!("{backend} {name}");
                label.starts_with(wanted.as_str()) || (row == 0 && wanted.starts_with(backend))
            };
            if !wanted.is_empty() && !wanted.iter().any(of) {
                continue;
            }
            match run(&setup, technique.as_ref()) {
                Ok(([prepare, shade], report)) => {
                    let [base_prepare, base_shade] = *base.get_or_insert([prepare, shade]);
                    let (moving, still) =
                        ((prepare + shade) / (base_prepare + base_shade), shade / base_shade);
                    println!("{backend} {name}: {prepare:.2} {shade:.2} {moving:.2} {still:.2}");
                    if stages {
                        println!("    {:.2?} {:?} {:?}", report.stages_ms, report.skipped, report.counted);
                    }
                }
                Err(why) => println!("{backend} {name}: {why}"),
            }
        }
    }
    Ok(())
}
