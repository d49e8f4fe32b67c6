//! Exact V against hand-computed values and against samples.

use glam::Affine3A;

use super::apexes::Apexes;
use super::oracle::UnionArea;
use super::*;
use crate::bvh::{Bvh, HalfSpace};
use crate::geometry::{AlphaMask, ObjectFlags};
use crate::light::LightPoint;
use crate::light::sampling::SampleKey;
use crate::reference::no_progress;
use crate::{TriangleMesh, raster, scenes};

/// Every caster of a scene, in no order, and rays by brute force in f64.
struct Naive<'a>(&'a Scene);

impl CasterSearch for Naive<'_> {
    fn each_in(&self, _region: &[HalfSpace], found: impl FnMut(u32)) {
        (0..self.0.triangles().len() as u32).for_each(found);
    }
}

impl Occlusion for Naive<'_> {
    fn occluded_from(&self, origin: Vec3, targets: &[LightPoint], blocked: &mut [bool]) {
        for (target, blocked) in targets.iter().zip(blocked) {
            let (direction, end) = target.ray_from(origin);
            *blocked = (0..self.0.triangles().len()).any(|index| {
                let [a, b, c] = self.0.corners(index).map(|p| p.as_dvec3() - origin.as_dvec3());
                let d = direction.as_dvec3();
                let sides = [a.cross(b).dot(d), b.cross(c).dot(d), c.cross(a).dot(d)];
                let normal = (b - a).cross(c - a);
                let t = normal.dot(a) / normal.dot(d);
                let inside = sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0);
                inside && t > 0.0 && t < f64::from(end)
            });
        }
    }
}

fn scene_of(corners: &[Vec3]) -> Scene {
    let triangles = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let mut scene = Scene::new();
    let mesh = TriangleMesh::new("soup", corners.to_vec(), triangles);
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    scene
}

fn floor_at(positions: &[Vec3]) -> GBuffer {
    let mut gbuffer = GBuffer::new(positions.len() as u32, 1);
    for (pixel, &position) in positions.iter().enumerate() {
        gbuffer.position[pixel] = position;
        gbuffer.normal[pixel] = Vec3::Y;
        gbuffer.triangle[pixel] = 0;
        gbuffer.object[pixel] = 0;
    }
    gbuffer
}

fn exact(scene: &Scene, light: &Light, gbuffer: &GBuffer) -> Vec<f32> {
    exact_reference(scene, &Naive(scene), light, gbuffer, &SETTINGS, &no_progress).unwrap().visibility.values
}

const SETTINGS: ReferenceSettings = ReferenceSettings { samples: 256, seed: 0, skip: true };

const RECT: Light = Light::Rect { center: Vec3::new(0.0, 2.0, 0.0), half_u: Vec3::X, half_v: Vec3::Z };

#[test]
fn hand_computed_points_are_exact() {
    // The half-plane x < 0 at height 1, as two large triangles; its image's edge is at −x.
    let far = 16.0;
    let at = |x: f32, z: f32| Vec3::new(x, 1.0, z);
    let (a, b, c, d) = (at(-far, -far), at(0.0, -far), at(0.0, far), at(-far, far));
    let scene = scene_of(&[a, b, c, a, c, d]);
    let positions = [-2.0, -1.0, -0.5, 0.0, 0.25, 0.999, 1.5].map(|x| Vec3::new(x, 0.0, 0.3));
    let found = exact(&scene, &RECT, &floor_at(&positions));
    for (v, expected) in found.iter().zip([0.0, 0.0, 0.25, 0.5, 0.625, 0.9995, 1.0]) {
        // The origin is lifted by 2⁻²¹ of the scene's 16, which moves the edge by up to four times as much.
        assert!((v - expected).abs() < 2e-5, "{v} {expected}");
    }
    // A square of side ½ at height 1 hides a square of side 1 of 4 in all.
    let s = 0.25;
    let (a, b, c, d) = (at(-s, -s), at(s, -s), at(s, s), at(-s, s));
    let scene = scene_of(&[a, b, c, a, c, d]);
    let found = exact(&scene, &RECT, &floor_at(&[Vec3::ZERO, Vec3::X, Vec3::X * 1.25, Vec3::X * 1.5]));
    for (v, expected) in found.iter().zip([0.75, 0.875, 0.9375, 1.0]) {
        assert!((v - expected).abs() < 2e-6, "{v} {expected}");
    }
}

#[test]
fn a_disk_is_within_its_bound() {
    // A half-plane through the middle, and a square that hides the disk's inscribed one.
    let light = Light::Disk { center: Vec3::Y * 2.0, normal: Vec3::Y, radius: 1.0 };
    let at = |x: f32, z: f32| Vec3::new(x, 1.0, z);
    let quad = |x0, x1, z0, z1| {
        let (a, b, c, d) = (at(x0, z0), at(x1, z0), at(x1, z1), at(x0, z1));
        scene_of(&[a, b, c, a, c, d])
    };
    let origin = floor_at(&[Vec3::ZERO]);
    let half = exact(&quad(-4.0, 0.0, -4.0, 4.0), &light, &origin)[0];
    assert!((half - 0.5).abs() < 2e-5, "{half}");
    let s = 0.5 * std::f32::consts::FRAC_1_SQRT_2;
    let inscribed = exact(&quad(-s, s, -s, s), &light, &origin)[0];
    assert!((inscribed - (1.0 - std::f32::consts::FRAC_2_PI)).abs() < 2e-5, "{inscribed}");
    // A segment at distance ½ from the middle: (acos ½ − ½·√¾)/π.
    let segment = exact(&quad(0.25, 4.0, -4.0, 4.0), &light, &origin)[0];
    let expected = 1.0 - (0.5f32.acos() - 0.5 * 0.75f32.sqrt()) / std::f32::consts::PI;
    assert!((segment - expected).abs() < 2e-5, "{segment} {expected}");
}

#[test]
fn what_is_behind_beside_or_beyond_hides_nothing() {
    let tri = |y: f32| [Vec3::new(-9.0, y, -9.0), Vec3::new(9.0, y, -9.0), Vec3::new(0.0, y, 9.0)];
    let origin = floor_at(&[Vec3::ZERO]);
    // Below, in the floor, in the light's own plane, above it; then surely in between.
    for (y, expected) in [(-1.0, 1.0), (0.0, 1.0), (2.0, 1.0), (2.5, 1.0), (1.9, 0.0), (0.1, 0.0)] {
        assert_eq!(exact(&scene_of(&tri(y)), &RECT, &origin), [expected], "{y}");
    }
    // One that pierces the light's plane and the floor: only the part between them hides.
    let blade = [Vec3::new(0.5, -5.0, 0.0), Vec3::new(0.5, 5.0, -20.0), Vec3::new(0.5, 5.0, 20.0)];
    let v = exact(&scene_of(&blade), &RECT, &origin)[0];
    assert!(v > 0.6 && v < 0.95, "{v}");
}

/// Random soups that cross the light's plane, the floor and one another, against samples: squared differences in
/// units of the samples' variance average 1.
#[test]
fn soups_agree_with_samples() {
    let key = SampleKey::new(1, 2);
    let lights = [
        RECT,
        Light::Rect { center: Vec3::new(0.2, 2.0, 0.0), half_u: Vec3::new(0.3, 0.5, 0.1), half_v: Vec3::Z },
        Light::Disk { center: Vec3::new(0.0, 1.5, 0.3), normal: Vec3::new(1.0, 2.0, 0.0), radius: 0.7 },
        // Reaches below the floor.
        Light::Rect { center: Vec3::new(0.0, 0.3, 0.0), half_u: Vec3::Y, half_v: Vec3::X },
    ];
    for (light, index) in lights.iter().zip(0..) {
        let at = |i: u32| {
            let (p, q) = (key.square(2 * i + 1000 * index), key.square(2 * i + 1 + 1000 * index));
            Vec3::new(p.x * 3.0 - 1.5, p.y * 2.4 - 0.2, q.x * 3.0 - 1.5)
        };
        let corners: Vec<_> = (0..20)
            .flat_map(|t| [0, 1, 2].map(|c| at(4 * t + 3) + 0.4 * (at(4 * t + c) - Vec3::Y)))
            .collect();
        let scene = scene_of(&corners);
        let positions: Vec<_> = (0..400)
            .map(|i| key.square(9000 + i))
            .map(|p| Vec3::new(p.x * 3.0 - 1.5, 0.0, p.y * 3.0 - 1.5))
            .collect();
        let gbuffer = floor_at(&positions);
        let settings = ReferenceSettings { samples: 1024, seed: 5, ..Default::default() };
        let sampled = reference(&scene, &Naive(&scene), light, &gbuffer, &settings, &no_progress).unwrap();
        let (mut squares, mut variances, mut sum) = (0.0, 0.0, 0.0);
        for (pixel, v) in exact(&scene, light, &gbuffer).into_iter().enumerate() {
            let (difference, error) = (sampled.visibility.values[pixel] - v, sampled.std_error[pixel]);
            assert!(difference.abs() < 8.0 * error + 4e-5, "{light:?} {pixel}: {difference} ± {error}");
            squares += difference * difference;
            variances += error * error;
            sum += difference;
        }
        assert!(squares < 1.3 * variances, "{light:?}: {squares} {variances}");
        assert!(sum.abs() < 4.0 * variances.sqrt(), "{light:?}: {sum}");
    }
}

#[test]
fn an_edge_on_light_has_a_value() {
    // The light stands upright over the receiver, in its own plane: the caster beside it hides nothing, the one
    // across it all.
    let light = Light::Rect { center: Vec3::Y * 2.0, half_u: Vec3::X, half_v: Vec3::Y * 0.5 };
    let tri = |z: f32| [Vec3::new(-9.0, 1.0, z), Vec3::new(9.0, 1.0, z), Vec3::new(0.0, 1.0, z + 9.0)];
    let origin = floor_at(&[Vec3::ZERO]);
    assert_eq!(exact(&scene_of(&tri(1.0)), &light, &origin), [1.0]);
    assert!(exact(&scene_of(&tri(-1.0)), &light, &origin)[0] < 1e-6);
}

#[test]
fn what_cannot_be_exact_is_refused() {
    let gbuffer = floor_at(&[Vec3::ZERO]);
    let run = |scene: &Scene, light: &Light| {
        exact_reference(scene, &Naive(scene), light, &gbuffer, &SETTINGS, &no_progress)
            .map(|r| r.visibility.values[0])
    };
    let empty = Scene::new();
    let sphere = Light::Sphere { center: Vec3::Y, radius: 0.5 };
    assert_eq!(run(&empty, &sphere), Err(ExactError::Light("sphere")));
    let sun = Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.1 };
    assert_eq!(run(&empty, &sun), Err(ExactError::Light("directional")));
    let flat = Light::Rect { center: Vec3::Y, half_u: Vec3::X, half_v: Vec3::X };
    assert_eq!(run(&empty, &flat), Err(ExactError::Light("rect")));
    assert_eq!(run(&empty, &Light::Point { position: Vec3::Y }), Ok(1.0));
}

/// V of every pixel by the union of all triangles' shadows, one by one, and by their edges.
fn oracle_and_patch(scene: &Scene, light: &Light, gbuffer: &GBuffer) -> Vec<[f64; 2]> {
    let outline = Outline::new(light).unwrap();
    let magnitude = scene.bounds().magnitude();
    let casters: Vec<u32> = (0..scene.triangles().len() as u32).collect();
    let representative = weld(scene.positions()).representative;
    let patch = |apexes: Option<Apexes>| Patch::new(scene, &representative, &casters, apexes.as_ref());
    let (mut union, mut buffers) = (UnionArea::default(), Buffers::default());
    let seen: Vec<usize> = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)).collect();
    let origin = |pixel: usize| shadow_origin(gbuffer.position[pixel], gbuffer.normal[pixel], magnitude);
    // From one point alone, from a row of neighbours, and from all together.
    let all = patch(Apexes::new(&outline, seen.iter().map(|&pixel| origin(pixel))));
    let rows =
        seen.chunks(5).map(|row| (row, patch(Apexes::new(&outline, row.iter().map(|&pixel| origin(pixel))))));
    let asked = patch(None);
    rows.flat_map(|(row, patch)| row.iter().map(move |&pixel| (pixel, patch.clone())))
        .map(|(pixel, row)| {
            let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
            let cone = Cone::new(&outline, origin(pixel), position, normal);
            union.clear();
            for index in 0..scene.triangles().len() {
                union.add(cone.shadow_on_outline(scene.corners(index)));
            }
            let hidden = if cone.seen_area > 0.0 { union.area() } else { 0.0 };
            let seen = row.seen(&cone, &mut buffers).most;
            for other in [&all, &asked].map(|patch| patch.seen(&cone, &mut buffers).most) {
                assert!((seen - other).abs() < 1e-10 * cone.area(), "{seen} {other}");
            }
            [(cone.seen_area - hidden) / cone.area(), seen / cone.area()]
        })
        .collect()
}

/// The fast way is the simple one: over meshes, soups, clusters of edges at one place, casters that reach through the light's
/// plane and behind the receiver, and lights that dip below the floor. Each way rounds areas by some 10⁻¹².
#[test]
fn edges_give_what_all_triangles_give() {
    for (spec, side, light) in [
        ("cornell", 24, None),
        ("quads", 24, None),
        ("layers", 16, None),
        ("edges", 24, None),
        ("cylinder", 12, None),
        ("ball", 8, None),
        ("knot:sides=12", 10, Some(RECT)),
        (
            "log-cabin",
            8,
            Some(Light::Rect { center: Vec3::new(1.0, 2.0, 4.0), half_u: Vec3::X, half_v: Vec3::Y }),
        ),
        ("chess:segments=6", 8, Some(Light::Disk { center: Vec3::Y, normal: Vec3::Y, radius: 0.4 })),
        // Half below the floor.
        ("quads", 24, Some(Light::Rect { center: Vec3::X * 2.0, half_u: Vec3::Y, half_v: Vec3::Z })),
    ] {
        let mut setup = scenes::build(spec, 0.0).unwrap();
        (setup.camera.width, setup.camera.height) = (side, side);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let light = light.unwrap_or(setup.lights[0]);
        let both = oracle_and_patch(&setup.scene, &light, &gbuffer);
        assert!(both.iter().any(|[v, _]| *v > 0.001 && *v < 0.999), "{spec} has no penumbra");
        for (index, [expected, found]) in both.iter().enumerate() {
            assert!((found - expected).abs() < 1e-9, "{spec} {light:?} {index}: {found} {expected}");
        }
        // And so do blocks of pixels and proofs; but for the disk, whose proofs are of the circle.
        let casters = Bvh::casters(&setup.scene);
        let truth =
            exact_reference(&setup.scene, &casters, &light, &gbuffer, &SETTINGS, &no_progress).unwrap();
        let bound = if matches!(light, Light::Disk { .. }) { 2e-5 } else { 1e-7 };
        let seen = truth.visibility.values.iter().filter(|v| !v.is_nan());
        for (index, (v, [expected, _])) in seen.zip(&both).enumerate() {
            assert!((f64::from(*v) - expected).abs() < bound, "{spec} {light:?} {index}: {v} {expected}");
        }
        let unproved = ReferenceSettings { skip: false, ..SETTINGS };
        let all = exact_reference(&setup.scene, &casters, &light, &gbuffer, &unproved, &no_progress).unwrap();
        assert_eq!((all.work.proved_lit, all.work.proved_dark), (0, 0));
        assert_eq!(all.work.exact, truth.work.exact + truth.work.proved_lit + truth.work.proved_dark);
    }
}

/// A masked leaf over the right half of the floor, a solid square over part of it: sampled only where the leaf is
/// seen before a part of the light that the square leaves open.
#[test]
fn masks_are_sampled_only_where_v_hangs_on_them() {
    let square = |x0: f32, x1: f32, y: f32| {
        let at = |x, z| Vec3::new(x, y, z);
        vec![at(x0, -9.0), at(x1, -9.0), at(x1, 9.0), at(x0, 9.0)]
    };
    let triangles = vec![[0, 1, 2], [0, 2, 3]];
    let mut leaf = TriangleMesh::new("leaf", square(0.0, 9.0, 1.0), triangles.clone());
    leaf.uvs = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(glam::Vec2::from).into();
    let alpha: Vec<u8> = (0..4096).map(|i| if (i % 64 + i / 64) % 2 == 0 { 255 } else { 0 }).collect();
    leaf.alpha = AlphaMask::from_alpha(64, 64, &alpha, 0.5, Default::default()).map(std::sync::Arc::new);
    let mut scene = Scene::new();
    let lid = TriangleMesh::new("lid", square(3.0, 9.0, 0.5), triangles);
    for mesh in [&leaf, &lid] {
        scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    }
    let gbuffer = floor_at(&[-2.0, 0.5, 1.5, 2.9, 4.5].map(|x| Vec3::X * x));
    let casters = Bvh::casters(&scene);
    for skip in [false, true] {
        let settings = ReferenceSettings { samples: 4096, skip, ..SETTINGS };
        let truth = exact_reference(&scene, &casters, &RECT, &gbuffer, &settings, &no_progress).unwrap();
        let plain = reference(&scene, &casters, &RECT, &gbuffer, &settings, &no_progress).unwrap();
        assert_eq!(truth.work.sampled, 3);
        assert_eq!(truth.work.exact + truth.work.proved_lit + truth.work.proved_dark, 2);
        let v = &truth.visibility.values;
        assert_eq!((v[0], v[4]), (1.0, 0.0));
        // What is sampled is what sampling alone gives.
        assert_eq!(v[1..4], plain.visibility.values[1..4]);
        assert_eq!(truth.std_error[1..4], plain.std_error[1..4]);
        assert!(truth.std_error[1..4].iter().all(|&e| e > 0.0) && truth.std_error[4] == 0.0);
    }
}
