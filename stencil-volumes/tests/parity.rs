//! The GPU path against one exact shadow ray a pixel, and against the CPU path.
//!
//! The G-buffer's texture keeps a position as a distance in f32, so the GPU is asked about places that are rounded anew. V may
//! differ from the ray's at the CPU's place only where it is the ray's at the rounded one, or within 1e-3 pixel or two lifts of a
//! ray's origin of a true shadow's border. All pixels that differ are counted.

#![cfg(feature = "gpu")]

mod truth;

use glam::{Affine3A, Vec3};
use gnomon_stencil_volumes::near_casters;
use gnomon_stencil_volumes::{
    Casters, Count, Skips, StencilVolumes, StencilVolumesOnGpu, Variant, VolumeParams,
};
use scene_core::bvh::Bvh;
use scene_core::geometry::{ObjectFlags, facing};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, testing};
use scene_core::reference::valid_pixels;
use scene_core::technique::{ShadowQuery, conformance};
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};
use truth::{Comparison, as_textures_hold_it, compare, trace};

fn on_gpu(
    gpu: &Gpu,
    scene: &Scene,
    camera: &Camera,
    light: &Light,
    gbuffer: &GBuffer,
    params: VolumeParams,
) -> (VisibilityImage, [u32; 4]) {
    let mut on_gpu = StencilVolumesOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT);
    let run = testing::run_over(gpu, gbuffer, (scene, camera, light), &mut on_gpu).unwrap();
    let StencilVolumesOnGpu::Volumes(volumes) = &mut on_gpu else { return (run.visibility, [0; 4]) };
    let counters: Vec<u32> = gpu.read_buffer(&volumes.counters(&gpu.device).unwrap()).unwrap();
    let pixels: Vec<u32> = gpu.read_buffer(&volumes.pixels(&gpu.device).unwrap()).unwrap();
    (run.visibility, [counters[0], counters[1], counters[2], pixels[0]])
}

fn check(gpu: &Gpu, name: &str, scene: &Scene, camera: &Camera, light: &Light) -> Comparison {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let bvh = Bvh::casters(scene);
    let truth = trace(scene, &bvh, light, &gbuffer);
    let rounded = trace(scene, &bvh, light, &as_textures_hold_it(&gbuffer, camera));
    let outside = near_casters(&Casters::new(scene).unwrap(), light, camera).is_empty();
    let mut last = Comparison::default();
    // Counted as far as can be, which small images with many edges are not unless asked for, and as by default.
    for (count, rays) in [(Count::Auto, false), (Count::Auto, true), (Count::ZPass, false)] {
        if count == Count::ZPass && !outside {
            continue;
        }
        let params = VolumeParams { count, rays, ..Default::default() };
        let (image, [edges, eye, near, traced]) = on_gpu(gpu, scene, camera, light, &gbuffer, params);
        last = compare(scene, &bvh, light, camera, &gbuffer, &truth, &image);
        let before = last.wrong.len();
        last.wrong.retain(|&pixel| image.values[pixel] != rounded[pixel]);
        let by_rounding = before - last.wrong.len();
        println!(
            "{name} {} {count:?}, rays {rays}: {} differ of {}, {} at a border, {} within two lifts, {by_rounding} by rounding, {} wrong; {edges} edges, {eye} faces before the eye, {near} near, {traced} pixels traced",
            light.kind(),
            last.differ,
            last.asked,
            last.at_border,
            last.at_lift,
            last.wrong.len()
        );
        assert!(last.wrong.is_empty(), "{name}, {light:?}, {count:?}: pixel {:?}", last.wrong.first());
        // A light in a surface's plane leaves that to rounding: valid pixels alone are held to the design's bound.
        let valid = valid_pixels(&gbuffer, light);
        let asked = valid.iter().filter(|&&valid| valid).count();
        let differ = (0..truth.len()).filter(|&p| valid[p] && image.values[p] != truth[p]).count();
        assert!(differ * 1000 <= asked, "{name}, {light:?}: {differ} of {asked} valid pixels differ");
    }
    last
}

#[test]
fn built_in_scenes() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["quads", "cornell", "cylinder", "ball", "chess", "fence", "log-cabin", "pool", "street"] {
        let setup = scenes::build(name, 0.4).unwrap();
        let camera = setup.camera.with_size(160, 120);
        let bounds = setup.scene.bounds();
        let inside = Light::Point { position: bounds.center() + 0.1 * bounds.size() };
        for light in [setup.lights[0], inside] {
            check(&gpu, name, &setup.scene, &camera, &light);
        }
    }
}

/// Faces almost in a plane with the light, which f32 cannot turn: pairs of f32 do, if the compiler leaves them their roundings.
#[test]
fn facings_are_exact() {
    let Some(gpu) = testing::gpu() else { return };
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / 8_388_608.0 - 1.0
    };
    let light = Vec3::new(0.3, 0.7, -0.2);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for face in 0..4096 {
        let [a, b] = [(); 2].map(|()| Vec3::new(random(), random(), random()));
        let (s, t) = (random(), random());
        positions.extend([a, b, a + s * (b - a) + t * (light - a)]);
        triangles.push([3 * face, 3 * face + 1, 3 * face + 2]);
    }
    let mut scene = Scene::new();
    let mesh = TriangleMesh::new("faces", positions, triangles);
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    let camera = scenes::build("quads", 0.0).unwrap().camera.with_size(8, 8);
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let light = Light::Point { position: light };
    let mut view = gpu.view(&scene, &camera).unwrap();
    let mut on_gpu = StencilVolumesOnGpu::new(&gpu.device, VolumeParams::default(), VISIBILITY_FORMAT);
    view.run(&mut on_gpu, &light, &gbuffer).unwrap();
    let StencilVolumesOnGpu::Volumes(volumes) = &mut on_gpu else { unreachable!("the default variant") };
    let found: Vec<i32> = gpu.read_buffer(&volumes.facings(&gpu.device).unwrap()).unwrap();
    let expected = facing(scene.positions(), scene.triangles(), light.center());
    let differ: Vec<_> = (0..expected.len()).filter(|&t| i32::from(expected[t]) != found[t]).collect();
    let edge_on = expected.iter().filter(|&&f| f == 0).count();
    assert!(differ.is_empty() && edge_on < 100, "{} differ, {edge_on} in the light's plane", differ.len());
}

/// The eye in a shadow, the near plane through casters, the light on a vertex and in a face's plane.
#[test]
fn views_that_are_hard() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("knot", 0.0).unwrap();
    let scene = &setup.scene;
    let bounds = scene.bounds();
    let (center, size) = (bounds.center(), bounds.size().max_element());
    let first = scene.positions()[0];
    for eye in [center + Vec3::new(0.02, -0.05, 0.03) * size, setup.camera.eye] {
        for near in [setup.camera.near, 0.3 * (setup.camera.eye - center).length()] {
            let camera = Camera { eye, near, ..setup.camera.with_size(96, 72) };
            for light in [
                setup.lights[0],
                Light::Point { position: center },
                Light::Point { position: first },
                Light::Directional { direction: Vec3::new(0.2, -1.0, 0.1), angular_radius: 0.0 },
            ] {
                check(&gpu, "knot", scene, &camera, &light);
            }
        }
    }
}

/// Blocks without room for their edges take all there are; one value serves any number of frames.
#[test]
fn lists_without_room_change_no_pixel() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("chess", 0.0).unwrap();
    let camera = setup.camera.with_size(96, 72);
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let mut view = gpu.view(&setup.scene, &camera).unwrap();
    view.upload_gbuffer(&gbuffer).unwrap();
    let mut on_gpu = StencilVolumesOnGpu::new(&gpu.device, VolumeParams::default(), VISIBILITY_FORMAT);
    let mut images = Vec::new();
    for (bytes, light) in [
        (64 << 20, setup.lights[0]),
        (1 << 10, setup.lights[0]),
        (0, Light::Point { position: setup.scene.bounds().center() }),
        (64 << 20, Light::Point { position: setup.scene.bounds().center() }),
    ] {
        let StencilVolumesOnGpu::Volumes(volumes) = &mut on_gpu else { unreachable!("the default variant") };
        volumes.set_list_bytes(bytes);
        let run = view.run(&mut on_gpu, &light, &gbuffer).unwrap();
        images.push(run.visibility.bits());
    }
    assert!(images[0] == images[1] && images[2] == images[3] && images[0] != images[2]);
}

/// The comparison can fail: the shadows of another light differ, and no border explains it.
#[test]
fn a_planted_difference_is_found() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("ball", 0.0).unwrap();
    let camera = setup.camera.with_size(64, 48);
    let light = Light::Point { position: Vec3::new(2.0, 6.0, 1.0) };
    let other = Light::Point { position: Vec3::new(-2.0, 6.0, 1.0) };
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let bvh = Bvh::casters(&setup.scene);
    let truth = trace(&setup.scene, &bvh, &light, &gbuffer);
    let (image, _) = on_gpu(&gpu, &setup.scene, &camera, &other, &gbuffer, VolumeParams::default());
    let found = compare(&setup.scene, &bvh, &light, &camera, &gbuffer, &truth, &image).wrong.len();
    assert!(found > 50, "{found}");
}

/// Planar shadows: outlines are snapped to 1/256 pixel by both rasterisers, so a few pixels on them may differ.
#[test]
fn planar_receivers() {
    let Some(gpu) = testing::gpu() else { return };
    let params = VolumeParams { variant: Variant::Planar, ..Default::default() };
    for name in ["ball", "chess", "cornell", "log-cabin", "fence"] {
        let setup = scenes::build(name, 0.0).unwrap();
        let (scene, camera) = (&setup.scene, setup.camera.with_size(160, 120));
        let gbuffer = raster::render_gbuffer(scene, &camera);
        let bounds = scene.bounds();
        for light in [setup.lights[0], Light::Point { position: bounds.center() + 0.3 * bounds.size() }] {
            let casters = Casters::new(scene).unwrap();
            let mut expected = VisibilityImage::new(camera.width, camera.height);
            StencilVolumes::new(params).prepare(&casters, &light, &camera).0.shade(&gbuffer, &mut expected);
            let (image, _) = on_gpu(&gpu, scene, &camera, &light, &gbuffer, params);
            let asked = (0..gbuffer.pixel_count()).filter(|&p| gbuffer.is_seen(p)).count();
            let differ =
                image.values.iter().zip(&expected.values).filter(|(a, b)| !a.is_nan() && a != b).count();
            let dark = expected.values.iter().filter(|&&v| v == 0.0).count();
            println!("planar {name} {}: {differ} of {asked} differ, {dark} dark", light.kind());
            assert!(
                differ * 1000 <= asked && dark > 0,
                "{name}, {light:?}: {differ} of {asked} differ, {dark} dark"
            );
        }
    }
}

/// Faces that cannot matter have no edges if skipping is on, and no pixel changes.
#[test]
fn skipping_changes_no_pixel() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["street", "chess", "forest:triangles=20000"] {
        let setup = scenes::build(name, 0.0).unwrap();
        let camera = Camera { fov_y: 0.2, ..setup.camera.with_size(96, 72) };
        let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
        let bounds = setup.scene.bounds();
        for light in [setup.lights[0], Light::Point { position: bounds.center() + 0.2 * bounds.size() }] {
            let mut view = gpu.view(&setup.scene, &camera).unwrap();
            view.upload_gbuffer(&gbuffer).unwrap();
            // Counted as far as can be: rays would hide what is missing.
            let params = VolumeParams { rays: false, ..Default::default() };
            let mut technique = StencilVolumesOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT);
            let mut first: Option<Vec<u32>> = None;
            let mut found = Vec::new();
            for (kind, skips) in Skips::EACH {
                let StencilVolumesOnGpu::Volumes(volumes) = &mut technique else {
                    unreachable!("the default variant")
                };
                volumes.set_skips(skips);
                let run = view.run(&mut technique, &light, &gbuffer).unwrap();
                let bits = run.visibility.bits();
                assert!(first.get_or_insert_with(|| bits.clone()) == &bits, "{name}, {light:?}, {kind}");
                println!(
                    "{name} {}, {kind}: {:?} {:?}",
                    light.kind(),
                    run.report.skipped,
                    run.report.counted
                );
                found.push(run.report);
            }
            let skipped =
                |kind: usize, what: &str| found[kind].skipped.get(what).copied().unwrap_or_default();
            let counted = |kind: usize, what: &str| found[kind].counted[what];
            for (kind, what) in [
                (1, "caster triangles outside view"),
                (2, "caster triangles in another's shadow"),
                (3, "runs of edges beside a block"),
                (4, "pixels the light cannot reach"),
            ] {
                let alone = (0..6).all(|other| other == kind || skipped(other, what) == 0);
                assert!(alone, "{name}, {light:?}: {what}");
                // Runs and blocks have other bounds if other kinds have left edges and pixels out, so that more or fewer of them lie
                // beside each other: there are fewer of them, though.
                let among = |report| match what {
                    "runs of edges beside a block" => {
                        skipped(report, what) + counted(report, "pairs of run and block")
                    }
                    _ => skipped(report, what),
                };
                assert!(among(6) <= among(kind), "{name}, {light:?}: {what}");
            }
            assert!(
                skipped(3, "runs of edges beside a block") > 0
                    && skipped(4, "pixels the light cannot reach") > 0
            );
            // A dense tile leaves its pixels to rays after the round of 64 edges in which it is found to be dense: which come first
            // differs from frame to frame.
            let pairs = |kind| counted(kind, "pairs of side and pixel");
            let most = pairs(0) + 64 * counted(0, "pixels traced");
            assert!((1..Skips::EACH.len()).all(|kind| pairs(kind) <= most), "{name}, {light:?}: {most}");
        }
    }
}

/// A device that binds so little that edges are gone through in pieces and the tree has larger leaves.
#[test]
fn tables_beyond_what_is_bound_change_nothing() {
    let setup = scenes::build("knot", 0.0).unwrap();
    let camera = setup.camera.with_size(96, 72);
    let query = ShadowQuery { scene: &setup.scene, light: &setup.lights[0], camera: &camera };
    // Triangles, twelve bytes each, are just bound; an edge and a half a triangle take as much by their ends alone.
    let bytes = 15 * setup.scene.triangles().len() as u64;
    for rays in [true, false] {
        let technique = StencilVolumes::new(VolumeParams { rays, ..Default::default() });
        let Some([whole, in_pieces]) = conformance::whole_and_in_pieces(&technique, &query, bytes) else {
            return;
        };
        let same = whole.values.iter().zip(&in_pieces.values).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same, "rays {rays}");
    }
}
