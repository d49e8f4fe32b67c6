//! Stages of each variant on a built-in scene: `cargo bench -p gnomon-ddoc`.

use criterion::{Criterion, criterion_group, criterion_main};
use gnomon_ddoc::{Ddoc, DdocParams, Variant};
use scene_core::{VisibilityImage, raster, scenes};

fn stages(criterion: &mut Criterion) {
    let setup = scenes::build("log-cabin", 0.0).expect("built in");
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let gbuffer = raster::render_gbuffer(scene, &setup.camera);
    let mut visibility = VisibilityImage::new(gbuffer.width, gbuffer.height);
    for variant in Variant::ALL {
        let technique = Ddoc::new(DdocParams { variant, ..Default::default() });
        criterion.bench_function(&format!("prepare/{}", variant.name()), |bencher| {
            bencher.iter(|| technique.prepare(scene, light).expect("few triangles"));
        });
        let (prepared, _) = technique.prepare(scene, light).expect("few triangles");
        criterion.bench_function(&format!("shade/{}", variant.name()), |bencher| {
            bencher.iter(|| prepared.shade(&gbuffer, &mut visibility));
        });
    }
}

criterion_group!(benches, stages);
criterion_main!(benches);
