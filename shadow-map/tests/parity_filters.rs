//! The GPU path of the variants that filter maps against the CPU path: at least 99.9 % of the valid pixels within 1/255, and
//! every other one explained ([`explained`]).

#![cfg(feature = "gpu")]

mod explained;

use glam::Vec3;
use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::light_maps::ShadowMapView;
use gnomon_shadow_map::receiver_plane::{plane_tolerance, view_tolerance};
use gnomon_shadow_map::{Kernel, ShadowMap, ShadowMapParams, Variant};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, testing};
use scene_core::reference::valid_pixels;
use scene_core::{Camera, Light, Scene, VisibilityImage, raster, scenes};

const MAP_SIZE: u32 = 256;

/// As far as rounding puts a receiver on the other side of a texel's border, in texels: derived in `parity.rs`.
const BORDER: f32 = 8.0 / 16_777_216.0 * 20.0 * 128.0;

struct Case<'a> {
    name: &'a str,
    scene: &'a Scene,
    camera: &'a Camera,
    light: Light,
}

/// What of an image was compared.
#[derive(Clone, Copy, Debug)]
struct Agreement {
    /// Valid pixels, and how many of them differ between the backends.
    valid: [usize; 2],
    /// Valid pixels that differ where the CPU looks the GPU's maps up.
    over_maps: usize,
    /// Texels that hold something on either side, and how many of them hold another triangle on the other.
    texels: [usize; 2],
}

/// The design's bound.
fn check(gpu: &Gpu, case: &Case<'_>, params: ShadowMapParams) {
    let Agreement { valid: [asked, differ], .. } = compare(gpu, case, params);
    assert!(differ * 1000 <= asked, "{}, {params:?}: {differ} of {asked} valid pixels differ", case.name);
}

/// Runs both backends and explains every difference.
fn compare(gpu: &Gpu, case: &Case<'_>, params: ShadowMapParams) -> Agreement {
    let Case { name, scene, camera, light } = *case;
    let gbuffer = raster::render_gbuffer(scene, camera);
    let (on_cpu, mut cpu_report) = ShadowMap::new(params).prepare(scene, &light);
    let mut expected = VisibilityImage::new(gbuffer.width, gbuffer.height);
    on_cpu.shade(&gbuffer, &mut expected);
    let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
    let run = testing::run_over(gpu, &gbuffer, (scene, camera, &light), &mut on_gpu).unwrap();
    // Faces without casters, which filters need: on the GPU a pass clears them, as it does others.
    cpu_report.skipped.remove("undrawn faces");
    assert_eq!(run.report.skipped, cpu_report.skipped, "{name}");

    let valid = valid_pixels(&gbuffer, &light);
    let seen: Vec<_> = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)).collect();
    let differs =
        |v: f32, pixel: usize| (v - expected.values[pixel]).abs().max(0.0) > 1.0 / 255.0 || v.is_nan();
    let different: Vec<_> =
        seen.iter().copied().filter(|&pixel| differs(run.visibility.values[pixel], pixel)).collect();
    let (asked, differ) = (
        seen.iter().filter(|&&pixel| valid[pixel]).count(),
        different.iter().filter(|&&pixel| valid[pixel]).count(),
    );
    let label = format!("{name}, {:?} {:?}, {light:?}", params.variant, params.kernel);
    println!("{label}: {differ} of {asked} valid pixels differ");

    let maps = explained::maps_of_gpu(gpu, &on_gpu, scene, &light, &params);
    let views: Vec<_> = maps.maps.iter().map(|map| map.view).collect();
    let mut texels = [0; 2];
    for (on_gpu, on_cpu) in maps.maps.iter().zip(on_cpu.maps()) {
        let of =
            |map: &ShadowMapView, texel: usize| (map.map.depth[texel] > 0.0).then(|| map.triangles[texel]);
        for texel in 0..on_gpu.triangles.len() {
            let [a, b] = [of(on_gpu, texel), of(on_cpu, texel)];
            texels[0] += usize::from(a.or(b).is_some());
            texels[1] += usize::from(a != b);
        }
    }
    let on_cpu = explained::over_gpu_maps(params, maps);
    let tolerance = plane_tolerance(scene.bounds(), &light);
    let reach = |pixel: usize| {
        let point = gbuffer.position[pixel];
        let texel = views.iter().map(|view| view.half_diagonal(view.depth_of(point)) * 2.0 / MAP_SIZE as f32);
        let border = BORDER * texel.filter(|size| *size > 0.0).fold(0.0, f32::max);
        border.max(tolerance + view_tolerance(gbuffer.depth[pixel]))
    };
    let brackets = explained::bracket(&on_cpu, &gbuffer, &different, reach);
    for (pixel, [least, most]) in different.into_iter().zip(brackets) {
        let v = run.visibility.values[pixel];
        assert!(
            (least - 1.0 / 255.0..=most + 1.0 / 255.0).contains(&v),
            "{label}: pixel {pixel} is {} on the CPU, {least} to {most} over the GPU's maps, {v} on the GPU",
            expected.values[pixel],
        );
    }
    on_cpu.shade(&gbuffer, &mut expected);
    let over_maps = seen
        .iter()
        .filter(|&&p| valid[p] && (run.visibility.values[p] - expected.values[p]).abs() > 1.0 / 255.0);
    Agreement { valid: [asked, differ], over_maps: over_maps.count(), texels }
}

fn variant(variant: Variant, kernel: Kernel) -> ShadowMapParams {
    ShadowMapParams { variant, kernel, map_size: MAP_SIZE, taps: 16, ..Default::default() }
}

#[test]
fn filters_agree_on_every_kind_of_view() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["ball", "street", "chess", "fence"] {
        let mut setup = scenes::build(name, 0.4).unwrap();
        (setup.camera.width, setup.camera.height) = (160, 120);
        let (scene, camera) = (&setup.scene, &setup.camera);
        let bounds = scene.bounds();
        let inside = Light::Point { position: bounds.center() + 0.1 * bounds.size() };
        for light in [setup.lights[0], inside] {
            for (kind, kernel) in [
                (Variant::Pcf, Kernel::Grid),
                (Variant::Pcf, Kernel::PoissonDisk),
                (Variant::ObjectId, Kernel::Grid),
                (Variant::Moments, Kernel::Grid),
            ] {
                check(&gpu, &Case { name, scene, camera, light }, variant(kind, kernel));
            }
        }
    }
}

/// The scene's own light, on a small picture, stage by stage: maps agree in 99.9 % of their texels, and looked up in the same maps
/// V agrees in 99.9 % of the pixels; so do both together.
///
/// But in the forest: thirty leaves and more lie over a texel, so that the last digits of their corners and depths say which is
/// stored in one of two thousand. `pcf` reads 36 texels a pixel, and each is a twenty-fifth of V.
#[test]
fn filters_agree_on_every_built_in_scene() {
    let Some(gpu) = testing::gpu() else { return };
    for name in scenes::all().iter().map(|scene| scene.name) {
        let setup = scenes::build(name, 0.4).unwrap();
        let (scene, camera) = (&setup.scene, &setup.camera.with_size(80, 60));
        for (kind, kernel) in [
            (Variant::Pcf, Kernel::Grid),
            (Variant::Pcf, Kernel::PoissonDisk),
            (Variant::ObjectId, Kernel::Grid),
            (Variant::Pcss, Kernel::Grid),
            (Variant::Moments, Kernel::Grid),
        ] {
            let params = variant(kind, kernel);
            let found = compare(&gpu, &Case { name, scene, camera, light: setup.lights[0] }, params);
            let label = format!("{name}, {kind:?} {kernel:?}: {found:?}");
            println!("{label}");
            let Agreement { valid, over_maps, texels } = found;
            assert!(texels[1] * 1000 <= texels[0] && over_maps * 1000 <= valid[0], "{label}");
            let reads_many = name == "forest" && matches!(kind, Variant::Pcf | Variant::ObjectId);
            assert!(reads_many || valid[1] * 1000 <= valid[0], "{label}");
        }
    }
}

/// Lights of every kind with an extent, from outside and, so that faces of a cube are looked up, from within the scene.
#[test]
fn soft_shadows_agree_under_every_kind_of_light() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["ball", "chess", "fence"] {
        let mut setup = scenes::build(name, 0.4).unwrap();
        (setup.camera.width, setup.camera.height) = (160, 120);
        let (scene, camera) = (&setup.scene, &setup.camera);
        let bounds = scene.bounds();
        let size = 0.05 * bounds.size().max_element();
        let above = bounds.center() + Vec3::new(0.1, 1.0, 0.2) * bounds.size().max_element();
        let inside = bounds.center() + 0.1 * bounds.size();
        let lights = [
            Light::Sphere { center: above, radius: size },
            Light::Sphere { center: inside, radius: 0.3 * size },
            Light::Rect { center: above, half_u: Vec3::X * size, half_v: Vec3::new(0.0, 0.3, 1.0) * size },
            Light::Disk { center: above, normal: Vec3::new(0.2, -1.0, 0.1), radius: size },
            Light::Directional { direction: Vec3::new(0.4, -1.0, 0.3), angular_radius: 0.04 },
            Light::Directional { direction: Vec3::new(0.4, -1.0, 0.3), angular_radius: 0.0 },
            Light::Point { position: inside },
        ];
        for light in lights {
            check(&gpu, &Case { name, scene, camera, light }, variant(Variant::Pcss, Kernel::Grid));
        }
    }
}

/// Even windows, two moments, light taken for leaked.
#[test]
fn bounds_agree() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("chess", 0.4).unwrap();
    (setup.camera.width, setup.camera.height) = (160, 120);
    let (scene, camera, light) = (&setup.scene, &setup.camera, setup.lights[0]);
    let of = variant(Variant::Moments, Kernel::Grid);
    for params in [
        ShadowMapParams { filter: 8, ..of },
        ShadowMapParams { filter: 1, ..of },
        ShadowMapParams { filter: 9, moments: 2, ..of },
        ShadowMapParams { light_bleeding: 0.3, ..of },
    ] {
        check(&gpu, &Case { name: "chess", scene, camera, light }, params);
    }
}

/// Leaving out what is certainly lit changes no bit.
#[test]
fn skipping_changes_nothing() {
    let Some(gpu) = testing::gpu() else { return };
    let mut setup = scenes::build("chess", 0.4).unwrap();
    (setup.camera.width, setup.camera.height) = (96, 72);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let mut view = gpu.view(&setup.scene, &setup.camera).unwrap();
    view.upload_gbuffer(&gbuffer).unwrap();
    let inside = Light::Point { position: setup.scene.bounds().center() };
    for light in [setup.lights[0], inside] {
        for kind in [Variant::Pcf, Variant::ObjectId, Variant::Pcss] {
            let mut images = [true, false].map(|skip| {
                // The faces of a cube stay the same: a filter looks from them into those beside.
                let params = ShadowMapParams { skip, ..variant(kind, Kernel::Grid) };
                let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
                view.run(&mut on_gpu, &light, &gbuffer).unwrap().visibility.values
            });
            images.iter_mut().for_each(|image| image.retain(|v| !v.is_nan()));
            assert!(images[0].iter().any(|&v| v < 1.0) && images[0] == images[1], "{kind:?}, {light:?}");
        }
    }
}
