//! Draws a scene with shadow volumes on the left and one shadow ray a pixel on the right, as PNG.
//!
//! ```text
//! cargo run --release -p gnomon-stencil-volumes --example figure -- knot figure.png
//! ```

#[path = "../tests/truth/mod.rs"]
mod truth;

use std::path::Path;

use gnomon_stencil_volumes::{Casters, StencilVolumes};
use scene_core::bvh::Bvh;
use scene_core::light::LightPoint;
use scene_core::{VisibilityImage, io, raster, scenes};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let spec = words.next().unwrap_or_else(|| "knot".to_owned());
    let file = words.next().unwrap_or_else(|| "figure.png".to_owned());
    let setup = scenes::build(&spec, 0.0)?;
    let (width, height) = (200, 160);
    let (scene, light, camera) = (&setup.scene, setup.lights[0], setup.camera.with_size(width, height));
    let gbuffer = raster::render_gbuffer(scene, &camera);
    let casters = Casters::new(scene)?;
    let (prepared, _) = StencilVolumes::default().prepare(&casters, &light, &camera);
    let mut volumes = VisibilityImage::new(width, height);
    prepared.shade(&gbuffer, &mut volumes);
    let rays = truth::trace(scene, &Bvh::casters(scene), &light, &gbuffer);
    let mut pixels = Vec::new();
    for row in 0..height as usize {
        for image in [&volumes.values, &rays] {
            for pixel in row * width as usize..(row + 1) * width as usize {
                let towards = match light.center() {
                    LightPoint::At(place) => (place - gbuffer.position[pixel]).normalize_or_zero(),
                    LightPoint::Towards(direction) => direction,
                };
                let lit = 0.12 + 0.8 * image[pixel] * gbuffer.normal[pixel].dot(towards).max(0.0);
                let grey = if gbuffer.is_seen(pixel) { (lit.sqrt() * 255.0) as u8 } else { 90 };
                pixels.push([grey; 3]);
            }
        }
    }
    io::write::color_png(Path::new(&file), &pixels, 2 * width, height)?;
    Ok(())
}
