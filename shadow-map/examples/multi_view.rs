//! How `multi-view` converges: its error and time against ground truth, as points and texels grow.
//!
//! `cargo run --release --example multi_view -- [PIXELS] [SCENE…]` goes up to 256 maps of 1024²; ground truth has 1,024
//! samples a pixel.

use std::error::Error;
use std::path::Path;

use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant};
use scene_core::bvh::Bvh;
use scene_core::reference::{ReferenceSettings, no_progress, reference, valid_pixels};
use scene_core::{VisibilityImage, io, metrics, raster, scenes};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let pixels: u32 = arguments.next().map_or(Ok(256), |count| count.parse())?;
    let mut specs: Vec<_> = arguments.collect();
    if specs.is_empty() {
        specs = ["quads", "ball", "log-cabin"].map(str::to_owned).to_vec();
    }
    println!("scene | points | map | ms a point: drawing | looking up | all, ms | rmse | pen_rmse | max");
    for spec in specs {
        let path = Path::new(&spec);
        let setup = if path.exists() { io::load_setup(path)? } else { scenes::build(&spec, 0.0)? };
        let (scene, light) = (&setup.scene, &setup.lights[0]);
        let camera = setup.camera.with_size(pixels, pixels);
        let gbuffer = raster::render_gbuffer(scene, &camera);
        let settings = ReferenceSettings { samples: 1024, ..Default::default() };
        let truth = reference(scene, &Bvh::casters(scene), light, &gbuffer, &settings, &no_progress)?;
        let valid = valid_pixels(&gbuffer, light);
        for (views, map_size) in [(16, 256), (64, 512), (256, 1024)] {
            let params =
                ShadowMapParams { variant: Variant::MultiView, views, map_size, ..Default::default() };
            let (prepared, _) = ShadowMap::new(params).prepare(scene, light);
            let mut image = VisibilityImage::new(camera.width, camera.height);
            let report = prepared.shade(&gbuffer, &mut image);
            let errors = metrics::errors(&image, &truth.visibility, &valid)?;
            let each = |stage: &str| report.stages_ms.get(stage).copied().unwrap_or(0.0) / f64::from(views);
            println!(
                "{spec} | {views} | {map_size} | {:.2} | {:.2} | {:.0} | {:.4} | {:.4} | {:.4}",
                each("shade.maps"),
                each("shade.lookup"),
                report.total_ms("shade."),
                errors.rmse,
                errors.pen_rmse,
                errors.max,
            );
        }
    }
    Ok(())
}
