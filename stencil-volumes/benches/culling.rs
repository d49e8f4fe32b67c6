//! What each kind of skipping saves on street and forest, alone and together: milliseconds and pairs that were counted, in the scenes'
//! own views and in a narrow one, on both backends. All images of a view are compared: none differs.
//!
//! ```text
//! cargo bench -p gnomon-stencil-volumes --bench culling
//! ```

use std::time::Instant;

use gnomon_stencil_volumes::{Casters, Skips, StencilVolumes, VolumeParams};
use scene_core::{Camera, GBuffer, Report, SceneSetup, VisibilityImage, raster, scenes};

/// A frame is taken as the best of so many, or, if one takes longer than a second, of two.
const TIMES: usize = 5;

fn main() {
    #[cfg(feature = "gpu")]
    let gpu = scene_core::gpu::Gpu::open().ok();
    for spec in ["street", "forest:triangles=200000"] {
        let setup = scenes::build(spec, 0.0).expect("a built-in scene");
        let own = setup.camera.with_size(512, 512);
        let narrow = Camera { fov_y: 0.12, ..setup.camera.with_size(256, 256) };
        for (view, camera) in [("own view", own), ("narrow view", narrow)] {
            let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
            for rays in [false, true] {
                println!("\n{spec}, {view}, {}², rays {rays}, CPU", camera.width);
                on_cpu(&setup, &camera, &gbuffer, rays);
            }
            #[cfg(feature = "gpu")]
            if let Some(gpu) = &gpu {
                for rays in [false, true] {
                    println!("\n{spec}, {view}, {}², rays {rays}, {}", camera.width, gpu.adapter_name());
                    on_gpu(gpu, &setup, &camera, &gbuffer, rays);
                }
            }
        }
    }
}

/// A row for each kind of skipping: `frame` gives an image and its report with milliseconds.
fn rows(mut frame: impl FnMut(Skips) -> (f64, VisibilityImage, Report)) {
    println!("{:<28} {:>9} {:>7}  counted", "left out", "ms", "gain");
    let mut off: Option<(f64, VisibilityImage)> = None;
    for (name, skips) in Skips::EACH {
        let (mut ms, image, report) = frame(skips);
        let times = if ms > 1000.0 { 2 } else { TIMES };
        for _ in 1..times {
            ms = ms.min(frame(skips).0);
        }
        let (base, first) = off.get_or_insert_with(|| (ms, image.clone()));
        let differ =
            image.values.iter().zip(&first.values).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
        assert_eq!(differ, 0, "{name}: pixels differ");
        println!("{name:<28} {ms:>9.2} {:>6.2}×  {:?}", *base / ms, report.counted);
        if skips == Skips::ALL {
            println!("left out: {:?}\nstages: {:.2?}", report.skipped, report.stages_ms);
        }
    }
}

fn on_cpu(setup: &SceneSetup, camera: &Camera, gbuffer: &GBuffer, rays: bool) {
    let casters = Casters::new(&setup.scene).expect("few triangles");
    rows(|skips| {
        let technique = StencilVolumes::new(VolumeParams { rays, ..Default::default() }).with_skips(skips);
        let mut image = VisibilityImage::new(camera.width, camera.height);
        let start = Instant::now();
        let (prepared, mut report) = technique.prepare(&casters, &setup.lights[0], camera);
        report.merge(&prepared.shade(gbuffer, &mut image));
        (start.elapsed().as_secs_f64() * 1e3, image, report)
    });
}

#[cfg(feature = "gpu")]
fn on_gpu(gpu: &scene_core::gpu::Gpu, setup: &SceneSetup, camera: &Camera, gbuffer: &GBuffer, rays: bool) {
    use gnomon_stencil_volumes::StencilVolumesOnGpu;
    use scene_core::gpu::headless::VISIBILITY_FORMAT;
    let mut view = gpu.view(&setup.scene, camera).expect("a small scene");
    view.upload_gbuffer(gbuffer).expect("the camera's size");
    let params = VolumeParams { rays, ..Default::default() };
    let mut technique = StencilVolumesOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT);
    // Edges and tree are made once a scene.
    view.run(&mut technique, &setup.lights[0], gbuffer).expect("a frame");
    rows(|skips| {
        if let StencilVolumesOnGpu::Volumes(volumes) = &mut technique {
            volumes.set_skips(skips);
        }
        let run = view.run(&mut technique, &setup.lights[0], gbuffer).expect("a frame");
        (run.prepare_ms + run.shade_ms, run.visibility, run.report)
    });
}
