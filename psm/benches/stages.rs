//! What choosing a parametrisation costs beside the stages that any shadow map has.
//!
//! `cargo bench -p gnomon-psm` prints, for the street at 512 × 512, the choice (`prepare.views`) of each variant beside
//! the G-buffer, the whole preparation with a map of 1024 × 1024, and the lookup.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use gnomon_psm::views::map_views;
use gnomon_psm::{Psm, PsmParams, Variant};
use scene_core::{Report, VisibilityImage, raster, scenes};

fn stages(c: &mut Criterion) {
    let setup = scenes::build("street", 0.0).expect("a built-in scene");
    let (scene, camera, light) = (&setup.scene, &setup.camera, &setup.lights[0]);
    let gbuffer = raster::render_gbuffer(scene, camera);
    let mut group = c.benchmark_group("street");
    group.sample_size(20);
    group.bench_function("gbuffer", |b| b.iter(|| raster::render_gbuffer(black_box(scene), camera)));
    for variant in Variant::ALL {
        let params = PsmParams { variant, ..Default::default() };
        let name = variant.name();
        group.bench_function(format!("{name}/prepare.views"), |b| {
            b.iter(|| {
                map_views(
                    black_box(scene),
                    light,
                    camera,
                    &gbuffer,
                    &[scene.bounds()],
                    &params,
                    &mut Report::default(),
                )
            });
        });
        let technique = Psm::new(params);
        group.bench_function(format!("{name}/prepare"), |b| {
            b.iter(|| technique.prepare(black_box(scene), light, camera, &gbuffer));
        });
        let (prepared, _) = technique.prepare(scene, light, camera, &gbuffer);
        let mut image = VisibilityImage::new(camera.width, camera.height);
        group.bench_function(format!("{name}/shade"), |b| b.iter(|| prepared.shade(&gbuffer, &mut image)));
    }
    group.finish();
}

criterion_group!(benches, stages);
criterion_main!(benches);
