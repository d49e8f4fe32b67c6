//! Draws the scenes made for what `coverage` does not know: a line each of `coverage`, `exact` and ground truth, and where `coverage` is too
//! dark (blue) or too light (red).
//!
//! `cargo run --release -p gnomon-penumbra-wedges --example known_errors -- FILE.png`

#[path = "../tests/truth/mod.rs"]
mod truth;

use std::error::Error;
use std::path::Path;

use gnomon_penumbra_wedges::{Variant, WedgeParams};
use scene_core::bvh::Bvh;
use scene_core::io::write;
use scene_core::reference::{ReferenceSettings, no_progress, reference};
use truth::{known_errors, shade};

const SIZE: [usize; 2] = [144, 108];

/// Blue where a value is too small, red where it is too large, full at a half.
fn signed(difference: f32) -> [u8; 3] {
    let fade = (255.0 * (1.0 - 2.0 * difference.abs()).max(0.0)) as u8;
    if difference < 0.0 { [fade, fade, 255] } else { [255, fade, fade] }
}

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).unwrap_or("known_errors.png".to_owned());
    let (scenes, camera) = known_errors();
    let [width, height] = SIZE;
    let camera = camera.with_size(width as u32, height as u32);
    let mut pixels = vec![[255_u8; 3]; 4 * width * 2 * height];
    for (line, (_, scene, light)) in scenes.iter().enumerate() {
        let by = |variant| shade(scene, light, &camera, WedgeParams { variant, ..Default::default() });
        let (gbuffer, coverage, _) = by(Variant::Coverage);
        let (_, exact, _) = by(Variant::Exact);
        let settings = ReferenceSettings { samples: 1024, seed: 11, skip: true };
        let truth =
            reference(scene, &Bvh::casters(scene), light, &gbuffer, &settings, &no_progress)?.visibility;
        for pixel in (0..width * height).filter(|&pixel| gbuffer.is_seen(pixel)) {
            let shades = [&coverage, &exact, &truth].map(|image| [(image.values[pixel] * 255.0) as u8; 3]);
            let difference = signed(coverage.values[pixel] - truth.values[pixel]);
            let row = (line * height + pixel / width) * 4 * width + pixel % width;
            for (column, color) in shades.into_iter().chain([difference]).enumerate() {
                pixels[row + column * width] = color;
            }
        }
    }
    write::color_png(Path::new(&file), &pixels, 4 * width as u32, 2 * height as u32)?;
    Ok(())
}
