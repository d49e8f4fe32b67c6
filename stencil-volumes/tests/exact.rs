//! Shadow volumes against one exact shadow ray a pixel.

mod truth;

use glam::{Affine3A, Vec3};
use gnomon_stencil_volumes::{Casters, Count, StencilVolumes, VolumeParams, near_casters};
use proptest::prelude::*;
use scene_core::bvh::Bvh;
use scene_core::geometry::ObjectFlags;
use scene_core::{Camera, Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};
use truth::{compare, trace};

/// Pixels that differ away from a border may be as many as this: none. Returns those asked and in shadow.
fn check(scene: &Scene, camera: &Camera, light: &Light, what: &str) -> (usize, usize) {
    let casters = Casters::new(scene).expect("few triangles");
    let bvh = Bvh::casters(scene);
    let gbuffer = raster::render_gbuffer(scene, camera);
    let truth = trace(scene, &bvh, light, &gbuffer);
    let outside = near_casters(&casters, light, camera).is_empty();
    let mut asked = 0;
    for count in [Count::ZPass, Count::ZFail, Count::Auto] {
        if count == Count::ZPass && !outside {
            continue;
        }
        for (skip, rays) in [(true, true), (true, false), (false, false)] {
            let technique = StencilVolumes::new(VolumeParams { count, skip, rays, ..Default::default() });
            let (prepared, _) = technique.prepare(&casters, light, camera);
            let mut visibility = VisibilityImage::new(camera.width, camera.height);
            prepared.shade(&gbuffer, &mut visibility);
            let result = compare(scene, &bvh, light, camera, &gbuffer, &truth, &visibility);
            assert_eq!(
                result.wrong.len(),
                0,
                "{what}, {light:?}, {count:?}, skip {skip}, rays {rays}: {} differ of {}, {} at a border; first {:?}",
                result.differ,
                result.asked,
                result.at_border,
                result.wrong.first()
            );
            asked = result.asked;
        }
    }
    (asked, truth.iter().filter(|&&v| v == 0.0).count())
}

fn lights(center: Vec3, size: f32) -> [Light; 3] {
    [
        Light::Point { position: center + Vec3::new(0.4, 1.3, 0.3) * size },
        Light::Directional { direction: Vec3::new(-0.4, -1.0, 0.2), angular_radius: 0.0 },
        Light::Spot {
            position: center + Vec3::new(-0.7, 1.1, 0.4) * size,
            direction: Vec3::new(0.7, -1.1, -0.4),
            outer: 0.6,
            inner: 0.3,
        },
    ]
}

#[test]
fn built_in_scenes() {
    for spec in ["quads", "ball", "cornell", "cylinder", "log-cabin", "chess", "knot"] {
        let setup = scenes::build(spec, 0.0).expect("a built-in scene");
        let camera = setup.camera.with_size(160, 120);
        let (center, size) = (setup.scene.bounds().center(), setup.scene.bounds().size().max_element() * 0.5);
        let own = setup.lights[0];
        for light in lights(center, size.min(4.0)).into_iter().chain([own]) {
            let (asked, dark) = check(&setup.scene, &camera, &light, spec);
            assert!(asked > 1000 && dark > 0, "{spec}: {asked} asked, {dark} dark");
        }
    }
}

/// A bumpy torus in one mesh of `count` by 20 quads.
fn torus(count: u32) -> TriangleMesh {
    let point = |i: u32, j: u32| {
        let (u, v) = ((i % count) as f32 / count as f32, (j % 20) as f32 / 20.0);
        let (su, cu) = (u * std::f32::consts::TAU).sin_cos();
        let (sv, cv) = (v * std::f32::consts::TAU).sin_cos();
        let r = 0.35 + 0.05 * (7.0 * u * std::f32::consts::TAU).sin();
        Vec3::new((1.0 + r * cv) * cu, r * sv + 0.6, (1.0 + r * cv) * su)
    };
    let positions = (0..count * 20).map(|k| point(k / 20, k % 20)).collect();
    let index = |i: u32, j: u32| i % count * 20 + j % 20;
    let quads = (0..count).flat_map(|i| (0..20).map(move |j| (i, j)));
    let triangles = quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    TriangleMesh::new("torus", positions, triangles)
}

fn ground(half: f32) -> TriangleMesh {
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
    let positions = corners.map(|(x, z)| Vec3::new(x * half, 0.0, z * half)).to_vec();
    TriangleMesh::new("ground", positions, vec![[0, 1, 2], [0, 2, 3]])
}

fn scene_of(meshes: &[&TriangleMesh], scale: f32, offset: Vec3) -> Scene {
    let mut scene = Scene::new();
    for mesh in meshes {
        let place = Affine3A::from_translation(offset) * Affine3A::from_scale(Vec3::splat(scale));
        scene.add(mesh, place, ObjectFlags::default()).expect("a sound mesh");
    }
    scene
}

fn camera(eye: Vec3, target: Vec3) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_y: 0.8, near: 0.01, far: f32::INFINITY, width: 160, height: 120 }
}

#[test]
fn holes_flips_and_duplicates() {
    let whole = torus(40);
    let holes = |t: &TriangleMesh| {
        let kept = t.triangles.iter().enumerate().filter(|(i, _)| i % 10 != 3).map(|(_, t)| *t);
        TriangleMesh { triangles: kept.collect(), ..t.clone() }
    };
    let mut flipped = whole.clone();
    flipped.triangles.iter_mut().step_by(3).for_each(|t| t.swap(1, 2));
    let mut doubled = whole.clone();
    doubled.triangles.extend(whole.triangles.iter().step_by(4));
    for (what, mesh) in [("holes", holes(&whole)), ("flipped", flipped), ("doubled", doubled)] {
        let scene = scene_of(&[&ground(6.0), &mesh], 1.0, Vec3::ZERO);
        for light in lights(Vec3::ZERO, 3.0) {
            let (_, dark) = check(&scene, &camera(Vec3::new(0.5, 3.0, 4.0), Vec3::Y * 0.3), &light, what);
            assert!(dark > 500, "{what}: {dark}");
        }
    }
}

#[test]
fn scales_and_places() {
    for scale in [1e-3, 1.0, 1e3, 1e6] {
        let scene = scene_of(&[&ground(6.0), &torus(40)], scale, Vec3::ZERO);
        let view = camera(Vec3::new(0.5, 3.0, 4.0) * scale, Vec3::Y * 0.3 * scale);
        let view = Camera { near: 0.01 * scale, ..view };
        for light in lights(Vec3::ZERO, 3.0 * scale) {
            check(&scene, &view, &light, &format!("scale {scale}"));
        }
    }
    // Up to where rounding moves what is seen by more than a pixel.
    for far in [1.0, 50.0] {
        let offset = Vec3::new(2000.0, 300.0, -1000.0) * far;
        let scene = scene_of(&[&ground(6.0), &torus(40)], 1.0, offset);
        let view = camera(Vec3::new(0.5, 3.0, 4.0) + offset, Vec3::Y * 0.3 + offset);
        for light in lights(offset, 3.0) {
            check(&scene, &view, &light, "far from the origin");
        }
    }
}

#[test]
fn eye_in_volumes_and_light_among_the_casters() {
    let mesh = torus(40);
    let scene = scene_of(&[&ground(6.0), &mesh], 1.0, Vec3::ZERO);
    // Under the ring, in its shadow; inside the body; and with the near plane through it.
    let eyes = [Vec3::new(1.0, 0.1, 0.0), Vec3::new(1.0, 0.6, 0.05), Vec3::new(1.0, 0.95, 0.6)];
    let positions = &mesh.positions;
    let on_face = (positions[0] + positions[20] + positions[21]) / 3.0;
    let places = [
        Vec3::new(0.0, 3.0, 0.0),
        Vec3::new(0.0, 0.6, 0.0),
        positions[45],
        on_face,
        Vec3::new(1.0, 0.6, 0.1),
    ];
    for eye in eyes {
        for near in [0.01, 0.4] {
            let view = Camera { near, ..camera(eye, Vec3::new(0.0, 0.3, -0.4)) };
            for position in places {
                check(
                    &scene,
                    &view,
                    &Light::Point { position },
                    &format!("eye {eye}, near {near}, light {position}"),
                );
            }
        }
    }
    // In the plane of the ground.
    let light = Light::Point { position: Vec3::new(9.0, 0.0, 0.0) };
    check(&scene, &camera(Vec3::new(0.5, 3.0, 4.0), Vec3::ZERO), &light, "light in the ground's plane");
}

proptest! {
    // The same soups every time.
    #![proptest_config(ProptestConfig {
        cases: 1000,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(2),
        ..Default::default()
    })]

    /// Soups on a coarse grid: shared vertices and edges, coplanar and degenerate faces, needles.
    #[test]
    fn random_soups(
        corners in prop::collection::vec(prop::array::uniform3(0_i32..9), 9..90),
        needles in prop::collection::vec(prop::array::uniform9(-1.0_f32..1.0), 0..6),
        light in prop::array::uniform3(-1.5_f32..1.5),
        eye in prop::array::uniform3(-2.0_f32..2.0),
        parallel in any::<bool>(),
    ) {
        let grid = |c: &[i32; 3]| Vec3::from_array(c.map(|x| x as f32 / 4.0 - 1.0));
        let mut positions: Vec<Vec3> = corners.iter().map(grid).collect();
        positions.truncate(positions.len() / 3 * 3);
        for n in &needles {
            let a = Vec3::new(n[0], n[1], n[2]);
            positions.extend([a, a + Vec3::new(n[3], n[4], n[5]) * 1e-3, Vec3::new(n[6], n[7], n[8])]);
        }
        let count = positions.len() as u32 / 3;
        let triangles = (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let scene = scene_of(&[&TriangleMesh::new("soup", positions, triangles)], 1.0, Vec3::ZERO);
        let light = Vec3::from_array(light);
        prop_assume!(light.length() > 0.05 && Vec3::from_array(eye).with_y(0.0).length() > 0.05);
        let light = if parallel {
            Light::Directional { direction: -light, angular_radius: 0.0 }
        } else {
            Light::Point { position: light }
        };
        let view = Camera { width: 64, height: 64, ..camera(Vec3::from_array(eye), Vec3::splat(0.013)) };
        check(&scene, &view, &light, "soup");
    }
}
