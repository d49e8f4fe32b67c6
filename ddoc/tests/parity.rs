//! The GPU path against the CPU path, on every built-in scene and for every kind of light.
//!
//! Both are asked about the same G-buffer. V may differ where rounding decides: a point of the light on the other side of
//! an edge, the light's centre on the other side of a face. So a pixel that differs by more than 1/255 must be one whose V
//! on the CPU changes, too, if the surface is moved by what positions are good to; the design's bound is 0.1 % of the valid
//! pixels.

#![cfg(feature = "gpu")]

use glam::Vec3;
use gnomon_ddoc::gpu::DdocOnGpu;
use gnomon_ddoc::{Ddoc, DdocParams, PreparedDdoc, Variant};
use gnomon_shadow_map::receiver_plane::{plane_tolerance, view_tolerance};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{GBufferTargets, Gpu, GpuShadowQuery, Recorder, SceneBuffers, testing};
use scene_core::reference::valid_pixels;
use scene_core::technique::TechniqueError;
use scene_core::{Camera, GBuffer, Light, Scene, VisibilityImage, raster, scenes};

struct Case<'a> {
    name: &'a str,
    scene: &'a Scene,
    camera: &'a Camera,
    light: Light,
    params: DdocParams,
}

fn small(variant: Variant) -> DdocParams {
    DdocParams { variant, map_size: 256, ..Default::default() }
}

/// V of the CPU for the surfaces of `gbuffer`, moved by `by` times what each position is good to.
fn moved(prepared: &PreparedDdoc<'_>, case: &Case<'_>, gbuffer: &GBuffer, by: Vec3) -> Vec<f32> {
    let mut gbuffer = gbuffer.clone();
    let tolerance = plane_tolerance(case.scene.bounds(), &case.light);
    for (position, depth) in gbuffer.position.iter_mut().zip(&gbuffer.depth) {
        *position += by * (tolerance + view_tolerance(*depth));
    }
    let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
    prepared.shade(&gbuffer, &mut image);
    image.values
}

/// How pixels go through the lists over them.
#[derive(Clone, Copy, PartialEq)]
enum Lists {
    /// In groups where lists are long.
    AsLong,
    /// In groups.
    InGroups,
}

fn check(gpu: &Gpu, case: &Case<'_>) {
    check_by(gpu, case, Lists::AsLong);
}

fn check_by(gpu: &Gpu, case: &Case<'_>, lists: Lists) {
    let Case { name, scene, camera, light, params } = case;
    let gbuffer = raster::render_gbuffer(scene, camera);
    let (on_cpu, _) = Ddoc::new(*params).prepare(scene, light).unwrap();
    let mut expected = VisibilityImage::new(gbuffer.width, gbuffer.height);
    on_cpu.shade(&gbuffer, &mut expected);
    let mut on_gpu = DdocOnGpu::new(&gpu.device, *params, VISIBILITY_FORMAT).unwrap();
    if lists == Lists::InGroups {
        on_gpu.always_in_groups();
    }
    let run = testing::run_over(gpu, &gbuffer, (scene, camera, light), &mut on_gpu).unwrap();

    let valid = valid_pixels(&gbuffer, light);
    let seen = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel));
    let differs = |pixel: &usize| {
        let (v, expected) = (run.visibility.values[*pixel], expected.values[*pixel]);
        v.is_nan() || (v - expected).abs() > 1.0 / 255.0
    };
    let differing: Vec<usize> = seen.filter(differs).collect();
    let of_valid = differing.iter().filter(|&&pixel| valid[pixel]).count();
    let all = valid.iter().filter(|&&valid| valid).count();
    println!("{name}, {}, {}: {of_valid} of {all} valid pixels differ", light.kind(), params.variant.name());
    if differing.is_empty() {
        return;
    }
    let shifts = (0..6).map(|i| Vec3::AXES[i / 2] * if i % 2 == 0 { 1.0 } else { -1.0 });
    let around: Vec<_> = shifts.map(|by| moved(&on_cpu, case, &gbuffer, by)).collect();
    let unexplained = differing.iter().filter(|&&pixel| {
        let values = || around.iter().map(|values| values[pixel]).chain([expected.values[pixel]]);
        let (low, high) = (values().fold(1.0, f32::min), values().fold(0.0, f32::max));
        let step = 1.0 / params.taps as f32 + 1.0 / 255.0;
        !(low - step..=high + step).contains(&run.visibility.values[pixel])
    });
    let unexplained: Vec<_> = unexplained
        .map(|&pixel| (pixel, gbuffer.position[pixel], expected.values[pixel], run.visibility.values[pixel]))
        .collect();
    // A caster's outline under a light's centre may pass between the two roundings.
    assert!(unexplained.len() * 10_000 <= all, "{name}, {light:?}, {params:?}: {unexplained:?}");
    assert!(of_valid * 1000 <= all, "{name}, {light:?}, {params:?}: {of_valid} of {all} pixels differ");
}

#[test]
fn every_built_in_scene() {
    let Some(gpu) = testing::gpu() else { return };
    for scene in scenes::all() {
        let mut setup = scenes::build(scene.name, 0.4).unwrap();
        // A thousandth of the pixels must be some.
        (setup.camera.width, setup.camera.height) =
            if scene.name == "forest" { (160, 120) } else { (64, 48) };
        for &light in &setup.lights {
            let params = small(Variant::Ddoc);
            check(
                &gpu,
                &Case { name: scene.name, scene: &setup.scene, camera: &setup.camera, light, params },
            );
        }
    }
}

/// Lights that see all of a street at once: tens of thousands of edges and faces over one tile end no loop early.
#[test]
fn many_edges_and_faces_over_one_tile() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("street", 0.0).unwrap();
    let scene = &setup.scene;
    let on_face = scene.corners(scene.triangles().len() / 2).iter().sum::<Vec3>() / 3.0;
    let radius = 0.02 * scene.bounds().diagonal();
    for light in [
        Light::Directional { direction: -setup.camera.forward(), angular_radius: 0.01 },
        Light::Sphere { center: on_face, radius },
    ] {
        // Where V is counted at many points every receiver takes long, and few tell as much.
        for (variant, width) in [(Variant::Ddoc, 32), (Variant::Smoothies, 96)] {
            let camera = &setup.camera.with_size(width, width / 4 * 3);
            let params = DdocParams { variant, ..Default::default() };
            check(&gpu, &Case { name: "street", scene, camera, light, params });
        }
    }
}

/// Every light, from inside the scene, too, where maps are the faces of a cube; every variant that has a GPU path; masks.
#[test]
fn every_light_and_variant() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["ball", "fence"] {
        let mut setup = scenes::build(name, 0.4).unwrap();
        (setup.camera.width, setup.camera.height) = (64, 48);
        let bounds = setup.scene.bounds();
        let center = bounds.center() + 0.1 * bounds.size();
        let size = 0.05 * bounds.size().length();
        let lights = [
            Light::Sphere { center, radius: size },
            Light::Disk { center: center + Vec3::Y * bounds.size().y, normal: Vec3::NEG_Y, radius: size },
            Light::Directional { direction: Vec3::new(0.4, -1.0, 0.3), angular_radius: 0.05 },
            Light::Spot { position: center, direction: Vec3::NEG_Y, outer: 0.9, inner: 0.3 },
        ];
        for (index, variant) in [Variant::Ddoc, Variant::ImageEdges, Variant::Smoothies, Variant::PenumbraMap]
            .into_iter()
            .enumerate()
        {
            let params = small(variant);
            let chosen = if index == 0 { &lights[..] } else { &lights[..2] };
            for &light in chosen {
                let case = Case { name, scene: &setup.scene, camera: &setup.camera, light, params };
                check(&gpu, &case);
                check_by(&gpu, &case, Lists::InGroups);
            }
        }
    }
}

/// More points of the light than are counted at once, and fewer than a vector has.
#[test]
fn any_number_of_points() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("layers", 0.0).unwrap();
    (setup.camera.width, setup.camera.height) = (64, 48);
    for taps in [1, 3, 64, 65, 130] {
        let params = DdocParams { taps, map_size: 256, ..Default::default() };
        let light = setup.lights[0];
        let case = Case { name: "layers", scene: &setup.scene, camera: &setup.camera, light, params };
        check(&gpu, &case);
        check_by(&gpu, &case, Lists::InGroups);
    }
}

#[test]
fn scenes_of_nothing_and_of_little() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("ball", 0.0).unwrap();
    (setup.camera.width, setup.camera.height) = (16, 16);
    let (camera, light) = (&setup.camera, setup.lights[0]);
    for map_size in [1, 16] {
        let params = DdocParams { map_size, ..Default::default() };
        check(&gpu, &Case { name: "nothing", scene: &Scene::new(), camera, light, params });
        check(&gpu, &Case { name: "ball", scene: &setup.scene, camera, light, params });
    }
}

/// The comparison can fail: edges of another light differ by more than any rounding.
#[test]
fn a_planted_difference_is_found() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("ball", 0.0).unwrap();
    (setup.camera.width, setup.camera.height) = (64, 48);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let params = small(Variant::Ddoc);
    let lights = [2.0, 2.1].map(|x| Light::Sphere { center: Vec3::new(x, 6.0, 1.0), radius: 0.5 });
    let (on_cpu, _) = Ddoc::new(params).prepare(&setup.scene, &lights[0]).unwrap();
    let mut expected = VisibilityImage::new(64, 48);
    on_cpu.shade(&gbuffer, &mut expected);
    let mut on_gpu = DdocOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
    let asked = (&setup.scene, &setup.camera, &lights[1]);
    let run = testing::run_over(&gpu, &gbuffer, asked, &mut on_gpu).unwrap();
    let far = |(a, b): (&f32, &f32)| (a - b).abs() > 2.0 / 64.0 + 1.0 / 255.0;
    let found = run.visibility.values.iter().zip(&expected.values).filter(|&pair| far(pair)).count();
    assert!(found > 30, "{found}");
}

#[test]
fn what_it_cannot_do_is_told() {
    let Some(gpu) = testing::gpu() else { return };
    let error = DdocOnGpu::new(&gpu.device, small(Variant::Paper), VISIBILITY_FORMAT).unwrap_err();
    assert!(matches!(error, TechniqueError::Unsupported { .. }), "{error}");
    let setup = scenes::build("ball", 0.0).unwrap();
    let buffers = SceneBuffers::new(&gpu.device, &setup.scene).unwrap();
    let targets = GBufferTargets::new(&gpu.device, 16, 16);
    let mut on_gpu = DdocOnGpu::new(&gpu.device, small(Variant::Ddoc), VISIBILITY_FORMAT).unwrap();
    let mut encoder = gpu.encoder();
    let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
    let view = targets.surface.create_view(&Default::default());
    let early = on_gpu.shade(&mut recorder, &setup.camera, &targets.view(), &view);
    assert!(matches!(early, Err(TechniqueError::NotPrepared { .. })));
    let query = GpuShadowQuery { scene: buffers.view(None), light: &setup.lights[0], camera: &setup.camera };
    let alone = on_gpu.prepare(&mut recorder, &query);
    assert!(matches!(alone, Err(TechniqueError::Unsupported { .. })));
}
