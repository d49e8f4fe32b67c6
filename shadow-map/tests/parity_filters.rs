//! The GPU path of the filtering variants against the CPU path.
//!
//! V may differ where a tap's texel holds another triangle on the GPU (a caster's outline), or where one of the
//! comparisons of a tap is a tie but for rounding: the GPU takes the stored point from the triangle's plane, the CPU from
//! its depth. Such pixels are counted, and are at most one in a thousand.

#![cfg(feature = "gpu")]

use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::{Kernel, ShadowMap, ShadowMapParams, Variant};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, testing};
use scene_core::reference::valid_pixels;
use scene_core::technique::TechniqueError;
use scene_core::{Camera, Light, Scene, VisibilityImage, raster, scenes};

fn check(gpu: &Gpu, name: &str, scene: &Scene, camera: &Camera, light: &Light, params: ShadowMapParams) {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let (on_cpu, _) = ShadowMap::new(params).prepare(scene, light);
    let mut expected = VisibilityImage::new(gbuffer.width, gbuffer.height);
    on_cpu.shade(&gbuffer, &mut expected);
    let mut view = gpu.view(scene, camera).unwrap();
    view.upload_gbuffer(&gbuffer).unwrap();
    let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
    let run = view.run(&mut on_gpu, light, &gbuffer).unwrap();
    let valid = valid_pixels(&gbuffer, light);
    let asked: Vec<_> = (0..gbuffer.pixel_count()).filter(|&p| gbuffer.is_seen(p) && valid[p]).collect();
    let difference = |p: usize| (run.visibility.values[p] - expected.values[p]).abs();
    let differs = |p: usize| difference(p).is_nan() || difference(p) > 1.0 / 255.0;
    let differ = asked.iter().filter(|&&p| differs(p)).count();
    println!("{name} {:?} {:?} {light:?}: {differ} of {}", params.variant, params.kernel, asked.len());
    assert!(
        differ * 1000 <= asked.len(),
        "{name}, {params:?}, {light:?}: {differ} of {} differ",
        asked.len()
    );
}

const VARIANTS: [(Variant, Kernel); 3] =
    [(Variant::Pcf, Kernel::Grid), (Variant::Pcf, Kernel::PoissonDisk), (Variant::ObjectId, Kernel::Grid)];

#[test]
fn filters_agree_on_every_kind_of_view() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["ball", "street", "chess", "fence"] {
        let mut setup = scenes::build(name, 0.4).unwrap();
        (setup.camera.width, setup.camera.height) = (160, 120);
        let bounds = setup.scene.bounds();
        let inside = Light::Point { position: bounds.center() + 0.1 * bounds.size() };
        for light in [setup.lights[0], inside] {
            for (variant, kernel) in VARIANTS {
                let params =
                    ShadowMapParams { variant, kernel, map_size: 256, taps: 16, ..Default::default() };
                check(&gpu, name, &setup.scene, &setup.camera, &light, params);
            }
        }
    }
}

#[test]
fn a_variant_without_a_gpu_path_is_an_error() {
    let Some(gpu) = testing::gpu() else { return };
    let params = ShadowMapParams { variant: Variant::AliasFree, ..Default::default() };
    let error = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap_err();
    assert!(matches!(error, TechniqueError::Unsupported { .. }), "{error}");
}
