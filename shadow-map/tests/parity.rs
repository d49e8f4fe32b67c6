//! The GPU path against the CPU path, on every built-in scene: stage by stage where they disagree.
//!
//! Both are asked about the same G-buffer. V may differ only at a pixel whose texel lies on a caster's outline, where
//! hardware may give it to the other side, or that projects onto the border of two texels, by rounding. Every other
//! difference fails the test, however few there are.

#![cfg(feature = "gpu")]

use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::{PreparedShadowMap, ShadowMap, ShadowMapParams};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, testing};
use scene_core::reference::valid_pixels;
use scene_core::{Camera, GBuffer, Light, Scene, VisibilityImage, raster, scenes};

const MAP_SIZE: u32 = 256;

/// How far from a texel's border a receiver may be put on its other side, in texels. A projection is a sum of four
/// products of size up to m/e, where m is the largest coordinate in play and e half the extent of the map, each rounded:
/// 8·2⁻²⁴·m/e in NDC. Scenes here have m/e < 20, and a texel is 2/256.
const BORDER: f32 = 8.0 / 16_777_216.0 * 20.0 * 128.0;

/// How many pixels of an image were compared and how many of them differ.
#[derive(Clone, Copy, Debug, Default)]
struct Agreement {
    valid: usize,
    differ: usize,
}

struct Case<'a> {
    name: &'a str,
    scene: &'a Scene,
    camera: &'a Camera,
    light: Light,
}

/// Runs both backends and explains every difference.
fn compare(gpu: &Gpu, case: &Case<'_>) -> Agreement {
    let params = ShadowMapParams { map_size: MAP_SIZE, ..Default::default() };
    let gbuffer = raster::render_gbuffer(case.scene, case.camera);
    let (on_cpu, cpu_report) = ShadowMap::new(params).prepare(case.scene, &case.light);
    let mut expected = VisibilityImage::new(gbuffer.width, gbuffer.height);
    on_cpu.shade(&gbuffer, &mut expected);

    let mut view = gpu.view(case.scene, case.camera).unwrap();
    view.upload_gbuffer(&gbuffer).unwrap();
    let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
    let run = view.run(&mut on_gpu, &case.light, &gbuffer).unwrap();
    assert_eq!(run.report.skipped, cpu_report.skipped, "{}", case.name);
    assert!(run.report.bytes >= cpu_report.bytes, "{}", case.name);

    let ids: Vec<Vec<u32>> = (0..on_cpu.maps().len() as u32)
        .map(|layer| gpu.read_texture(on_gpu.layers().ids().unwrap(), layer).unwrap())
        .collect();
    let valid = valid_pixels(&gbuffer, &case.light);
    let mut agreement = Agreement::default();
    for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)) {
        agreement.valid += usize::from(valid[pixel]);
        if (run.visibility.values[pixel] - expected.values[pixel]).abs() <= 1.0 / 255.0 {
            continue;
        }
        agreement.differ += usize::from(valid[pixel]);
        assert!(
            is_explained(&on_cpu, &ids, &gbuffer, pixel, &case.light),
            "{}, {:?}: pixel {pixel} is {} on the CPU and {} on the GPU",
            case.name,
            case.light,
            expected.values[pixel],
            run.visibility.values[pixel],
        );
    }
    agreement
}

/// Whether a pixel may differ: its texel holds another triangle on the GPU, or it lies on the border of texels or maps,
/// or turns from the light by rounding.
fn is_explained(
    maps: &PreparedShadowMap<'_>,
    ids: &[Vec<u32>],
    gbuffer: &GBuffer,
    pixel: usize,
    light: &Light,
) -> bool {
    let receiver = gbuffer.position[pixel];
    let (to_light, _) = light.center().ray_from(receiver);
    if gbuffer.normal[pixel].dot(to_light.normalize()).abs() < 1e-5 {
        return true;
    }
    let Some((layer, ndc)) =
        maps.maps().iter().enumerate().find_map(|(i, map)| map.view.project(receiver).map(|ndc| (i, ndc)))
    else {
        return false;
    };
    let size = MAP_SIZE as f32;
    let place = glam::Vec2::new(ndc.x * 0.5 + 0.5, 0.5 - ndc.y * 0.5) * size;
    if (place - place.round()).abs().min_element() < BORDER {
        return true;
    }
    let texel = place.min(glam::Vec2::splat(size - 1.0)).as_uvec2();
    let index = (texel.y * MAP_SIZE + texel.x) as usize;
    ids[layer][index] != maps.maps()[layer].triangles[index]
}

#[test]
fn every_built_in_scene() {
    let Some(gpu) = testing::gpu() else { return };
    for scene in scenes::all() {
        let mut setup = scenes::build(scene.name, 0.4).unwrap();
        (setup.camera.width, setup.camera.height) = (160, 120);
        let (mut dark, mut lit) = (0, 0);
        for &light in &setup.lights {
            let case = Case { name: scene.name, scene: &setup.scene, camera: &setup.camera, light };
            let Agreement { valid, differ } = compare(&gpu, &case);
            eprintln!("{}: {differ} of {valid} pixels differ", scene.name);
            assert!(differ * 1000 <= valid, "{}: {differ} of {valid} pixels differ", scene.name);
        }
    }
}
