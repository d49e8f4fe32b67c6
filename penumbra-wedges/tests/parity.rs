//! The GPU path against the CPU path, pixel by pixel.
//!
//! Both ask about the same samples of the light. The G-buffer's texture keeps a position as a distance in f32, and places on the
//! light's plane are f32, so that a sample may be seen on the other side of an outline that it all but touches. At least 999 of 1,000
//! valid pixels must agree to 1/255, and each of the others must be explained: the CPU, asked about the place moved by rounding's size
//! in six directions, must bracket what the GPU says.

#![cfg(feature = "gpu")]

mod truth;

use glam::Vec3;
use gnomon_penumbra_wedges::{PenumbraWedges, PenumbraWedgesOnGpu, Variant, WedgeParams};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::{Gpu, testing};
use scene_core::reference::valid_pixels;
use scene_core::technique::{ShadowQuery, conformance};
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};
use truth::shade_gbuffer;

/// Half a step of an 8-bit image is 1/510; a whole one is what may differ.
const STEP: f32 = 1.0 / 255.0;

struct Case<'a> {
    name: &'a str,
    scene: &'a Scene,
    camera: Camera,
    light: Light,
}

/// V, and what was counted: edges found, faces that touch the light, pixels traced.
fn on_gpu(
    gpu: &Gpu,
    case: &Case<'_>,
    gbuffer: &GBuffer,
    params: WedgeParams,
    list_bytes: u64,
) -> (VisibilityImage, [u32; 3]) {
    let mut on_gpu = PenumbraWedgesOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT);
    on_gpu.set_list_bytes(list_bytes);
    let asked = (case.scene, &case.camera, &case.light);
    let run = testing::run_over(gpu, gbuffer, asked, &mut on_gpu).unwrap();
    let counters: Vec<u32> = gpu.read_buffer(&on_gpu.counters(&gpu.device).unwrap()).unwrap();
    let pixels: Vec<u32> = gpu.read_buffer(&on_gpu.pixels(&gpu.device).unwrap()).unwrap();
    (run.visibility, [counters[0], counters[2], pixels[0]])
}

/// Pixels of valid ones that differ by more than a step, and those of them that nothing explains.
fn differences(
    case: &Case<'_>,
    gbuffer: &GBuffer,
    params: WedgeParams,
    image: &VisibilityImage,
) -> (Vec<usize>, Vec<usize>) {
    let expected = shade_gbuffer(case.scene, &case.light, &case.camera, gbuffer, params).0;
    let valid = valid_pixels(gbuffer, &case.light);
    let off = |p: usize| (image.values[p] - expected.values[p]).abs();
    let differ: Vec<usize> = (0..valid.len()).filter(|&p| valid[p] && off(p) > STEP).collect();
    if differ.is_empty() {
        return (differ, Vec::new());
    }
    let size = case.scene.bounds().magnitude();
    let moved: Vec<VisibilityImage> = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z]
        .iter()
        .map(|&way| {
            let mut moved = gbuffer.clone();
            for (position, depth) in moved.position.iter_mut().zip(&gbuffer.depth) {
                *position += way * (8.0 * f32::EPSILON * (size + depth));
            }
            shade_gbuffer(case.scene, &case.light, &case.camera, &moved, params).0
        })
        .collect();
    let is_wrong = |&p: &usize| {
        let around = moved.iter().map(|image| image.values[p]).chain([expected.values[p]]);
        let (low, high) = around.fold((1.0_f32, 0.0_f32), |(low, high), v| (low.min(v), high.max(v)));
        !(low - STEP..=high + STEP).contains(&image.values[p])
    };
    let wrong = differ.iter().copied().filter(is_wrong).collect();
    (differ, wrong)
}

/// Edges found, faces that touch the light, pixels traced.
fn check(gpu: &Gpu, case: &Case<'_>, params: WedgeParams) -> [u32; 3] {
    let gbuffer = raster::render_gbuffer(case.scene, &case.camera);
    let (image, counts) = on_gpu(gpu, case, &gbuffer, params, 64 << 20);
    for pixel in 0..gbuffer.pixel_count() {
        assert_eq!(gbuffer.is_seen(pixel), (0.0..=1.0).contains(&image.values[pixel]), "pixel {pixel}");
    }
    let asked = valid_pixels(&gbuffer, &case.light).iter().filter(|&&valid| valid).count();
    let (differ, wrong) = differences(case, &gbuffer, params, &image);
    println!(
        "{} {} {:?}: {} of {asked} valid pixels differ, {} unexplained; {} edges, {} faces at the light, {} pixels traced",
        case.name,
        case.light.kind(),
        params.variant,
        differ.len(),
        wrong.len(),
        counts[0],
        counts[1],
        counts[2],
    );
    assert!(wrong.is_empty(), "{}, {:?}: pixel {:?}", case.name, params.variant, wrong.first());
    assert!(differ.len() * 1000 <= asked, "{}: {} of {asked} differ", case.name, differ.len());
    counts
}

const VARIANTS: [Variant; 3] = [Variant::Interpolated, Variant::Coverage, Variant::Exact];

#[test]
fn built_in_scenes() {
    let Some(gpu) = testing::gpu() else { return };
    for name in [
        "ball",
        "quads",
        "cornell",
        "cylinder",
        "log-cabin",
        "knot",
        "street",
        "edges",
        "layers",
        "park:leaves=300",
    ] {
        let setup = scenes::build(name, 0.0).unwrap();
        for variant in VARIANTS {
            let camera = setup.camera.with_size(96, 72);
            let case = Case { name, scene: &setup.scene, camera, light: setup.lights[0] };
            check(&gpu, &case, WedgeParams { variant, ..Default::default() });
        }
    }
}

/// All kinds of lights over one scene: those with an extent, with more and fewer samples than threads, and those without.
#[test]
fn lights_and_samples() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("log-cabin", 0.0).unwrap();
    let (scene, camera) = (&setup.scene, setup.camera.with_size(64, 48));
    let bounds = scene.bounds();
    let (size, center) = (bounds.size().max_element(), bounds.center());
    let place = center + Vec3::new(0.3, 0.6, 0.4) * size;
    let lights = [
        Light::Sphere { center: place, radius: 0.1 * size },
        Light::Disk { center: place, normal: Vec3::new(0.1, -1.0, 0.2), radius: 0.1 * size },
        Light::Rect { center: place, half_u: Vec3::X * 0.1 * size, half_v: Vec3::Z * 0.03 * size },
        Light::Directional { direction: Vec3::new(-0.3, -1.0, 0.2), angular_radius: 0.1 },
        Light::Point { position: place },
        Light::Spot { position: place, direction: center - place, outer: 0.3, inner: 0.2 },
    ];
    for light in lights {
        let case = Case { name: "log-cabin", scene, camera, light };
        for variant in VARIANTS {
            check(&gpu, &case, WedgeParams { variant, ..Default::default() });
        }
        for (views, rays) in [(7, true), (1000, false), (64, false)] {
            let counts = check(&gpu, &case, WedgeParams { views, rays, ..Default::default() });
            assert!(rays || counts[2] == 0, "nothing is traced where that is off");
        }
    }
}

/// Casters with masks, and a light that casters touch: all samples are traced.
#[test]
fn what_has_no_edges_is_traced() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("fence", 0.0).unwrap();
    let camera = setup.camera.with_size(64, 48);
    let case = Case { name: "fence", scene: &setup.scene, camera, light: setup.lights[0] };
    let [_, _, traced] = check(&gpu, &case, WedgeParams::default());
    let gbuffer = raster::render_gbuffer(case.scene, &case.camera);
    let asked = valid_pixels(&gbuffer, &case.light).iter().filter(|&&valid| valid).count();
    println!("fence: {traced} pixels traced, {asked} asked");
    // Those that a mask may hide the light from.
    assert!(traced > 0 && traced < asked as u32);
    let setup = scenes::build("log-cabin", 0.0).unwrap();
    let on_wall = setup.scene.corners(setup.scene.triangles().len() / 2)[0];
    let light = Light::Sphere { center: on_wall, radius: 0.1 };
    let case = Case { name: "log-cabin", scene: &setup.scene, camera: setup.camera.with_size(64, 48), light };
    let [_, touching, traced] = check(&gpu, &case, WedgeParams::default());
    assert!(touching > 0 && traced > 0);
}

/// Blocks and tiles without room for their edges take all there are.
#[test]
fn lists_without_room_change_no_pixel() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("log-cabin", 0.0).unwrap();
    let case = Case {
        name: "log-cabin",
        scene: &setup.scene,
        camera: setup.camera.with_size(40, 30),
        light: setup.lights[0],
    };
    let gbuffer = raster::render_gbuffer(case.scene, &case.camera);
    for variant in VARIANTS {
        let params = WedgeParams { variant, rays: false, ..Default::default() };
        let images = [64 << 20, 1 << 8, 0].map(|bytes| {
            let image = on_gpu(&gpu, &case, &gbuffer, params, bytes).0;
            image.bits()
        });
        assert!(images[0] == images[1] && images[0] == images[2], "{variant:?}");
    }
}

/// The comparison can fail: the shadows of another light differ, and no rounding explains it.
#[test]
fn a_planted_difference_is_found() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("ball", 0.0).unwrap();
    let camera = setup.camera.with_size(64, 48);
    let light = |x: f32| Light::Sphere { center: Vec3::new(x, 6.0, 1.0), radius: 0.5 };
    let case = |x: f32| Case { name: "ball", scene: &setup.scene, camera, light: light(x) };
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let params = WedgeParams::default();
    let (image, _) = on_gpu(&gpu, &case(-2.0), &gbuffer, params, 64 << 20);
    let found = differences(&case(2.0), &gbuffer, params, &image).1.len();
    assert!(found > 50, "{found}");
}

/// A device that binds so little that edges are gone through in pieces and the tree has larger leaves; and one that has no room for all
/// edges of the silhouette, where rays to the same samples answer.
#[test]
fn tables_beyond_what_is_bound_change_nothing() {
    let setup = scenes::build("knot", 0.0).unwrap();
    let camera = setup.camera.with_size(64, 48);
    let bounds = setup.scene.bounds();
    let center = bounds.center() + Vec3::new(0.3, 0.9, 0.2) * bounds.diagonal();
    let light = Light::Sphere { center, radius: 0.05 * bounds.diagonal() };
    let query = ShadowQuery { scene: &setup.scene, light: &light, camera: &camera };
    // Triangles, twelve bytes each, are just bound; an edge and a half a triangle take twice as much.
    let bytes = 13 * setup.scene.triangles().len() as u64;
    let technique = PenumbraWedges::new(WedgeParams::default());
    let images = |query: &ShadowQuery<'_>, bytes| conformance::whole_and_in_pieces(&technique, query, bytes);
    let Some([whole, in_pieces]) = images(&query, bytes) else { return };
    assert!(whole.values.iter().zip(&in_pieces.values).all(|(a, b)| a.to_bits() == b.to_bits()));

    // No edge has two faces: all are of the silhouette.
    let corner = |i: usize, root: f64| ((i as f64 * root).fract() as f32 - 0.5) * 4.0;
    let at = |i| Vec3::new(corner(i, 2f64.sqrt()), corner(i, 3f64.sqrt()), corner(i, 5f64.sqrt()));
    let corners: Vec<Vec3> =
        (0..400).flat_map(|i| [at(i), at(i) + at(i + 7) * 0.1, at(i) + at(i + 9) * 0.1]).collect();
    let triangles = (0..400).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mut scene = Scene::new();
    scene
        .add(&TriangleMesh::new("soup", corners, triangles), glam::Affine3A::IDENTITY, Default::default())
        .unwrap();
    let light = Light::Sphere { center: Vec3::Y * 6.0, radius: 0.5 };
    let query = ShadowQuery { scene: &scene, light: &light, camera: &camera.with_size(32, 24) };
    let Some([whole, in_pieces]) = images(&query, 24 << 10) else { return };
    let differ = whole.values.iter().zip(&in_pieces.values).filter(|(a, b)| (**a - **b).abs() > STEP);
    assert_eq!(differ.count(), 0);
}
