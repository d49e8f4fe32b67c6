//! What classing tiles costs, and how much of an image it settles.
//!
//! `cargo run --release --example tile_classes -- [SCENE…]`: built-in scenes, scene files or meshes; every built-in one
//! without arguments. Shares are of the pixels that receive; "to be had" is what ground truth finds in tiles that
//! are wholly lit or dark.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use gnomon_scene_core::bvh::Bvh;
use gnomon_scene_core::reference::{ReferenceSettings, no_progress, reference};
use gnomon_scene_core::relevance::{TILE, TileBounds, TileClass, classify_tiles};
use gnomon_scene_core::{GBuffer, SceneSetup, VisibilityImage, io, raster, scenes};

fn main() -> Result<(), Box<dyn Error>> {
    let mut scenes: Vec<String> = std::env::args().skip(1).collect();
    if scenes.is_empty() {
        scenes = scenes::all().iter().map(|scene| scene.name.to_owned()).collect();
    }
    println!(
        "scene | triangles | light | bounds ms | classes ms | lit % (to be had) | umbra % (to be had) | truth ms a sample"
    );
    for scene in scenes {
        let setup = load(&scene)?;
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let casters = Bvh::casters(&setup.scene);
        for light in &setup.lights {
            let (bounds_ms, tiles) = fastest(|| TileBounds::of_receivers(&setup.scene, &gbuffer));
            let (classes_ms, classes) =
                fastest(|| classify_tiles(&setup.scene, &casters, light, &gbuffer, &tiles));
            let settings = ReferenceSettings { samples: 16, seed: 0, skip: true };
            let start = Instant::now();
            let truth = reference(&setup.scene, &casters, light, &gbuffer, &settings, &no_progress)?;
            let sample_ms = start.elapsed().as_secs_f64() * 1e3 / 16.0;
            let found = [TileClass::Lit, TileClass::Umbra]
                .map(|class| share(&setup, &gbuffer, |x, y| classes.of_pixel(x, y) == class));
            let best = [1.0, 0.0].map(|v| {
                let tiles = uniform_tiles(&setup, &gbuffer, &truth.visibility, v);
                let columns = gbuffer.width.div_ceil(TILE);
                share(&setup, &gbuffer, |x, y| tiles[(y / TILE * columns + x / TILE) as usize])
            });
            println!(
                "{} | {} | {} | {bounds_ms:.2} | {classes_ms:.2} | {:.1} ({:.1}) | {:.1} ({:.1}) | {sample_ms:.2}",
                setup.name,
                setup.scene.caster_count(),
                light.kind(),
                found[0],
                best[0],
                found[1],
                best[1],
            );
        }
    }
    Ok(())
}

fn load(scene: &str) -> Result<SceneSetup, Box<dyn Error>> {
    if Path::new(scene).exists() {
        Ok(io::load_setup(Path::new(scene))?)
    } else {
        Ok(scenes::build(scene, 0.0)?)
    }
}

/// The least of five times, in milliseconds, and the result.
fn fastest<T>(work: impl Fn() -> T) -> (f64, T) {
    let run = || {
        let start = Instant::now();
        let result = work();
        (start.elapsed().as_secs_f64() * 1e3, result)
    };
    let first = run();
    (0..4).map(|_| run()).fold(first, |best, next| if next.0 < best.0 { next } else { best })
}

fn receives(setup: &SceneSetup, gbuffer: &GBuffer, pixel: usize) -> bool {
    gbuffer.is_seen(pixel) && setup.scene.objects()[gbuffer.object[pixel] as usize].flags.receives
}

/// Percent of the receiving pixels for which `counts` holds.
fn share(setup: &SceneSetup, gbuffer: &GBuffer, counts: impl Fn(u32, u32) -> bool) -> f64 {
    let receiving = || (0..gbuffer.pixel_count()).filter(|&pixel| receives(setup, gbuffer, pixel));
    let at = |pixel: usize| counts(pixel as u32 % gbuffer.width, pixel as u32 / gbuffer.width);
    100.0 * receiving().filter(|&pixel| at(pixel)).count() as f64 / receiving().count().max(1) as f64
}

/// The tiles in which every receiving pixel has this V.
fn uniform_tiles(setup: &SceneSetup, gbuffer: &GBuffer, truth: &VisibilityImage, v: f32) -> Vec<bool> {
    let columns = gbuffer.width.div_ceil(TILE);
    let mut tiles = vec![true; columns as usize * gbuffer.height.div_ceil(TILE) as usize];
    for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| receives(setup, gbuffer, pixel)) {
        let (x, y) = (pixel as u32 % gbuffer.width, pixel as u32 / gbuffer.width);
        tiles[(y / TILE * columns + x / TILE) as usize] &= truth.values[pixel] == v;
    }
    tiles
}
