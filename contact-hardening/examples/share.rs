//! Time of `multi-pass` against the share of the image that is in penumbra, at 1920 × 1080:
//! `cargo run --release -p gnomon-contact-hardening --example share [FOLDER]` prints the table and writes `share.svg`.
//!
//! The ball's light is made smaller step by step: everything stays but the penumbra. For comparison, `gaussian`, and
//! `multi-pass` without skipping.

mod shared;

use std::error::Error;
use std::path::Path;

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, Variant};
use scene_core::technique::ShadowQuery;
use scene_core::{VisibilityImage, raster, scenes};
use shared::{Clock, Curve, chart};

const LIGHTS: [&str; 8] = ["0.01", "0.05", "0.1", "0.2", "0.35", "0.5", "0.7", "0.9"];

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".to_owned());
    let names = ["multi-pass", "gaussian", "multi-pass, skip=false"];
    let mut curves: Vec<Curve> = names.iter().map(|name| ((*name).to_owned(), Vec::new())).collect();
    println!("| light | penumbra, % of the image | {} ms |", names.join(" ms | "));
    println!("| --- | --- | --- | --- | --- |");
    for light in LIGHTS {
        let mut setup = scenes::build(&format!("ball:light={light}"), 0.0)?;
        (setup.camera.width, setup.camera.height) = (1920, 1080);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let query = ShadowQuery { scene: &setup.scene, light: &setup.lights[0], camera: &setup.camera };
        let mut times = Vec::new();
        let mut share = 0.0;
        for (variant, skip) in
            [(Variant::MultiPass, true), (Variant::Gaussian, true), (Variant::MultiPass, false)]
        {
            let params = ContactHardeningParams { variant, taps: 20, skip, ..Default::default() };
            let (prepared, _) = ContactHardening::new(params).prepare(&query)?;
            let mut image = VisibilityImage::new(1920, 1080);
            let mut least = f64::INFINITY;
            for _ in 0..2 {
                let clock = Clock::start();
                prepared.shade(&setup.camera, &gbuffer, &mut image)?;
                least = least.min(clock.milliseconds());
            }
            times.push(least);
            if variant == Variant::Gaussian {
                let partly = image.values.iter().filter(|&&v| v > 0.001 && v < 0.999).count();
                share = 100.0 * partly as f64 / image.values.len() as f64;
            }
        }
        let words: Vec<String> = times.iter().map(|ms| format!("{ms:.0}")).collect();
        println!("| {light} | {share:.2} | {} |", words.join(" | "));
        for (curve, ms) in curves.iter_mut().zip(times) {
            curve.1.push([share, ms]);
        }
    }
    let title = "Passes 2 to 5 at 1920 × 1080, ball, 20 points";
    let svg = chart(title, ["penumbra, % of the image", "processor ms"], &curves);
    std::fs::write(Path::new(&folder).join("share.svg"), svg)?;
    Ok(())
}
