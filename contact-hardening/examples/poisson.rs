//! How far Poisson points are from the whole Gaussian kernel they stand for, as in the paper's figure 7: ten passes of
//! `multi-pass`, 1 to 20 points of a kernel of 29 × 29 pixels, against every pixel of it.
//! `cargo run --release -p gnomon-contact-hardening --example poisson [FOLDER]` prints the table and writes
//! `poisson.svg` and `figure-7.png`.

mod shared;

use std::error::Error;
use std::path::Path;

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, GaussianKernel, Scaling, Variant};
use scene_core::io::write;
use shared::{Case, Curve, chart, in_rows};

const SCENES: [&str; 4] = ["ball", "fence", "log-cabin", "pool"];

/// As many kernels are drawn, each from another seed.
const SEEDS: u32 = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".to_owned());
    let mut curves: Vec<Curve> = Vec::new();
    println!("rms difference from the whole kernel, over pixels that it changes\n");
    println!("| points | {} | mean |\n| ---{} | --- |", SCENES.join(" | "), " | ---".repeat(SCENES.len()));
    let mut table = vec![Vec::new(); 24];
    for name in SCENES {
        // No rays: what is compared are two blurs.
        let case = Case::new(name, [240, 180], 1)?;
        let blur = |kernel: GaussianKernel, taps: u32, seed: u32| {
            // Every shadowed pixel has D = 29, and the dilation gives its surroundings some.
            let params = ContactHardeningParams {
                variant: Variant::MultiPass,
                scaling: Scaling::Paper,
                geometry: false,
                fill: false,
                smooth: false,
                widening: false,
                kernel,
                taps,
                seed,
                kernel_size: 29,
                passes: 10,
                dilate: 29,
                distance_power: 0.0,
                distance_multiplier: 29.0,
                ..Default::default()
            };
            case.run(&ContactHardening::new(params)).map(|(image, _)| image)
        };
        let whole = blur(GaussianKernel::Separable, 1, 0)?;
        let hard = blur(GaussianKernel::PoissonDisk, 1, 0)?;
        let changed: Vec<usize> = (0..whole.values.len())
            .filter(|&pixel| (whole.values[pixel] - hard.values[pixel]).abs() > 1.0 / 255.0)
            .collect();
        if name == "ball" {
            // The picture: some numbers of points, and the whole kernel.
            let mut images = Vec::new();
            for taps in [1, 2, 4, 8, 12, 16, 20] {
                images.push(blur(GaussianKernel::PoissonDisk, taps, 0)?);
            }
            images.push(whole.clone());
            write::visibility_png(&Path::new(&folder).join("figure-7.png"), &in_rows(&images, 4))?;
        }
        let mut points = Vec::new();
        for (taps, row) in (1..).zip(&mut table) {
            let mut sum = 0.0;
            for seed in 0..SEEDS {
                let image = blur(GaussianKernel::PoissonDisk, taps, seed)?;
                sum += changed
                    .iter()
                    .map(|&pixel| f64::from(image.values[pixel] - whole.values[pixel]).powi(2))
                    .sum::<f64>();
            }
            let error = (sum / (changed.len().max(1) as f64 * f64::from(SEEDS))).sqrt();
            row.push(error);
            points.push([f64::from(taps), error]);
        }
        curves.push((name.to_owned(), points));
    }
    for (taps, row) in (1..).zip(&table) {
        let mean = row.iter().sum::<f64>() / row.len() as f64;
        let words: Vec<String> = row.iter().map(|error| format!("{error:.4}")).collect();
        println!("| {taps} | {} | {mean:.4} |", words.join(" | "));
    }
    let title = "Poisson points of a 29 × 29 Gaussian, ten passes";
    let svg = chart(title, ["points", "rms difference from the whole kernel"], &curves);
    std::fs::write(Path::new(&folder).join("poisson.svg"), svg)?;
    Ok(())
}
