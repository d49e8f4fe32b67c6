//! Errors and milliseconds of every variant beside PCSS, against ray tracing:
//! `cargo run --release -p gnomon-ddoc --example against_truth -- [--size WxH] [--samples N] [--stages] [SCENE…]`, of built-in scenes
//! and scene files; all built-in scenes with a light of some extent if none is named.
//!
//! Below the table stands on how many scenes `ddoc` has the lower rmse than the variants of outer penumbrae, and than PCSS at
//! equal time: its best setting that takes no longer than `ddoc`, or its fastest one.

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

/// What one contender came to on a scene.
struct Row {
    name: String,
    ms: f64,
    rmse: f64,
}

/// Scenes on which `ddoc` has the lower error, by whom it is held against.
#[derive(Default)]
struct Wins {
    scenes: usize,
    smoothies: usize,
    penumbra_map: usize,
    pcss: usize,
}

impl Wins {
    fn count(&mut self, rows: &[Row]) {
        let of = |name: &str| rows.iter().find(|row| row.name == name);
        let Some(ddoc) = of("ddoc") else { return };
        let pcss = || rows.iter().filter(|row| row.name.starts_with("pcss"));
        let in_time = pcss().filter(|row| row.ms <= ddoc.ms).min_by(|a, b| a.rmse.total_cmp(&b.rmse));
        let equal = in_time.or_else(|| pcss().min_by(|a, b| a.ms.total_cmp(&b.ms)));
        let is_below = |other: Option<&Row>| usize::from(other.is_some_and(|other| ddoc.rmse < other.rmse));
        self.scenes += 1;
        self.smoothies += is_below(of("smoothies"));
        self.penumbra_map += is_below(of("penumbra-map"));
        self.pcss += is_below(equal);
    }
}

fn main() -> Result<(), Error> {
    let (mut size, mut samples, mut stages, mut names) = (None, 256, false, Vec::new());
    let mut wins = Wins::default();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--size" => {
                let text = words.next().ok_or("--size needs WxH")?;
                let (width, height) = text.split_once('x').ok_or("--size needs WxH")?;
                size = Some((width.parse()?, height.parse()?));
            }
            "--stages" => stages = true,
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
        let mut rows = Vec::new();
        for (technique_name, technique) in contenders() {
            let query = ShadowQuery { scene, light, camera };
            let begin = Instant::now();
            let (prepared, prepared_report) = technique.prepare(&query)?;
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
            if stages {
                println!("    {:?} {:?} {:?}", prepared_report.stages_ms, report.stages_ms, report.skipped);
            }
            rows.push(Row { name: technique_name, ms: prepare_ms + shade_ms, rmse: errors.rmse });
        }
        wins.count(&rows);
    }
    let Wins { scenes, smoothies, penumbra_map, pcss } = wins;
    println!("ddoc below smoothies: {smoothies} of {scenes}, below penumbra-map: {penumbra_map} of {scenes}");
    println!("ddoc below PCSS at equal time: {pcss} of {scenes}");
    Ok(())
}
