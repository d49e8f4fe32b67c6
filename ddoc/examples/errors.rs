//! Errors and milliseconds of every variant beside PCSS, against ray tracing:
//! `cargo run --release -p gnomon-ddoc --example errors -- [--size WxH] [--samples N] [SCENE…]`, of built-in scenes and scene
//! files; all built-in scenes with a light of some extent if none is named.

use std::path::Path;
use std::time::Instant;

use gnomon_ddoc::{Ddoc, DdocParams, Variant};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant as MapVariant};
use scene_core::bvh::Bvh;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::technique::{ShadowQuery, ShadowTechnique};
use scene_core::{SceneSetup, VisibilityImage, io, metrics, raster, scenes};

type Error = Box<dyn std::error::Error>;

fn load(name: &str) -> Result<SceneSetup, Error> {
    if Path::new(name).extension().is_some() {
        Ok(io::load_setup(Path::new(name))?)
    } else {
        Ok(scenes::build(name, 0.0)?)
    }
}

fn contenders() -> Vec<(String, Box<dyn ShadowTechnique>)> {
    let mut all: Vec<(String, Box<dyn ShadowTechnique>)> = Vec::new();
    for (name, map_size, taps) in [("pcss-low", 512, 16), ("pcss-medium", 1024, 64), ("pcss-high", 2048, 256)]
    {
        let params = ShadowMapParams { variant: MapVariant::Pcss, map_size, taps, ..Default::default() };
        all.push((name.to_owned(), Box::new(ShadowMap::new(params))));
    }
    for variant in Variant::ALL {
        let params = DdocParams { variant, ..Default::default() };
        all.push((variant.name().to_owned(), Box::new(Ddoc::new(params))));
    }
    all
}

fn main() -> Result<(), Error> {
    let (mut size, mut samples, mut names) = (None, 256, Vec::new());
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--size" => {
                let text = words.next().ok_or("--size needs WxH")?;
                let (width, height) = text.split_once('x').ok_or("--size needs WxH")?;
                size = Some((width.parse()?, height.parse()?));
            }
            "--samples" => samples = words.next().ok_or("--samples needs a number")?.parse()?,
            _ => names.push(word),
        }
    }
    if names.is_empty() {
        names = scenes::all().iter().map(|scene| scene.name.to_owned()).collect();
    }
    println!("scene technique prepare_ms shade_ms mae rmse p99 pen_rmse");
    for name in names {
        let mut setup = load(&name)?;
        if let Some((width, height)) = size {
            (setup.camera.width, setup.camera.height) = (width, height);
        }
        let Some(light) = setup.lights.iter().find(|light| light.is_extended()) else { continue };
        let (scene, camera) = (&setup.scene, &setup.camera);
        let gbuffer = raster::render_gbuffer(scene, camera);
        let sampling = ReferenceSettings { samples, ..Default::default() };
        let truth =
            reference::reference(scene, &Bvh::casters(scene), light, &gbuffer, &sampling, &no_progress)?;
        let valid = reference::valid_pixels(&gbuffer, light);
        let label =
            Path::new(&name).file_stem().map_or(name.clone(), |stem| stem.to_string_lossy().into_owned());
        for (technique_name, technique) in contenders() {
            let query = ShadowQuery { scene, light, camera };
            let begin = Instant::now();
            let (prepared, _) = technique.prepare(&query)?;
            let prepare_ms = begin.elapsed().as_secs_f64() * 1e3;
            let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
            let begin = Instant::now();
            let report = prepared.shade(&gbuffer, &mut image)?;
            let shade_ms = begin.elapsed().as_secs_f64() * 1e3;
            let errors = metrics::errors(&image, &truth.visibility, &valid)?;
            println!(
                "{label} {technique_name} {prepare_ms:.1} {shade_ms:.1} {:.4} {:.4} {:.3} {:.4}",
                errors.mae, errors.rmse, errors.p99, errors.pen_rmse
            );
            if std::env::var_os("STAGES").is_some() {
                println!("    {:?} {:?}", report.stages_ms, report.skipped);
            }
        }
    }
    Ok(())
}
