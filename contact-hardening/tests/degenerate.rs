//! Input at the edge of what has a meaning: an answer, never a panic.

use std::sync::Arc;

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, Scaling, Variant};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams};
use scene_core::technique::{ShadowQuery, conformance};
use scene_core::{VisibilityImage, raster, scenes};

#[test]
fn every_scene_and_light_is_answered() {
    for variant in Variant::ALL {
        for scaling in [Scaling::Physical, Scaling::Paper] {
            let distance_power = 8.0;
            let params = ContactHardeningParams {
                variant,
                scaling,
                distance_power,
                map_size: 64,
                dilate: 3,
                taps: 1,
                ..Default::default()
            };
            conformance::assert_answers(&ContactHardening::new(params));
        }
    }
}

#[test]
fn free_points_are_refused() {
    conformance::assert_answers_free_points(&ContactHardening::default());
}

#[test]
fn buffers_of_the_wrong_size_are_refused() {
    conformance::assert_refuses_wrong_sizes(&ContactHardening::default());
}

/// Its own map and shadow-map's hard shadows of the same size, as a source, are the same.
#[test]
fn any_technique_can_be_the_source() {
    let mut setup = scenes::build("ball", 0.0).expect("built in");
    (setup.camera.width, setup.camera.height) = (96, 64);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let query = ShadowQuery { scene: &setup.scene, light: &setup.lights[0], camera: &setup.camera };
    let params = ContactHardeningParams { map_size: 256, ..Default::default() };
    let shade = |technique: ContactHardening| {
        let (prepared, _) = technique.prepare(&query).expect("supported");
        let mut image = VisibilityImage::new(96, 64);
        prepared.shade(&setup.camera, &gbuffer, &mut image).expect("sizes match");
        image.bits()
    };
    let source = |map_size: u32| -> ContactHardening {
        let hard = ShadowMap::new(ShadowMapParams { map_size, ..Default::default() });
        ContactHardening::new(params).on_top_of("hard", Arc::new(hard))
    };
    let own = shade(ContactHardening::new(params).on_own_map());
    assert_eq!(own, shade(source(256)));
    assert_ne!(own, shade(source(16)), "the source is asked");
}

/// A scene far from zero is shaded about as well as at zero: half as much again. Counted from zero, nothing nearer to its caster
/// than six steps of a map's depths would be in shadow. Exact hard shadows stay exact.
#[test]
fn far_from_zero_shadows_stay() {
    let exact = ContactHardening::default();
    for technique in [exact.clone().on_own_map(), exact] {
        let error = conformance::far_from_zero(&technique);
        assert!(error.there <= 1.5 * error.here, "{}: {error:?}", technique.source_name());
    }
}

/// The G-buffer of a GPU holds a distance, from which positions follow along the ray of a pixel's centre: they lie beside the rounded ones
/// that the truth is asked at, half a pixel at most.
#[cfg(feature = "gpu")]
#[test]
fn far_from_zero_shadows_stay_on_the_gpu() {
    let Some(gpu) = scene_core::gpu::testing::gpu() else { return };
    let error = conformance::far_from_zero_on(&gpu, &ContactHardening::default());
    assert!(error.there < error.here + error.moved, "{error:?}");
}

/// Vertices are read from the second piece that they are bound in as from the first.
#[cfg(feature = "gpu")]
#[test]
fn scenes_bound_in_two_pieces_look_the_same() {
    for variant in Variant::ALL {
        let params = ContactHardeningParams { variant, map_size: 256, ..Default::default() };
        conformance::assert_same_in_two_pieces(&ContactHardening::new(params));
    }
}
