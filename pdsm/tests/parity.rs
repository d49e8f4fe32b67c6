//! The GPU path against the CPU path, on every built-in scene.
//!
//! Both are asked about the same G-buffer, of which the GPU finds positions again from depths. V may differ where that
//! puts the receiver on the other side of a step of a function, or of the plane through a sample of the light: the CPU,
//! asked about the receiver moved by as much along its normal, must then bracket what the GPU says. Every other difference
//! fails the test, however few there are.

#![cfg(feature = "gpu")]

use gnomon_pdsm::compression::Segments;
use gnomon_pdsm::gpu::PdsmOnGpu;
use gnomon_pdsm::{ErrorMeasure, Pdsm, PdsmParams, Precision};
use gnomon_shadow_map::receiver_plane::{plane_tolerance, view_tolerance};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{GBufferTargets, Gpu, GpuShadowQuery, HeadlessRun, Recorder, SceneBuffers, testing};
use scene_core::reference::valid_pixels;
use scene_core::technique::TechniqueError;
use scene_core::{Camera, GBuffer, Light, Scene, VisibilityImage, raster, scenes};

const PARAMS: PdsmParams = PdsmParams {
    views: 16,
    map_size: 128,
    pdsm_size: 128,
    cascades: 3,
    max_error: 0.02,
    error_measure: ErrorMeasure::Visibility,
    segments: Segments::Greedy,
    bilinear: true,
    filter_radius: 1,
    precision: Precision::Full,
    only_surfaces: false,
    skip: true,
    seed: 0,
};

struct Case<'a> {
    name: &'a str,
    scene: &'a Scene,
    camera: &'a Camera,
    light: Light,
}

fn on_cpu(params: PdsmParams, case: &Case<'_>, gbuffers: &[GBuffer]) -> Vec<VisibilityImage> {
    let (pdsm, _) = Pdsm::new(params).prepare_for(case.scene, &case.light, Some(case.camera));
    let shade = |gbuffer: &GBuffer| {
        let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
        pdsm.shade(gbuffer, &mut image);
        image
    };
    gbuffers.iter().map(shade).collect()
}

fn on_gpu(gpu: &Gpu, params: PdsmParams, case: &Case<'_>, gbuffer: &GBuffer) -> HeadlessRun {
    let mut pdsm = PdsmOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT);
    testing::run_over(gpu, gbuffer, (case.scene, case.camera, &case.light), &mut pdsm).unwrap()
}

/// The G-buffer with every position moved along its normal by `share` of what both backends may differ in: the
/// tolerance of planes and of positions found from depths.
fn moved(gbuffer: &GBuffer, tolerance: f32, share: f32) -> GBuffer {
    let mut moved = gbuffer.clone();
    for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)) {
        let by = share * (tolerance + view_tolerance(gbuffer.depth[pixel]));
        moved.position[pixel] += gbuffer.normal[pixel] * by;
    }
    moved
}

/// Pixels, valid ones, and of these those that differ; and how many differ without an explanation.
fn compare(run: &HeadlessRun, case: &Case<'_>, params: PdsmParams, gbuffer: &GBuffer) -> [usize; 3] {
    let tolerance = plane_tolerance(case.scene.bounds(), &case.light);
    let shares = [0.0, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0];
    let gbuffers = shares.map(|share| moved(gbuffer, tolerance, share));
    let expected = on_cpu(params, case, &gbuffers);
    let valid = valid_pixels(gbuffer, &case.light);
    let [mut compared, mut differ, mut unexplained] = [0; 3];
    for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)) {
        compared += usize::from(valid[pixel]);
        let got = run.visibility.values[pixel];
        if (got - expected[0].values[pixel]).abs() <= 1.0 / 255.0 {
            continue;
        }
        differ += usize::from(valid[pixel]);
        let values = expected.iter().map(|image| image.values[pixel]);
        let low = values.clone().fold(f32::INFINITY, f32::min) - 1.0 / 255.0;
        let high = values.fold(f32::NEG_INFINITY, f32::max) + 1.0 / 255.0;
        if !(low..=high).contains(&got) {
            unexplained += 1;
            eprintln!("{}: pixel {pixel} is {got}, not {low} to {high}", case.name);
        }
    }
    [compared, differ, unexplained]
}

/// The design's bound: at least 99.9 % of the valid pixels agree, and the rest is explained.
fn check(gpu: &Gpu, params: PdsmParams, case: &Case<'_>) {
    let gbuffer = raster::render_gbuffer(case.scene, case.camera);
    let run = on_gpu(gpu, params, case, &gbuffer);
    let [valid, differ, unexplained] = compare(&run, case, params, &gbuffer);
    println!("{}, {:?}: {differ} of {valid} pixels differ", case.name, case.light);
    assert!(
        differ * 1000 <= valid && unexplained == 0,
        "{}, {:?}: {differ} of {valid} pixels differ, {unexplained} unexplained",
        case.name,
        case.light
    );
}

#[test]
fn every_built_in_scene() {
    let Some(gpu) = testing::gpu() else { return };
    for scene in scenes::all() {
        let mut setup = scenes::build(scene.name, 0.4).unwrap();
        (setup.camera.width, setup.camera.height) = (160, 120);
        for &light in &setup.lights {
            check(
                &gpu,
                PARAMS,
                &Case { name: scene.name, scene: &setup.scene, camera: &setup.camera, light },
            );
        }
    }
}

/// Six windows around a lamp inside the scene, one before a sphere, both sides of a disk, a cone, a sun at a slant;
/// one pixel or four, a pixel as large as a texel and larger.
#[test]
fn every_kind_of_window() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["chess", "fence"] {
        let mut setup = scenes::build(name, 0.4).unwrap();
        (setup.camera.width, setup.camera.height) = (96, 72);
        let bounds = setup.scene.bounds();
        let inside = bounds.center() + 0.1 * bounds.size();
        let above = bounds.center() + glam::Vec3::Y * bounds.diagonal();
        let lights = [
            Light::Point { position: inside },
            Light::Sphere { center: inside, radius: 0.02 * bounds.diagonal() },
            Light::Sphere { center: above, radius: 0.05 * bounds.diagonal() },
            Light::Disk { center: inside, normal: glam::Vec3::new(0.4, -1.0, 0.2), radius: 0.2 },
            Light::Spot {
                position: inside,
                direction: bounds.center() - inside - glam::Vec3::Y,
                outer: 0.6,
                inner: 0.3,
            },
            Light::Directional { direction: glam::Vec3::new(1.0, -0.3, 0.4), angular_radius: 0.03 },
        ];
        for light in lights {
            let case = Case { name, scene: &setup.scene, camera: &setup.camera, light };
            for (pdsm_size, bilinear) in [(128, true), (64, true), (43, false)] {
                check(&gpu, PdsmParams { pdsm_size, bilinear, ..PARAMS }, &case);
            }
        }
    }
}

/// 16-bit nodes, functions at surfaces alone, and functions that were baked, with what moves beside them.
#[test]
fn every_kind_of_functions() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["street", "quads"] {
        let mut setup = scenes::build(name, 0.4).unwrap();
        (setup.camera.width, setup.camera.height) = (96, 72);
        let light = setup.lights[0];
        let case = Case { name, scene: &setup.scene, camera: &setup.camera, light };
        let half = PdsmParams { precision: Precision::Half, ..PARAMS };
        check(&gpu, half, &case);
        check(&gpu, PdsmParams { filter_radius: 3, ..PARAMS }, &case);
        check(&gpu, PdsmParams { only_surfaces: true, ..PARAMS }, &case);

        let (baked, _) = Pdsm::new(half).bake(&setup.scene, &light);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let mut expected = VisibilityImage::new(gbuffer.width, gbuffer.height);
        let (on_cpu, _) = baked.prepare(&setup.scene, &light).unwrap();
        on_cpu.shade(&gbuffer, &mut expected);
        assert_eq!(on_cpu.moving_windows().is_empty(), name == "quads");
        let mut on_gpu = PdsmOnGpu::from_baked(&gpu.device, baked, VISIBILITY_FORMAT);
        let run =
            testing::run_over(&gpu, &gbuffer, (&setup.scene, &setup.camera, &light), &mut on_gpu).unwrap();
        let seen = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)).count();
        let pairs = run.visibility.values.iter().zip(&expected.values);
        let differ = pairs.filter(|(a, b)| (*a - *b).abs() > 1.0 / 255.0).count();
        println!("{name}, baked: {differ} of {seen} pixels differ");
        assert!(differ * 1000 <= seen, "{name}, baked: {differ} of {seen} pixels differ");
    }
}

/// The comparison can fail: functions of another light differ, and nothing explains it.
#[test]
fn a_planted_difference_is_found() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("ball", 0.0).unwrap();
    (setup.camera.width, setup.camera.height) = (64, 48);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let case = |x| Case {
        name: "ball, planted",
        scene: &setup.scene,
        camera: &setup.camera,
        light: Light::Sphere { center: glam::Vec3::new(x, 6.0, 1.0), radius: 0.3 },
    };
    let run = on_gpu(&gpu, PARAMS, &case(-2.0), &gbuffer);
    let [_, _, unexplained] = compare(&run, &case(2.0), PARAMS, &gbuffer);
    assert!(unexplained > 50, "{unexplained}");
}

/// One value serves any number of lights, one after the other, and an empty scene is lit.
#[test]
fn it_is_reused_from_light_to_light() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("chess", 0.0).unwrap();
    (setup.camera.width, setup.camera.height) = (64, 48);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let mut view = gpu.view(&setup.scene, &setup.camera).unwrap();
    view.upload_gbuffer(&gbuffer).unwrap();
    let mut pdsm = PdsmOnGpu::new(&gpu.device, PARAMS, VISIBILITY_FORMAT);
    let other = Light::Point { position: setup.scene.bounds().center() };
    let runs = [other, setup.lights[0], other].map(|light| view.run(&mut pdsm, &light, &gbuffer).unwrap());
    assert!(
        runs[0].visibility.bits() == runs[2].visibility.bits()
            && runs[0].visibility.bits() != runs[1].visibility.bits()
    );
    assert!(runs[1].report.stages_ms.contains_key("prepare.upload"), "{:?}", runs[1].report);

    let camera = Camera { width: 16, height: 16, ..setup.camera };
    let nothing = Case { name: "nothing", scene: &Scene::new(), camera: &camera, light: setup.lights[0] };
    check(&gpu, PARAMS, &nothing);
}

/// What cannot be done is told: shading before preparing, and a scene whose geometry is on the GPU alone.
#[test]
fn what_is_missing_is_an_error() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("ball", 0.0).unwrap();
    let buffers = SceneBuffers::new(&gpu.device, &setup.scene).unwrap();
    let targets = GBufferTargets::new(&gpu.device, 16, 16);
    let mut pdsm = PdsmOnGpu::new(&gpu.device, PARAMS, VISIBILITY_FORMAT);
    let mut encoder = gpu.encoder();
    let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
    let query = GpuShadowQuery { scene: buffers.view(None), light: &setup.lights[0], camera: &setup.camera };
    let error = pdsm.prepare(&mut recorder, &query).unwrap_err();
    assert!(matches!(error, TechniqueError::Unsupported { .. }), "{error}");
    let view = gpu.visibility_texture(&targets).create_view(&Default::default());
    let error = pdsm.shade(&mut recorder, &setup.camera, &targets.view(), &view).unwrap_err();
    assert!(matches!(error, TechniqueError::NotPrepared { .. }), "{error}");
}
