//! The Ball scene by every way of blurring, as in the paper's figure 5, A to G, and the physical scaling beside ground
//! truth: `cargo run --release -p gnomon-contact-hardening --example rows [SCENE]` writes `rows.png` and prints errors.

use std::error::Error;
use std::path::Path;

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, Scaling, Variant};
use gnomon_shadow_map::{Kernel, ShadowMap, ShadowMapParams, Variant as MapVariant};
use scene_core::bvh::Bvh;
use scene_core::io::write;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::technique::{ShadowQuery, ShadowTechnique};
use scene_core::{VisibilityImage, metrics, raster, scenes};

/// Pixels a picture.
const SIZE: [u32; 2] = [160, 128];

fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "ball".to_owned());
    let mut setup = scenes::build(&name, 0.0)?;
    [setup.camera.width, setup.camera.height] = SIZE;
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let gbuffer = raster::render_gbuffer(scene, &setup.camera);
    let sampling = ReferenceSettings { samples: 256, ..Default::default() };
    let truth = reference::reference(scene, &Bvh::casters(scene), light, &gbuffer, &sampling, &no_progress)
        .map_err(|_| "cancelled")?;
    let valid = reference::valid_pixels(&gbuffer, light);

    let uniform = |filter: u32| -> Box<dyn ShadowTechnique> {
        let variant = if filter == 0 { MapVariant::Hard } else { MapVariant::Pcf };
        let filter = filter.max(1);
        Box::new(ShadowMap::new(ShadowMapParams {
            variant,
            filter,
            map_size: 256,
            kernel: Kernel::Grid,
            ..Default::default()
        }))
    };
    let blurred = |variant: Variant, scaling: Scaling| -> Box<dyn ShadowTechnique> {
        let distance_multiplier = 12.0;
        Box::new(ContactHardening::new(ContactHardeningParams {
            variant,
            scaling,
            distance_multiplier,
            ..Default::default()
        }))
    };
    let techniques = [
        ("A hard", uniform(0)),
        ("C uniform 5x5", uniform(5)),
        ("D uniform 7x7", uniform(7)),
        ("E pcf, paper", blurred(Variant::Pcf, Scaling::Paper)),
        ("F gaussian, paper", blurred(Variant::Gaussian, Scaling::Paper)),
        ("G multi-pass, paper", blurred(Variant::MultiPass, Scaling::Paper)),
        ("pcf", blurred(Variant::Pcf, Scaling::Physical)),
        ("gaussian", blurred(Variant::Gaussian, Scaling::Physical)),
        ("multi-pass", blurred(Variant::MultiPass, Scaling::Physical)),
    ];
    let mut images = vec![truth.visibility.clone()];
    println!("{:<20} {:>8} {:>8} {:>8}", "", "rmse", "pen_rmse", "ms");
    for (label, technique) in &techniques {
        let query = ShadowQuery { scene, light, camera: &setup.camera };
        let (prepared, mut report) = technique.prepare(&query)?;
        let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
        report.merge(&prepared.shade(&gbuffer, &mut image)?);
        let errors = metrics::errors(&image, &truth.visibility, &valid)?;
        println!("{label:<20} {:>8.4} {:>8.4} {:>8.2}", errors.rmse, errors.pen_rmse, report.total_ms(""));
        images.push(image);
    }
    write::visibility_png(Path::new("rows.png"), &in_rows(&images))?;
    Ok(())
}

/// The pictures, five a row.
fn in_rows(images: &[VisibilityImage]) -> VisibilityImage {
    let rows = images.len().div_ceil(5) as u32;
    let mut all = VisibilityImage::new(SIZE[0] * 5, SIZE[1] * rows);
    for (index, image) in (0..).zip(images) {
        let place = (index / 5 * SIZE[1] * all.width + index % 5 * SIZE[0]) as usize;
        for (row, values) in image.values.chunks(SIZE[0] as usize).enumerate() {
            let start = place + row * all.width as usize;
            all.values[start..start + values.len()].copy_from_slice(values);
        }
    }
    all
}
