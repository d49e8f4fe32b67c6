//! What points cost in place of triangles: a forest of millions of triangles, its plants drawn by their triangles and as points.
//!
//! `cargo run --release -p gnomon-psm --example points -- [TRIANGLES] [MAP_SIZE]…`; 20,000,000 triangles and maps of 256, 512 and 1024
//! texels a side unless told. Drawing is the median of five frames of 512 × 512 pixels; the first makes what is
//! kept. On the GPU, too, where it binds so many triangles.

use std::error::Error;
use std::time::Instant;

use gnomon_psm::points::PointClouds;
use gnomon_psm::{Casters, Psm, PsmParams};
use scene_core::{Camera, GBuffer, Light, Report, Scene, SceneSetup, VisibilityImage, raster, scenes};

const RUNS: usize = 5;

/// What both backends are asked about.
struct Forest {
    scene: Scene,
    camera: Camera,
    light: Light,
    gbuffer: GBuffer,
}

/// One way to draw the plants.
struct Drawn {
    maps_ms: f64,
    triangles: u64,
    points: u64,
    image: VisibilityImage,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<u32> = std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let triangles = arguments.first().copied().unwrap_or(20_000_000);
    let sizes = if arguments.len() > 1 { &arguments[1..] } else { &[256, 512, 1024][..] };
    let forest = Forest::new(triangles, 1)?;
    let start = Instant::now();
    let clouds = PointClouds::new(&forest.scene);
    let made = start.elapsed().as_secs_f64() * 1e3;
    println!("clouds: {} points of {triangles} triangles, made in {made:.0} ms", clouds.count());
    println!(
        "backend | map | triangles | prepare.maps, ms | with points: triangles | points | prepare.maps, ms | ratio | pixels that differ"
    );
    println!("--- | --- | --- | --- | --- | --- | --- | --- | ---");
    let surfaces = Casters::new(&forest.scene, &PsmParams::default(), &mut Report::default()).surfaces;
    let [plain, marked] =
        [PointClouds::default(), clouds].map(|clouds| Casters { clouds, surfaces: surfaces.clone() });
    for &map_size in sizes {
        let technique = Psm::new(PsmParams { map_size, ..Default::default() });
        print("CPU", map_size, [&plain, &marked].map(|casters| on_cpu(&technique, casters, &forest)));
    }
    drop((plain, marked, surfaces, forest));
    #[cfg(feature = "gpu")]
    on_gpu(triangles, sizes)?;
    Ok(())
}

impl Forest {
    /// With `points` 1 its plants are marked.
    fn new(triangles: u32, points: u32) -> Result<Self, Box<dyn Error>> {
        let setup = scenes::build(&format!("forest:points={points},triangles={triangles}"), 0.0)?;
        let SceneSetup { scene, camera, lights, .. } = setup;
        let light = match lights[0] {
            Light::Directional { direction, .. } => Light::Directional { direction, angular_radius: 0.0 },
            light => light,
        };
        let camera = camera.with_size(512, 512);
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        Ok(Self { scene, camera, light, gbuffer })
    }
}

fn on_cpu(technique: &Psm, casters: &Casters, forest: &Forest) -> Drawn {
    let Forest { scene, camera, light, gbuffer } = forest;
    let mut image = VisibilityImage::new(camera.width, camera.height);
    let (mut times, mut triangles, mut points) = (Vec::new(), 0, 0);
    for _ in 0..RUNS {
        let (prepared, report) = technique.prepare_with(casters, scene, light, camera, gbuffer);
        times.push(report.stages_ms["prepare.maps"]);
        (triangles, points) = (report.counted["caster triangles drawn"], report.counted["points drawn"]);
        prepared.shade(gbuffer, &mut image);
    }
    Drawn { maps_ms: median(times), triangles, points, image }
}

/// The same on the GPU, which is told of points by the scene's own marks.
#[cfg(feature = "gpu")]
fn on_gpu(triangles: u32, sizes: &[u32]) -> Result<(), Box<dyn Error>> {
    use scene_core::gpu::Gpu;

    let gpu = Gpu::open()?;
    let mut drawn = [Vec::new(), Vec::new()];
    for (points, drawn) in (0..).zip(&mut drawn) {
        let Forest { scene, camera, light, gbuffer } = Forest::new(triangles, points)?;
        let mut view = match gpu.view(&scene, &camera) {
            Ok(view) => view,
            Err(error) => {
                println!("GPU: {error}");
                return Ok(());
            }
        };
        view.upload_gbuffer(&gbuffer)?;
        for &map_size in sizes {
            let mut technique = view.technique(&Psm::new(PsmParams { map_size, ..Default::default() }))?;
            let mut run = || view.run(technique.as_mut(), &light, &gbuffer);
            let first = run()?;
            let times = (0..RUNS).map(|_| Ok(run()?.report.stages_ms["prepare.maps"]));
            let maps_ms = median(times.collect::<Result<_, Box<dyn Error>>>()?);
            let [triangles, points] =
                ["caster triangles drawn", "points drawn"].map(|name| first.report.counted[name]);
            drawn.push(Drawn { maps_ms, triangles, points, image: first.visibility });
        }
    }
    let [plain, marked] = drawn;
    for (&map_size, both) in sizes.iter().zip(plain.into_iter().zip(marked)) {
        print("GPU", map_size, both.into());
    }
    Ok(())
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn print(backend: &str, map_size: u32, [plain, marked]: [Drawn; 2]) {
    let pixels = plain.image.values.iter().zip(&marked.image.values);
    let differ = pixels.filter(|(a, b)| a.to_bits() != b.to_bits()).count();
    println!(
        "{backend} | {map_size} | {} | {:.1} | {} | {} | {:.1} | {:.2} | {differ}",
        plain.triangles,
        plain.maps_ms,
        marked.triangles,
        marked.points,
        marked.maps_ms,
        marked.maps_ms / plain.maps_ms,
    );
}
