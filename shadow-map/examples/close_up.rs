//! What leaving out saves where a camera looks at a small part of a large scene: `prepare` and `shade` with and without
//! `skip`, and that every pixel is the same.
//!
//! `cargo run --release --example close_up -- [RUNS] [SCENE] [VARIANT]`: a forest of a million triangles, seen from a step away:
//! a patch of its ground, a metre or so across. The bounds of runs of triangles, which hold as long as the scene does, are taken once and timed
//! apart.

use std::error::Error;
use std::time::Instant;

use glam::Vec3;
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant};
use scene_core::relevance::CasterChunks;
use scene_core::{Camera, Light, Report, VisibilityImage, raster, scenes};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let runs: u32 = arguments.next().map_or(Ok(5), |count| count.parse())?;
    let spec = arguments.next().unwrap_or_else(|| "forest:triangles=1000000".to_owned());
    let only = arguments.next();
    let setup = scenes::build(&spec, 0.0)?;
    let scene = &setup.scene;
    let camera = Camera {
        eye: Vec3::new(2.0, 1.7, 1.0),
        target: Vec3::new(2.8, 0.0, 0.2),
        fov_y: 0.7,
        ..setup.camera.with_size(512, 512)
    };
    let gbuffer = raster::render_gbuffer(scene, &camera);
    let start = Instant::now();
    let chunks = CasterChunks::new(scene);
    println!(
        "{spec}: {} triangles; bounds of runs of them, once: {:.1} ms",
        scene.caster_count(),
        start.elapsed().as_secs_f64() * 1e3
    );
    println!("milliseconds, least of {runs} runs, 512 × 512, maps of 1024²");
    println!(
        "variant | light | skip off: prepare + shade | on: prepare + shade | ratio | left out | different pixels"
    );
    let sun = setup.lights[0];
    let sharp = match sun {
        Light::Directional { direction, .. } => Light::Directional { direction, angular_radius: 0.0 },
        other => other,
    };
    let lamp = Light::Point { position: camera.target + Vec3::new(-1.0, 4.0, 1.0) };
    for (variant, light, name) in [
        (Variant::Hard, sharp, "sun"),
        (Variant::Hard, lamp, "lamp"),
        (Variant::Pcf, sharp, "sun"),
        (Variant::Pcf, lamp, "lamp"),
        (Variant::ObjectId, sharp, "sun"),
        (Variant::Pcss, sun, "sun of its size"),
        (Variant::Moments, sharp, "sun"),
        (Variant::Cascaded, sharp, "sun"),
        (Variant::MultiView, sun, "sun of its size"),
        (Variant::AliasFree, sharp, "sun"),
    ] {
        if only.as_ref().is_some_and(|only| only != variant.name()) {
            continue;
        }
        let mut images = [(); 2].map(|()| VisibilityImage::new(camera.width, camera.height));
        let mut least = [[f64::INFINITY; 2]; 2];
        let (mut left_out, mut stages) = (String::new(), [const { String::new() }; 2]);
        for _ in 0..runs {
            for (at, skip) in [false, true].into_iter().enumerate() {
                let params = ShadowMapParams { variant, skip, views: 4, ..Default::default() };
                let technique = ShadowMap::new(params);
                let start = Instant::now();
                let (prepared, mut report) = technique.prepare_for_view(scene, &light, &camera, &chunks);
                // Taken once, above, where it is not: as it is for the other variants.
                let once = report.stages_ms.get("prepare.chunks").copied().unwrap_or(0.0);
                let prepare = start.elapsed().as_secs_f64() * 1e3 - once;
                let start = Instant::now();
                report.merge(&prepared.shade(&gbuffer, &mut images[at]));
                let shade = start.elapsed().as_secs_f64() * 1e3;
                if prepare + shade < least[at][0] + least[at][1] {
                    least[at] = [prepare, shade];
                    stages[at] = stages_of(&report);
                }
                left_out = skips(&report);
            }
        }
        let [a, b] = &images;
        let different = a.values.iter().zip(&b.values).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
        let [off, on] = least;
        println!(
            "{} | {name} | {:.1} + {:.1} | {:.1} + {:.1} | {:.1} | {left_out} | {different}",
            variant.name(),
            off[0],
            off[1],
            on[0],
            on[1],
            (off[0] + off[1]) / (on[0] + on[1]),
        );
        println!("  off: {}\n  on: {}", stages[0], stages[1]);
    }
    Ok(())
}

fn stages_of(report: &Report) -> String {
    report.stages_ms.iter().map(|(stage, ms)| format!("{stage} {ms:.2}")).collect::<Vec<_>>().join(", ")
}

fn skips(report: &Report) -> String {
    let counted = report.skipped.iter().filter(|(_, count)| **count > 0);
    counted.map(|(what, count)| format!("{count} {what}")).collect::<Vec<_>>().join(", ")
}
