//! Holds shadow volumes against one exact shadow ray a pixel, on every built-in scene and every file given.
//!
//! ```text
//! cargo run --release -p gnomon-stencil-volumes --example exactness -- ../shared/scenes/*.obj
//! ```

#[path = "../tests/truth/mod.rs"]
mod truth;

use std::time::Instant;

use gnomon_stencil_volumes::{Casters, Count, StencilVolumes, VolumeParams};
use scene_core::bvh::Bvh;
use scene_core::{Light, SceneSetup, VisibilityImage, io, raster, scenes};
use truth::{compare, trace};

fn main() {
    let mut setups: Vec<(String, SceneSetup)> = Vec::new();
    let files: Vec<String> = std::env::args().skip(1).collect();
    for file in &files {
        if let Some(spec) = file.strip_prefix("builtin:") {
            setups.push((spec.to_owned(), scenes::build(spec, 0.0).expect("a built-in scene")));
            continue;
        }
        match io::load_setup(std::path::Path::new(file)) {
            Ok(setup) => setups.push((file.clone(), setup)),
            Err(error) => eprintln!("{file}: {error}"),
        }
    }
    if files.is_empty() {
        for scene in scenes::all() {
            match scenes::build(scene.name, 0.0) {
                Ok(setup) => setups.push((scene.name.to_owned(), setup)),
                Err(error) => eprintln!("{}: {error}", scene.name),
            }
        }
    }
    println!(
        "scene light count | pixels asked, differ, of these at a border, within two lifts of one | ms: rays; edges, prepare, shade | silhouette edges"
    );
    for (name, setup) in &setups {
        run(name, setup);
    }
}

fn run(name: &str, setup: &SceneSetup) {
    let (scene, camera) = (&setup.scene, setup.camera.with_size(512, 512));
    let short = name.rsplit('/').next().unwrap_or(name);
    let casters = match Casters::new(scene) {
        Ok(casters) => casters,
        Err(error) => return println!("{short}: {error}"),
    };
    let start = Instant::now();
    let _ = Casters::new(scene);
    let edges_ms = start.elapsed().as_secs_f64() * 1e3;
    let bvh = Bvh::casters(scene);
    let gbuffer = raster::render_gbuffer(scene, &camera);
    let bounds = scene.bounds();
    let inside = bounds.center() + 0.3 * bounds.size() * glam::Vec3::new(0.5, 0.9, 0.7);
    for light in [setup.lights[0], Light::Point { position: inside }] {
        let start = Instant::now();
        let truth = trace(scene, &bvh, &light, &gbuffer);
        let rays_ms = start.elapsed().as_secs_f64() * 1e3;
        for count in [Count::ZPass, Count::ZFail, Count::Auto] {
            let technique = StencilVolumes::new(VolumeParams { count, ..Default::default() });
            let mut best = (f64::INFINITY, f64::INFINITY);
            let mut visibility = VisibilityImage::new(512, 512);
            let mut edges = 0;
            let mut stages = String::new();
            for _ in 0..3 {
                let start = Instant::now();
                let (prepared, report) = technique.prepare(&casters, &light, &camera);
                let prepare = start.elapsed().as_secs_f64() * 1e3;
                let start = Instant::now();
                let shade_report = prepared.shade(&gbuffer, &mut visibility);
                let shade = start.elapsed().as_secs_f64() * 1e3;
                if prepare + shade < best.0 + best.1 {
                    best = (prepare, shade);
                    stages = format!(
                        "{:.1?} {:.1?} {:?} {:?}",
                        report.stages_ms, shade_report.stages_ms, report.skipped, shade_report.skipped
                    );
                }
                edges = prepared.volumes().map_or(0, |v| v.edges.len());
            }
            let result = compare(scene, &bvh, &light, &camera, &gbuffer, &truth, &visibility);
            println!(
                "{short} {} {count:?} | {} {} {} {} | {rays_ms:.1}; {edges_ms:.1} {:.1} {:.1} | {edges}",
                light.kind(),
                result.asked,
                result.differ,
                result.at_border,
                result.at_lift,
                best.0,
                best.1,
            );
            if std::env::var_os("STAGES").is_some() {
                println!("    {stages}");
            }
        }
    }
}
