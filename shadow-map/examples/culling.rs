//! What choosing casters by the view costs, and what it saves.
//!
//! `cargo run --release --example culling -- [VIEWS] [SCENE…]` draws a shadow map of all casters and one of those that
//! a random view needs, for many views; every image must be the same, bit for bit.

#[path = "../tests/views/mod.rs"]
mod views;

use std::error::Error;

use gnomon_shadow_map::{ShadowMap, ShadowMapParams};
use scene_core::relevance::CasterChunks;
use scene_core::{VisibilityImage, raster, scenes};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let views: u64 = arguments.next().map_or(Ok(50), |count| count.parse())?;
    let mut specs: Vec<_> = arguments.collect();
    if specs.is_empty() {
        specs = ["street", "park", "forest:triangles=1000000"].map(str::to_owned).to_vec();
    }
    println!("{views} views each, milliseconds a view; saved = all − chosen");
    println!(
        "scene | triangles | left out | chunks once | choose | all | chosen | choose / saved | different pixels"
    );
    for spec in specs {
        let setup = scenes::build(&spec, 1.0)?;
        let (scene, light) = (&setup.scene, &setup.lights[0]);
        let technique = ShadowMap::new(ShadowMapParams { map_size: 1024, ..Default::default() });
        let start = std::time::Instant::now();
        let chunks = CasterChunks::new(scene);
        let chunk_ms = start.elapsed().as_secs_f64() * 1e3;
        let (mut left_out, mut choose, mut all, mut chosen, mut different) = (0, 0.0, 0.0, 0.0, 0);
        for seed in 0..views {
            let camera = views::random_view(scene, seed);
            let gbuffer = raster::render_gbuffer(scene, &camera);
            let (full, full_report) = technique.prepare(scene, light);
            let (part, part_report) = technique.prepare_for_view(scene, light, &camera, &chunks);
            all += full_report.stages_ms["prepare.maps"];
            chosen += part_report.stages_ms["prepare.maps"];
            choose += part_report.stages_ms["prepare.relevance"];
            left_out += part_report.skipped["caster triangles outside view"];
            let mut images = [(); 2].map(|()| VisibilityImage::new(camera.width, camera.height));
            full.shade(&gbuffer, &mut images[0]);
            part.shade(&gbuffer, &mut images[1]);
            let [a, b] = images;
            different += a.values.iter().zip(&b.values).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
        }
        let mean = |sum: f64| sum / views as f64;
        println!(
            "{spec} | {} | {:.1} % | {chunk_ms:.2} | {:.3} | {:.2} | {:.2} | {:.1} % | {different}",
            scene.caster_count(),
            100.0 * left_out as f64 / (views as f64 * scene.caster_count() as f64),
            mean(choose),
            mean(all),
            mean(chosen),
            100.0 * choose / (all - chosen),
        );
        if different > 0 {
            return Err(format!("{spec}: {different} pixels differ").into());
        }
    }
    Ok(())
}
