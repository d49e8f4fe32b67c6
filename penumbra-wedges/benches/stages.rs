//! Wedges beside shadow rays to the same samples, what culling saves, and what a pixel in penumbra costs.

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use gnomon_penumbra_wedges::{Casters, PenumbraWedges, Variant, WedgeParams};
use scene_core::bvh::Bvh;
use scene_core::reference::{ReferenceSettings, no_progress, reference};
use scene_core::{VisibilityImage, raster, scenes};

/// The light's half size or radius in the scene's own unit is left as it is.
fn variants(criterion: &mut Criterion) {
    for spec in ["ball", "knot", "log-cabin"] {
        let setup = scenes::build(spec, 0.0).expect("a built-in scene");
        let (scene, light, camera) = (&setup.scene, setup.lights[0], setup.camera.with_size(256, 256));
        let gbuffer = raster::render_gbuffer(scene, &camera);
        let casters = Casters::new(scene).expect("edges");
        let tree = Bvh::casters(scene);
        let mut visibility = VisibilityImage::new(256, 256);
        let mut group = criterion.benchmark_group(format!("soft-shadow/{spec}"));
        group.sample_size(10);
        for variant in [Variant::Interpolated, Variant::Coverage, Variant::Exact] {
            let technique = PenumbraWedges::new(WedgeParams { variant, ..Default::default() });
            group.bench_function(format!("{variant:?}"), |b| {
                b.iter(|| {
                    let (prepared, _) = technique.prepare(&casters, &light, &camera).expect("no masks");
                    prepared.shade(&gbuffer, &mut visibility)
                });
            });
        }
        for skip in [true, false] {
            let settings = ReferenceSettings { samples: 256, seed: 0, skip };
            group.bench_function(format!("rays, proofs {skip}"), |b| {
                b.iter(|| reference(scene, &tree, &light, &gbuffer, &settings, &no_progress).expect("done"));
            });
        }
        group.bench_function("edges of the scene", |b| b.iter(|| black_box(Casters::new(scene))));
        group.finish();
        // What a pixel in penumbra costs: all of shading over those pixels.
        for variant in [Variant::Interpolated, Variant::Coverage, Variant::Exact] {
            let technique = PenumbraWedges::new(WedgeParams { variant, ..Default::default() });
            let (prepared, _) = technique.prepare(&casters, &light, &camera).expect("no masks");
            let start = Instant::now();
            let (_, work) = prepared.shade_and_count(&gbuffer, &mut visibility);
            let micros = start.elapsed().as_secs_f64() * 1e6;
            println!(
                "{spec} {variant:?}: {} of {} pixels in penumbra, {:.2} µs each, {:.1} edges each, {:.1} more of the tile's",
                work.penumbra,
                work.asked,
                micros / work.penumbra.max(1) as f64,
                work.inside as f64 / work.penumbra.max(1) as f64,
                (work.pairs - work.inside) as f64 / work.penumbra.max(1) as f64,
            );
        }
    }
}

/// With wedges left out for tiles and pixels, and with all of them asked by every pixel.
fn culling(criterion: &mut Criterion) {
    for (spec, size) in [("log-cabin", [128, 96]), ("park", [12, 9])] {
        let setup = scenes::build(spec, 0.0).expect("a built-in scene");
        let (scene, light) = (&setup.scene, setup.lights[0]);
        let camera = setup.camera.with_size(size[0], size[1]);
        let gbuffer = raster::render_gbuffer(scene, &camera);
        let casters = Casters::new(scene).expect("edges");
        let mut visibility = VisibilityImage::new(size[0], size[1]);
        let mut group = criterion.benchmark_group(format!("culling/{spec}"));
        group.sample_size(10);
        for variant in [Variant::Coverage, Variant::Exact] {
            for skip in [true, false] {
                let params = WedgeParams { variant, skip, rays: false, ..Default::default() };
                let technique = PenumbraWedges::new(params);
                let (prepared, _) = technique.prepare(&casters, &light, &camera).expect("no masks");
                group.bench_function(format!("{variant:?}, skip {skip}"), |b| {
                    b.iter(|| prepared.shade(&gbuffer, &mut visibility));
                });
            }
        }
        group.finish();
    }
}

criterion_group!(benches, variants, culling);
criterion_main!(benches);
