//! Errors and milliseconds beside PCSS, against ray tracing:
//! `cargo run --release -p gnomon-ddoc --example against_truth -- [--size WxH] [--samples N] [--all] [--cases FOLDER] [SCENE…]`
//! prints a table of built-in scenes and scene files, those of a folder too; of all built-in scenes with a light of some extent
//! if none is named. `--all` adds every variant, every setting of PCSS and the stages.
//!
//! "PCSS in time" is that of all its settings tried with the lowest rmse among those that take no longer than `ddoc`, measured
//! beside it; its fastest where none does. Settings rise from a map of 512² and 16 taps to one of 4096² and 1,024 taps,
//! until one takes twice as long. A time is that of preparing and shading together, the shorter of two.

use std::path::Path;
use std::time::Instant;

use gnomon_ddoc::{Ddoc, DdocParams, Variant};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant as MapVariant};
use scene_core::bvh::Bvh;
use scene_core::metrics::{self, Errors};
use scene_core::reference::{self, Reference, ReferenceSettings, no_progress};
use scene_core::technique::{ShadowQuery, ShadowTechnique};
use scene_core::{GBuffer, Light, SceneSetup, VisibilityImage, io, raster, scenes};

type Error = Box<dyn std::error::Error>;

/// Maps and taps of PCSS, cheapest first.
const PCSS: [(u32, u32); 8] =
    [(512, 16), (1024, 16), (1024, 64), (2048, 64), (2048, 256), (4096, 256), (2048, 1024), (4096, 1024)];

/// What is asked for.
struct Wanted {
    size: Option<(u32, u32)>,
    samples: u32,
    all: bool,
    scenes: Vec<String>,
}

/// A scene and its ground truth.
struct Case<'a> {
    setup: &'a SceneSetup,
    light: &'a Light,
    gbuffer: GBuffer,
    truth: Reference,
    valid: Vec<bool>,
    all: bool,
}

/// What one contender came to on a scene.
struct Row {
    name: String,
    ms: f64,
    errors: Errors,
}

/// Scenes on which `ddoc` has the lower error, by whom it is held against.
#[derive(Default)]
struct Wins {
    scenes: usize,
    smoothies: usize,
    penumbra_map: usize,
    pcss: usize,
}

fn wanted() -> Result<Wanted, Error> {
    let mut wanted = Wanted { size: None, samples: 256, all: false, scenes: Vec::new() };
    let mut words = std::env::args().skip(1);
    let mut cases = Vec::new();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--size" => {
                let text = words.next().ok_or("--size needs WxH")?;
                let (width, height) = text.split_once('x').ok_or("--size needs WxH")?;
                wanted.size = Some((width.parse()?, height.parse()?));
            }
            "--samples" => wanted.samples = words.next().ok_or("--samples needs a number")?.parse()?,
            "--all" => wanted.all = true,
            "--cases" => {
                for entry in std::fs::read_dir(words.next().ok_or("--cases needs a folder")?)? {
                    let path = entry?.path();
                    if path.extension().is_some_and(|extension| extension == "json" || extension == "toml") {
                        cases.push(path.to_string_lossy().into_owned());
                    }
                }
                cases.sort();
            }
            _ => wanted.scenes.push(word),
        }
    }
    if wanted.scenes.is_empty() {
        wanted.scenes = scenes::all().iter().map(|scene| scene.name.to_owned()).collect();
    }
    wanted.scenes.extend(cases);
    Ok(wanted)
}

fn load(name: &str) -> Result<SceneSetup, Error> {
    if Path::new(name).extension().is_some() {
        Ok(io::load_setup(Path::new(name))?)
    } else {
        Ok(scenes::build(name, 0.0)?)
    }
}

impl Case<'_> {
    /// Milliseconds and errors of a technique.
    fn run(&self, name: &str, technique: &dyn ShadowTechnique) -> Result<Row, Error> {
        let query = ShadowQuery { scene: &self.setup.scene, light: self.light, camera: &self.setup.camera };
        let mut image = VisibilityImage::new(self.gbuffer.width, self.gbuffer.height);
        let mut ms = f64::INFINITY;
        for _ in 0..2 {
            let begin = Instant::now();
            let (prepared, prepare_report) = technique.prepare(&query)?;
            let report = prepared.shade(&self.gbuffer, &mut image)?;
            ms = ms.min(begin.elapsed().as_secs_f64() * 1e3);
            if self.all {
                println!(
                    "    {name}: {:?} {:?} {:?}",
                    prepare_report.stages_ms, report.stages_ms, report.skipped
                );
            }
        }
        let errors = metrics::errors(&image, &self.truth.visibility, &self.valid)?;
        if self.all {
            let Errors { mae, rmse, p99, pen_rmse, .. } = errors;
            println!(
                "    {name}: {ms:.1} ms, mae {mae:.4}, rmse {rmse:.4}, p99 {p99:.3}, pen_rmse {pen_rmse:.4}"
            );
        }
        Ok(Row { name: name.to_owned(), ms, errors })
    }

    fn variant(&self, variant: Variant) -> Result<Row, Error> {
        let params = DdocParams { variant, ..Default::default() };
        self.run(variant.name(), &Ddoc::new(params))
    }

    /// The best PCSS that takes no longer than `ms`.
    fn pcss(&self, ms: f64) -> Result<Row, Error> {
        let mut best: Option<Row> = None;
        for (map_size, taps) in PCSS {
            let params = ShadowMapParams { variant: MapVariant::Pcss, map_size, taps, ..Default::default() };
            let row = self.run(&format!("{map_size}², {taps} taps"), &ShadowMap::new(params))?;
            let takes = row.ms;
            let is_better = match &best {
                None => true,
                Some(best) if best.ms > ms => takes < best.ms,
                Some(best) => takes <= ms && row.errors.rmse < best.errors.rmse,
            };
            if is_better {
                best = Some(row);
            }
            if takes > 2.0 * ms && !self.all {
                break;
            }
        }
        best.ok_or_else(|| "no setting of PCSS".into())
    }
}

fn main() -> Result<(), Error> {
    let Wanted { size, samples, all, scenes } = wanted()?;
    let mut wins = Wins::default();
    println!(
        "| scene | ddoc, ms | rmse | `pen_rmse` | smoothies | penumbra-map | PCSS in time | ms | rmse |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for name in scenes {
        let mut setup = load(&name)?;
        if let Some((width, height)) = size {
            (setup.camera.width, setup.camera.height) = (width, height);
        }
        let Some(light) = setup.lights.iter().find(|light| light.is_extended()) else { continue };
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let sampling = ReferenceSettings { samples, ..Default::default() };
        let casters = Bvh::casters(&setup.scene);
        let truth = reference::reference(&setup.scene, &casters, light, &gbuffer, &sampling, &no_progress)?;
        let valid = reference::valid_pixels(&gbuffer, light);
        let case = Case { setup: &setup, light, gbuffer, truth, valid, all };
        if all {
            case.variant(Variant::ImageEdges)?;
            case.variant(Variant::Paper)?;
        }
        let ddoc = case.variant(Variant::Ddoc)?;
        let (smoothies, penumbra_map) =
            (case.variant(Variant::Smoothies)?, case.variant(Variant::PenumbraMap)?);
        let pcss = case.pcss(ddoc.ms)?;
        let label = Path::new(&name).file_stem().map_or(name.clone(), |stem| stem.to_string_lossy().into());
        println!(
            "| {label} | {:.0} | {:.4} | {:.4} | {:.4} | {:.4} | {} | {:.0} | {:.4} |",
            ddoc.ms,
            ddoc.errors.rmse,
            ddoc.errors.pen_rmse,
            smoothies.errors.rmse,
            penumbra_map.errors.rmse,
            pcss.name,
            pcss.ms,
            pcss.errors.rmse
        );
        let is_below = |other: &Row| usize::from(ddoc.errors.rmse < other.errors.rmse);
        wins.scenes += 1;
        wins.smoothies += is_below(&smoothies);
        wins.penumbra_map += is_below(&penumbra_map);
        wins.pcss += is_below(&pcss);
    }
    let Wins { scenes, smoothies, penumbra_map, pcss } = wins;
    println!(
        "\nddoc below smoothies: {smoothies} of {scenes}, below penumbra-map: {penumbra_map} of {scenes}"
    );
    println!("ddoc below PCSS at equal time: {pcss} of {scenes}");
    Ok(())
}
