//! Input at the edge of what has a meaning: an answer, never a panic.

use gnomon_pdsm::compression::Segments;
use gnomon_pdsm::{ErrorMeasure, Pdsm, PdsmParams, Precision};
use scene_core::scenes;
use scene_core::technique::conformance;

const PARAMS: PdsmParams = PdsmParams {
    views: 4,
    map_size: 30,
    pdsm_size: 16,
    cascades: 3,
    max_error: 0.01,
    error_measure: ErrorMeasure::Visibility,
    segments: Segments::Greedy,
    bilinear: true,
    filter_radius: 1,
    precision: Precision::Full,
    only_surfaces: false,
    skip: true,
    seed: 0,
};

#[test]
fn every_scene_and_light_is_answered() {
    conformance::assert_answers(&Pdsm::new(PARAMS));
}

#[test]
fn free_points_that_are_not_finite_stay_unknown() {
    conformance::assert_answers_free_points(&Pdsm::new(PdsmParams { map_size: 64, pdsm_size: 64, ..PARAMS }));
}

#[test]
fn buffers_of_the_wrong_size_are_refused() {
    conformance::assert_refuses_wrong_sizes(&Pdsm::new(PARAMS));
}

#[test]
fn threads_leave_no_trace() {
    let setup = scenes::build("quads", 0.0).expect("a built-in scene");
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let technique = Pdsm::new(PdsmParams { map_size: 64, pdsm_size: 64, ..PARAMS });
        pool.install(|| technique.prepare(&setup.scene, &setup.lights[0]).0.windows()[0].functions.clone())
    };
    let one = build(1);
    assert!(!one.nodes().is_empty());
    assert_eq!(one, build(3));
}

/// Built on the CPU and looked up on the GPU, far from zero as near it, but for borders that move by half a pixel at most.
#[cfg(feature = "gpu")]
#[test]
fn far_from_zero_shadows_stay_on_the_gpu() {
    let Some(gpu) = scene_core::gpu::testing::gpu() else { return };
    let technique = Pdsm::new(PdsmParams { map_size: 256, pdsm_size: 256, ..PARAMS });
    let error = conformance::far_from_zero_on(&gpu, &technique);
    assert!(error.there < error.here + error.moved, "{error:?}");
}

/// Vertices are read from the second piece that they are bound in as from the first.
#[cfg(feature = "gpu")]
#[test]
fn scenes_bound_in_two_pieces_look_the_same() {
    conformance::assert_same_in_two_pieces(&Pdsm::new(PARAMS));
}
