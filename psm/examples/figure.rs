//! Draws figure 1 of the paper in kind: chess under a spot, with a uniform map, with a perspective one of the same size,
//! and by one shadow ray a pixel; below them the street under its sun.
//!
//! `cargo run --release -p gnomon-psm --example figure -- FILE.png`

use std::error::Error;
use std::path::Path;

use gnomon_psm::{Psm, PsmParams, Variant};
use scene_core::bvh::Bvh;
use scene_core::io::write;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::{Light, VisibilityImage, raster, scenes};

const WIDTH: usize = 160;
const HEIGHT: usize = 120;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).unwrap_or("figure.png".to_owned());
    let mut pixels = vec![[255u8; 3]; 3 * WIDTH * 2 * HEIGHT];
    for (line, spec) in ["chess", "street"].into_iter().enumerate() {
        let setup = scenes::build(spec, 0.0)?;
        let camera = setup.camera.with_size(WIDTH as u32, HEIGHT as u32);
        let light = match setup.lights[0] {
            Light::Directional { direction, .. } => Light::Directional { direction, angular_radius: 0.0 },
            light => light,
        };
        let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
        let by = |variant| {
            let params = PsmParams { variant, map_size: 256, ..Default::default() };
            let (prepared, _) = Psm::new(params).prepare(&setup.scene, &light, &camera, &gbuffer);
            let mut image = VisibilityImage::new(camera.width, camera.height);
            prepared.shade(&gbuffer, &mut image);
            image
        };
        let settings = ReferenceSettings::default();
        let casters = Bvh::casters(&setup.scene);
        let truth = reference::reference(&setup.scene, &casters, &light, &gbuffer, &settings, &no_progress)?;
        for (column, image) in [by(Variant::Uniform), by(Variant::Psm), truth.visibility].iter().enumerate() {
            for (i, v) in image.values.iter().enumerate() {
                let place = (line * HEIGHT + i / WIDTH) * 3 * WIDTH + column * WIDTH + i % WIDTH;
                // What is not seen is white; what is lit is shaded a little by its normal.
                let shade = gbuffer.normal[i].y.mul_add(0.2, 0.8);
                pixels[place] =
                    [if v.is_nan() { 255 } else { (v.mul_add(0.75, 0.15) * shade * 255.0) as u8 }; 3];
            }
        }
    }
    write::color_png(Path::new(&file), &pixels, 3 * WIDTH as u32, 2 * HEIGHT as u32)?;
    Ok(())
}
