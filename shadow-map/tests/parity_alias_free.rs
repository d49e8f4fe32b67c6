//! `alias-free` on the GPU against the CPU path, which is one exact shadow ray a pixel: V may differ only where a shadow's
//! border passes within a thousandth of a pixel, or where light grazes a surface at a cosine below 10⁻⁶.

#![cfg(feature = "gpu")]

use glam::Vec2;
use gnomon_shadow_map::alias_free::AliasFree;
use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::{ShadowMapParams, Variant};
use scene_core::bvh::shadow_origin;
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, testing};
use scene_core::light::LightPoint;
use scene_core::{Camera, GBuffer, Light, Scene, VisibilityImage, raster, scenes};

/// Pixels.
const NEAR_BORDER: f32 = 1e-3;

/// V of the surface that a pixel sees, at places within so many pixels of its middle.
fn around(
    scene: &Scene,
    camera: &Camera,
    light: &Light,
    gbuffer: &GBuffer,
    pixel: usize,
    pixels: f32,
) -> Vec<f32> {
    let (column, row) = (pixel as u32 % gbuffer.width, pixel as u32 / gbuffer.width);
    let middle = Vec2::new(column as f32, row as f32) + 0.5;
    let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
    let rays = camera.rays();
    let mut faces = Vec::new();
    let places: Vec<_> = (0..48u8)
        .map(|step| {
            let (turn, reach) =
                (f32::from(step % 16) * std::f32::consts::TAU / 16.0, f32::from(1 + step / 16) / 3.0);
            let direction = rays.direction(middle + Vec2::from_angle(turn) * (pixels * reach));
            let (n, d) = (normal.as_dvec3(), direction.as_dvec3());
            let t = n.dot(position.as_dvec3() - camera.eye.as_dvec3()) / n.dot(d);
            let place = (camera.eye.as_dvec3() + d * t).as_vec3();
            let towards = match light.center() {
                LightPoint::At(at) => at - place,
                LightPoint::Towards(direction) => direction,
            };
            faces.push(normal.dot(towards) > 0.0 && light.reaches(place));
            shadow_origin(place, normal, scene.bounds().magnitude())
        })
        .collect();
    let mut blocked = vec![false; places.len()];
    AliasFree::new(scene, true).occluded_packet(light.center(), &places, &mut blocked);
    blocked.iter().zip(faces).map(|(&blocked, faces)| if blocked || !faces { 0.0 } else { 1.0 }).collect()
}

/// Pixels seen, dark ones, ones that differ, and those of them that light grazes.
fn check(gpu: &Gpu, name: &str, scene: &Scene, camera: &Camera, light: &Light) -> [usize; 4] {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let mut expected = VisibilityImage::new(gbuffer.width, gbuffer.height);
    AliasFree::new(scene, true).shade(light, &gbuffer, &mut expected);
    let params = ShadowMapParams { variant: Variant::AliasFree, ..Default::default() };
    let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
    let run = testing::run_over(gpu, &gbuffer, (scene, camera, light), &mut on_gpu).unwrap();
    let (mut different, mut grazed) = (0, 0);
    for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)) {
        let (got, wanted) = (run.visibility.values[pixel], expected.values[pixel]);
        if got != wanted {
            different += 1;
            let within = |pixels| around(scene, camera, light, &gbuffer, pixel, pixels).contains(&got);
            let (to_light, _) = light.center().ray_from(gbuffer.position[pixel]);
            let cosine = to_light.normalize().dot(gbuffer.normal[pixel]);
            // Which side of a surface the light grazes is decided by rounding, here as there.
            grazed += usize::from(cosine.abs() <= 1e-6);
            if cosine.abs() > 1e-6 && !within(NEAR_BORDER) {
                let near = (1..10u8)
                    .map(|step| NEAR_BORDER * f32::from(1u16 << step))
                    .find(|&pixels| within(pixels));
                panic!(
                    "{name}, {light:?}: pixel {pixel} is {got}, not {wanted}, and the next border is {near:?} pixels away; \
                     the light is seen at a cosine of {cosine}"
                );
            }
        }
    }
    let count = |test: fn(f32) -> bool| expected.values.iter().filter(|&&v| test(v)).count();
    [count(|v| !v.is_nan()), count(|v| v == 0.0), different, grazed]
}

#[test]
fn every_built_in_scene() {
    let Some(gpu) = testing::gpu() else { return };
    let (mut seen, mut different) = (0, 0);
    for name in scenes::all().iter().map(|scene| scene.name) {
        let spec = if name == "forest" { "forest:triangles=100000" } else { name };
        let setup = scenes::build(spec, 0.0).unwrap();
        let camera = setup.camera.with_size(192, 144);
        let bounds = setup.scene.bounds();
        let inside = Light::Point { position: bounds.center() + 0.13 * bounds.size() };
        for light in [setup.lights[0], inside] {
            let found = check(&gpu, name, &setup.scene, &camera, &light);
            println!("{name}, {light:?}: seen, dark, different, grazed {found:?}");
            (seen, different) = (seen + found[0], different + found[2]);
        }
    }
    assert!(different * 1000 <= seen, "{different} of {seen} pixels");
}

/// Triangles before many receivers, which no invocation asks alone: at this size shadows of half the facade were missing when a workgroup
/// asked those of all of its triangles, one after the other.
#[test]
fn triangles_before_many_receivers() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("street", 0.0).unwrap();
    let camera = setup.camera.with_size(320, 180);
    let found = check(&gpu, "street", &setup.scene, &camera, &setup.lights[0]);
    println!("seen, dark, different, grazed {found:?}");
    assert!(found[2] * 1000 <= found[0], "{found:?}");
}

/// Cones, large and small scenes, and a camera of another size from frame to frame.
#[test]
fn cones_scales_and_sizes() {
    let Some(gpu) = testing::gpu() else { return };
    for scale in [1e-3, 1.0, 1e4] {
        let mut setup = scenes::build("chess", 0.4).unwrap();
        let affine = glam::Affine3A::from_scale(glam::Vec3::splat(scale));
        let mut scene = Scene::new();
        for object in setup.scene.objects() {
            let positions = setup.scene.positions()[object.vertices.clone()].to_vec();
            let first = object.vertices.start as u32;
            let triangles = setup.scene.triangles()[object.triangles.clone()]
                .iter()
                .map(|triangle| triangle.map(|vertex| vertex - first))
                .collect();
            let mesh = scene_core::TriangleMesh::new(object.name.clone(), positions, triangles);
            scene.add(&mesh, affine, object.flags).unwrap();
        }
        setup.camera.eye *= scale;
        setup.camera.target *= scale;
        setup.camera.near *= scale;
        setup.camera.far *= scale;
        let bounds = scene.bounds();
        let position = bounds.center() + 0.4 * bounds.size();
        let spot = Light::Spot { position, direction: bounds.center() - position, outer: 0.6, inner: 0.3 };
        for size in [[96, 72], [31, 17]] {
            let camera = setup.camera.with_size(size[0], size[1]);
            let [seen, dark, different, _] = check(&gpu, "chess", &scene, &camera, &spot);
            assert!(dark > 50 && different * 100 <= seen, "{scale}: {seen} {dark} {different}");
        }
    }
}
