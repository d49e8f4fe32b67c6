//! The two artefacts that the paper reports, on scenes made for them: ground truth, `paper`, `ddoc`, from left to right.
//! `cargo run --release -p gnomon-ddoc --example two_artefacts [FOLDER]` writes `layers.png` and `directions.png` and prints errors.

mod artefacts;

use std::error::Error;
use std::path::PathBuf;

use gnomon_ddoc::{Ddoc, DdocParams, Variant};
use scene_core::bvh::Bvh;
use scene_core::io::write;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::{Scene, VisibilityImage, metrics, raster};

/// Rays a pixel.
const SAMPLES: u32 = 256;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| ".".to_owned()));
    for (name, scene) in [("layers", artefacts::layers()?), ("directions", artefacts::directions()?)] {
        let images = draw(name, &scene)?;
        write::visibility_png(&folder.join(format!("{name}.png")), &in_a_row(&images))?;
    }
    Ok(())
}

/// Ground truth, `paper` and `ddoc`.
fn draw(name: &str, scene: &Scene) -> Result<Vec<VisibilityImage>, Box<dyn Error>> {
    let (camera, light) = (artefacts::camera()?, artefacts::LIGHT);
    let gbuffer = raster::render_gbuffer(scene, &camera);
    let sampling = ReferenceSettings { samples: SAMPLES, ..Default::default() };
    let truth = reference::reference(scene, &Bvh::casters(scene), &light, &gbuffer, &sampling, &no_progress)?;
    let valid = reference::valid_pixels(&gbuffer, &light);
    let mut images = vec![truth.visibility.clone()];
    for variant in [Variant::Paper, Variant::Ddoc] {
        let (prepared, _) = Ddoc::new(DdocParams { variant, ..Default::default() }).prepare(scene, &light)?;
        let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
        prepared.shade(&gbuffer, &mut image);
        let errors = metrics::errors(&image, &truth.visibility, &valid)?;
        println!("{name} {}: rmse {:.4}, pen_rmse {:.4}", variant.name(), errors.rmse, errors.pen_rmse);
        images.push(image);
    }
    Ok(images)
}

fn in_a_row(images: &[VisibilityImage]) -> VisibilityImage {
    let (width, height) = images.first().map_or((0, 0), |image| (image.width, image.height));
    let mut row = VisibilityImage::new(width * images.len() as u32, height);
    let (width, all) = (width as usize, width as usize * images.len());
    for (column, image) in images.iter().enumerate() {
        for (y, from) in image.values.chunks(width.max(1)).enumerate() {
            let at = y * all + column * width;
            row.values[at..at + width].copy_from_slice(from);
        }
    }
    row
}
