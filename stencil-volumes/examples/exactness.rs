//! Holds shadow volumes against one exact shadow ray a pixel, on every built-in scene and every file given: every way of
//! counting, on the CPU and, with the feature `gpu`, on the GPU. A table in Markdown; ends with 1 if a pixel is wrong.
//!
//! A ray starts from the position that the G-buffer holds. The CPU's holds places, the GPU's a distance along the pixel's ray in f32,
//! so each backend is held against the rays of its own G-buffer. `by rounding` says at how many pixels the two disagree: there the
//! surface contains the light up to rounding, or an outline passes between both places.
//!
//! ```text
//! cargo run --release -p gnomon-stencil-volumes --example exactness -- --size 512 ../shared/scenes/*.obj
//! ```

#[path = "../tests/truth/mod.rs"]
mod truth;

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use gnomon_stencil_volumes::{Casters, Count, StencilVolumes, VolumeParams, near_casters};
use scene_core::bvh::Bvh;
#[cfg(feature = "gpu")]
use scene_core::gpu::Gpu;
use scene_core::{Camera, GBuffer, Light, Scene, SceneSetup, VisibilityImage, io, raster, scenes};
#[cfg(feature = "gpu")]
use truth::as_textures_hold_it;
use truth::{Comparison, compare, trace};

fn main() -> ExitCode {
    let mut size = 512;
    let mut setups: Vec<(String, SceneSetup)> = Vec::new();
    let built_in = |spec: &str| scenes::build(spec, 0.0).map_err(|error| error.to_string());
    let mut arguments = std::env::args().skip(1).peekable();
    let mut given = Vec::new();
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--size" => size = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(size),
            _ => given.push(argument),
        }
    }
    if given.is_empty() {
        given = scenes::all().iter().map(|scene| format!("builtin:{}", scene.name)).collect();
    }
    for file in &given {
        let setup = match file.strip_prefix("builtin:") {
            Some(spec) => built_in(spec),
            None => io::load_setup(Path::new(file)).map_err(|error| error.to_string()),
        };
        match setup {
            Ok(setup) => setups.push((file.clone(), setup)),
            Err(error) => eprintln!("{file}: {error}"),
        }
    }
    println!(
        "| scene | light | edges | way | asked | differ | of these at a border | within two lifts | by rounding | wrong | ms |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut wrong = 0;
    for (name, setup) in &setups {
        wrong += run(name, setup, size);
    }
    println!("\n{wrong} wrong");
    ExitCode::from(u8::from(wrong > 0))
}

/// One view of a scene by one light.
struct Case<'a> {
    name: &'a str,
    scene: &'a Scene,
    camera: Camera,
    light: Light,
    gbuffer: &'a GBuffer,
    bvh: &'a Bvh,
    truth: Vec<f32>,
    /// Pixels at which rays from the other backend's positions say something else.
    by_rounding: usize,
    edges: usize,
}

impl Case<'_> {
    /// Prints a row; how many pixels are wrong.
    fn row(&self, way: &str, image: &VisibilityImage, ms: f64) -> usize {
        let Comparison { asked, differ, at_border, at_lift, wrong } =
            compare(self.scene, self.bvh, &self.light, &self.camera, self.gbuffer, &self.truth, image);
        println!(
            "| {} | {} | {} | {way} | {asked} | {differ} | {at_border} | {at_lift} | {} | {} | {ms:.1} |",
            self.name,
            self.light.kind(),
            self.edges,
            self.by_rounding,
            wrong.len()
        );
        wrong.len()
    }
}

fn run(name: &str, setup: &SceneSetup, size: u32) -> usize {
    let (scene, camera) = (&setup.scene, setup.camera.with_size(size, size));
    let short = name.rsplit(['/', ':']).next().unwrap_or(name);
    let casters = match Casters::new(scene) {
        Ok(casters) => casters,
        Err(error) => {
            println!("{short}: {error}");
            return 0;
        }
    };
    let bvh = Bvh::casters(scene);
    let gbuffer = raster::render_gbuffer(scene, &camera);
    let bounds = scene.bounds();
    let inside = bounds.center() + 0.3 * bounds.size() * glam::Vec3::new(0.5, 0.9, 0.7);
    #[cfg(feature = "gpu")]
    let gpu = Gpu::open().ok();
    let mut wrong = 0;
    for light in [setup.lights[0], Light::Point { position: inside }] {
        let start = Instant::now();
        let truth = trace(scene, &bvh, &light, &gbuffer);
        let rays_ms = start.elapsed().as_secs_f64() * 1e3;
        let mut case = Case {
            name: short,
            scene,
            camera,
            light,
            gbuffer: &gbuffer,
            bvh: &bvh,
            truth,
            by_rounding: 0,
            edges: 0,
        };
        let outside = near_casters(&casters, &light, &camera).is_empty();
        let ways = [(Count::ZPass, "z-pass"), (Count::ZFail, "z-fail"), (Count::Auto, "auto")];
        for (count, way) in ways.into_iter().filter(|(count, _)| outside || *count != Count::ZPass) {
            let technique = StencilVolumes::new(VolumeParams { count, ..Default::default() });
            let mut image = VisibilityImage::new(size, size);
            let start = Instant::now();
            let (prepared, _) = technique.prepare(&casters, &light, &camera);
            prepared.shade(&gbuffer, &mut image);
            let ms = start.elapsed().as_secs_f64() * 1e3;
            case.edges = prepared.volumes().map_or(0, |v| v.edges.len());
            wrong += case.row(&format!("CPU {way}"), &image, ms);
        }
        #[cfg(feature = "gpu")]
        if let Some(gpu) = &gpu {
            let held = as_textures_hold_it(&gbuffer, &camera);
            let truth = trace(scene, &bvh, &light, &held);
            let by_rounding =
                truth.iter().zip(&case.truth).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
            let edges = case.edges;
            let case = Case {
                name: short,
                scene,
                camera,
                light,
                gbuffer: &held,
                bvh: &bvh,
                truth,
                by_rounding,
                edges,
            };
            wrong += on_gpu(gpu, &case, &gbuffer, outside);
        }
        let image = VisibilityImage { values: case.truth.clone(), ..VisibilityImage::new(size, size) };
        case.row("one ray", &image, rays_ms);
    }
    wrong
}

/// The same on the GPU, given the G-buffer of the CPU; without a device that shades the case, nothing.
#[cfg(feature = "gpu")]
fn on_gpu(gpu: &Gpu, case: &Case<'_>, uploaded: &GBuffer, outside: bool) -> usize {
    let mut wrong = 0;
    for (count, way) in [(Count::ZPass, "z-pass"), (Count::Auto, "z-fail, auto")] {
        if count == Count::ZPass && !outside {
            continue;
        }
        let technique = StencilVolumes::new(VolumeParams { count, ..Default::default() });
        let shaded = || -> Result<_, Box<dyn std::error::Error>> {
            let mut view = gpu.view(case.scene, &case.camera)?;
            view.upload_gbuffer(uploaded)?;
            let mut technique = view.technique(&technique)?;
            Ok(view.run(technique.as_mut(), &case.light, uploaded)?)
        };
        match shaded() {
            Ok(run) => {
                let ms = run.report.stages_ms.iter().filter(|(stage, _)| *stage != "prepare.edges");
                let ms = ms.map(|(_, ms)| ms).sum();
                wrong += case.row(&format!("GPU {way}"), &run.visibility, ms);
            }
            Err(error) => eprintln!("{}: {error}", case.name),
        }
    }
    wrong
}
