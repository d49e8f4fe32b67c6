//! A look at a built-in scene: a shaded PNG with the hard shadow of the light's middle.
//!
//! ```text
//! cargo run --release --example preview -- chess:position=1 chess.png [time in seconds]
//! ```
//!
//! The rasteriser says what each pixel sees, one shadow ray a pixel whether the light's middle is seen from
//! there. Objects get colours of their own.

use std::error::Error;
use std::f32::consts::TAU;
use std::time::Instant;

use glam::Vec3;
use gnomon_scene_core::bvh::{Bvh, shadow_origin};
use gnomon_scene_core::raster::render_gbuffer;
use gnomon_scene_core::{GBuffer, Light, scenes};
use rayon::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [spec, file, rest @ ..] = &arguments[..] else {
        println!("usage: preview SCENE[:key=value,…] FILE.png [TIME]\n\nscenes:");
        for scene in scenes::all() {
            println!("  {:<10} {}", scene.name, scene.summary);
            for p in scene.parameters {
                println!("      {} = {} ({} to {}): {}", p.name, p.default, p.min, p.max, p.doc);
            }
        }
        return Ok(());
    };
    let time = rest.first().map_or(Ok(0.0), |t| t.parse())?;

    let start = Instant::now();
    let setup = scenes::build(spec, time)?;
    let built = start.elapsed();
    let gbuffer = render_gbuffer(&setup.scene, &setup.camera);
    let casters = Bvh::casters(&setup.scene);
    let magnitude = setup.scene.bounds().magnitude();
    let pixels: Vec<[u8; 3]> = (0..gbuffer.pixel_count())
        .into_par_iter()
        .map(|pixel| shade(&gbuffer, pixel, &setup.lights[0], &casters, magnitude))
        .collect();
    image::save_buffer(file, pixels.as_flattened(), gbuffer.width, gbuffer.height, image::ColorType::Rgb8)?;
    println!(
        "{}: {} vertices, {} triangles, {} meshes; built in {built:.1?}, all in {:.1?}",
        setup.name,
        setup.scene.positions().len(),
        setup.scene.triangles().len(),
        setup.scene.objects().len(),
        start.elapsed(),
    );
    Ok(())
}

fn shade(gbuffer: &GBuffer, pixel: usize, light: &Light, casters: &Bvh, magnitude: f32) -> [u8; 3] {
    if !gbuffer.is_seen(pixel) {
        return [168, 190, 214];
    }
    let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
    let (towards, _) = light.center().ray_from(position);
    let facing = normal.dot(towards.normalize_or_zero()).max(0.0);
    let origin = shadow_origin(position, normal, magnitude);
    let lit = facing > 0.0 && light.reaches(position) && !casters.is_occluded(origin, light.center());
    let ambient = 0.2 + 0.08 * normal.y;
    let shaded = colour(gbuffer.object[pixel]) * (ambient + if lit { 0.85 * facing } else { 0.0 });
    // Linear light to sRGB, near enough.
    shaded.to_array().map(|c| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0) as u8)
}

/// Pale hues, a golden turn apart; the first object is white.
fn colour(object: u32) -> Vec3 {
    if object == 0 {
        return Vec3::splat(0.8);
    }
    let hue = (object as f32 * 0.618_034).fract();
    let channel = |shift: f32| 0.62 + 0.22 * ((hue + shift) * TAU).cos();
    Vec3::new(channel(0.0), channel(2.0 / 3.0), channel(1.0 / 3.0))
}
