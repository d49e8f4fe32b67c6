//! `physical` beside uniform PCF with the best of its kernels, and beside PCSS at equal time:
//! `cargo run --release -p gnomon-contact-hardening --example table [SIDE] [SCENE…]`, of built-in scenes and scene files;
//! none are all built-in ones whose light has an extent.

mod shared;

use std::error::Error;

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant};
use scene_core::{metrics, scenes};
use shared::Case;

/// Texels a side of the maps of uniform PCF, and of its kernels: in a coarse map they are wide.
const UNIFORM: [u32; 2] = [512, 2048];
const FILTERS: [u32; 8] = [1, 3, 5, 9, 15, 23, 31, 41];

/// Texels a side and points of PCSS, the quality ladder.
const LADDER: [(u32, u32); 8] =
    [(512, 16), (1024, 16), (1024, 32), (1024, 64), (2048, 64), (2048, 128), (2048, 256), (2048, 512)];

fn main() -> Result<(), Box<dyn Error>> {
    let mut specs: Vec<String> = std::env::args().skip(1).collect();
    let side = specs.first().and_then(|word| word.parse().ok());
    if side.is_some() {
        specs.remove(0);
    }
    let side = side.unwrap_or(256);
    if specs.is_empty() {
        specs = scenes::all().iter().map(|scene| scene.name.to_owned()).collect();
    }
    println!(
        "| scene | best kernel | rmse | `physical` | rmse | share | PCSS at equal time | rmse | share |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut shares = Vec::new();
    for spec in &specs {
        let case = Case::new(spec, [side, side], 256)?;
        if !case.setup.lights[0].is_extended() {
            continue;
        }
        let map = |params: ShadowMapParams| -> Result<(metrics::Errors, f64), Box<dyn Error>> {
            measure(&case, &ShadowMap::new(params))
        };
        let mut best = (String::new(), f64::INFINITY);
        for (map_size, filter) in UNIFORM.into_iter().flat_map(|map| FILTERS.map(|filter| (map, filter))) {
            let params = ShadowMapParams { variant: Variant::Pcf, map_size, filter, ..Default::default() };
            let errors = case.errors(&case.run(&ShadowMap::new(params))?.0)?;
            if errors.rmse < best.1 {
                best = (format!("{map_size}², {filter}"), errors.rmse);
            }
        }
        let (own, own_ms) = measure(&case, &ContactHardening::new(ContactHardeningParams::default()))?;
        // The best rung that costs no more; the lowest costs more than that at times.
        let mut pcss = (String::new(), f64::INFINITY, f64::INFINITY);
        for (index, (map_size, taps)) in LADDER.into_iter().enumerate() {
            let (errors, ms) =
                map(ShadowMapParams { variant: Variant::Pcss, map_size, taps, ..Default::default() })?;
            if index == 0 || ms <= own_ms && errors.rmse < pcss.2 {
                pcss = (format!("{map_size}², {taps}"), ms, errors.rmse);
            }
        }
        let (kernel, uniform) = best;
        let (label, ms, soft) = pcss;
        shares.push([own.rmse / uniform, own.rmse / soft]);
        println!(
            "| {} | {kernel} | {uniform:.4} | {own_ms:.0} ms | {:.4} | {:.2} | {label}, {ms:.0} ms | {soft:.4} | {:.2} |",
            case.name,
            own.rmse,
            own.rmse / uniform,
            own.rmse / soft
        );
    }
    let count = shares.len().max(1) as f64;
    let mean = |at: usize| (shares.iter().map(|share| share[at].ln()).sum::<f64>() / count).exp();
    let over = |at: usize, bar: f64| shares.iter().filter(|share| share[at] > bar).count();
    println!("\nGeometric means of shares: {:.2} of uniform PCF, {:.2} of PCSS.", mean(0), mean(1));
    println!("Above 0.6 of uniform PCF: {}; above PCSS: {}, of {count}.", over(0, 0.6), over(1, 1.0));
    Ok(())
}

/// Errors, and the least milliseconds of two runs.
fn measure(
    case: &Case,
    technique: &dyn scene_core::technique::ShadowTechnique,
) -> Result<(metrics::Errors, f64), Box<dyn Error>> {
    let (image, first) = case.run(technique)?;
    let (_, second) = case.run(technique)?;
    Ok((case.errors(&image)?, first.min(second)))
}
