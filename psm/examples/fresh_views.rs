//! How wrong pixels go by what `auto` chooses by ([`gnomon_psm::aliasing::expected_error`]), on views that are not those of the
//! example `directions`: from it comes the gain that `auto` asks for.
//!
//! `cargo run --release -p gnomon-psm --example fresh_views -- [SCENE]…`: two cameras, six suns and two sizes of map a scene,
//! 400 × 400 pixels. Of each of `psm` and `lispsm` that has more than 60 wrong pixels with `uniform`: measure and wrong pixels,
//! as shares of uniform's; and how far the logarithms of the two are apart.

#[path = "../tests/directions/mod.rs"]
mod directions;

use std::error::Error;

use glam::Vec3;
use gnomon_psm::{Parametrisation, PreparedPsm};
use scene_core::bvh::Bvh;
use scene_core::{Camera, Light, raster, scenes};

/// Fewer wrong pixels than this are chance.
const LEAST_COUNT: usize = 60;

/// Degrees over the ground, of suns 60° apart around it.
const ELEVATIONS: [f32; 6] = [25.0, 55.0, 38.0, 15.0, 65.0, 30.0];

/// The scene's own camera, and one that is nearer and lower.
fn cameras(own: Camera) -> [Camera; 2] {
    let ahead = own.target - own.eye;
    let eye = own.eye + ahead * 0.35 - Vec3::Y * (0.3 * ahead.y.abs());
    [own, Camera { eye, ..own }].map(|camera| camera.with_size(400, 400))
}

fn sun(index: usize) -> Light {
    let (sin, cos) = ELEVATIONS[index].to_radians().sin_cos();
    let (z, x) = (23.0 + 60.0 * index as f32).to_radians().sin_cos();
    Light::Directional { direction: Vec3::new(x * cos, -sin, z * cos), angular_radius: 0.0 }
}

fn measure(prepared: &PreparedPsm<'_>) -> Option<(Parametrisation, f64)> {
    prepared.maps().first().map(|map| (map.view.parametrisation, map.view.measure))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut specs: Vec<String> = std::env::args().skip(1).collect();
    if specs.is_empty() {
        let all = ["fence", "log-cabin", "knot", "pool", "ball", "cylinder", "park:leaves=1500", "street"];
        specs = all.map(str::to_owned).to_vec();
    }
    let (mut apart, mut worst) = (Vec::new(), 0f64);
    println!(
        "scene | camera | sun | map | variant | measure / uniform's | wrong pixels / uniform's | auto / uniform"
    );
    println!("--- | --- | --- | --- | --- | --- | --- | ---");
    for spec in &specs {
        let setup = scenes::build(spec, 0.3)?;
        let casters = Bvh::casters(&setup.scene);
        for (which, camera) in cameras(setup.camera).into_iter().enumerate() {
            let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
            for index in 0..ELEVATIONS.len() {
                let row = directions::Row::new(&setup.scene, &casters, camera, &gbuffer, sun(index));
                for map_size in [512, 2048] {
                    let rows = row.of_all(map_size);
                    let (uniform, of_uniform) = (rows[3].0, measure(&rows[3].1));
                    let Some((_, of_uniform)) = of_uniform.filter(|_| uniform >= LEAST_COUNT) else {
                        continue;
                    };
                    let share = |count: usize| count as f64 / uniform as f64;
                    worst = worst.max(share(rows[0].0));
                    for (variant, (wrong, prepared)) in ["psm", "lispsm"].iter().zip(&rows[1..3]) {
                        let Some((kind, measure)) = measure(prepared) else { continue };
                        if kind == Parametrisation::Uniform {
                            continue;
                        }
                        let (promised, found) = (measure / of_uniform, share(*wrong));
                        apart.push((found.max(1.0 / uniform as f64) / promised).ln());
                        println!(
                            "{spec} | {which} | {index} | {map_size} | {variant} | {promised:.3} | {found:.3} | {:.3}",
                            share(rows[0].0)
                        );
                    }
                }
            }
        }
    }
    let count = apart.len().max(1) as f64;
    let mean = apart.iter().sum::<f64>() / count;
    let variance = apart.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / count;
    println!(
        "{} rows; ln(found / promised): mean {mean:.3}, standard deviation {:.3}; worst auto / uniform {worst:.3}",
        apart.len(),
        variance.sqrt()
    );
    Ok(())
}
