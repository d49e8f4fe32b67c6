//! Fog lit through a PDSM (figure 8 g): V is asked for along every ray of the camera, anywhere between eye and surface.
//! `cargo run --release -p gnomon-pdsm --example fog [OUT.png [SCENE]]`.
//!
//! The fog scatters light once, alike in all directions: a step of length d at distance s adds `FOG`·d·e^(−`FOG`·s)·V of
//! the light's colour, and what is behind is dimmed by e^(−`FOG`·s).

use std::path::Path;
use std::time::Instant;

use glam::{Vec2, Vec3};
use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::light::LightPoint;
use scene_core::{SceneSetup, VisibilityImage, io, raster, scenes};

/// Steps a ray.
const STEPS: usize = 64;
/// Optical depth of the fog over the distance from the eye to what it looks at.
const FOG: f32 = 0.55;
/// Colour of light, of the surfaces' surroundings, and of the sky behind all.
const LIGHT: Vec3 = Vec3::new(1.0, 0.93, 0.8);
const AMBIENT: Vec3 = Vec3::new(0.10, 0.12, 0.16);
const SKY: Vec3 = Vec3::new(0.16, 0.19, 0.25);

fn picture(setup: &SceneSetup) -> Vec<[u8; 3]> {
    let (scene, light, camera) = (&setup.scene, &setup.lights[0], &setup.camera);
    let params = PdsmParams { views: 64, map_size: 512, pdsm_size: 512, ..Default::default() };
    let (pdsm, report) = Pdsm::new(params).prepare(scene, light);
    println!("built in {:.0} ms", report.total_ms("prepare."));
    let gbuffer = raster::render_gbuffer(scene, camera);
    let mut surface = VisibilityImage::new(camera.width, camera.height);
    pdsm.shade(&gbuffer, &mut surface);
    let start = Instant::now();
    let reach = camera.eye.distance(camera.target);
    let per_unit = FOG / reach;
    // A ray that meets nothing is followed twice as far as the eye looks.
    let mut points = Vec::with_capacity(gbuffer.pixel_count() * STEPS);
    let mut lengths = Vec::with_capacity(gbuffer.pixel_count());
    for pixel in 0..gbuffer.pixel_count() {
        let (x, y) = (pixel % camera.width as usize, pixel / camera.width as usize);
        let direction = camera.ray_direction(Vec2::new(x as f32 + 0.5, y as f32 + 0.5)).normalize();
        let length =
            if gbuffer.is_seen(pixel) { gbuffer.position[pixel].distance(camera.eye) } else { 2.0 * reach };
        // Neighbours start elsewhere within a step, so that steps show as fine grain and not as layers.
        let start = ((x * 5 + y * 7) % 16) as f32 / 16.0;
        points.extend(
            (0..STEPS).map(|i| camera.eye + direction * (length * (i as f32 + start) / STEPS as f32)),
        );
        lengths.push(length);
    }
    let mut values = vec![0.0; points.len()];
    pdsm.visibility_at(&points, &mut values);
    let ms = start.elapsed().as_secs_f64() * 1e3;
    println!("{} points in {ms:.0} ms, {:.0} ns a point", points.len(), ms * 1e6 / points.len() as f64);
    (0..gbuffer.pixel_count())
        .map(|pixel| {
            let seen = gbuffer.is_seen(pixel);
            let behind = if seen {
                let to_light = match light.center() {
                    LightPoint::At(place) => (place - gbuffer.position[pixel]).normalize_or_zero(),
                    LightPoint::Towards(direction) => direction,
                };
                let direct = gbuffer.normal[pixel].dot(to_light).max(0.0) * surface.values[pixel];
                (AMBIENT + LIGHT * direct) * 0.6
            } else {
                SKY
            };
            let depth = lengths[pixel] * per_unit;
            let step = depth / STEPS as f32;
            let lit: f32 = values[pixel * STEPS..][..STEPS]
                .iter()
                .zip(0..)
                .map(|(v, i)| v * step * (-(i as f32 + 0.5) * step).exp())
                .sum();
            let color = behind * (-depth).exp() + LIGHT * lit * 0.8;
            color.to_array().map(|c| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0).round() as u8)
        })
        .collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().unwrap_or_else(|| "fog.png".to_owned());
    let name = arguments.next().unwrap_or_else(|| "fence".to_owned());
    let mut setup = if Path::new(&name).exists() {
        io::load_setup(Path::new(&name))?
    } else {
        scenes::build(&name, 0.0)?
    };
    (setup.camera.width, setup.camera.height) = (400, 300);
    let pixels = picture(&setup);
    io::write::color_png(Path::new(&out), &pixels, 400, 300)?;
    Ok(())
}
