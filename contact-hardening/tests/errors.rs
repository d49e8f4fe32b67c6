//! Errors of every variant against ground truth on built-in scenes, in snapshots: they may not grow unseen.

use std::fmt::Write;

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, Variant};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant as MapVariant};
use scene_core::bvh::Bvh;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::technique::ShadowQuery;
use scene_core::{VisibilityImage, metrics, raster, scenes};

/// Rounded to 0.005: the reference's own error of 64 samples is 0.005 (rmse) over penumbrae, and a pixel that another
/// processor's rounding moves changes one of some thousand.
fn rounded(error: f64) -> f64 {
    (error * 200.0).round() / 200.0
}

/// Beside uniform PCF with the best of its kernels, which `pcf` here must beat.
#[test]
fn errors_do_not_grow() {
    let mut table = String::from("scene variant rmse pen_rmse\n");
    for spec in ["quads", "ball", "pool", "log-cabin", "fence", "street", "edges"] {
        let mut setup = scenes::build(spec, 0.0).expect("a built-in scene");
        (setup.camera.width, setup.camera.height) = (160, 120);
        let (scene, light) = (&setup.scene, &setup.lights[0]);
        let gbuffer = raster::render_gbuffer(scene, &setup.camera);
        let sampling = ReferenceSettings { samples: 64, ..Default::default() };
        let truth =
            reference::reference(scene, &Bvh::casters(scene), light, &gbuffer, &sampling, &no_progress)
                .expect("nobody cancels");
        let valid = reference::valid_pixels(&gbuffer, light);
        let errors = |image: &VisibilityImage| {
            metrics::errors(image, &truth.visibility, &valid).expect("images of one size")
        };
        let mut write = |name: &str, rmse: f64, pen_rmse: f64| {
            let (rmse, pen_rmse) = (rounded(rmse), rounded(pen_rmse));
            writeln!(table, "{spec} {name} {rmse:.3} {pen_rmse:.3}").expect("a string takes everything");
        };
        let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
        let mut uniform = |filter: u32| {
            let params =
                ShadowMapParams { variant: MapVariant::Pcf, map_size: 512, filter, ..Default::default() };
            ShadowMap::new(params).prepare(scene, light).0.shade(&gbuffer, &mut image);
            errors(&image)
        };
        let best = [3, 9, 21, 41].map(&mut uniform).into_iter().min_by(|a, b| a.rmse.total_cmp(&b.rmse));
        let best = best.expect("four kernels");
        write("uniform-pcf", best.rmse, best.pen_rmse);
        for variant in Variant::ALL {
            let params = ContactHardeningParams { variant, ..Default::default() };
            let query = ShadowQuery { scene, light, camera: &setup.camera };
            let (prepared, _) = ContactHardening::new(params).prepare(&query).expect("own map");
            prepared.shade(&setup.camera, &gbuffer, &mut image).expect("sizes match");
            let errors = errors(&image);
            write(variant.name(), errors.rmse, errors.pen_rmse);
            let beats = variant != Variant::Pcf || errors.rmse < best.rmse;
            assert!(beats, "{spec} {variant:?}: {} of {}", errors.rmse, best.rmse);
        }
    }
    insta::assert_snapshot!(table);
}
