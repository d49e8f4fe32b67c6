//! Errors over penumbrae beside those of engines: `cargo run --release -p gnomon-ddoc --example bars -- FOLDER` prints the
//! `pen_rmse` of every variant and of PCSS on `fence-sun`, `teapot-sphere` and `dragon-rect`, scene files in the folder, at 512×512
//! against 1,024 rays a pixel, settings untouched; last what the best of three.js and Babylon came to on the same three, its
//! bias, radius and light size tuned case by case.

use std::path::PathBuf;

use gnomon_ddoc::{Ddoc, DdocParams, Variant};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant as MapVariant};
use scene_core::bvh::Bvh;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::technique::{ShadowQuery, ShadowTechnique};
use scene_core::{VisibilityImage, io, metrics, raster};

/// Cases, and the best tuned engine's `pen_rmse`.
const CASES: [(&str, f64); 3] = [("fence-sun", 0.056), ("teapot-sphere", 0.055), ("dragon-rect", 0.093)];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("name the folder of scene files")?);
    let mut techniques: Vec<(String, Box<dyn ShadowTechnique>)> = Vec::new();
    for variant in Variant::ALL {
        let params = DdocParams { variant, ..Default::default() };
        techniques.push((format!("`{}`", variant.name()), Box::new(Ddoc::new(params))));
    }
    let pcss = ShadowMapParams { variant: MapVariant::Pcss, map_size: 2048, taps: 256, ..Default::default() };
    techniques.push(("PCSS, 256 taps, 2048²".to_owned(), Box::new(ShadowMap::new(pcss))));
    let names: Vec<_> = techniques.iter().map(|(name, _)| name.as_str()).collect();
    println!("| case | {} | best tuned engine |", names.join(" | "));
    println!("|{}", " --- |".repeat(names.len() + 2));
    for (case, engine) in CASES {
        let mut setup = io::load_setup(&folder.join(case).with_extension("json"))?;
        (setup.camera.width, setup.camera.height) = (512, 512);
        let light = setup.lights.first().ok_or("a scene without a light")?;
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let sampling = ReferenceSettings { samples: 1024, ..Default::default() };
        let casters = Bvh::casters(&setup.scene);
        let truth = reference::reference(&setup.scene, &casters, light, &gbuffer, &sampling, &no_progress)?;
        let valid = reference::valid_pixels(&gbuffer, light);
        let mut row = format!("| {case} |");
        for (_, technique) in &techniques {
            let query = ShadowQuery { scene: &setup.scene, light, camera: &setup.camera };
            let (prepared, _) = technique.prepare(&query)?;
            let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
            prepared.shade(&gbuffer, &mut image)?;
            let errors = metrics::errors(&image, &truth.visibility, &valid)?;
            row += &format!(" {:.4} |", errors.pen_rmse);
        }
        println!("{row} {engine:.3} |");
    }
    Ok(())
}
