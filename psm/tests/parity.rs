//! The GPU path against the CPU path, on every built-in scene: stage by stage where they disagree.
//!
//! Both are asked about the same G-buffer. First the views: the parametrisation is the same, and every receiver falls on the
//! same place of the map but for what f32 leaves. Then V: it may differ only at a pixel whose texel, or one beside it, holds another
//! triangle (a caster's outline), or that falls onto the border of two texels by as much. Every other difference fails the test,
//! however few there are.

#![cfg(feature = "gpu")]

use glam::{Affine3A, DVec2, DVec4, Vec3};
use gnomon_psm::gpu::PsmOnGpu;
use gnomon_psm::gpu::layout::ViewOnGpu;
use gnomon_psm::warp::Warp;
use gnomon_psm::{Parametrisation, PreparedPsm, Psm, PsmParams, Show, Variant};
use scene_core::geometry::ObjectFlags;
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{
    GBufferTargets, Gpu, GpuObject, GpuScene, GpuShadowQuery, HeadlessRun, Recorder, SceneBuffers, testing,
};
use scene_core::reference::valid_pixels;
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};

const MAP_SIZE: u32 = 256;

/// How far apart, in texels, the two backends may put a receiver. A place is x/w; each form is four products, each rounded, of
/// coordinates relative to the eye, at most 20 times the window's half extent here; w is at least 1/100 of its largest, and
/// the forms themselves go through two such sums before: 3 · 8 · 2⁻²⁴ · 20 · 100 in half windows, of 128 texels each.
const APART: f64 = 3.0 * 8.0 / 16_777_216.0 * 20.0 * 100.0 * 128.0;

struct Case<'a> {
    name: &'a str,
    scene: &'a Scene,
    camera: &'a Camera,
    light: Light,
    params: PsmParams,
}

/// How many valid pixels of an image were compared and how many of them differ; and how far apart the views are, in texels.
#[derive(Clone, Copy, Debug, Default)]
struct Agreement {
    valid: usize,
    differ: usize,
    apart: f64,
}

/// Forms on world positions of a view that is relative to the eye.
fn in_world(view: &ViewOnGpu, camera: &Camera) -> Warp {
    let eye = camera.eye.as_dvec3();
    let [x, y, w] = view.ndc.map(|form| {
        let form = form.as_dvec4();
        DVec4::new(form.x, form.y, form.z, form.w - form.truncate().dot(eye))
    });
    Warp { x, y, w }
}

/// Column and row of a place in a map, as numbers.
fn in_texels(place: DVec2) -> DVec2 {
    DVec2::new(place.x * 0.5 + 0.5, 0.5 - place.y * 0.5) * f64::from(MAP_SIZE)
}

fn on_cpu<'a>(case: &Case<'a>, gbuffer: &GBuffer) -> (PreparedPsm<'a>, VisibilityImage) {
    let (prepared, _) = Psm::new(case.params).prepare(case.scene, &case.light, case.camera, gbuffer);
    let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
    prepared.shade(gbuffer, &mut image);
    (prepared, image)
}

fn on_gpu(gpu: &Gpu, case: &Case<'_>, gbuffer: &GBuffer) -> (PsmOnGpu, HeadlessRun) {
    let mut technique = PsmOnGpu::new(&gpu.device, case.params, VISIBILITY_FORMAT).unwrap();
    let asked = (case.scene, case.camera, &case.light);
    let run = testing::run_over(gpu, gbuffer, asked, &mut technique).unwrap();
    (technique, run)
}

/// Runs both backends and explains every difference.
fn compare(gpu: &Gpu, case: &Case<'_>) -> Agreement {
    let gbuffer = raster::render_gbuffer(case.scene, case.camera);
    let (prepared, expected) = on_cpu(case, &gbuffer);
    let (technique, run) = on_gpu(gpu, case, &gbuffer);
    let views: Vec<ViewOnGpu> = gpu.read_buffer(technique.views().unwrap()).unwrap();
    let layers: Vec<u32> =
        (0..views.len() as u32).filter(|&i| views[i as usize].parametrisation().is_some()).collect();
    let what = || format!("{}, {:?}, {:?}", case.name, case.light, case.params.variant);
    assert_eq!(layers.len(), prepared.maps().len(), "{}", what());
    let mut agreement = Agreement::default();
    let (mut warps, mut ids) = (Vec::new(), Vec::<Vec<u32>>::new());
    for (&layer, map) in layers.iter().zip(prepared.maps()) {
        let view = &views[layer as usize];
        let same = match (view.parametrisation().unwrap(), map.view.parametrisation) {
            (Parametrisation::Psm { shift: a }, Parametrisation::Psm { shift: b }) => {
                (a - b).abs() <= 1e-4 * b.max(1.0)
            }
            (a, b) => a == b,
        };
        assert!(same, "{}: {view:?}, {:?}", what(), map.view);
        warps.push(in_world(view, case.camera));
        ids.push(gpu.read_texture(technique.layers().ids().unwrap(), layer).unwrap());
    }
    let valid = valid_pixels(&gbuffer, &case.light);
    for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)) {
        agreement.valid += usize::from(valid[pixel]);
        let point = gbuffer.position[pixel];
        let held = prepared.maps().iter().position(|map| map.texel_of(point).is_some());
        let apart = held.map(|i| {
            let place = prepared.maps()[i].view.ndc.place(point.as_dvec3());
            let apart = (in_texels(warps[i].place(point.as_dvec3())) - in_texels(place)).abs();
            apart.max_element()
        });
        agreement.apart = agreement.apart.max(apart.unwrap_or(0.0));
        if (run.visibility.values[pixel] - expected.values[pixel]).abs() <= 1.0 / 255.0 {
            continue;
        }
        agreement.differ += usize::from(valid[pixel]);
        assert!(
            is_explained(&prepared, &ids, &gbuffer, pixel, &case.light, APART),
            "{}: pixel {pixel} is {} on the CPU and {} on the GPU",
            what(),
            expected.values[pixel],
            run.visibility.values[pixel],
        );
    }
    agreement
}

/// Whether a pixel may differ: its texel or one beside it holds another triangle on the GPU, or it lies on the border of texels or maps, or
/// turns from the light by rounding.
fn is_explained(
    prepared: &PreparedPsm<'_>,
    ids: &[Vec<u32>],
    gbuffer: &GBuffer,
    pixel: usize,
    light: &Light,
    apart: f64,
) -> bool {
    let receiver = gbuffer.position[pixel];
    let (to_light, _) = light.center().ray_from(receiver);
    if gbuffer.normal[pixel].dot(to_light.normalize()).abs() < 1e-5 {
        return true;
    }
    let held = prepared.maps().iter().enumerate().find_map(|(i, map)| map.texel_of(receiver).map(|t| (i, t)));
    let Some((index, [column, row])) = held else { return false };
    let map = &prepared.maps()[index];
    let place = in_texels(map.view.ndc.place(receiver.as_dvec3()));
    let size = MAP_SIZE as usize;
    let around = |at: usize| at.saturating_sub(1)..(at + 2).min(size);
    let mut texels = around(row).flat_map(|row| around(column).map(move |column| row * size + column));
    (place - place.round()).abs().min_element() < apart
        || texels.any(|texel| ids[index][texel] != map.triangles[texel])
}

/// The design's bound: at least 99.9 % of the valid pixels agree.
fn check(gpu: &Gpu, case: &Case<'_>) {
    let Agreement { valid, differ, apart } = compare(gpu, case);
    let what = format!("{}, {:?}, {:?}", case.name, case.light, case.params.variant);
    println!("{what}: {differ} of {valid} differ, views {apart:.4} texels apart");
    assert!(apart <= APART, "{what}: views are {apart} texels apart");
    assert!(differ * 1000 <= valid, "{what}: {differ} of {valid} pixels differ");
}

fn params(variant: Variant) -> PsmParams {
    PsmParams { variant, map_size: MAP_SIZE, ..Default::default() }
}

#[test]
fn every_built_in_scene() {
    let Some(gpu) = testing::gpu() else { return };
    for scene in scenes::all() {
        let setup = scenes::build(scene.name, 0.4).unwrap();
        let camera = setup.camera.with_size(160, 120);
        for &light in &setup.lights {
            let params = params(Variant::Auto);
            check(&gpu, &Case { name: scene.name, scene: &setup.scene, camera: &camera, light, params });
        }
    }
}

/// Each variant under suns from before, behind and above, cube faces of a lamp inside the scene, a cone.
#[test]
fn every_variant_and_kind_of_view() {
    let Some(gpu) = testing::gpu() else { return };
    for name in ["street", "chess"] {
        let setup = scenes::build(name, 0.4).unwrap();
        let camera = setup.camera.with_size(160, 120);
        let bounds = setup.scene.bounds();
        let inside = bounds.center() + 0.1 * bounds.size();
        let sun = |direction: Vec3| Light::Directional { direction, angular_radius: 0.0 };
        let ahead = camera.forward();
        let lights = [
            Light::Point { position: inside },
            Light::Spot {
                position: inside,
                direction: bounds.center() - inside - Vec3::Y,
                outer: 0.6,
                inner: 0.3,
            },
            sun(Vec3::NEG_Y),
            sun(ahead - Vec3::Y),
            sun(-ahead.with_y(0.5)),
        ];
        for light in lights {
            for variant in Variant::ALL {
                let params = params(variant);
                check(&gpu, &Case { name, scene: &setup.scene, camera: &camera, light, params });
            }
        }
    }
}

/// Thousands of objects: what an invocation does must not grow with their number, since drivers end loops that seem endless (Mesa's
/// after 65,535 rounds of all loops together).
#[test]
fn thousands_of_objects() {
    let Some(gpu) = testing::gpu() else { return };
    let mut scene = Scene::new();
    let mut add = |name: &str, corners: [Vec3; 4]| {
        let mesh = TriangleMesh::new(name, corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("sound");
    };
    let square = |side: f32| {
        [(-1, -1), (1, -1), (1, 1), (-1, 1)].map(|(x, z)| side * Vec3::new(x as f32, 0.0, z as f32))
    };
    add("ground", square(60.0));
    for i in 0..12_000u16 {
        let at = Vec3::new(f32::from(i % 120) - 59.5, 0.5, f32::from(i / 120) - 49.5);
        add("leaf", square(0.2).map(|corner| at + corner));
    }
    let camera = Camera {
        eye: Vec3::new(0.0, 4.0, 55.0),
        target: Vec3::ZERO,
        up: Vec3::Y,
        fov_y: 0.8,
        near: 0.1,
        far: f32::INFINITY,
        width: 256,
        height: 256,
    };
    let light = Light::Directional { direction: Vec3::new(0.4, -1.0, 0.3), angular_radius: 0.0 };
    let params = PsmParams { map_size: MAP_SIZE, ..Default::default() };
    check(&gpu, &Case { name: "leaves", scene: &scene, camera: &camera, light, params });
}

/// Where resolution goes is said alike: 1/d within 1 %, which the two windows and f32 leave.
#[test]
fn texels_are_shown_alike() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("street", 0.0).unwrap();
    let camera = setup.camera.with_size(96, 72);
    let params = PsmParams { show: Show::Texels, map_size: 32, ..params(Variant::Psm) };
    let case = Case { name: "street", scene: &setup.scene, camera: &camera, light: setup.lights[0], params };
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let (_, expected) = on_cpu(&case, &gbuffer);
    let (_, run) = on_gpu(&gpu, &case, &gbuffer);
    let valid = valid_pixels(&gbuffer, &case.light);
    let mut shown = 0;
    for pixel in (0..gbuffer.pixel_count()).filter(|&i| valid[i]) {
        let (a, b) = (expected.values[pixel], run.visibility.values[pixel]);
        assert!((a - b).abs() <= 0.01 * a.max(b), "pixel {pixel}: {a} and {b}");
        shown += usize::from(a > 0.0 && a < 1.0);
    }
    assert!(shown > 500, "{shown}");
}

/// The comparison can fail: maps of another light differ, and nothing explains it.
#[test]
fn a_planted_difference_is_found() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("chess", 0.0).unwrap();
    let camera = setup.camera.with_size(160, 120);
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let case = |direction| Case {
        name: "chess",
        scene: &setup.scene,
        camera: &camera,
        light: Light::Directional { direction, angular_radius: 0.0 },
        params: params(Variant::Psm),
    };
    let this = case(Vec3::new(0.5, -1.0, 0.2));
    let (prepared, expected) = on_cpu(&this, &gbuffer);
    let (_, run) = on_gpu(&gpu, &case(Vec3::new(-0.5, -1.0, 0.2)), &gbuffer);
    let same_ids = [prepared.maps()[0].triangles.clone()];
    let found = (0..gbuffer.pixel_count())
        .filter(|&pixel| (run.visibility.values[pixel] - expected.values[pixel]).abs() > 1.0 / 255.0)
        .filter(|&pixel| !is_explained(&prepared, &same_ids, &gbuffer, pixel, &this.light, APART))
        .count();
    assert!(found > 50, "{found}");
}

/// One value serves any number of lights and frames, one after the other.
#[test]
fn it_is_reused_from_frame_to_frame() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("chess", 0.0).unwrap();
    let camera = setup.camera.with_size(64, 48);
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let mut view = gpu.view(&setup.scene, &camera).unwrap();
    view.upload_gbuffer(&gbuffer).unwrap();
    let mut technique = PsmOnGpu::new(&gpu.device, params(Variant::Auto), VISIBILITY_FORMAT).unwrap();
    let cube = Light::Point { position: setup.scene.bounds().center() };
    let runs = [cube, setup.lights[0], cube].map(|light| view.run(&mut technique, &light, &gbuffer).unwrap());
    assert!(
        runs[0].visibility.bits() == runs[2].visibility.bits()
            && runs[0].visibility.bits() != runs[1].visibility.bits()
    );
    let stages = ["prepare.receivers", "prepare.views", "prepare.maps", "shade.lookup"];
    for stage in if gpu.has_timestamps() { &stages[..] } else { &["shade.wall"] } {
        assert!(runs[1].report.stages_ms.contains_key(*stage), "{stage}: {:?}", runs[1].report);
    }
}

/// What casts may change from frame to frame while the buffers stay the same.
#[test]
fn an_object_that_casts_no_more_is_drawn_no_more() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("chess", 0.0).unwrap();
    let (scene, camera) = (&setup.scene, setup.camera.with_size(64, 48));
    let buffers = SceneBuffers::new(&gpu.device, scene).unwrap();
    let targets = GBufferTargets::new(&gpu.device, camera.width, camera.height);
    targets.upload(&gpu.queue, &raster::render_gbuffer(scene, &camera));
    let visibility = gpu.visibility_texture(&targets);
    let mut technique = PsmOnGpu::new(&gpu.device, params(Variant::Psm), VISIBILITY_FORMAT).unwrap();
    let mut drawn = |objects: &[GpuObject]| -> Vec<u32> {
        let scene = GpuScene { objects, ..buffers.view(Some(scene)) };
        let query = GpuShadowQuery { scene, light: &setup.lights[0], camera: &camera };
        let mut encoder = gpu.encoder();
        let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
        technique.prepare(&mut recorder, &query).unwrap();
        let view = visibility.create_view(&Default::default());
        technique.shade(&mut recorder, &camera, &targets.view(), &view).unwrap();
        gpu.submit(encoder).unwrap();
        gpu.read_texture(technique.layers().ids().unwrap(), 0).unwrap()
    };
    let mut objects = buffers.view(None).objects.to_vec();
    let first = drawn(&objects);
    let triangle = first.iter().copied().find(|&id| id != GBuffer::NOTHING).unwrap();
    let seen = objects.iter().position(|object| object.triangles.contains(&triangle)).unwrap();
    let triangles = objects[seen].triangles.clone();
    objects[seen].flags.casts = false;
    assert!(drawn(&objects).iter().all(|id| !triangles.contains(id)));
    objects[seen].flags.casts = true;
    assert!(drawn(&objects) == first);
}

#[test]
fn a_map_too_large_is_an_error() {
    let Some(gpu) = testing::gpu() else { return };
    let limit = gpu.device.limits().max_texture_dimension_2d;
    let params = PsmParams { map_size: limit + 1, ..Default::default() };
    let error = PsmOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap_err();
    assert!(error.to_string().contains(&limit.to_string()), "{error}");
}

#[test]
fn an_empty_scene_is_lit() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("ball", 0.0).unwrap();
    let camera = setup.camera.with_size(16, 16);
    let params = params(Variant::Auto);
    check(
        &gpu,
        &Case { name: "nothing", scene: &Scene::new(), camera: &camera, light: setup.lights[0], params },
    );
}
