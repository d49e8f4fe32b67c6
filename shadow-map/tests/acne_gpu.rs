//! No acne on the GPU: the sweep of the example `acne`, every variant over angles up to 89.9°, a coarse and a finer map.

#![cfg(feature = "gpu")]

#[allow(dead_code, reason = "the example's own main")]
#[path = "../examples/acne.rs"]
mod acne;

use acne::{Backend, name_of, settings, sweep};
use gnomon_shadow_map::ShadowMapParams;
use scene_core::gpu::testing;

#[test]
fn no_pixel_is_wrong_away_from_a_shadows_edge() {
    let Some(gpu) = testing::gpu() else { return };
    let backend = Backend::Gpu(Box::new(gpu));
    for (map_size, scales) in [(64, &[1e-3, 1e4][..]), (512, &[1.0])] {
        for params in settings() {
            let params = ShadowMapParams { map_size, ..params };
            let (images, counts) = sweep(&backend, &params, 7, scales).unwrap();
            let label = format!("{}, {map_size}", name_of(&params));
            println!("{label}: {images} images, {counts:?}");
            let [[plane, not_lit], [shadow, wrong]] = counts;
            assert!(
                plane > 1_000 * images as usize / 2 && shadow > 100 * images as usize / 2,
                "{label}: {counts:?}"
            );
            assert_eq!([not_lit, wrong], [0, 0], "{label}");
        }
    }
}
