//! Shadow volumes against one shadow ray a pixel; `auto` against `z-fail`; silhouettes a second. What skipping saves: `culling.rs`.
//!
//! Rays get their tree for nothing and volumes their edges: both live as long as the scene does, and both are timed on
//! their own.

#[path = "../tests/truth/mod.rs"]
mod truth;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gnomon_stencil_volumes::silhouette::extract;
use gnomon_stencil_volumes::{Casters, Count, StencilVolumes, VolumeParams};
use rayon::prelude::*;
use scene_core::bvh::Bvh;
use scene_core::geometry::{Incidence, facing};
use scene_core::{VisibilityImage, raster, scenes};

fn methods(criterion: &mut Criterion) {
    for spec in ["ball", "knot", "log-cabin", "chess", "street", "forest:triangles=200000"] {
        let setup = scenes::build(spec, 0.0).expect("a built-in scene");
        let (scene, light, camera) = (&setup.scene, setup.lights[0], setup.camera.with_size(512, 512));
        let gbuffer = raster::render_gbuffer(scene, &camera);
        let casters = Casters::new(scene).expect("few triangles");
        let bvh = Bvh::casters(scene);
        let mut visibility = VisibilityImage::new(512, 512);
        let mut group = criterion.benchmark_group(format!("hard-shadow/{spec}"));
        group.sample_size(20);
        for (name, count) in [("z-pass", Count::ZPass), ("z-fail", Count::ZFail), ("auto", Count::Auto)] {
            let technique = StencilVolumes::new(VolumeParams { count, ..Default::default() });
            group.bench_function(format!("volumes: {name}"), |b| {
                b.iter(|| technique.prepare(&casters, &light, &camera).0.shade(&gbuffer, &mut visibility));
            });
        }
        group.bench_function("volumes: edges of the scene", |b| b.iter(|| black_box(Casters::new(scene))));
        group.bench_function("rays: trace", |b| b.iter(|| truth::trace(scene, &bvh, &light, &gbuffer)));
        group.bench_function("rays: tree of the scene", |b| b.iter(|| black_box(Bvh::casters(scene))));
        group.finish();
    }
}

/// A scene that fits into caches, and one of two million triangles that does not.
const STREAMED: [&str; 2] = ["chess", "knot:sides=250"];

fn silhouettes(criterion: &mut Criterion) {
    for spec in STREAMED {
        silhouettes_of(criterion, spec);
    }
}

fn silhouettes_of(criterion: &mut Criterion, spec: &str) {
    let setup = scenes::build(spec, 0.0).expect("a built-in scene");
    let scene = &setup.scene;
    let casters = Casters::new(scene).expect("few triangles");
    let facing = facing(scene.positions(), scene.triangles(), setup.lights[0].center());
    let topology = &casters.topology;
    let run = || extract((topology, &casters.runs), scene.positions(), &facing);
    // What a pass must read: an edge's faces and their facing, of the silhouette's edges both vertex indices, too.
    let (edges, open) = (topology.len(), run().len());
    let faces = topology.faces_of(0..edges);
    let bytes = (size_of_val(faces) + faces.len() + 8 * open) as u64;
    println!(
        "{spec}: {edges} edges, {open} of the silhouette, {:.1} bytes an edge",
        bytes as f64 / edges as f64
    );
    let mut group = criterion.benchmark_group(format!("silhouette/{spec}"));
    for threads in [1, rayon::current_num_threads()] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        for (name, throughput) in
            [("edges", Throughput::Elements(edges as u64)), ("bytes", Throughput::Bytes(bytes))]
        {
            group.throughput(throughput);
            group.bench_function(format!("{name}, {threads} threads"), |b| {
                pool.install(|| b.iter(|| black_box(run())));
            });
        }
        // The same faces, with nothing done but to add them up.
        group.throughput(Throughput::Bytes(size_of_val(faces) as u64));
        group.bench_function(format!("plain reading, {threads} threads"), |b| {
            let sum = |faces: &[Incidence]| faces.iter().fold(0_u32, |sum, f| sum.wrapping_add(f.face()));
            pool.install(|| b.iter(|| faces.par_chunks(1 << 15).map(sum).reduce(|| 0, u32::wrapping_add)));
        });
    }
    group.finish();
}

/// The same pass on the GPU, by its own clock. It reads what the CPU reads, with facings of four bytes, and writes next to
/// nothing.
#[cfg(feature = "gpu")]
fn silhouettes_on_gpu(criterion: &mut Criterion) {
    let Ok(gpu) = scene_core::gpu::Gpu::open() else { return };
    for spec in STREAMED {
        silhouettes_of_on_gpu(criterion, &gpu, spec);
    }
}

#[cfg(feature = "gpu")]
fn silhouettes_of_on_gpu(criterion: &mut Criterion, gpu: &scene_core::gpu::Gpu, spec: &str) {
    let setup = scenes::build(spec, 0.0).expect("a built-in scene");
    let scene = &setup.scene;
    let topology = Casters::new(scene).expect("few triangles").topology;
    let incidences: usize = (0..topology.len()).map(|e| topology.faces(e).len()).sum();
    let bytes = (topology.len() * (8 + 4) + incidences * (4 + 4)) as u64;
    let camera = setup.camera.with_size(64, 64);
    let gbuffer = raster::render_gbuffer(scene, &camera);
    let mut view = gpu.view(scene, &camera).expect("a small scene");
    view.upload_gbuffer(&gbuffer).expect("the camera's size");
    let mut technique = view.technique(&StencilVolumes::default()).expect("a GPU path");
    let mut group = criterion.benchmark_group(format!("silhouette on the GPU/{spec}"));
    group.sample_size(10);
    for (name, throughput) in
        [("edges", Throughput::Elements(topology.len() as u64)), ("bytes", Throughput::Bytes(bytes))]
    {
        group.throughput(throughput);
        group.bench_function(name, |b| {
            b.iter_custom(|times| {
                let run =
                    |_| view.run(technique.as_mut(), &setup.lights[0], &gbuffer).expect("a frame").report;
                let ms: f64 = (0..times)
                    .map(run)
                    .map(|r| r.stages_ms.get("prepare.silhouette").copied())
                    .map(|ms| ms.unwrap_or_default())
                    .sum();
                std::time::Duration::from_secs_f64(ms * 1e-3)
            });
        });
    }
    group.finish();
}

#[cfg(not(feature = "gpu"))]
fn silhouettes_on_gpu(_: &mut Criterion) {}

criterion_group!(benches, methods, silhouettes, silhouettes_on_gpu);
criterion_main!(benches);
