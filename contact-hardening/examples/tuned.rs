//! `physical`, untouched, at 512 × 512 against 1,024 rays a pixel, beside what other engines reach on the same cases with bias, radius
//! and light size tuned to each: `cargo run --release -p gnomon-contact-hardening --example tuned FOLDER`, the folder that holds
//! `fence-sun.json`, `teapot-sphere.json` and `dragon-rect.json`. Fails where the rmse is above the engine's.

mod shared;

use std::error::Error;
use std::path::Path;

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams};
use shared::Case;

/// Cases, the engine that is best on each, and its rmse.
const CASES: [(&str, &str, f64); 3] = [
    ("fence-sun", "Babylon.js, cascaded PCSS, 2048²", 0.031),
    ("teapot-sphere", "three.js, PCSS of 64 + 64 points, 1024²", 0.020),
    ("dragon-rect", "three.js, PCSS of 64 + 64 points, 2048²", 0.047),
];

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("which folder holds the cases?")?;
    let technique = ContactHardening::new(ContactHardeningParams::default());
    println!("| scene | best tuned engine | its rmse | rmse | p99 | penumbra rmse |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let mut missed = Vec::new();
    for (name, engine, bar) in CASES {
        let file = Path::new(&folder).join(name).with_extension("json");
        let case = Case::new(&file.to_string_lossy(), [512, 512], 1024)?;
        let errors = case.errors(&case.run(&technique)?.0)?;
        println!(
            "| {name} | {engine} | {bar:.3} | {:.4} | {:.3} | {:.4} |",
            errors.rmse, errors.p99, errors.pen_rmse
        );
        if errors.rmse > bar {
            missed.push(name);
        }
    }
    if missed.is_empty() {
        Ok(())
    } else {
        Err(format!("above the tuned engine: {}", missed.join(", ")).into())
    }
}
