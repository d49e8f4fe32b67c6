//! Passes of each variant on a built-in scene: `cargo bench -p gnomon-contact-hardening`.

use criterion::{Criterion, criterion_group, criterion_main};
use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, Variant};
use scene_core::technique::ShadowQuery;
use scene_core::{VisibilityImage, raster, scenes};

fn shade(criterion: &mut Criterion) {
    let setup = scenes::build("ball", 0.0).expect("built in");
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let query = ShadowQuery { scene: &setup.scene, light: &setup.lights[0], camera: &setup.camera };
    let mut visibility = VisibilityImage::new(gbuffer.width, gbuffer.height);
    for variant in Variant::ALL {
        let params = ContactHardeningParams { variant, ..Default::default() };
        let (prepared, _) = ContactHardening::new(params).prepare(&query).expect("own map");
        criterion.bench_function(&format!("shade/{}", variant.name()), |bencher| {
            bencher.iter(|| prepared.shade(&setup.camera, &gbuffer, &mut visibility).expect("sizes match"));
        });
    }
}

criterion_group!(benches, shade);
criterion_main!(benches);
