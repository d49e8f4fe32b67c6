//! The GPU path against the CPU path, on one G-buffer.
//!
//! A kernel's point that lies on the border of two pixels or texels falls to either side by rounding, and so does a decision
//! that a pixel stands next to; a texel on a caster's outline may hold another triangle on the GPU. What differs is explained:
//! the CPU path, given the GPU's own map, must give the GPU's V if every position of the G-buffer is moved by as much
//! as one may be rounded.

#![cfg(feature = "gpu")]

use std::sync::Arc;

use glam::Vec3;
use gnomon_contact_hardening::gpu::ContactHardeningOnGpu;
use gnomon_contact_hardening::{
    Blocker, ContactHardening, ContactHardeningParams, GaussianKernel, Scaling, Show, Variant,
};
use gnomon_shadow_map::light_maps::LightMaps;
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant as MapVariant};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, testing};
use scene_core::light::sampling::SampleKey;
use scene_core::reference::valid_pixels;
use scene_core::technique::ShadowQuery;
use scene_core::{Camera, GBuffer, Light, Report, Scene, VisibilityImage, raster, scenes};

const MAP_SIZE: u32 = 512;

/// Moved G-buffers. A flipped point is on either side in half of them.
const TRIALS: u32 = 24;

/// How far a position is moved, in units of the largest coordinate in play. The GPU finds it as eye + ray·depth, 6 roundings
/// of 2⁻²⁴ of lengths up to twice that (`view_tolerance`), and its place in the image and in the map by sums of four products
/// more: below 24·2⁻²⁴ < 2⁻¹⁹.
const ROUNDING: f32 = 1.0 / 524_288.0;

#[derive(Clone, Copy)]
struct Case<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    light: &'a Light,
}

fn on_cpu(
    technique: &ContactHardening,
    case: &Case<'_>,
    maps: Option<LightMaps<'_>>,
    gbuffer: &GBuffer,
) -> VisibilityImage {
    let query = ShadowQuery { scene: case.scene, light: case.light, camera: case.camera };
    let prepared = match maps {
        Some(maps) => technique.prepare_with(maps, &query),
        None => technique.prepare(&query),
    };
    let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
    prepared.expect("supported").0.shade(case.camera, gbuffer, &mut image).expect("sizes match");
    image
}

/// The G-buffer with every position moved, to the side of its surface that is seen: exact hard shadows lift a position by less than
/// that, and below its surface all of it would be in its own shadow.
fn moved(gbuffer: &GBuffer, eye: Vec3, trial: u32) -> GBuffer {
    let mut result = gbuffer.clone();
    for (pixel, position) in (0u32..).zip(&mut result.position) {
        let key = SampleKey::new(u64::from(trial), u64::from(pixel));
        let [a, b] = [key.square(0), key.square(1)];
        let largest = position.abs().max_element().max(eye.abs().max_element());
        let step = (Vec3::new(a.x, a.y, b.x) * 2.0 - 1.0) * (largest * ROUNDING);
        let normal = gbuffer.normal[pixel as usize];
        *position += step - normal * (2.0 * normal.dot(step).min(0.0));
    }
    result
}

/// How many pixels of an image were compared, how many of them differ, and which of these nothing explains.
#[derive(Debug)]
struct Agreement {
    valid: usize,
    differ: usize,
    /// Of those that differ, how many still do where the CPU is given the GPU's maps.
    over_maps: usize,
    /// Texels of the maps, and those that hold another triangle.
    texels: [usize; 2],
    unexplained: Vec<String>,
}

/// Compares a technique on the CPU with one on the GPU.
fn compare(gpu: &Gpu, case: &Case<'_>, technique: &ContactHardening, shown: &ContactHardening) -> Agreement {
    let gbuffer = raster::render_gbuffer(case.scene, case.camera);
    let expected = on_cpu(technique, case, None, &gbuffer);
    let mut on_gpu = ContactHardeningOnGpu::new(&gpu.device, shown, VISIBILITY_FORMAT).unwrap();
    let run = testing::run_over(gpu, &gbuffer, (case.scene, case.camera, case.light), &mut on_gpu).unwrap();
    let valid = valid_pixels(&gbuffer, case.light);
    let asked: Vec<_> = (0..gbuffer.pixel_count()).filter(|&p| gbuffer.is_seen(p) && valid[p]).collect();
    let agrees = |a: f32, b: f32| (a - b).abs() <= 1.0 / 255.0;
    let differ: Vec<_> =
        asked.iter().copied().filter(|&p| !agrees(run.visibility.values[p], expected.values[p])).collect();
    let (mut over_maps, mut texels, mut unexplained) = (0, [0, 0], Vec::new());
    if !differ.is_empty() {
        let (maps, compared) = maps_of(gpu, case, &on_gpu);
        texels = compared;
        let over = on_cpu(technique, case, Some(maps.clone()), &gbuffer);
        over_maps = differ.iter().filter(|&&p| !agrees(run.visibility.values[p], over.values[p])).count();
        let images: Vec<_> = (0..TRIALS)
            .map(|trial| {
                let gbuffer = moved(&gbuffer, case.camera.eye, trial);
                on_cpu(technique, case, Some(maps.clone()), &gbuffer)
            })
            .collect();
        for &pixel in &differ {
            let (cpu, v) = (expected.values[pixel], run.visibility.values[pixel]);
            let moved = images.iter().map(|image| image.values[pixel]);
            let (low, high) = moved.fold((cpu, cpu), |(low, high), v| (low.min(v), high.max(v)));
            if !(v >= low - 1.0 / 255.0 && v <= high + 1.0 / 255.0) {
                unexplained.push(format!(
                    "pixel {pixel} is {cpu} on the CPU, {low} to {high} moved, {v} on the GPU"
                ));
            }
        }
    }
    Agreement { valid: asked.len(), differ: differ.len(), over_maps, texels, unexplained }
}

/// The CPU's maps with what the GPU's texels hold; how many texels there are, and how many held another triangle.
fn maps_of<'a>(gpu: &Gpu, case: &Case<'a>, on_gpu: &ContactHardeningOnGpu) -> (LightMaps<'a>, [usize; 2]) {
    // The variant that pass 1 draws for: it decides which faces of a cube there are.
    let settings = ShadowMapParams { variant: MapVariant::Pcf, map_size: MAP_SIZE, ..Default::default() };
    let mut maps = LightMaps::draw(case.scene, case.light, &settings, &mut Report::default(), |_, _, _| None);
    let (depths, layer) = on_gpu.depths().unwrap();
    let depths: Vec<f32> = gpu.read_buffer(depths).unwrap();
    let mut texels = [0, 0];
    for (index, map) in maps.maps.iter_mut().enumerate() {
        let triangles: Vec<u32> = gpu.read_texture(on_gpu.layers().ids().unwrap(), index as u32).unwrap();
        let depths = &depths[index * layer as usize..][..triangles.len()];
        for texel in 0..triangles.len() {
            // Where there is no caster the triangle may be anything.
            let held = |depth: f32, triangle| (depth > 0.0).then_some(triangle);
            let on_cpu = held(map.map.depth[texel], map.triangles[texel]);
            texels[0] += 1;
            texels[1] += usize::from(on_cpu != held(depths[texel], triangles[texel]));
        }
        map.triangles = triangles;
        map.map.depth.copy_from_slice(depths);
    }
    (maps, texels)
}

fn check(gpu: &Gpu, name: &str, light: Option<Light>, params: ContactHardeningParams) {
    let Agreement { valid, differ, .. } = check_stages(gpu, name, light, params);
    assert!(differ * 1000 <= valid, "{name} {params:?}: {differ} of {valid} pixels differ");
}

/// Stage by stage: maps agree in 99.9 % of their texels, and looked up in the same maps V agrees in 99.9 % of the pixels.
fn check_stages(gpu: &Gpu, name: &str, light: Option<Light>, params: ContactHardeningParams) -> Agreement {
    let mut setup = scenes::build(name, 0.4).unwrap();
    (setup.camera.width, setup.camera.height) = (160, 120);
    let light = light.unwrap_or(setup.lights[0]);
    let case = Case { scene: &setup.scene, camera: &setup.camera, light: &light };
    let technique = ContactHardening::new(params);
    let found = compare(gpu, &case, &technique, &technique);
    let label = format!("{name} {:?} {:?} {:?}: {found:?}", params.variant, params.scaling, params.show);
    println!("{label}");
    let Agreement { valid, over_maps, texels: [texels, others], unexplained, .. } = &found;
    assert!(unexplained.is_empty(), "{label}");
    assert!(over_maps * 1000 <= *valid && others * 1000 <= *texels, "{label}");
    found
}

fn with(variant: Variant, scaling: Scaling) -> ContactHardeningParams {
    ContactHardeningParams { variant, scaling, map_size: MAP_SIZE, taps: 32, ..Default::default() }
}

/// Rect, sphere, disk and sun.
const SCENES: [&str; 6] = ["quads", "ball", "fence", "knot", "cylinder", "street"];

#[test]
fn physical_scaling_agrees_on_every_kind_of_light() {
    let Some(gpu) = testing::gpu() else { return };
    for name in SCENES {
        for variant in Variant::ALL {
            check(&gpu, name, None, with(variant, Scaling::Physical));
        }
    }
}

#[test]
fn paper_scaling_agrees() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["ball", "fence"] {
        for variant in Variant::ALL {
            for kernel in [GaussianKernel::PoissonDisk, GaussianKernel::Separable] {
                let params = with(variant, Scaling::Paper);
                check(&gpu, name, None, ContactHardeningParams { kernel, dilate: 9, ..params });
            }
        }
    }
}

#[test]
fn every_setting_agrees() {
    let Some(gpu) = testing::gpu() else { return };
    let params = with(Variant::Pcf, Scaling::Physical);
    for params in [
        ContactHardeningParams { geometry: false, ..params },
        ContactHardeningParams { fill: false, ..params },
        ContactHardeningParams { smooth: false, ..params },
        ContactHardeningParams { solids: false, ..params },
        ContactHardeningParams { skip: false, ..params },
        ContactHardeningParams { blocker: Blocker::Average, ..params },
        ContactHardeningParams { blocker: Blocker::Minimum, seed: 7, ..params },
        ContactHardeningParams { show: Show::Penumbra, ..params },
        ContactHardeningParams { show: Show::Distance, ..params },
    ] {
        check(&gpu, "ball", None, params);
    }
}

/// Solids on a floor under a lamp larger than they are, and solids among leaves.
///
/// Of the log cabin's maps ten texels of 1,572,864 hold another triangle on the GPU. Its penumbrae are tens of pixels wide, and each of
/// their pixels asks 32 points: those ten change 14 of 12,599 pixels by a point, and over the same maps none differs.
#[test]
fn solids_agree() {
    let Some(gpu) = testing::gpu() else { return };
    check(&gpu, "edges", None, with(Variant::Pcf, Scaling::Physical));
    check_stages(&gpu, "log-cabin", None, with(Variant::Pcf, Scaling::Physical));
}

/// A lamp among casters sees by the faces of a cube; a light without extent has hard shadows.
#[test]
fn lights_among_casters_and_without_extent_agree() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("quads", 0.4).unwrap();
    let center = setup.scene.bounds().center() + Vec3::Y * 0.3;
    for light in [Light::Sphere { center, radius: 0.1 }, Light::Point { position: center }] {
        check(&gpu, "quads", Some(light), with(Variant::Pcf, Scaling::Physical));
    }
}

#[test]
fn another_technique_s_hard_shadows_are_asked() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("ball", 0.0).unwrap();
    (setup.camera.width, setup.camera.height) = (96, 72);
    let light = setup.lights[0];
    let case = Case { scene: &setup.scene, camera: &setup.camera, light: &light };
    let coarse = |map_size: u32| {
        let hard = ShadowMap::new(ShadowMapParams { map_size, ..Default::default() });
        let params = ContactHardeningParams { fill: false, ..with(Variant::Pcf, Scaling::Physical) };
        ContactHardening::new(params).on_top_of("coarse", Arc::new(hard))
    };
    let Agreement { valid, differ, unexplained, .. } = compare(&gpu, &case, &coarse(64), &coarse(64));
    assert!(differ * 1000 <= valid && unexplained.is_empty(), "{differ} of {valid}: {unexplained:#?}");
    let gbuffer = raster::render_gbuffer(case.scene, case.camera);
    let [fine, rough] = [MAP_SIZE, 16].map(|size| on_cpu(&coarse(size), &case, None, &gbuffer));
    assert!(fine.values.iter().zip(&rough.values).filter(|(a, b)| a != b).count() > 20);
}

/// The comparison can fail: another blur differs, and nothing explains it.
#[test]
fn a_planted_difference_is_found() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("ball", 0.0).unwrap();
    (setup.camera.width, setup.camera.height) = (96, 72);
    let case = Case { scene: &setup.scene, camera: &setup.camera, light: &setup.lights[0] };
    let [pcf, gaussian] = [Variant::Pcf, Variant::Gaussian]
        .map(|variant| ContactHardening::new(with(variant, Scaling::Physical)));
    let found = compare(&gpu, &case, &pcf, &gaussian);
    assert!(
        found.differ > 100 && found.unexplained.len() > 50,
        "{}, {}",
        found.differ,
        found.unexplained.len()
    );
}
