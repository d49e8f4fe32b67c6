//! What leaving wedges out saves, and from how many edges on it is cheaper to trace a tile's samples than to count.
//!
//! `cargo run --release -p gnomon-penumbra-wedges --example what_culling_saves [culling | rays] [SCENE WIDTHxHEIGHT]...`

use std::error::Error;
use std::time::Instant;

use glam::DVec3;
use gnomon_penumbra_wedges::cpu::{Answer, TILE};
use gnomon_penumbra_wedges::exact::{Exact, Scratch};
use gnomon_penumbra_wedges::receiver::{Asked, Receiver};
use gnomon_penumbra_wedges::{Casters, PenumbraWedges, PreparedWedges, Variant, WedgeParams};
use scene_core::{GBuffer, SceneSetup, VisibilityImage, raster, scenes};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let what = arguments.first();
    let all = what.is_none();
    if all || what.is_some_and(|what| what == "culling") {
        culling(arguments.get(1..).unwrap_or_default())?;
    }
    if all || what.is_some_and(|what| what == "rays") {
        rays()?;
    }
    Ok(())
}

/// Shading with wedges left out for strips, runs, tiles and pixels, and with all of them asked by every pixel.
fn culling(stations: &[String]) -> Result<(), Box<dyn Error>> {
    println!("| scene | edges | variant | all wedges, ms | culled, ms | pays | µs a penumbra pixel |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let usual = ["log-cabin", "192x192", "park", "192x192"].map(str::to_owned);
    for station in (if stations.is_empty() { &usual[..] } else { stations }).chunks_exact(2) {
        let (spec, size) = (&station[0], station[1].split_once('x').ok_or("a size is WIDTHxHEIGHT")?);
        let size = [size.0.parse()?, size.1.parse()?];
        let setup = scenes::build(spec, 0.0)?;
        let camera = setup.camera.with_size(size[0], size[1]);
        let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
        let casters = Casters::new(&setup.scene)?;
        for variant in [Variant::Interpolated, Variant::Coverage, Variant::Exact] {
            let mut took = Vec::new();
            let mut images = Vec::new();
            let (mut edges, mut each) = (0, 0.0);
            for skip in [false, true] {
                let params = WedgeParams { variant, skip, rays: false, ..Default::default() };
                let (prepared, _) =
                    PenumbraWedges::new(params).prepare(&casters, &setup.lights[0], &camera)?;
                let mut image = VisibilityImage::new(size[0], size[1]);
                let start = Instant::now();
                let (_, work) = prepared.shade_and_count(&gbuffer, &mut image);
                took.push(start.elapsed().as_secs_f64() * 1e3);
                images.push(image.bits());
                edges = prepared.wedges().map_or(0, |wedges| wedges.wedges.len());
                each = took[took.len() - 1] * 1e3 / work.penumbra.max(1) as f64;
            }
            let same = if images[0] == images[1] { "" } else { ", but images differ" };
            println!(
                "| `{spec}` {}×{} | {edges} | {variant:?} | {:.0} | {:.0} | {:.1}×{same} | {each:.1} |",
                size[0],
                size[1],
                took[0],
                took[1],
                took[0] / took[1]
            );
        }
    }
    Ok(())
}

/// One tile's receivers and edges.
struct Tile {
    receivers: Vec<Receiver>,
    edges: Vec<u32>,
}

/// Every `step`th tile.
fn tiles(exact: &Exact<'_>, setup: &SceneSetup, gbuffer: &GBuffer, step: usize) -> Vec<Tile> {
    let magnitude = setup.scene.bounds().magnitude();
    let (width, height) = (gbuffer.width as usize, gbuffer.height as usize);
    let corners = (0..height).step_by(TILE).flat_map(|y| (0..width).step_by(TILE).map(move |x| (x, y)));
    let tile = |(x, y): (usize, usize)| {
        let mut receivers = Vec::new();
        for row in y..(y + TILE).min(height) {
            for pixel in row * width + x..row * width + (x + TILE).min(width) {
                let light = &exact.wedges.light;
                if let Asked::Yes(receiver) = Receiver::at(&setup.scene, gbuffer, light, magnitude, pixel) {
                    receivers.push(receiver);
                }
            }
        }
        let (low, high) = receivers
            .iter()
            .map(Receiver::place)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), place| {
                (low.min(place), high.max(place))
            });
        let (center, half) = ((low + high) * 0.5, (high - low) * 0.5);
        let wedges = &exact.wedges.wedges;
        let edges = 0..wedges.len() as u32;
        let edges = if receivers.is_empty() {
            Vec::new()
        } else {
            edges.filter(|&e| wedges[e as usize].touches(center, half)).collect()
        };
        Tile { receivers, edges }
    };
    corners.step_by(step).map(tile).collect()
}

/// Time to count and time to trace, by edges of the tile for each sample.
fn rays() -> Result<(), Box<dyn Error>> {
    println!("| edges a sample | tiles | counting against tracing, middle of the ratios |");
    println!("| --- | --- | --- |");
    let limits = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, f64::INFINITY];
    let mut ratios = vec![Vec::new(); limits.len()];
    for spec in ["knot", "park", "street", "layers", "log-cabin"] {
        let setup = scenes::build(spec, 0.0)?;
        let camera = setup.camera.with_size(192, 192);
        let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
        let casters = Casters::new(&setup.scene)?;
        for views in [64, 256] {
            let params = WedgeParams { views, ..Default::default() };
            let (prepared, _) = PenumbraWedges::new(params).prepare(&casters, &setup.lights[0], &camera)?;
            let prepared: PreparedWedges<'_> = prepared;
            let Some(Answer::Exact(exact)) = prepared.answer() else { continue };
            let mut scratch = Scratch::default();
            for tile in tiles(&exact, &setup, &gbuffer, 13).iter().filter(|tile| !tile.edges.is_empty()) {
                let start = Instant::now();
                let counted: f32 =
                    tile.receivers.iter().map(|r| exact.visibility(r, &tile.edges, &mut scratch)).sum();
                let counting = start.elapsed();
                let start = Instant::now();
                let traced: f32 = tile.receivers.iter().map(|r| exact.traced(r, &mut scratch)).sum();
                let tracing = start.elapsed();
                if (counted - traced).abs() > 1.0 {
                    println!("{spec}: {counted} by counting, {traced} by rays");
                }
                let a_sample = tile.edges.len() as f64 / f64::from(views);
                let bin = limits.iter().position(|&limit| a_sample <= limit).unwrap_or(0);
                ratios[bin].push(counting.as_secs_f64() / tracing.as_secs_f64());
            }
        }
    }
    for (limit, ratios) in limits.iter().zip(&mut ratios) {
        ratios.sort_by(f64::total_cmp);
        let middle = ratios.get(ratios.len() / 2).copied().unwrap_or(f64::NAN);
        println!("| up to {limit} | {} | {middle:.2} |", ratios.len());
    }
    Ok(())
}
