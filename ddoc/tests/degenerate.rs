//! Input at the edge of what has a meaning: an answer, never a panic.

use gnomon_ddoc::{Ddoc, DdocParams, Variant};
use scene_core::technique::conformance;
use scene_core::{VisibilityImage, raster, scenes};

#[test]
fn every_scene_and_light_is_answered() {
    for variant in Variant::ALL {
        conformance::assert_answers(&Ddoc::new(DdocParams {
            variant,
            map_size: 64,
            taps: 3,
            ..Default::default()
        }));
    }
}

#[test]
fn free_points_that_are_not_finite_stay_unknown() {
    for variant in Variant::ALL {
        conformance::assert_answers_free_points(&Ddoc::new(DdocParams { variant, ..Default::default() }));
    }
}

#[test]
fn buffers_of_the_wrong_size_are_refused() {
    for variant in Variant::ALL {
        conformance::assert_refuses_wrong_sizes(&Ddoc::new(DdocParams { variant, ..Default::default() }));
    }
}

/// A map of one texel and one of a thousand agree about objects: silhouettes are not the map's.
#[test]
fn the_map_may_be_small() {
    let mut setup = scenes::build("quads", 0.0).expect("built in");
    (setup.camera.width, setup.camera.height) = (96, 64);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let shade = |map_size: u32| {
        let technique = Ddoc::new(DdocParams { map_size, taps: 16, ..Default::default() });
        let (prepared, _) = technique.prepare(&setup.scene, &setup.lights[0]).expect("few triangles");
        let mut image = VisibilityImage::new(96, 64);
        prepared.shade(&gbuffer, &mut image);
        image.values
    };
    let (small, large) = (shade(16), shade(1024));
    // A vertex is snapped to the map's own steps; a pixel so close to an outline may differ.
    let differ = small.iter().zip(&large).filter(|(a, b)| a.to_bits() != b.to_bits() && !a.is_nan()).count();
    assert!(differ * 200 < small.len(), "{differ} of {} pixels differ", small.len());
}

/// A scene far from zero is shaded by every variant as at zero but for shadows' borders that move by half a pixel at most.
#[test]
fn far_from_zero_shadows_stay() {
    for variant in Variant::ALL {
        let error = conformance::far_from_zero(&Ddoc::new(DdocParams { variant, ..Default::default() }));
        assert!(error.there < error.here + error.moved, "{variant:?}: {error:?}");
    }
}

/// A G-buffer of the GPU's holds a distance, from which positions follow along the ray of a pixel's centre.
#[cfg(feature = "gpu")]
#[test]
fn far_from_zero_shadows_stay_on_the_gpu() {
    let Some(gpu) = scene_core::gpu::testing::gpu() else { return };
    let error = conformance::far_from_zero_on(&gpu, &Ddoc::default());
    assert!(error.there < error.here + error.moved, "{error:?}");
}

/// Vertices are read from the second piece that they are bound in as from the first. `Paper` has no GPU path.
#[cfg(feature = "gpu")]
#[test]
fn scenes_bound_in_two_pieces_look_the_same() {
    for variant in Variant::ALL.into_iter().filter(|&variant| variant != Variant::Paper) {
        conformance::assert_same_in_two_pieces(&Ddoc::new(DdocParams {
            variant,
            map_size: 256,
            ..Default::default()
        }));
    }
}
