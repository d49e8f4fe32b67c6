//! What building a PDSM costs, stage by stage; emission beside the paper's walk; a lookup beside 64 shadow rays.
//!
//! `cargo bench --no-default-features -p gnomon-pdsm` builds 64 maps of 512² over a curved closed mesh of 200,000
//! triangles. Emission and walk make the same events from the same maps, at several resolutions.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use gnomon_pdsm::crossings::Crossings;
use gnomon_pdsm::emission::{EmissionScratch, emit_events};
use gnomon_pdsm::events::EventStrips;
use gnomon_pdsm::functions::Functions;
use gnomon_pdsm::grid::{DepthGrid, PixelGrid};
use gnomon_pdsm::layout::{Fit, Layout};
use gnomon_pdsm::walk::walk_events;
use gnomon_pdsm::{Pdsm, PdsmParams, cpu};
use scene_core::bvh::Bvh;
use scene_core::raster::{DepthOptions, render_depth};
use scene_core::reference::{ReferenceSettings, no_progress, reference};
use scene_core::{SceneSetup, VisibilityImage, raster, relevance, scenes};

fn setup() -> SceneSetup {
    scenes::build("knot:sides=79", 0.0).expect("a built-in scene")
}

/// The knot alone, without its ground.
fn layout(setup: &SceneSetup, map_size: u32, views: u32) -> Layout {
    let light = &setup.lights[0];
    let casters = relevance::told_apart(&setup.scene, light, 1e-4).drawn;
    let fit = Fit { scene: &setup.scene, light, views, map_size, seed: 0 };
    fit.layouts(&casters).0.swap_remove(0)
}

fn events(criterion: &mut Criterion) {
    let setup = setup();
    let mut group = criterion.benchmark_group("events of one map");
    group.sample_size(10);
    for size in [128, 512, 2048] {
        let layout = layout(&setup, size, 4);
        let step = layout.steps().next().expect("a sample");
        let depths =
            render_depth(&setup.scene, layout.map_projection(step), size, size, &DepthOptions::default());
        let mut map = DepthGrid::default();
        map.fill(size, &depths.depth, layout.t_of_depth());
        let crossings = Crossings::new(step, layout.t_range());
        let grid = PixelGrid { size, ratio: 1 };
        let mut counted = EventStrips::new(size);
        emit_events(&map, grid, &crossings, true, &mut EmissionScratch::default(), &mut counted);
        println!("{size}²: {} events, {} cells a ray", counted.len(), crossings.cells().count());
        group.bench_with_input(BenchmarkId::new("walk", size), &map, |b, map| {
            b.iter(|| {
                let mut events = EventStrips::new(size);
                walk_events(map, grid, &crossings, &mut events);
                black_box(events)
            });
        });
        group.bench_with_input(BenchmarkId::new("emission", size), &map, |b, map| {
            let mut scratch = EmissionScratch::default();
            b.iter(|| {
                let mut events = EventStrips::new(size);
                emit_events(map, grid, &crossings, true, &mut scratch, &mut events);
                black_box(events)
            });
        });
    }
    group.finish();
}

fn construction(criterion: &mut Criterion) {
    let setup = setup();
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let layout = layout(&setup, 512, 64);
    let grid = PixelGrid { size: 512, ratio: 1 };
    let casters = relevance::told_apart(scene, light, 1e-4).drawn;
    println!("{} triangles, 64 maps of 512²", scene.triangles().len());
    let mut group = criterion.benchmark_group("construction");
    group.sample_size(10);
    group.bench_function("maps and events", |b| {
        b.iter(|| black_box(cpu::collect_events(scene, &casters, &layout, grid, true)));
    });
    let (events, _) = cpu::collect_events(scene, &casters, &layout, grid, true);
    group.bench_function("sort and compress", |b| {
        b.iter(|| black_box(Functions::new(512, &events, 64, 0.02.into(), None)));
    });
    let technique = Pdsm::new(PdsmParams { max_error: 0.02, ..Default::default() });
    group.bench_function("all", |b| b.iter(|| black_box(technique.prepare(scene, light).1)));
    group.finish();
}

fn shading(criterion: &mut Criterion) {
    let mut setup = setup();
    (setup.camera.width, setup.camera.height) = (512, 512);
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let gbuffer = raster::render_gbuffer(scene, &setup.camera);
    let (pdsm, _) = Pdsm::new(PdsmParams { max_error: 0.02, ..Default::default() }).prepare(scene, light);
    let bvh = Bvh::casters(scene);
    let mut image = VisibilityImage::new(512, 512);
    let mut group = criterion.benchmark_group("shading 512²");
    group.sample_size(10);
    group.bench_function("lookup", |b| b.iter(|| pdsm.shade(&gbuffer, &mut image)));
    for skip in [false, true] {
        let settings = ReferenceSettings { samples: 64, skip, ..Default::default() };
        let name = if skip { "64 rays where needed" } else { "64 rays" };
        group.bench_function(name, |b| {
            b.iter(|| black_box(reference(scene, &bvh, light, &gbuffer, &settings, &no_progress)));
        });
    }
    group.finish();
}

criterion_group!(benches, events, construction, shading);
criterion_main!(benches);
