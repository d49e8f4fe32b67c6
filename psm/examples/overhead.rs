//! What looking at the G-buffer, choosing a parametrisation and computing its matrix costs, as a share of the frame, on both
//! backends.
//!
//! `cargo run --release -p gnomon-psm --example overhead -- [SCENE]…`; chess and street unless told. A frame is the G-buffer,
//! the maps and the lookup, of 512 × 512 pixels and 1024 × 1024 texels; what is kept from frame to frame is made before the
//! first. Each stage is the median of 21 frames.

use std::collections::BTreeMap;
use std::error::Error;

use gnomon_psm::{Casters, Psm, PsmParams};
use scene_core::SceneSetup;
use scene_core::{Report, VisibilityImage, raster, scenes};

const RUNS: usize = 21;

/// Of the stages: those that a map without any parametrisation would not have.
const OVERHEAD: [&str; 3] = ["prepare.images", "prepare.receivers", "prepare.views"];

fn main() -> Result<(), Box<dyn Error>> {
    let mut specs: Vec<String> = std::env::args().skip(1).collect();
    if specs.is_empty() {
        specs = ["chess", "street"].map(str::to_owned).to_vec();
    }
    println!("scene | backend | frame, ms | overhead, ms | share | stages, ms");
    println!("--- | --- | --- | --- | --- | ---");
    for spec in specs {
        let setup = scenes::build(&spec, 0.0)?;
        let setup = SceneSetup { camera: setup.camera.with_size(512, 512), ..setup };
        print(&spec, "CPU", &on_cpu(&setup));
        #[cfg(feature = "gpu")]
        print(&spec, "GPU", &on_gpu(&setup)?);
    }
    Ok(())
}

fn on_cpu(setup: &SceneSetup) -> Vec<Report> {
    let SceneSetup { scene, camera, lights, .. } = setup;
    let lasting = Casters::new(scene, &PsmParams::default(), &mut Report::default());
    let frame = || {
        let mut report = Report::default();
        let gbuffer = report.time("gbuffer", |_| raster::render_gbuffer(scene, camera));
        let (prepared, rest) = Psm::default().prepare_with(&lasting, scene, &lights[0], camera, &gbuffer);
        report.merge(&rest);
        let mut image = VisibilityImage::new(camera.width, camera.height);
        report.merge(&prepared.shade(&gbuffer, &mut image));
        report
    };
    (0..RUNS).map(|_| frame()).collect()
}

#[cfg(feature = "gpu")]
fn on_gpu(setup: &SceneSetup) -> Result<Vec<Report>, Box<dyn Error>> {
    use scene_core::gpu::Gpu;

    let gpu = Gpu::open()?;
    let mut view = gpu.view(&setup.scene, &setup.camera)?;
    let mut technique = view.technique(&Psm::default())?;
    (0..RUNS)
        .map(|_| {
            let (gbuffer, mut report) = view.draw_gbuffer()?;
            report.merge(&view.run(technique.as_mut(), &setup.lights[0], &gbuffer)?.report);
            Ok(report)
        })
        .collect()
}

fn print(spec: &str, backend: &str, reports: &[Report]) {
    let mut stages = BTreeMap::<&str, Vec<f64>>::new();
    for report in reports {
        for (stage, ms) in &report.stages_ms {
            stages.entry(stage).or_default().push(*ms);
        }
    }
    let median = |mut ms: Vec<f64>| {
        // Where a frame has no such stage.
        ms.resize(reports.len(), 0.0);
        ms.sort_by(f64::total_cmp);
        ms[ms.len() / 2]
    };
    let stages: BTreeMap<&str, f64> = stages.into_iter().map(|(stage, ms)| (stage, median(ms))).collect();
    let frame: f64 = stages.values().sum();
    let overhead: f64 = OVERHEAD.iter().filter_map(|stage| stages.get(stage)).sum();
    let listed: Vec<_> = stages.iter().map(|(stage, ms)| format!("{stage} {ms:.2}")).collect();
    println!(
        "{spec} | {backend} | {frame:.1} | {overhead:.2} | {:.1} % | {}",
        100.0 * overhead / frame,
        listed.join(", ")
    );
}
