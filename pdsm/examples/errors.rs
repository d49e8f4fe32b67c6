//! The error on every built-in scene and light against 1,024 shadow rays a pixel: `cargo run --release -p gnomon-pdsm
//! --example errors [VIEWS [MAP_SIZE [PDSM_SIZE]]] [SCENE…]`, 256 maps of 1024² and a PDSM of 512² without numbers.

use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::bvh::Bvh;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::{VisibilityImage, metrics, raster, scenes};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<_> = std::env::args().skip(1).collect();
    let numbers: Vec<u32> = words.iter().map_while(|word| word.parse().ok()).collect();
    let names = &words[numbers.len()..];
    let number = |place: usize, default| numbers.get(place).copied().unwrap_or(default);
    let views = number(0, 256);
    let params = PdsmParams {
        views,
        map_size: number(1, 1024),
        pdsm_size: number(2, 512),
        max_error: 0.5 / views as f32,
        ..Default::default()
    };
    println!("{} maps of {}², PDSM of {}²", params.views, params.map_size, params.pdsm_size);
    println!("| scene | light | rmse | pen_rmse | p99 | MiB | built, s |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for scene in
        scenes::all().iter().filter(|scene| names.is_empty() || names.iter().any(|n| n == scene.name))
    {
        let mut setup = scenes::build(scene.name, 0.0)?;
        (setup.camera.width, setup.camera.height) = (256, 256);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let bvh = Bvh::casters(&setup.scene);
        for light in &setup.lights {
            let sampling = ReferenceSettings { samples: 1024, ..Default::default() };
            let truth = reference::reference(&setup.scene, &bvh, light, &gbuffer, &sampling, &no_progress)?;
            let valid = reference::valid_pixels(&gbuffer, light);
            let (pdsm, report) = Pdsm::new(params).prepare_for(&setup.scene, light, Some(&setup.camera));
            let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
            pdsm.shade(&gbuffer, &mut image);
            let errors = metrics::errors(&image, &truth.visibility, &valid)?;
            println!(
                "| {} | {} | {:.4} | {:.4} | {:.3} | {:.0} | {:.2} |",
                scene.name,
                light.kind(),
                errors.rmse,
                errors.pen_rmse,
                errors.p99,
                report.bytes as f64 / f64::from(1 << 20),
                report.total_ms("prepare.") * 1e-3
            );
        }
    }
    Ok(())
}
