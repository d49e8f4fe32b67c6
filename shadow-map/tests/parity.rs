//! The GPU path against the CPU path, on every built-in scene: stage by stage where they disagree.
//!
//! Both are asked about the same G-buffer. V may differ only at a pixel whose texel lies on a caster's outline, where
//! hardware may give it to the other side, or that projects onto the border of two texels, by rounding. Every other
//! difference fails the test, however few there are.

#![cfg(feature = "gpu")]

use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::{PreparedShadowMap, ShadowMap, ShadowMapParams};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{GBufferTargets, Gpu, GpuShadowQuery, Recorder, SceneBuffers, testing};
use scene_core::reference::valid_pixels;
use scene_core::technique::TechniqueError;
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
    let (on_cpu, mut cpu_report) = ShadowMap::new(params).prepare(case.scene, &case.light);
    let mut expected = VisibilityImage::new(gbuffer.width, gbuffer.height);
    on_cpu.shade(&gbuffer, &mut expected);

    let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
    let asked = (case.scene, case.camera, &case.light);
    let run = testing::run_over(gpu, &gbuffer, asked, &mut on_gpu).unwrap();
    // Faces without casters: `hard` has none, by the boxes of objects on both backends; a clipped box may tell more here.
    cpu_report.skipped.remove("undrawn faces");
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

/// Whether a pixel may differ: its texel or one beside holds another triangle on the GPU, or it lies on the border of texels or maps,
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
    // Triangles beside the receiver's texel may be asked, too.
    let last = MAP_SIZE - 1;
    let around = |at: u32| at.saturating_sub(1)..=(at + 1).min(last);
    around(texel.y).any(|row| {
        around(texel.x).any(|column| {
            let index = (row * MAP_SIZE + column) as usize;
            ids[layer][index] != maps.maps()[layer].triangles[index]
        })
    })
}

/// The design's bound: at least 99.9 % of the valid pixels agree.
fn check(gpu: &Gpu, case: &Case<'_>) {
    let Agreement { valid, differ } = compare(gpu, case);
    assert!(differ * 1000 <= valid, "{}, {:?}: {differ} of {valid} pixels differ", case.name, case.light);
}

#[test]
fn every_built_in_scene() {
    let Some(gpu) = testing::gpu() else { return };
    for scene in scenes::all() {
        let mut setup = scenes::build(scene.name, 0.4).unwrap();
        (setup.camera.width, setup.camera.height) = (160, 120);
        for &light in &setup.lights {
            check(&gpu, &Case { name: scene.name, scene: &setup.scene, camera: &setup.camera, light });
        }
    }
}

/// Cube faces of a lamp inside the scene, a cone, a sun at a slant.
#[test]
fn every_kind_of_view() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["street", "chess", "fence"] {
        let mut setup = scenes::build(name, 0.4).unwrap();
        (setup.camera.width, setup.camera.height) = (160, 120);
        let bounds = setup.scene.bounds();
        let inside = bounds.center() + 0.1 * bounds.size();
        let lights = [
            Light::Point { position: inside },
            Light::Spot {
                position: inside,
                direction: bounds.center() - inside - glam::Vec3::Y,
                outer: 0.6,
                inner: 0.3,
            },
            Light::Directional { direction: glam::Vec3::new(1.0, -0.3, 0.4), angular_radius: 0.0 },
        ];
        for light in lights {
            check(&gpu, &Case { name, scene: &setup.scene, camera: &setup.camera, light });
        }
    }
}

/// The comparison can fail: maps of another light differ, and nothing explains it.
#[test]
fn a_planted_difference_is_found() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("ball", 0.0).unwrap();
    (setup.camera.width, setup.camera.height) = (64, 48);
    let light = Light::Point { position: glam::Vec3::new(2.0, 6.0, 1.0) };
    let other = Light::Point { position: glam::Vec3::new(-2.0, 6.0, 1.0) };
    let params = ShadowMapParams { map_size: MAP_SIZE, ..Default::default() };
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let (on_cpu, _) = ShadowMap::new(params).prepare(&setup.scene, &light);
    let mut expected = VisibilityImage::new(gbuffer.width, gbuffer.height);
    on_cpu.shade(&gbuffer, &mut expected);
    let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
    let asked = (&setup.scene, &setup.camera, &other);
    let run = testing::run_over(&gpu, &gbuffer, asked, &mut on_gpu).unwrap();
    let same_ids = [on_cpu.maps()[0].triangles.clone()];
    let found = (0..gbuffer.pixel_count())
        .filter(|&pixel| (run.visibility.values[pixel] - expected.values[pixel]).abs() > 1.0 / 255.0)
        .filter(|&pixel| !is_explained(&on_cpu, &same_ids, &gbuffer, pixel, &light))
        .count();
    assert!(found > 50, "{found}");
}

/// One value serves any number of lights and frames, one after the other, and keeps its maps.
#[test]
fn it_is_reused_from_frame_to_frame() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("chess", 0.0).unwrap();
    (setup.camera.width, setup.camera.height) = (64, 48);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let params = ShadowMapParams { map_size: MAP_SIZE, ..Default::default() };
    let mut view = gpu.view(&setup.scene, &setup.camera).unwrap();
    view.upload_gbuffer(&gbuffer).unwrap();
    let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
    let cube = Light::Point { position: setup.scene.bounds().center() };
    let mut runs = Vec::new();
    for light in [cube, setup.lights[0], cube] {
        runs.push(view.run(&mut on_gpu, &light, &gbuffer).unwrap());
    }
    assert!(
        runs[0].visibility.bits() == runs[2].visibility.bits()
            && runs[0].visibility.bits() != runs[1].visibility.bits()
    );
    // The faces stay when a light needs fewer.
    assert_eq!(runs[1].report.bytes, runs[0].report.bytes);
    for stage in ["prepare.views", if gpu.has_timestamps() { "prepare.maps" } else { "prepare.wall" }] {
        assert!(runs[1].report.stages_ms.contains_key(stage), "{stage}: {:?}", runs[1].report);
    }
    let used = runs[1].report.gpu.as_ref().unwrap();
    assert!(used.adapter.contains(&gpu.adapter.name), "{used:?}");
    assert_eq!(used.features.iter().any(|f| f == "TIMESTAMP_QUERY"), gpu.has_timestamps());
}

/// A renderer that keeps no geometry in memory gets the same shadows, up to the texels that looser views take.
#[test]
fn geometry_in_memory_is_not_needed() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("ball", 0.0).unwrap();
    (setup.camera.width, setup.camera.height) = (96, 72);
    let params = ShadowMapParams { map_size: 1024, ..Default::default() };
    let light = setup.lights[0];
    let buffers = SceneBuffers::new(&gpu.device, &setup.scene).unwrap();
    let targets = GBufferTargets::new(&gpu.device, 96, 72);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    targets.upload(&gpu.queue, &gbuffer);
    let mut images = Vec::new();
    for geometry in [Some(&setup.scene), None] {
        // An eighth of the precision, as a renderer may want it.
        let format = wgpu::TextureFormat::R8Unorm;
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: targets.surface.size(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, format).unwrap();
        let mut encoder = gpu.encoder();
        let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
        let view = texture.create_view(&Default::default());
        // Shading before preparing is told.
        let early = on_gpu.shade(&mut recorder, &setup.camera, &targets.view(), &view);
        assert!(matches!(early, Err(TechniqueError::NotPrepared { .. })));
        let scene = buffers.view(geometry);
        let query = GpuShadowQuery { scene, light: &light, camera: &setup.camera };
        on_gpu.prepare(&mut recorder, &query).unwrap();
        on_gpu.shade(&mut recorder, &setup.camera, &targets.view(), &view).unwrap();
        gpu.submit(encoder).unwrap();
        images.push(gpu.read_visibility(&texture, &gbuffer).unwrap());
    }
    let dark = |image: &VisibilityImage| image.values.iter().filter(|&&v| v == 0.0).count();
    let differ =
        images[0].values.iter().zip(&images[1].values).filter(|(a, b)| a != b && !a.is_nan()).count();
    assert!(dark(&images[0]) > 300 && differ * 100 < gbuffer.pixel_count(), "{differ}, {}", dark(&images[0]));
}

#[test]
fn a_map_too_large_is_an_error() {
    let Some(gpu) = testing::gpu() else { return };
    let limit = gpu.device.limits().max_texture_dimension_2d;
    let params = ShadowMapParams { map_size: limit + 1, ..Default::default() };
    let error = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap_err();
    assert!(error.to_string().contains(&limit.to_string()), "{error}");
}

#[test]
fn an_empty_scene_is_lit() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("ball", 0.0).unwrap();
    let camera = Camera { width: 16, height: 16, ..setup.camera };
    check(&gpu, &Case { name: "nothing", scene: &Scene::new(), camera: &camera, light: setup.lights[0] });
}
