//! A scene by every way of blurring, as in the paper's figure 5, A to G, penumbrae marked as there:
//! `cargo run --release -p gnomon-contact-hardening --example rows [SCENE] [FOLDER]` writes `figure-5.png` and prints errors
//! of ground truth. Below the row, `physical` scaling and ground truth.

mod shared;

use std::error::Error;
use std::path::PathBuf;

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, Show, Variant};
use gnomon_shadow_map::{Kernel, ShadowMap, ShadowMapParams, Variant as MapVariant};
use scene_core::VisibilityImage;
use scene_core::io::write;
use shared::{Case, as_published, in_rows};

/// Pixels a picture.
const SIZE: [u32; 2] = [160, 128];

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let scene = words.next().unwrap_or_else(|| "ball".to_owned());
    let folder = PathBuf::from(words.next().unwrap_or_else(|| ".".to_owned()));
    let case = Case::new(&scene, SIZE, 256)?;

    let map = |variant: MapVariant, filter: u32| -> Result<(VisibilityImage, f64), Box<dyn Error>> {
        let kernel = Kernel::Grid;
        case.run(&ShadowMap::new(ShadowMapParams {
            variant,
            filter,
            map_size: 256,
            kernel,
            ..Default::default()
        }))
    };
    let blurred = |params: ContactHardeningParams| case.run(&ContactHardening::new(params));
    // Widths of up to 19 pixels, as the paper's; its D_p and D_m are for its own units.
    let paper = |variant: Variant| blurred(as_published(variant, 12.0));
    let physical = |variant: Variant| blurred(ContactHardeningParams { variant, ..Default::default() });
    let hard = map(MapVariant::Hard, 1)?;
    let uniform = (uniform_gaussian(&hard.0), hard.1);
    let pictures = [
        ("A hard", hard),
        ("B uniform Gaussian 5x5", uniform),
        ("C uniform 5x5", map(MapVariant::Pcf, 5)?),
        ("D uniform 7x7", map(MapVariant::Pcf, 7)?),
        ("E pcf, paper", paper(Variant::Pcf)?),
        ("F gaussian, paper", paper(Variant::Gaussian)?),
        ("G multi-pass, paper", paper(Variant::MultiPass)?),
        ("pcf, physical", physical(Variant::Pcf)?),
        ("gaussian, physical", physical(Variant::Gaussian)?),
        ("multi-pass, physical", physical(Variant::MultiPass)?),
    ];
    println!("{:<24} {:>8} {:>8} {:>8}", "", "rmse", "pen_rmse", "ms");
    for (label, (image, ms)) in &pictures {
        let errors = case.errors(image)?;
        println!("{label:<24} {:>8.4} {:>8.4} {ms:>8.1}", errors.rmse, errors.pen_rmse);
    }
    let marked: Vec<VisibilityImage> =
        pictures.iter().map(|(_, (image, _))| image).chain([&case.truth]).map(marked).collect();
    write::visibility_png(&folder.join("figure-5.png"), &in_rows(&marked, 7))?;
    Ok(())
}

/// As `show=penumbra` writes it.
fn marked(image: &VisibilityImage) -> VisibilityImage {
    let mut marked = image.clone();
    marked.values.iter_mut().for_each(|value| *value = Show::penumbra_mark(*value));
    marked
}

/// A Gaussian of 5 × 5 pixels over the whole image, 3-sigma.
fn uniform_gaussian(image: &VisibilityImage) -> VisibilityImage {
    let (width, height) = (image.width as i32, image.height as i32);
    let mut blurred = image.clone();
    for (index, value) in (0..).zip(&mut blurred.values) {
        let (mut sum, mut all) = (0.0, 0.0);
        for (x, y) in (-2..=2).flat_map(|x| (-2..=2).map(move |y| (x, y))) {
            let (column, row) = (index % width + x, index / width + y);
            let weight = (-4.5 * (x * x + y * y) as f32 / 4.0).exp();
            if (0..width).contains(&column) && (0..height).contains(&row) {
                let v = image.values[(row * width + column) as usize];
                if !v.is_nan() {
                    sum += weight * v;
                    all += weight;
                }
            }
        }
        if !value.is_nan() {
            *value = sum / all;
        }
    }
    blurred
}
