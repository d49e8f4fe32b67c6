//! V before any clamp. The sum of `coverage` is one over faces: at an edge that two share their parts cancel. What a face adds is the
//! share of the light behind it, in [0, 1], as long as no plane of a face cuts the light. No wedge is turned inside out, then, if that
//! holds for every face alone; here for faces of all built-in scenes, needles and leaves among them, and of a soup at all scales, before
//! round and square lights, from places in and around their shadows.

mod truth;

use glam::{DVec3, Vec3};
use gnomon_penumbra_wedges::area_light::AreaLight;
use gnomon_penumbra_wedges::cpu::Answer;
use gnomon_penumbra_wedges::edges::{FaceSide, side_of};
use gnomon_penumbra_wedges::exact::Work;
use gnomon_penumbra_wedges::receiver::Receiver;
use gnomon_penumbra_wedges::{Casters, PenumbraWedges, Variant, WedgeParams};
use scene_core::light::LightPoint;
use scene_core::light::sampling::{LightView, SampleKey, Strata};
use scene_core::{Light, Scene, TriangleMesh, scenes};
use truth::scene_of;

/// Faces of a scene that are looked at, spread evenly over its triangles.
const FACES: usize = 150;

/// Points of the light that places are in line with, for each face.
const POINTS: usize = 16;

/// What was asked.
#[derive(Debug, Default)]
struct Asked {
    faces: usize,
    places: usize,
    /// Places that see part of the light.
    penumbra: usize,
}

/// Lights where a scene has its own: its own, and a round and a flat one of its extent.
fn lights(own: &Light) -> Vec<Light> {
    let Some(area) = AreaLight::new(own) else { return Vec::new() };
    let extents = DVec3::from_array(DVec3::AXES.map(|axis| area.reach(axis))).as_vec3();
    let LightPoint::At(center) = area.center() else { return vec![*own] };
    let radius = extents.max_element();
    vec![
        *own,
        Light::Sphere { center, radius },
        Light::Rect { center, half_u: Vec3::X * radius, half_v: Vec3::new(0.0, 0.3, 0.5) * radius },
    ]
}

/// What rounding may do to the share behind a face. Ways from the receiver to its corners are rounded once, by 2⁻²⁴ of their length in each
/// coordinate, which moves a corner on the plane, where the light is 2 across, by `moved`. With the corners a polygon's border moves, within
/// the square, by no more than that over a length of at most 2·√2 an edge; the light's area is π or more, and the solid angle's weight at most
/// twice the mean for the lights here. So 2·(2·√2 / π)·moved < 2·moved for each of three edges; sums of f64 are nothing beside it.
fn rounding(area: &AreaLight, corners: [Vec3; 3], place: Vec3) -> Option<f64> {
    let frame = area.frame(place.as_dvec3())?;
    let moved = |corner: Vec3| {
        let way = corner - place;
        let rounded = way.as_dvec3().length() * f64::from(f32::EPSILON) * 0.5;
        let [x, y, z] = Vec3::AXES.map(|axis| frame.project(axis).abs());
        let sum = (x + y + z) * rounded;
        let at = frame.project(way);
        let least = at.z - sum.z;
        // U / W, of the part inside the square.
        if least > 0.0 { (sum.x.max(sum.y) + sum.z) / least } else { f64::INFINITY }
    };
    let moved = corners.map(moved).into_iter().fold(0.0, f64::max);
    Some(3.0 * 2.0 * moved)
}

fn check_face(corners: [Vec3; 3], light: &Light, what: &str, asked: &mut Asked) {
    let Some(area) = AreaLight::new(light) else { return };
    if side_of(&area, corners) == FaceSide::Variable {
        return;
    }
    let scene = scene_of(&[TriangleMesh::new("face", corners.to_vec(), vec![[0, 1, 2]])]);
    if scene.triangles().is_empty() {
        return;
    }
    let casters = Casters::new(&scene).expect("one face");
    let params = WedgeParams { variant: Variant::Coverage, skip: false, ..Default::default() };
    let view = truth::camera(Vec3::ONE, Vec3::ZERO, 1, 1);
    let (prepared, _) = PenumbraWedges::new(params).prepare(&casters, light, &view).expect("no masks");
    let Some(Answer::Coverage(coverage)) = prepared.answer() else { panic!("coverage was asked for") };
    let edges: Vec<u32> = (0..coverage.all.wedges.wedges.len() as u32).collect();
    let seen = LightView::new(light, corners[0]);
    let mut points = [area.center(); POINTS];
    Strata::new(POINTS as u32, seen.aspect()).fill(&seen, SampleKey::new(0, asked.faces as u64), &mut points);
    let size = scene.bounds().diagonal();
    let mut work = Work::default();
    for (i, point) in points.iter().enumerate() {
        // Corners, edges, the middle, and beside the face.
        let [u, v] = [[0.0, 0.0], [0.5, 0.0], [0.3, 0.3], [0.9, 0.4]][i % 4];
        let on = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
        let (way, far) = match *point {
            LightPoint::At(p) => (p - on, 1.0),
            LightPoint::Towards(d) => (d, size),
        };
        for behind in [0.01, 0.3, 2.0] {
            let place = on - way * (far * behind);
            let Some(rounding) = rounding(&area, corners, place) else { continue };
            // A corner behind the receiver is clipped where rounding has no bound.
            if rounding >= 0.1 {
                continue;
            }
            let receiver = Receiver::free(place, 0);
            let Some(v) = coverage.unclamped(&receiver, &edges, &mut work) else { continue };
            asked.places += 1;
            asked.penumbra += usize::from(v > rounding && v < 1.0 - rounding);
            let bound = rounding + 1e-12;
            assert!(
                (-bound..=1.0 + bound).contains(&v),
                "{what}, {light:?}: {v}, {bound} allowed, at {place} for {corners:?}"
            );
        }
    }
    asked.faces += 1;
}

fn check(scene: &Scene, own: &Light, what: &str) -> Asked {
    let mut asked = Asked::default();
    let step = scene.triangles().len().div_ceil(FACES).max(1);
    for light in lights(own) {
        for face in (0..scene.triangles().len()).step_by(step) {
            check_face(scene.corners(face), &light, what, &mut asked);
        }
    }
    println!("{what}: {asked:?}");
    asked
}

#[test]
fn what_a_face_of_a_built_in_scene_hides_is_a_share() {
    for built_in in scenes::all() {
        let setup = scenes::build(built_in.name, 0.0).expect("built in");
        let asked = check(&setup.scene, &setup.lights[0], built_in.name);
        assert!(!setup.lights[0].is_extended() || asked.penumbra > 0, "{}: {asked:?}", built_in.name);
    }
}

/// Needles, coarse and fine faces around a light, at scales a million apart.
#[test]
fn what_a_face_of_a_soup_hides_is_a_share() {
    // A multiplicative generator: the same soup everywhere.
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    };
    let mut place = || Vec3::new(random(), random(), random());
    for scale in [1e-3_f32, 1.0, 1e3] {
        let mut asked = Asked::default();
        for face in 0..300 {
            let (a, b, c) = (place(), place(), place());
            let corners = match face % 3 {
                0 => [a, b, c],
                1 => [a, b, b + c * 1e-4],
                _ => [a, a + b * 0.1, a + c * 0.1],
            };
            let corners = corners.map(|p| (p - Vec3::Y * 0.4) * scale);
            for own in [
                Light::Sphere { center: Vec3::Y * scale, radius: 0.2 * scale },
                Light::Directional { direction: Vec3::new(0.2, -1.0, 0.1), angular_radius: 0.1 },
            ] {
                for light in lights(&own) {
                    check_face(corners, &light, "soup", &mut asked);
                }
            }
        }
        println!("soup at {scale}: {asked:?}");
        assert!(asked.penumbra > 1000, "{asked:?}");
    }
}
