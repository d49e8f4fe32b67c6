//! What points cost in place of triangles: a forest of 20 million triangles, its plants drawn by their triangles and as points.
//!
//! `cargo run --release -p gnomon-psm --example points -- [TRIANGLES] [MAP_SIZE]`; 20,000,000 and 1024 unless told. Drawing is the
//! median of five frames.

use std::error::Error;
use std::time::Instant;

use gnomon_psm::points::PointClouds;
use gnomon_psm::{Casters, Psm, PsmParams};
use scene_core::{Light, Report, VisibilityImage, raster, scenes};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<u32>());
    let triangles = arguments.next().unwrap_or(Ok(20_000_000))?;
    let map_size = arguments.next().unwrap_or(Ok(1024))?;
    println!(
        "plants drawn by | clouds, ms | points kept | points drawn | prepare.maps, ms | pixels that differ"
    );
    println!("--- | --- | --- | --- | --- | ---");
    let setup = scenes::build(&format!("forest:points=1,triangles={triangles}"), 0.0)?;
    let (scene, camera) = (&setup.scene, setup.camera.with_size(512, 512));
    let light = match setup.lights[0] {
        Light::Directional { direction, .. } => Light::Directional { direction, angular_radius: 0.0 },
        light => light,
    };
    let gbuffer = raster::render_gbuffer(scene, &camera);
    let params = PsmParams { map_size, ..Default::default() };
    let technique = Psm::new(params);
    let start = Instant::now();
    let clouds = PointClouds::new(scene);
    let made = start.elapsed().as_secs_f64() * 1e3;
    let surfaces = Casters::new(scene, &params, &mut Report::default()).surfaces;
    let mut first: Option<VisibilityImage> = None;
    for (name, clouds) in [("triangles", PointClouds::default()), ("points", clouds)] {
        let casters = Casters { clouds, surfaces: surfaces.clone() };
        let clouds = &casters.clouds;
        let (mut times, mut drawn) = (Vec::new(), 0);
        let mut image = VisibilityImage::new(camera.width, camera.height);
        for _ in 0..5 {
            let (prepared, report) = technique.prepare_with(&casters, scene, &light, &camera, &gbuffer);
            times.push(report.stages_ms["prepare.maps"]);
            let maps = prepared.maps().iter();
            drawn = maps.map(|map| clouds.chosen(scene, &map.view, map_size).count()).sum();
            prepared.shade(&gbuffer, &mut image);
        }
        times.sort_by(f64::total_cmp);
        let differ = first.as_ref().map_or(0, |first| {
            first.values.iter().zip(&image.values).filter(|(a, b)| a.to_bits() != b.to_bits()).count()
        });
        let made = if clouds.is_empty() { 0.0 } else { made };
        println!("{name} | {made:.0} | {} | {drawn} | {:.1} | {differ}", clouds.count(), times[2]);
        first.get_or_insert(image);
    }
    Ok(())
}
