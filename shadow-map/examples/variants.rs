//! What each variant costs and how far it is from ground truth.
//!
//! `cargo run --release --example variants -- [key=value…] [SCENE…]` takes built-in scenes and scene files, draws every
//! variant (or the one that `variant=` names) at its settings, and prints milliseconds and errors.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant};
use scene_core::bvh::Bvh;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::technique::Params;
use scene_core::{VisibilityImage, io, metrics, raster, scenes};

const SIDE: u32 = 512;
const SAMPLES: u32 = 256;

fn main() -> Result<(), Box<dyn Error>> {
    let (settings, mut specs): (Vec<_>, Vec<_>) = std::env::args().skip(1).partition(|word| {
        word.split_once('=').is_some_and(|(key, _)| ShadowMapParams::SETTINGS.iter().any(|s| s.name == key))
    });
    if specs.is_empty() {
        specs = ["quads", "ball", "chess"].map(str::to_owned).to_vec();
    }
    let settings: Vec<_> = settings
        .iter()
        .filter_map(|word| word.split_once('='))
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .collect();
    println!("scene | variant | prepare ms | shade ms | rmse | p99 | pen_rmse");
    for spec in specs {
        let mut setup = if spec.ends_with(".json") {
            io::load_setup(Path::new(&spec))?
        } else {
            scenes::build(&spec, 0.0)?
        };
        (setup.camera.width, setup.camera.height) = (SIDE, SIDE);
        let (scene, light) = (&setup.scene, &setup.lights[0]);
        let gbuffer = raster::render_gbuffer(scene, &setup.camera);
        let sampling = ReferenceSettings { samples: SAMPLES, ..Default::default() };
        let casters = Bvh::casters(scene);
        let truth = reference::reference(scene, &casters, light, &gbuffer, &sampling, &no_progress)?;
        let valid = reference::valid_pixels(&gbuffer, light);
        for variant in Variant::ALL {
            let mut params = ShadowMapParams { variant, ..ShadowMapParams::from_overrides(None, &settings)? };
            if let Some((_, name)) = settings.iter().find(|(key, _)| key == "variant") {
                if name != variant.name() {
                    continue;
                }
                params.variant = variant;
            }
            let technique = ShadowMap::new(params);
            let mut image = VisibilityImage::new(SIDE, SIDE);
            let (mut prepare_ms, mut shade_ms) = (f64::INFINITY, f64::INFINITY);
            for _ in 0..3 {
                let start = Instant::now();
                let (maps, _) = technique.prepare(scene, light);
                prepare_ms = (start.elapsed().as_secs_f64() * 1e3).min(prepare_ms);
                let start = Instant::now();
                maps.shade(&gbuffer, &mut image);
                shade_ms = (start.elapsed().as_secs_f64() * 1e3).min(shade_ms);
            }
            let errors = metrics::errors(&image, &truth.visibility, &valid)?;
            let metrics::Errors { rmse, p99, pen_rmse, .. } = errors;
            let name = variant.name();
            println!(
                "{spec} | {name} | {prepare_ms:.2} | {shade_ms:.2} | {rmse:.4} | {p99:.3} | {pen_rmse:.4}"
            );
            if let Some(folder) = std::env::var_os("OUT") {
                let stem = Path::new(&spec).file_stem().unwrap_or_default().to_string_lossy().into_owned();
                let path = Path::new(&folder).join(format!("{stem}-{name}.png"));
                io::write::visibility_png(&path, &image)?;
                let path = Path::new(&folder).join(format!("{stem}-truth.png"));
                io::write::visibility_png(&path, &truth.visibility)?;
            }
        }
    }
    Ok(())
}
