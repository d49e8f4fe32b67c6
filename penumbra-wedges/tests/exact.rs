//! `exact` against shadow rays to the very same samples.

use glam::{Affine3A, Vec3};
use gnomon_penumbra_wedges::cpu::Answer;
use gnomon_penumbra_wedges::exact::Scratch;
use gnomon_penumbra_wedges::receiver::{Asked, Receiver};
use gnomon_penumbra_wedges::{Casters, PenumbraWedges, Variant, WedgeParams};
use proptest::prelude::*;
use scene_core::geometry::ObjectFlags;
use scene_core::light::LightPoint;
use scene_core::{Camera, Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};

/// How far a sample may be from an edge to be a tie, as a share of the light's size: samples, their places on the plane and
/// the rays to them are rounded to f32, at coordinates of `magnitude`.
fn tie(magnitude: f32, size: f32) -> f32 {
    4.0 * f32::EPSILON * (1.0 + magnitude / size)
}

/// The number of samples that a step to one of four sides turns from seen to hidden or back: those at an edge.
fn ties(answer: &Answer<'_>, receiver: &Receiver, tie: f32) -> usize {
    let exact = answer.as_exact();
    let mut points = Vec::new();
    exact.sample_points(receiver, &mut points);
    let is_tie = |point: &LightPoint| {
        let (way, _) = point.ray_from(receiver.origin);
        let (x, y) = way.normalize().any_orthonormal_pair();
        let step = |d: Vec3| match *point {
            LightPoint::At(p) => LightPoint::At(p + d * tie),
            LightPoint::Towards(t) => LightPoint::Towards(t + d * tie),
        };
        let mut seen = [x, -x, y, -y, x + y, x - y, y - x, -x - y]
            .map(|d| receiver.is_above(step(d)) && !exact.tree.is_occluded(receiver.origin, step(d)));
        seen.sort_unstable();
        seen[0] != seen[7]
    };
    points.iter().filter(|point| is_tie(point)).count()
}

/// Compares every pixel; returns how many are in penumbra, and how many samples of all differed (as ties).
fn check(scene: &Scene, camera: &Camera, light: &Light, what: &str) -> (usize, usize) {
    let casters = Casters::new(scene).expect("edges");
    let gbuffer = raster::render_gbuffer(scene, camera);
    let params = WedgeParams { views: 64, rays: false, ..Default::default() };
    let (prepared, _) =
        PenumbraWedges::new(params).prepare(&casters, light, camera).expect("exact takes all");
    let mut visibility = VisibilityImage::new(camera.width, camera.height);
    prepared.shade(&gbuffer, &mut visibility);
    let answer = prepared.answer().expect("an extended light");
    let area = prepared.wedges().expect("an extended light").light;
    let size = Vec3::AXES.map(|axis| area.reach(axis.as_dvec3()) as f32).into_iter().fold(0.0, f32::max);
    let (mut scratch, mut penumbra, mut differ) = (Scratch::default(), 0, 0);
    let magnitude = scene.bounds().magnitude();
    for (pixel, &v) in visibility.values.iter().enumerate() {
        let Asked::Yes(receiver) = Receiver::at(scene, &gbuffer, &area, magnitude, pixel) else { continue };
        let expected = answer.as_exact().traced(&receiver, &mut scratch);
        assert!((0.0..=1.0).contains(&v), "{what}: {v}");
        penumbra += usize::from(expected > 0.0 && expected < 1.0);
        if v != expected {
            let off = ((v - expected).abs() * 64.0).round() as usize;
            let ties = ties(&answer, &receiver, tie(magnitude, size) * size);
            assert!(
                off <= ties,
                "{what}: pixel {pixel} at {}: {v} instead of {expected}, {ties} ties",
                receiver.origin
            );
            differ += off;
        }
    }
    (penumbra, differ)
}

#[test]
fn built_in_scenes() {
    for spec in scenes::all().iter().map(|scene| scene.name) {
        // Penumbrae of chess are narrow, edges of park many.
        let (width, height) = match spec {
            "chess" => (200, 150),
            "park" => (40, 30),
            _ => (80, 60),
        };
        let spec = if spec == "forest" { "forest:triangles=60000" } else { spec };
        let setup = scenes::build(spec, 0.0).expect("a built-in scene");
        let camera = setup.camera.with_size(width, height);
        // The lamp of chess has no extent: a ball around it has.
        let radius = 0.01 * setup.scene.bounds().magnitude();
        let light = match setup.lights[0] {
            Light::Spot { position: center, .. } => Light::Sphere { center, radius },
            extended => extended,
        };
        let (penumbra, differ) = check(&setup.scene, &camera, &light, spec);
        println!("{spec}: {penumbra} pixels in penumbra, {differ} samples differ");
        assert!(penumbra > 20, "{spec}: {penumbra}");
        // A sample is as close as a tie to an edge with a chance of some 10⁻⁵ an edge.
        assert!(differ <= 1 + penumbra * 64 / 1000, "{spec}: {differ} of {penumbra}");
    }
}

fn lights(center: Vec3, size: f32) -> [Light; 4] {
    let at = center + Vec3::new(0.4, 1.3, 0.3) * size;
    [
        Light::Rect {
            center: at,
            half_u: Vec3::new(0.3, 0.1, 0.0) * size,
            half_v: Vec3::new(0.0, 0.05, 0.2) * size,
        },
        Light::Disk { center: at, normal: Vec3::new(0.2, 1.0, 0.1), radius: 0.3 * size },
        Light::Sphere { center: at, radius: 0.3 * size },
        Light::Directional { direction: Vec3::new(-0.4, -1.0, 0.2), angular_radius: 0.2 },
    ]
}

fn camera(eye: Vec3, target: Vec3) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_y: 0.8, near: 0.01, far: f32::INFINITY, width: 48, height: 48 }
}

fn soup(corners: &[[i32; 3]], needles: &[[f32; 9]], scale: f32, offset: Vec3) -> Scene {
    let mut positions: Vec<Vec3> =
        corners.iter().map(|c| Vec3::from_array(c.map(|x| x as f32 / 4.0 - 1.0))).collect();
    positions.truncate(positions.len() / 3 * 3);
    for n in needles {
        let a = Vec3::new(n[0], n[1], n[2]);
        positions.extend([a, a + Vec3::new(n[3], n[4], n[5]) * 1e-3, Vec3::new(n[6], n[7], n[8])]);
    }
    let count = positions.len() as u32 / 3;
    let triangles = (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let mut scene = Scene::new();
    let place = Affine3A::from_translation(offset) * Affine3A::from_scale(Vec3::splat(scale));
    let mesh = TriangleMesh::new("soup", positions, triangles);
    scene.add(&mesh, place, ObjectFlags::default()).expect("finite");
    scene
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 60,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(2),
        ..Default::default()
    })]

    /// Soups on a coarse grid around the light and away from it: shared and crossing edges, coplanar, degenerate and
    /// doubled faces, needles, faces through the light, at several scales and places.
    #[test]
    fn random_soups(
        corners in prop::collection::vec(prop::array::uniform3(0_i32..9), 9..90),
        needles in prop::collection::vec(prop::array::uniform9(-1.0_f32..1.0), 0..6),
        place in prop::array::uniform3(-0.8_f32..0.8),
        eye in prop::array::uniform3(-2.0_f32..2.0),
        (kind, is_near, scale) in (0_usize..4, any::<bool>(), prop::sample::select(vec![1e-3_f32, 1.0, 1e3])),
    ) {
        prop_assume!(Vec3::from_array(eye).with_y(0.0).length() > 0.05);
        let scene = soup(&corners, &needles, scale, Vec3::ZERO);
        // Near: among the faces. Far: above them.
        let center = if is_near { Vec3::from_array(place) * scale } else { Vec3::from_array(place) * scale + Vec3::Y * scale };
        let light = lights(center - Vec3::new(0.4, 1.3, 0.3) * scale * if is_near { 1.0 } else { 0.0 }, scale)[kind];
        let view = Camera { near: 0.01 * scale, ..camera(Vec3::from_array(eye) * scale, Vec3::splat(0.013 * scale)) };
        check(&scene, &view, &light, "soup");
    }
}

#[test]
fn holes_flips_and_places() {
    let setup = scenes::build("ball", 0.0).expect("built in");
    let ball = setup.scene.objects().iter().max_by_key(|o| o.triangles.len()).expect("a ball");
    let base = ball.vertices.start as u32;
    let triangles: Vec<[u32; 3]> =
        setup.scene.triangles()[ball.triangles.clone()].iter().map(|t| t.map(|i| i - base)).collect();
    let positions = setup.scene.positions()[ball.vertices.clone()].to_vec();
    let whole = TriangleMesh::new("ball", positions, triangles);
    let mut flipped = whole.clone();
    flipped.triangles.iter_mut().step_by(3).for_each(|t| t.swap(1, 2));
    let mut holes = whole.clone();
    holes.triangles =
        whole.triangles.iter().enumerate().filter(|(i, _)| i % 10 != 3).map(|(_, t)| *t).collect();
    let mut doubled = whole.clone();
    doubled.triangles.extend(whole.triangles.iter().step_by(4));
    let corner = [(-6.0, -6.0), (-6.0, 6.0), (6.0, 6.0), (6.0, -6.0)].map(|(x, z)| Vec3::new(x, -1.5, z));
    let ground = TriangleMesh::new("ground", corner.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    for (what, mesh) in [("flipped", flipped), ("holes", holes), ("doubled", doubled)] {
        for offset in [Vec3::ZERO, Vec3::new(900.0, 0.0, -400.0)] {
            let mut scene = Scene::new();
            for mesh in [&ground, &mesh] {
                scene.add(mesh, Affine3A::from_translation(offset), ObjectFlags::default()).expect("finite");
            }
            for light in lights(offset, 4.0) {
                let view = camera(Vec3::new(0.5, 4.0, 5.0) + offset, offset);
                let (penumbra, _) = check(&scene, &view, &light, what);
                assert!(penumbra > 50, "{what}: {penumbra}");
            }
        }
    }
}

#[test]
fn masked_casters_are_traced() {
    let setup = scenes::build("fence", 0.0).expect("built in");
    let camera = setup.camera.with_size(64, 48);
    let (penumbra, _) = check(&setup.scene, &camera, &setup.lights[0], "fence");
    assert!(penumbra > 20, "{penumbra}");
    let casters = Casters::new(&setup.scene).expect("edges");
    for variant in [Variant::Coverage, Variant::Interpolated] {
        let technique = PenumbraWedges::new(WedgeParams { variant, ..Default::default() });
        let prepared = technique.prepare(&casters, &setup.lights[0], &camera);
        assert_eq!(prepared.is_err(), casters.masked().is_some());
    }
}
