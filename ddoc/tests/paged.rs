//! Lists and edges that are more than the device binds in one piece: the same image, bit for bit, as on a device that binds them.

#![cfg(feature = "gpu")]

use gnomon_ddoc::gpu::DdocOnGpu;
use gnomon_ddoc::{DdocParams, Variant};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, HeadlessError, HeadlessRun, testing};
use scene_core::{GBuffer, Light, SceneSetup, raster, scenes};

/// Bytes that the small device binds in one piece: the scenes of these tests have no more besides lists and edges.
const LIMIT: u64 = 1 << 20;

/// A device of `layers` pages, which hold 256 KiB of lists and 1 MiB of edges.
fn small(layers: u32) -> Option<Gpu> {
    testing::gpu_with_pages(LIMIT, 256, layers)
}

fn setup(name: &str) -> (SceneSetup, GBuffer) {
    let mut setup = scenes::build(name, 0.4).unwrap();
    setup.camera = setup.camera.with_size(24, 18);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    (setup, gbuffer)
}

fn run(
    gpu: &Gpu,
    (setup, gbuffer): &(SceneSetup, GBuffer),
    light: &Light,
    ddoc: &mut DdocOnGpu,
) -> Result<HeadlessRun, HeadlessError> {
    testing::run_over(gpu, gbuffer, (&setup.scene, &setup.camera, light), ddoc)
}

#[test]
fn pages_hold_what_buffers_hold() {
    let (Some(gpu), Some(small)) = (testing::gpu(), small(256)) else { return };
    let seen = setup("knot");
    let bounds = seen.0.scene.bounds();
    let inside = Light::Sphere { center: bounds.center(), radius: 0.005 * bounds.diagonal() };
    for (variant, map_size, in_groups) in
        [(Variant::Ddoc, 64, false), (Variant::Ddoc, 64, true), (Variant::ImageEdges, 128, false)]
    {
        let params = DdocParams { variant, map_size, taps: 16, ..Default::default() };
        // One for all lights: what is paged comes after what is not, and before it.
        let mut both = [&gpu, &small].map(|gpu| {
            let mut ddoc = DdocOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
            if in_groups {
                ddoc.always_in_groups();
            }
            (gpu, ddoc)
        });
        for light in [inside, seen.0.lights[0], inside] {
            let [whole, paged] = both.each_mut().map(|(gpu, ddoc)| run(gpu, &seen, &light, ddoc).unwrap());
            let [held, in_pages] = [&whole, &paged].map(|run| run.report.bytes);
            println!("{variant:?}, {}: {held} bytes, {in_pages} on the small device", light.kind());
            // Pages end with what nothing fills.
            assert!(in_pages > held || (light != inside && in_pages == held), "{light:?}, {params:?}");
            assert!(whole.visibility.bits() == paged.visibility.bits(), "{light:?}, {params:?}");
        }
    }
}

#[test]
fn what_pages_do_not_hold_is_an_error() {
    let Some(small) = small(1) else { return };
    let seen = setup("knot");
    let mut ddoc = DdocOnGpu::new(&small.device, DdocParams::default(), VISIBILITY_FORMAT).unwrap();
    let error = run(&small, &seen, &seen.0.lights[0], &mut ddoc).unwrap_err().to_string();
    for word in ["lists over tiles need", "262144", "GNOMON_ADAPTER", "--backend cpu"] {
        assert!(error.contains(word), "{error}");
    }
}
