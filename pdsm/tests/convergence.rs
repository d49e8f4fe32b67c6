//! Against ground truth: what is left is the maps' resolution and their number.

use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::bvh::Bvh;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::{VisibilityImage, metrics, raster, scenes};

/// rmse of the built-in scene `spec` over valid pixels, against 1,024 samples, by each of `settings`.
fn errors(spec: &str, settings: &[PdsmParams]) -> Vec<f64> {
    let mut setup = scenes::build(spec, 0.0).expect("a built-in scene");
    (setup.camera.width, setup.camera.height) = (128, 96);
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let gbuffer = raster::render_gbuffer(scene, &setup.camera);
    let sampling = ReferenceSettings { samples: 1024, ..Default::default() };
    let truth = reference::reference(scene, &Bvh::casters(scene), light, &gbuffer, &sampling, &no_progress)
        .expect("nobody cancels");
    let valid = reference::valid_pixels(&gbuffer, light);
    let rmse = |params: &PdsmParams| {
        let (pdsm, _) = Pdsm::new(*params).prepare(scene, light);
        let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
        pdsm.shade(&gbuffer, &mut image);
        metrics::errors(&image, &truth.visibility, &valid).expect("images of one size").rmse
    };
    settings.iter().map(rmse).collect()
}

/// More maps of more texels come closer, and near enough: an rmse of 0.02.
#[test]
fn error_falls_with_views_and_resolution() {
    let setting = |views, size| PdsmParams {
        views,
        map_size: size,
        pdsm_size: size,
        max_error: 0.5 / views as f32,
        ..Default::default()
    };
    for spec in ["quads", "ball", "cylinder"] {
        let errors = errors(spec, &[setting(9, 64), setting(36, 192), setting(100, 512)]);
        assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{spec}: {errors:?}");
        assert!(errors[2] < 0.02, "{spec}: {errors:?}");
    }
}
