//! Errors of every variant against ground truth on built-in scenes, in snapshots: they may not grow unseen.

use std::fmt::Write;

use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant};
use scene_core::bvh::Bvh;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::{VisibilityImage, metrics, raster, scenes};

/// Rounded to 0.005: the reference's own error of 64 samples is 0.005 (rmse) over penumbrae, and a texel that another
/// processor's rounding moves changes one of some thousand pixels.
fn rounded(error: f64) -> f64 {
    (error * 200.0).round() / 200.0
}

#[test]
fn errors_do_not_grow() {
    let mut table = String::from("scene variant rmse pen_rmse\n");
    for spec in ["quads", "ball", "chess", "fence"] {
        let mut setup = scenes::build(spec, 0.0).expect("a built-in scene");
        (setup.camera.width, setup.camera.height) = (128, 96);
        let (scene, light) = (&setup.scene, &setup.lights[0]);
        let gbuffer = raster::render_gbuffer(scene, &setup.camera);
        let sampling = ReferenceSettings { samples: 64, ..Default::default() };
        let truth =
            reference::reference(scene, &Bvh::casters(scene), light, &gbuffer, &sampling, &no_progress)
                .expect("nobody cancels");
        let valid = reference::valid_pixels(&gbuffer, light);
        for variant in Variant::ALL {
            let params = ShadowMapParams { variant, ..Default::default() };
            let (maps, _) = ShadowMap::new(params).prepare(scene, light);
            let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
            maps.shade(&gbuffer, &mut image);
            let errors = metrics::errors(&image, &truth.visibility, &valid).expect("images of one size");
            let (name, rmse, pen_rmse) = (variant.name(), rounded(errors.rmse), rounded(errors.pen_rmse));
            writeln!(table, "{spec} {name} {rmse:.3} {pen_rmse:.3}").expect("a string takes everything");
        }
    }
    insta::assert_snapshot!(table);
}
