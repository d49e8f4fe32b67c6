//! `alias-free` beside one shadow ray a pixel, building the tree for the rays counted.
//!
//! `cargo run --release --example alias_free -- [RUNS] [SCENE…]`: built-in scenes or scene files. Every image must be the
//! same, bit for bit.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use gnomon_shadow_map::alias_free::AliasFree;
use rayon::prelude::*;
use scene_core::bvh::{Bvh, shadow_origin};
use scene_core::light::LightPoint;
use scene_core::{GBuffer, Light, Scene, VisibilityImage, io, raster, scenes};

/// V by one shadow ray a pixel.
fn trace(scene: &Scene, bvh: &Bvh, light: &Light, gbuffer: &GBuffer, visibility: &mut VisibilityImage) {
    let magnitude = scene.bounds().magnitude();
    let width = gbuffer.width as usize;
    visibility.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        for (column, value) in values.iter_mut().enumerate() {
            let pixel = row * width + column;
            if !gbuffer.is_seen(pixel) {
                continue;
            }
            let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
            if !light.reaches(position) {
                *value = 0.0;
                continue;
            }
            let faces = match light.center() {
                LightPoint::At(place) => normal.dot(place - position) > 0.0,
                LightPoint::Towards(direction) => normal.dot(direction) > 0.0,
            };
            let origin = shadow_origin(position, normal, magnitude);
            *value = if faces && !bvh.is_occluded(origin, light.center()) { 1.0 } else { 0.0 };
        }
    });
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let runs: u32 = arguments.next().map_or(Ok(5), |count| count.parse())?;
    let mut specs: Vec<_> = arguments.collect();
    if specs.is_empty() {
        specs = ["knot", "chess", "log-cabin", "forest:triangles=1000000"].map(str::to_owned).to_vec();
    }
    println!("milliseconds, least of {runs} runs, 512 × 512");
    println!(
        "scene | triangles | bounds once | receivers | casters | alias-free | tree | rays | tree + rays | different"
    );
    for spec in specs {
        let setup = if Path::new(&spec).exists() {
            io::load_setup(Path::new(&spec))?
        } else {
            scenes::build(&spec, 0.0)?
        };
        let (scene, light) = (&setup.scene, &setup.lights[0]);
        let gbuffer = raster::render_gbuffer(scene, &setup.camera.with_size(512, 512));
        let mut images = [(); 2].map(|()| VisibilityImage::new(512, 512));
        let mut least = [f64::INFINITY; 6];
        let mut take = |at: usize, ms: f64| least[at] = least[at].min(ms);
        for _ in 0..runs {
            let since = |start: Instant| start.elapsed().as_secs_f64() * 1e3;
            let start = Instant::now();
            let casters = AliasFree::new(scene, true);
            take(0, since(start));
            let start = Instant::now();
            let report = casters.shade(light, &gbuffer, &mut images[0]);
            take(3, since(start));
            take(1, report.stages_ms["shade.receivers"] + report.stages_ms["shade.relevance"]);
            take(2, report.stages_ms.get("shade.casters").copied().unwrap_or(0.0));
            let start = Instant::now();
            let bvh = Bvh::casters(scene);
            take(4, since(start));
            let start = Instant::now();
            trace(scene, &bvh, light, &gbuffer, &mut images[1]);
            take(5, since(start));
        }
        let [a, b] = &images;
        let different = a.values.iter().zip(&b.values).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
        let [once, receivers, casters, all, tree, rays] = least;
        println!(
            "{spec} | {} | {once:.1} | {receivers:.1} | {casters:.1} | {all:.1} | {tree:.1} | {rays:.1} | {:.1} | {different}",
            scene.caster_count(),
            tree + rays,
        );
    }
    Ok(())
}
