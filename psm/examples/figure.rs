//! Draws the paper's figures in kind: chess under a spot (figure 1), street and forest under the sun (figures 8 to 10). From left
//! to right a uniform map, a perspective one of the same size, both looked up by texels so that these show, and one shadow ray a pixel.
//!
//! `cargo run --release -p gnomon-psm --example figure -- SCENE MAP_SIZE FILE.png`

use std::error::Error;
use std::path::Path;

use gnomon_psm::{Lookup, Psm, PsmParams, Variant};
use scene_core::bvh::Bvh;
use scene_core::io::write;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::{Light, VisibilityImage, raster, scenes};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [spec, map_size, file] = &arguments[..] else {
        return Err("asked for: SCENE MAP_SIZE FILE.png".into());
    };
    let map_size = map_size.parse()?;
    let setup = scenes::build(spec, 0.0)?;
    let camera = setup.camera.with_size(WIDTH as u32, HEIGHT as u32);
    let light = match setup.lights[0] {
        Light::Directional { direction, .. } => Light::Directional { direction, angular_radius: 0.0 },
        light => light,
    };
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let settings = ReferenceSettings::default();
    let casters = Bvh::casters(&setup.scene);
    let truth =
        reference::reference(&setup.scene, &casters, &light, &gbuffer, &settings, &no_progress)?.visibility;
    let valid = reference::valid_pixels(&gbuffer, &light);
    let by = |variant| {
        let params = PsmParams { variant, lookup: Lookup::Texel, map_size, ..Default::default() };
        let (prepared, _) = Psm::new(params).prepare(&setup.scene, &light, &camera, &gbuffer);
        let mut image = VisibilityImage::new(camera.width, camera.height);
        prepared.shade(&gbuffer, &mut image);
        let pixels = image.values.iter().zip(&truth.values).zip(&valid);
        let wrong = pixels.filter(|((v, t), valid)| **valid && (*v - *t).abs() > 0.5).count();
        println!("{spec}, {map_size}², {}: {wrong} wrong pixels", variant.name());
        image
    };
    let columns = [by(Variant::Uniform), by(Variant::Psm), truth.clone()];
    let mut pixels = vec![[255u8; 3]; 3 * WIDTH * HEIGHT];
    for (column, image) in columns.iter().enumerate() {
        for (i, v) in image.values.iter().enumerate() {
            // What is not seen is white; what is lit is shaded a little by its normal, in steps that keep the file small.
            let shade = gbuffer.normal[i].y.mul_add(0.2, 0.8);
            let grey = if v.is_nan() { 255 } else { (v.mul_add(0.75, 0.15) * shade * 255.0) as u8 & 0xf8 };
            pixels[i / WIDTH * 3 * WIDTH + column * WIDTH + i % WIDTH] = [grey; 3];
        }
    }
    write::color_png(Path::new(file), &pixels, 3 * WIDTH as u32, HEIGHT as u32)?;
    Ok(())
}
