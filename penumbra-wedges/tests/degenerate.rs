//! Input at the edge of what has a meaning: an answer in [0, 1], never a panic.

mod truth;

use glam::{Affine3A, Vec2, Vec3};
use gnomon_penumbra_wedges::cpu::Answer;
use gnomon_penumbra_wedges::exact::Work;
use gnomon_penumbra_wedges::receiver::{Asked, Receiver};
use gnomon_penumbra_wedges::{Casters, Factory, PenumbraWedges, Variant, WedgeParams};
use scene_core::geometry::{AlphaMask, ObjectFlags, Wrap};
use scene_core::technique::conformance::{self, CAMERA};
use scene_core::technique::{ShadowQuery, TechniqueError, TechniqueFactory};
use scene_core::{Camera, Light, Scene, TriangleMesh, VisibilityImage, raster};
use truth::{cube, scene_of, sheet};

const VARIANTS: [Variant; 3] = [Variant::Interpolated, Variant::Coverage, Variant::Exact];

/// Lights of every kind; the middle ones stand on or in the geometry.
const LIGHTS: [Light; 9] = [
    Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.3 },
    Light::Directional { direction: Vec3::NEG_Y, angular_radius: std::f32::consts::FRAC_PI_2 },
    Light::Sphere { center: Vec3::new(0.0, 3.0, 0.0), radius: 0.5 },
    Light::Sphere { center: Vec3::ZERO, radius: 0.5 },
    Light::Rect { center: Vec3::ZERO, half_u: Vec3::X, half_v: Vec3::Z },
    Light::Rect { center: Vec3::new(0.0, 0.5, 0.0), half_u: Vec3::X, half_v: Vec3::Y },
    Light::Disk { center: Vec3::new(0.2, 0.0, 0.2), normal: Vec3::new(1.0, 1.0, 0.0), radius: 0.4 },
    Light::Point { position: Vec3::ZERO },
    Light::Spot { position: Vec3::Y, direction: Vec3::NEG_Y, outer: 1.57, inner: 0.1 },
];

fn of(variant: Variant) -> PenumbraWedges {
    PenumbraWedges::new(WedgeParams { variant, views: 32, rays: false, ..Default::default() })
}

/// All variants' images: a number in [0, 1] wherever a surface is seen.
fn check(scene: &Scene, light: &Light, camera: &Camera, what: &str) {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let casters = Casters::new(scene).expect("edges");
    for variant in VARIANTS {
        let (prepared, _) = of(variant).prepare(&casters, light, camera).expect("no masks");
        let mut visibility = VisibilityImage::new(camera.width, camera.height);
        prepared.shade(&gbuffer, &mut visibility);
        for (pixel, &v) in visibility.values.iter().enumerate() {
            assert_eq!(
                gbuffer.is_seen(pixel),
                (0.0..=1.0).contains(&v),
                "{what}, {variant:?}, {light:?}: pixel {pixel} is {v}"
            );
        }
    }
}

#[test]
fn every_scene_and_light_is_answered() {
    for variant in VARIANTS {
        conformance::assert_answers(&of(variant));
    }
}

#[test]
fn buffers_of_the_wrong_size_are_refused() {
    for variant in VARIANTS {
        conformance::assert_refuses_wrong_sizes(&of(variant));
    }
}

/// Lights that touch or hold geometry, edges through them and that point at them, needles; all at a scale.
fn stress_list(scale: f32) -> (Scene, Camera, [Light; 9]) {
    let needle =
        |a: Vec3, b: Vec3| TriangleMesh::new("needle", vec![a, b, b + Vec3::X * 1e-5], vec![[0, 1, 2]]);
    let mut scene = Scene::new();
    for mesh in [
        sheet(0.0, [-3.0, -3.0], [3.0, 3.0]),
        cube(Vec3::new(0.0, 0.5, 0.0), 0.5),
        needle(Vec3::new(0.0, 3.0, 0.0), Vec3::new(0.0, 0.2, 1.0)),
        needle(Vec3::new(-3.0, 0.5, -3.0), Vec3::new(3.0, 0.5, 3.0)),
        // An edge along the line through the lights' middles.
        needle(Vec3::new(0.0, 1.5, 0.0), Vec3::new(0.0, 2.0, 0.0)),
    ] {
        scene.add(&mesh, Affine3A::from_scale(Vec3::splat(scale)), ObjectFlags::default()).expect("finite");
    }
    let camera = Camera { eye: CAMERA.eye * scale, near: 0.01 * scale, far: 100.0 * scale, ..CAMERA };
    let lights = LIGHTS.map(|light| match light {
        Light::Sphere { center, radius } => Light::Sphere { center: center * scale, radius: radius * scale },
        Light::Rect { center, half_u, half_v } => {
            Light::Rect { center: center * scale, half_u: half_u * scale, half_v: half_v * scale }
        }
        Light::Disk { center, normal, radius } => {
            Light::Disk { center: center * scale, normal, radius: radius * scale }
        }
        Light::Point { position } => Light::Point { position: position * scale },
        Light::Spot { position, direction, outer, inner } => {
            Light::Spot { position: position * scale, direction, outer, inner }
        }
        Light::Directional { .. } => light,
    });
    (scene, camera, lights)
}

const SCALES: [f32; 4] = [1e-3, 1.0, 1e3, 1e6];

#[test]
fn hard_geometry_is_answered_at_all_scales() {
    for scale in SCALES {
        let (scene, camera, lights) = stress_list(scale);
        for light in lights {
            check(&scene, &light, &camera, &format!("scale {scale}"));
        }
    }
}

/// The same on the GPU, one value a variant for all of them.
#[cfg(feature = "gpu")]
#[test]
fn the_gpu_answers_as_well() {
    use gnomon_penumbra_wedges::PenumbraWedgesOnGpu;
    use scene_core::gpu::headless::VISIBILITY_FORMAT;
    use scene_core::gpu::testing;

    let Some(gpu) = testing::gpu() else { return };
    let cases =
        conformance::scenes().into_iter().map(|scene| (scene, CAMERA, LIGHTS)).chain(SCALES.map(stress_list));
    let mut on_gpu = VARIANTS.map(|variant| {
        let params = WedgeParams { variant, views: 32, rays: false, ..Default::default() };
        PenumbraWedgesOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT)
    });
    for (scene, camera, lights) in cases {
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        let mut view = gpu.view(&scene, &camera).expect("small");
        view.upload_gbuffer(&gbuffer).expect("of its size");
        for light in &lights {
            for technique in &mut on_gpu {
                let image = view.run(technique, light, &gbuffer).expect("supported").visibility;
                for (pixel, &v) in image.values.iter().enumerate() {
                    assert_eq!(
                        gbuffer.is_seen(pixel),
                        (0.0..=1.0).contains(&v),
                        "{light:?}: pixel {pixel} is {v}"
                    );
                }
            }
        }
    }
}

/// Around a single convex caster the sum over edges is a share of the light before any clamp: no wedge is turned inside out.
#[test]
fn unclamped_sums_are_shares() {
    let floor = sheet(0.0, [-4.0, -4.0], [4.0, 4.0]);
    let ball = scene_core::scenes::build("ball", 0.0).expect("built in").scene;
    let ball_object = ball.objects().iter().max_by_key(|o| o.triangles.len()).expect("a ball");
    let base = ball_object.vertices.start as u32;
    let triangles =
        ball.triangles()[ball_object.triangles.clone()].iter().map(|t| t.map(|i| i - base)).collect();
    let positions = ball.positions()[ball_object.vertices.clone()].iter().map(|p| *p + Vec3::Y).collect();
    let ball = TriangleMesh::new("ball", positions, triangles);
    let camera = Camera { eye: Vec3::new(1.5, 4.0, 6.0), width: 96, height: 72, ..CAMERA };
    for caster in [cube(Vec3::new(0.0, 1.0, 0.0), 0.5), ball] {
        let scene = scene_of(&[floor.clone(), caster]);
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        let casters = Casters::new(&scene).expect("edges");
        for light in [
            Light::Sphere { center: Vec3::new(-1.0, 6.0, 1.0), radius: 0.8 },
            Light::Rect { center: Vec3::new(-1.0, 6.0, 1.0), half_u: Vec3::X * 0.9, half_v: Vec3::Z * 0.4 },
            Light::Disk { center: Vec3::new(-1.0, 6.0, 1.0), normal: Vec3::Y, radius: 0.8 },
            Light::Directional { direction: Vec3::new(0.2, -1.0, -0.1), angular_radius: 0.12 },
        ] {
            let params = WedgeParams { variant: Variant::Coverage, ..Default::default() };
            let (prepared, _) =
                PenumbraWedges::new(params).prepare(&casters, &light, &camera).expect("no masks");
            let Some(Answer::Coverage(coverage)) = prepared.answer() else {
                panic!("coverage was asked for")
            };
            let edges: Vec<u32> = (0..coverage.all.wedges.wedges.len() as u32).collect();
            let (mut work, mut asked) = (Work::default(), 0);
            for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.object[pixel] == 0) {
                let known = Receiver::at(
                    &scene,
                    &gbuffer,
                    &coverage.all.wedges.light,
                    scene.bounds().magnitude(),
                    pixel,
                );
                let Asked::Yes(receiver) = known else { continue };
                let v =
                    coverage.unclamped(&receiver, &edges, &mut work).expect("the floor is below the light");
                // A sum of a few hundred terms of f64, each below 1.
                assert!((-1e-9..=1.0 + 1e-9).contains(&v), "{light:?}: {v} at {}", receiver.origin);
                asked += 1;
            }
            assert!(asked > 1000 && work.penumbra > 50, "{asked} {work:?}");
        }
    }
}

#[test]
fn free_points_are_answered_and_those_that_are_not_finite_stay_unknown() {
    let scene = scene_of(&[sheet(0.0, [-1.0, -9.0], [9.0, 9.0])]);
    let casters = Casters::new(&scene).expect("edges");
    // Under the sheet, above it, and under its border on the plane through the border and the light's middle.
    let border = Vec3::new(-2.0, -3.0, 0.0);
    let points = [Vec3::NAN, Vec3::splat(f32::INFINITY), Vec3::NEG_Y * 0.1, Vec3::Y, border];
    for variant in VARIANTS {
        let technique = PenumbraWedges::new(WedgeParams { variant, views: 1024, ..Default::default() });
        let (prepared, _) = technique.prepare(&casters, &LIGHTS[2], &CAMERA).expect("no masks");
        let mut values = [7.0; 5];
        prepared.visibility_at(&points, &mut values);
        assert!(values[0].is_nan() && values[1].is_nan());
        assert_eq!(values[2..4], [0.0, 1.0], "{variant:?}");
        assert!((values[4] - 0.5).abs() < 0.01, "{variant:?}: {values:?}");
        // A light without extent: one ray.
        let (prepared, _) = technique.prepare(&casters, &LIGHTS[8], &CAMERA).expect("no masks");
        prepared.visibility_at(&points, &mut values);
        assert_eq!(values[2], 0.0, "{variant:?}");
    }
}

#[test]
fn masked_casters_are_refused() {
    let mut mesh = TriangleMesh::new("leaf", vec![Vec3::ZERO, Vec3::X, Vec3::Z], vec![[0, 1, 2]]);
    mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::Y];
    mesh.alpha = AlphaMask::from_alpha(2, 1, &[0, 255], 0.5, [Wrap::Repeat; 2]).map(Into::into);
    let masked = scene_of(&[mesh]);
    let query = ShadowQuery { scene: &masked, light: &LIGHTS[2], camera: &CAMERA };
    for (preset, is_taken) in [("coverage", false), ("interpolated", false), ("exact-64", true)] {
        let technique = Factory.create(Some(preset), &[]).expect("a preset");
        let refused = matches!(technique.prepare(&query), Err(TechniqueError::Unsupported { .. }));
        assert_eq!(refused, !is_taken, "{preset}");
    }
}

/// Vertices are read from the second piece that they are bound in as from the first.
#[cfg(feature = "gpu")]
#[test]
fn scenes_bound_in_two_pieces_look_the_same() {
    for variant in VARIANTS {
        let params = WedgeParams { variant, ..Default::default() };
        conformance::assert_same_in_two_pieces(&PenumbraWedges::new(params));
    }
}
