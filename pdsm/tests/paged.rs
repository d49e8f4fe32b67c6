//! Functions that are more than the device binds in one piece: the same image, bit for bit, as on a device that binds them.

#![cfg(feature = "gpu")]

use gnomon_pdsm::functions::Functions;
use gnomon_pdsm::gpu::PdsmOnGpu;
use gnomon_pdsm::{Pdsm, PdsmParams, Precision};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, HeadlessError, HeadlessRun, testing};
use scene_core::{GBuffer, Light, SceneSetup, raster, scenes};

fn params() -> PdsmParams {
    PdsmParams { views: 16, map_size: 256, pdsm_size: 256, ..Default::default() }
}

/// Bytes that the small device binds in one piece.
const LIMIT: u64 = 1 << 22;

/// A device of `layers` pages, which hold 1 MiB each.
fn small(layers: u32) -> Option<Gpu> {
    testing::gpu_with_pages(LIMIT, 512, layers)
}

fn setup(name: &str) -> (SceneSetup, GBuffer) {
    let mut setup = scenes::build(name, 0.4).unwrap();
    setup.camera = setup.camera.with_size(96, 72);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    (setup, gbuffer)
}

fn run(
    gpu: &Gpu,
    (setup, gbuffer): &(SceneSetup, GBuffer),
    light: &Light,
    pdsm: &mut PdsmOnGpu,
) -> Result<HeadlessRun, HeadlessError> {
    testing::run_over(gpu, gbuffer, (&setup.scene, &setup.camera, light), pdsm)
}

/// Lights outside and amid the casters.
fn lights(setup: &SceneSetup) -> [Light; 2] {
    let bounds = setup.scene.bounds();
    [setup.lights[0], Light::Sphere { center: bounds.center(), radius: 0.02 * bounds.diagonal() }]
}

#[test]
fn pages_hold_what_buffers_hold() {
    let (Some(gpu), Some(small)) = (testing::gpu(), small(256)) else { return };
    for name in ["chess", "quads"] {
        let seen = setup(name);
        for params in [params(), PdsmParams { precision: Precision::Half, filter_radius: 2, ..params() }] {
            // One for all lights: what is paged comes after what is not, and before it.
            let new = |gpu: &Gpu| PdsmOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT);
            let (mut whole, mut paged) = (new(&gpu), new(&small));
            let (position, direction) = (seen.0.scene.bounds().max, glam::Vec3::Y);
            let away = Light::Spot { position, direction, outer: 0.3, inner: 0.2 };
            let [outside, inside] = lights(&seen.0);
            for light in [inside, away, outside, inside] {
                let (pdsm, _) = Pdsm::new(params).prepare_for(&seen.0.scene, &light, Some(&seen.0.camera));
                let words = pdsm.windows().iter().map(|window| window.functions.nodes().words().len() as u64);
                let bytes = 4 * words.sum::<u64>();
                println!("{name}, {light:?}: {bytes} bytes");
                assert!(bytes > LIMIT || light != inside, "{name}, {light:?}: {bytes} bytes");
                let whole = run(&gpu, &seen, &light, &mut whole).unwrap();
                let paged = run(&small, &seen, &light, &mut paged).unwrap();
                assert!(whole.visibility.bits() == paged.visibility.bits(), "{name}, {params:?}, {light:?}");
            }
        }
    }
}

/// What moves is looked up in windows of its own.
#[test]
fn pages_hold_baked_functions() {
    let (Some(gpu), Some(small)) = (testing::gpu(), small(256)) else { return };
    let seen = setup("street");
    for light in lights(&seen.0) {
        let (baked, _) = Pdsm::new(params()).bake(&seen.0.scene, &light);
        let [whole, paged] = [&gpu, &small].map(|gpu| {
            let mut pdsm = PdsmOnGpu::from_baked(&gpu.device, baked.clone(), VISIBILITY_FORMAT);
            run(gpu, &seen, &light, &mut pdsm).unwrap()
        });
        assert!(whole.visibility.bits() == paged.visibility.bits(), "{light:?}");
    }
}

/// Pages hold nodes and the index: where they hold the nodes of all but no more, parts of what the camera sees are left out.
#[test]
fn parts_that_pages_do_not_hold_are_left_out() {
    let Some(gpu) = testing::gpu() else { return };
    let seen = setup("street");
    let [_, light] = lights(&seen.0);
    let params = PdsmParams { cascades: 3, ..params() };
    let (pdsm, _) = Pdsm::new(params).prepare_for(&seen.0.scene, &light, Some(&seen.0.camera));
    let bytes = |words: fn(&Functions) -> &[u32]| -> u64 {
        pdsm.windows().iter().map(|window| size_of_val(words(&window.functions)) as u64).sum()
    };
    let (nodes, index) = (bytes(|functions| functions.nodes().words()), bytes(Functions::index));
    let layers = nodes.div_ceil(1 << 20);
    assert!(nodes > LIMIT && nodes + index > layers << 20);
    let Some(small) = small(layers as u32) else { return };
    let left_out = |gpu: &Gpu| {
        let mut pdsm = PdsmOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT);
        run(gpu, &seen, &light, &mut pdsm).unwrap().report.skipped["windows beyond the device's memory"]
    };
    assert_eq!(left_out(&gpu), 0);
    assert!(left_out(&small) > 0);
}

#[test]
fn what_pages_do_not_hold_is_an_error() {
    let Some(small) = small(1) else { return };
    let seen = setup("chess");
    let mut pdsm = PdsmOnGpu::new(&small.device, params(), VISIBILITY_FORMAT);
    let [_, light] = lights(&seen.0);
    let error = run(&small, &seen, &light, &mut pdsm).unwrap_err().to_string();
    for word in ["functions need", "1048576", "smaller or fewer maps", "GNOMON_ADAPTER", "--backend cpu"] {
        assert!(error.contains(word), "{error}");
    }
}
