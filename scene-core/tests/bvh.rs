//! The ray tracer against brute force, against itself, and on meshes made to break it.

use std::sync::Arc;

use glam::{Affine3A, DVec3, Vec2, Vec3};
use gnomon_scene_core::bvh::{Bvh, shadow_origin};
use gnomon_scene_core::geometry::{Aabb, AlphaMask, ObjectFlags, Scene, TriangleMesh};
use gnomon_scene_core::light::LightPoint;
use proptest::prelude::*;

/// Uniform numbers in [0, 1), the same in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1_u32 << 24) as f32
    }

    fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }

    /// A point of the cube [−1, 1]³.
    fn point(&mut self) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|_| self.within(-1.0, 1.0)))
    }
}

fn scene_of(mesh: &TriangleMesh) -> Scene {
    let mut scene = Scene::new();
    scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    scene
}

fn soup(random: &mut Random, count: u32, size: f32) -> TriangleMesh {
    let mut positions = Vec::new();
    for _ in 0..count {
        let center = random.point();
        positions.extend((0..3).map(|_| center + random.point() * size));
    }
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    TriangleMesh::new("soup", positions, triangles)
}

/// A closed ball of `2 * rings * sectors` triangles, roughly, around the origin.
fn ball(rings: u32, sectors: u32) -> TriangleMesh {
    let mut positions = vec![Vec3::Y, Vec3::NEG_Y];
    for ring in 1..rings {
        let (sin, cos) = (std::f32::consts::PI * ring as f32 / rings as f32).sin_cos();
        for sector in 0..sectors {
            let (s, c) = (std::f32::consts::TAU * sector as f32 / sectors as f32).sin_cos();
            positions.push(Vec3::new(sin * c, cos, sin * s));
        }
    }
    let at = |ring: u32, sector: u32| 2 + (ring - 1) * sectors + sector % sectors;
    let mut triangles = Vec::new();
    for sector in 0..sectors {
        triangles.push([0, at(1, sector), at(1, sector + 1)]);
        triangles.push([1, at(rings - 1, sector + 1), at(rings - 1, sector)]);
        for ring in 1..rings - 1 {
            let (a, b) = (at(ring, sector), at(ring, sector + 1));
            let (c, d) = (at(ring + 1, sector), at(ring + 1, sector + 1));
            triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    TriangleMesh::new("ball", positions, triangles)
}

/// How far inside the triangle the ray passes (the least barycentric weight) and at which t, in f64.
fn cross_f64(corners: [Vec3; 3], origin: Vec3, direction: Vec3) -> Option<(f64, f64)> {
    let [a, b, c] = corners.map(|v| v.as_dvec3() - origin.as_dvec3());
    let d = direction.as_dvec3();
    let normal = (b - a).cross(c - a);
    let facing = normal.dot(d);
    if facing.abs() <= 1e-12 * normal.length() * d.length() {
        return None;
    }
    let weight = |u: DVec3, v: DVec3| u.cross(v).dot(d) / facing;
    let least = weight(a, b).min(weight(b, c)).min(weight(c, a));
    Some((least, normal.dot(a) / facing))
}

/// What brute force says of a segment: blocked, free, or too close to tell.
fn brute(scene: &Scene, origin: Vec3, target: LightPoint) -> Option<bool> {
    const MARGIN: f64 = 1e-4;
    let (direction, end) = target.ray_from(origin);
    let end = f64::from(end);
    let mut doubtful = false;
    for triangle in 0..scene.triangles().len() {
        if let Some((least, t)) = cross_f64(scene.corners(triangle), origin, direction) {
            if least > MARGIN && t > MARGIN && t < end * (1.0 - MARGIN) {
                return Some(true);
            }
            doubtful |= least > -MARGIN && t > -MARGIN && t < end * (1.0 + MARGIN);
        }
    }
    (!doubtful).then_some(false)
}

/// Some rays of every kind a light makes, from one point.
fn targets(random: &mut Random, kind: u8, count: usize) -> Vec<LightPoint> {
    let center = random.point() * 2.0;
    (0..count)
        .map(|_| match kind {
            0 => LightPoint::At(center + random.point() * 0.3),
            1 => LightPoint::At(random.point() * 1.5),
            2 => LightPoint::Towards((center + random.point() * 0.05).normalize_or(Vec3::Y)),
            3 => LightPoint::Towards(random.point().normalize_or(Vec3::Y)),
            _ if random.next() < 0.5 => LightPoint::At(center + random.point()),
            _ => LightPoint::Towards([Vec3::X, Vec3::NEG_Y, Vec3::Z][(random.next() * 3.0) as usize]),
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn occlusion_equals_brute_force(seed: u64, count in 0_u32..200, size in 0.01_f32..1.0, kind in 0_u8..5) {
        let random = &mut Random(seed);
        let scene = scene_of(&soup(random, count, size));
        let bvh = Bvh::casters(&scene);
        let origin = random.point();
        let targets = targets(random, kind, 100);
        let mut blocked = vec![true; targets.len()];
        bvh.occluded_from(origin, &targets, &mut blocked);
        for (&target, &blocked) in targets.iter().zip(&blocked) {
            prop_assert_eq!(bvh.is_occluded(origin, target), blocked);
            if let Some(expected) = brute(&scene, origin, target) {
                prop_assert_eq!(blocked, expected);
            }
        }
    }

    #[test]
    fn closest_hit_equals_brute_force(seed: u64, count in 0_u32..200, size in 0.01_f32..1.0, t_min in 0.0_f32..0.5) {
        let random = &mut Random(seed);
        let scene = scene_of(&soup(random, count, size));
        let bvh = Bvh::all(&scene);
        for _ in 0..30 {
            let (origin, direction) = (random.point() * 2.0, random.point());
            let hit = bvh.closest_hit(origin, direction, t_min, f32::INFINITY);
            let crossed = |margin: f64| {
                (0..scene.triangles().len())
                    .filter_map(|i| cross_f64(scene.corners(i), origin, direction))
                    .filter(move |&(least, t)| least > margin && t > f64::from(t_min) + margin)
                    .map(|(_, t)| t)
                    .fold(f64::INFINITY, f64::min)
            };
            // Between what is surely hit and what is perhaps hit.
            let t = hit.map_or(f64::INFINITY, |hit| f64::from(hit.t));
            prop_assert!(t <= crossed(1e-4) * (1.0 + 1e-5) && t >= crossed(-1e-4) * (1.0 - 1e-5) - 1e-6);
            if let Some(hit) = hit {
                let [a, b, c] = scene.corners(hit.triangle as usize);
                let on_triangle = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
                prop_assert!(on_triangle.distance(origin + direction * hit.t) < 1e-4 * (1.0 + hit.t));
            }
        }
    }

    #[test]
    fn moving_and_scaling_by_powers_of_two_changes_nothing(seed: u64, exponent in -40_i32..40) {
        let random = &mut Random(seed);
        let mesh = soup(random, 60, 0.5);
        let scale = 2.0_f32.powi(exponent);
        let mut scene = Scene::new();
        scene.add(&mesh, Affine3A::from_scale(Vec3::splat(scale)), ObjectFlags::default()).unwrap();
        let (plain, scaled) = (Bvh::all(&scene_of(&mesh)), Bvh::all(&scene));
        for _ in 0..100 {
            let (origin, target) = (random.point(), random.point() * 2.0);
            prop_assert_eq!(
                plain.is_occluded(origin, LightPoint::At(target)),
                scaled.is_occluded(origin * scale, LightPoint::At(target * scale))
            );
        }
    }
}

/// Rays from inside a closed mesh: at random, exactly at its vertices, at points of its edges.
#[test]
fn nothing_escapes_from_a_closed_mesh() {
    let random = &mut Random(1);
    for (mesh, offset) in [
        (ball(16, 24), Vec3::ZERO),
        (ball(3, 3), Vec3::new(0.1, 0.7, -0.3)),
        (ball(40, 60), Vec3::new(1000.0, -3000.0, 77.0)),
    ] {
        let mesh = mesh.transformed(Affine3A::from_translation(offset));
        let mut flipped = mesh.clone();
        flipped.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        for mesh in [mesh, flipped] {
            let scene = scene_of(&mesh);
            let bvh = Bvh::casters(&scene);
            for origin in [offset, offset + Vec3::new(0.01, 0.02, -0.03), offset + random.point() * 0.1] {
                let mut ends = Vec::new();
                for triangle in 0..mesh.triangles.len() {
                    let [a, b, c] = scene.corners(triangle);
                    ends.extend([a, b, c, a.midpoint(b), b.lerp(c, random.next()), c.lerp(a, random.next())]);
                    ends.push((a + b + c) / 3.0);
                }
                // Along the axes too, and anywhere.
                ends.extend(Vec3::AXES.iter().flat_map(|&axis| [origin + axis, origin - axis]));
                ends.extend((0..2000).map(|_| origin + random.point().normalize_or(Vec3::X)));
                for end in ends {
                    let direction = end - origin;
                    assert!(bvh.is_occluded(origin, LightPoint::Towards(direction)), "{origin} to {end}");
                    assert!(bvh.is_occluded(origin, LightPoint::At(origin + direction * 8.0)));
                    let hit = bvh.closest_hit(origin, direction, 0.0, f32::INFINITY);
                    assert!(hit.is_some_and(|hit| hit.t > 0.0));
                    // And from the other side of the same edges and vertices.
                    let outside = origin + direction * 8.0;
                    if (end - offset).length() > 0.5 {
                        assert!(bvh.is_occluded(outside, LightPoint::At(origin)), "{outside} to {origin}");
                    }
                }
            }
        }
    }
}

/// A plane cut into triangles has no crack, seen from either side.
#[test]
fn a_plane_has_no_cracks() {
    let random = &mut Random(7);
    let side = 33_u32;
    let (u, v) = (Vec3::new(1.0, 0.3, 0.1), Vec3::new(-0.2, 0.4, 0.9));
    let positions: Vec<_> = (0..side * side).map(|i| u * (i % side) as f32 + v * (i / side) as f32).collect();
    let mut triangles = Vec::new();
    for y in 0..side - 1 {
        for x in 0..side - 1 {
            let a = y * side + x;
            triangles.extend([[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]);
        }
    }
    let normal = u.cross(v).normalize();
    let scene = scene_of(&TriangleMesh::new("plane", positions.clone(), triangles));
    let bvh = Bvh::casters(&scene);
    let middle = u * 16.0 + v * 16.0;
    for _ in 0..300 {
        let height = normal * random.within(0.5, 4.0);
        for origin in [middle + height, middle - height] {
            let through: Vec<_> = (0..64)
                .map(|_| {
                    let at = |r: &mut Random| 4 + (r.next() * 24.0) as u32;
                    let i = at(random) * side + at(random);
                    // A vertex, or the middle of the edge to one of its neighbours.
                    let neighbour = [i, i + 1, i + side, i + side - 1][(random.next() * 4.0) as usize];
                    let on_plane = positions[i as usize].midpoint(positions[neighbour as usize]);
                    LightPoint::At(origin + (on_plane - origin) * 2.0)
                })
                .collect();
            let mut blocked = [false; 64];
            bvh.occluded_from(origin, &through, &mut blocked);
            assert_eq!(blocked, [true; 64]);
        }
    }
}

#[test]
fn objects_that_cast_nothing_are_only_seen() {
    let square = TriangleMesh::new(
        "square",
        vec![Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 0.0, -1.0), Vec3::new(0.0, 0.0, 1.0)],
        vec![[0, 1, 2]],
    );
    let mut scene = Scene::new();
    let ghost = ObjectFlags { casts: false, ..ObjectFlags::default() };
    scene.add(&square, Affine3A::from_translation(Vec3::Y), ghost).unwrap();
    scene.add(&square, Affine3A::from_translation(Vec3::Y * 2.0), ObjectFlags::default()).unwrap();
    let (casters, all) = (Bvh::casters(&scene), Bvh::all(&scene));
    assert_eq!((casters.triangle_count(), all.triangle_count()), (1, 2));
    let seen = |bvh: &Bvh| bvh.closest_hit(Vec3::ZERO, Vec3::Y, 0.0, 9.0).unwrap();
    assert_eq!((seen(&casters).triangle, seen(&casters).t), (1, 2.0));
    assert_eq!((seen(&all).triangle, seen(&all).t), (0, 1.0));
    assert!(!casters.is_occluded(Vec3::ZERO, LightPoint::At(Vec3::Y * 1.5)));
    assert!(all.is_occluded(Vec3::ZERO, LightPoint::At(Vec3::Y * 1.5)));
    assert!(casters.is_occluded(Vec3::ZERO, LightPoint::Towards(Vec3::Y)));
    // A blocker ends before the light does, and starts after the origin.
    assert!(!casters.is_occluded(Vec3::ZERO, LightPoint::At(Vec3::Y * 2.0)));
    assert!(!casters.is_occluded(Vec3::Y * 2.0, LightPoint::At(Vec3::Y * 3.0)));
    assert_eq!(all.closest_hit(Vec3::ZERO, Vec3::Y, 1.5, 9.0).unwrap().triangle, 1);
    assert!(all.closest_hit(Vec3::ZERO, Vec3::Y, 0.0, 0.5).is_none());
}

#[test]
fn masks_let_light_through_where_they_are_cut() {
    let corners = vec![Vec3::new(-1.0, 1.0, -1.0), Vec3::new(3.0, 1.0, -1.0), Vec3::new(-1.0, 1.0, 3.0)];
    let mut mesh = TriangleMesh::new("mask", corners, vec![[0, 1, 2]]);
    mesh.uvs = vec![Vec2::ZERO, Vec2::X * 2.0, Vec2::Y * 2.0];
    // Solid where exactly one of x and z is negative.
    mesh.alpha = AlphaMask::from_alpha(2, 2, &[0, 255, 255, 0], 0.5, Default::default()).map(Arc::new);
    let mut scene = Scene::new();
    // The masked triangle among others that are far away, to land in a block with them.
    let far = Affine3A::from_translation(Vec3::X * 100.0);
    scene.add(&soup(&mut Random(3), 3, 0.5), far, ObjectFlags::default()).unwrap();
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    scene.add(&soup(&mut Random(4), 30, 0.5), far, ObjectFlags::default()).unwrap();
    let bvh = Bvh::casters(&scene);
    let random = &mut Random(5);
    for _ in 0..500 {
        let points: Vec<_> = (0..64).map(|_| random.point() * Vec3::new(0.99, 0.0, 0.99)).collect();
        let targets: Vec<_> = points.iter().map(|p| LightPoint::At(p * 2.0 + Vec3::Y * 2.0)).collect();
        let mut blocked = vec![false; 64];
        bvh.occluded_from(Vec3::ZERO, &targets, &mut blocked);
        for ((point, target), blocked) in points.iter().zip(targets).zip(blocked) {
            if point.x.abs().min(point.z.abs()) < 1e-4 {
                continue;
            }
            let solid = (point.x < 0.0) != (point.z < 0.0);
            assert_eq!(blocked, solid, "{point}");
            assert_eq!(bvh.is_occluded(Vec3::ZERO, target), solid);
            let (direction, _) = target.ray_from(Vec3::ZERO);
            assert_eq!(bvh.closest_hit(Vec3::ZERO, direction, 0.0, 1.0).is_some(), solid);
        }
    }
}

#[test]
fn broken_input_is_answered_quietly() {
    let empty = Bvh::all(&Scene::new());
    assert!(empty.bounds().is_empty() && empty.triangle_count() == 0);
    assert!(!empty.is_occluded(Vec3::ZERO, LightPoint::Towards(Vec3::X)));
    assert!(empty.closest_hit(Vec3::ZERO, Vec3::X, 0.0, 1.0).is_none());
    let bvh = Bvh::all(&scene_of(&ball(8, 8)));
    let bad = [Vec3::NAN, Vec3::INFINITY, Vec3::new(0.0, f32::NAN, 1.0)];
    for bad in bad {
        for target in [LightPoint::At(bad), LightPoint::Towards(bad)] {
            assert!(!bvh.is_occluded(Vec3::ZERO, target));
        }
        assert!(!bvh.is_occluded(bad, LightPoint::Towards(Vec3::X)));
        assert!(bvh.closest_hit(Vec3::ZERO, bad, 0.0, 1.0).is_none());
        assert!(bvh.closest_hit(bad, Vec3::X, 0.0, 1.0).is_none());
        assert!(bvh.closest_hit(Vec3::ZERO, Vec3::X, f32::NAN, 9.0).is_none());
        // One bad ray does not disturb its packet.
        let targets = [LightPoint::At(Vec3::X * 9.0), LightPoint::At(bad), LightPoint::At(Vec3::Y * 9.0)];
        let mut blocked = [true; 3];
        bvh.occluded_from(Vec3::ZERO, &targets, &mut blocked);
        assert_eq!(blocked, [true, false, true]);
    }
    assert!(!bvh.is_occluded(Vec3::ZERO, LightPoint::Towards(Vec3::ZERO)));
    assert!(!bvh.is_occluded(Vec3::ZERO, LightPoint::At(Vec3::ZERO)));
    assert!(bvh.closest_hit(Vec3::ZERO, Vec3::ZERO, 0.0, 1.0).is_none());
    bvh.occluded_from(Vec3::ZERO, &[], &mut []);
}

#[test]
fn sizes_near_the_ends_of_f32_work() {
    for scale in [1e-37_f32, 1e-30, 1e-20, 1e13, 1e20, 1e37] {
        let mut scene = Scene::new();
        scene.add(&ball(8, 12), Affine3A::from_scale(Vec3::splat(scale)), ObjectFlags::default()).unwrap();
        let bvh = Bvh::all(&scene);
        let random = &mut Random(11);
        for _ in 0..200 {
            let end = random.point().normalize_or(Vec3::X);
            assert!(bvh.is_occluded(Vec3::ZERO, LightPoint::Towards(end)), "{scale} {end}");
            assert!(bvh.is_occluded(Vec3::ZERO, LightPoint::At(end * scale * 3.0)), "{scale} {end}");
            assert!(!bvh.is_occluded(Vec3::ZERO, LightPoint::At(end * scale * 0.3)), "{scale} {end}");
            let hit = bvh.closest_hit(Vec3::ZERO, end * scale, 0.0, f32::INFINITY).unwrap();
            assert!((0.8..1.001).contains(&hit.t), "{scale} {hit:?}");
        }
    }
}

#[test]
fn a_million_identical_triangles_are_one() {
    let positions = vec![Vec3::new(-1.0, 1.0, -1.0), Vec3::new(1.0, 1.0, -1.0), Vec3::new(0.0, 1.0, 1.0)];
    let bvh = Bvh::all(&scene_of(&TriangleMesh::new("same", positions, vec![[0, 1, 2]; 1_000_000])));
    assert!(bvh.is_occluded(Vec3::ZERO, LightPoint::Towards(Vec3::Y)));
    assert!(!bvh.is_occluded(Vec3::ZERO, LightPoint::Towards(-Vec3::Y)));
    assert!(!bvh.is_occluded(Vec3::ZERO, LightPoint::At(Vec3::new(3.0, 2.0, 0.0))));
    assert_eq!(bvh.closest_hit(Vec3::ZERO, Vec3::Y, 0.0, 9.0).unwrap().triangle, 0);
}

#[test]
fn triangles_without_area_block_nothing() {
    let third = 1.0 / 3.0;
    let positions = vec![Vec3::new(-1.0, 1.0, -1.0), Vec3::new(third, 1.0, third), Vec3::new(1.0, 1.0, 1.0)];
    for triangle in [[0, 0, 1], [0, 2, 2], [1, 1, 1], [0, 1, 2]] {
        let mesh = TriangleMesh::new("line", positions.clone(), vec![triangle]);
        let bvh = Bvh::all(&scene_of(&mesh));
        for end in [Vec3::Y, positions[0], positions[1], positions[2]] {
            assert!(!bvh.is_occluded(Vec3::ZERO, LightPoint::At(end * 2.0)));
        }
    }
}

#[test]
fn a_visit_reaches_every_triangle_once() {
    let scene = scene_of(&soup(&mut Random(2), 500, 0.1));
    let bvh = Bvh::all(&scene);
    let mut seen = vec![0; 500];
    bvh.visit(|_| true, |triangle| seen[triangle as usize] += 1);
    assert_eq!(seen, [1; 500]);
    // Only boxes that touch a corner region: every triangle with a vertex there is seen.
    let region = Aabb { min: Vec3::splat(0.3), max: Vec3::splat(1.0) };
    let meets = |b: Aabb| b.min.cmple(region.max).all() && b.max.cmpge(region.min).all();
    let mut seen = [false; 500];
    bvh.visit(meets, |triangle| seen[triangle as usize] = true);
    for (triangle, seen) in seen.into_iter().enumerate() {
        assert!(seen || !meets(Aabb::from_points(scene.corners(triangle))));
    }
    assert!(seen.iter().any(|&s| !s));
}

/// A tessellated square of side `2 * half` around `center`, with its unit normal.
fn square(center: Vec3, u: Vec3, v: Vec3, cells: u32) -> TriangleMesh {
    let side = cells + 1;
    let at = |i: u32| i as f32 / cells as f32 * 2.0 - 1.0;
    let positions = (0..side * side).map(|i| center + u * at(i % side) + v * at(i / side)).collect();
    let mut triangles = Vec::new();
    for y in 0..cells {
        for x in 0..cells {
            let a = y * side + x;
            triangles.extend([[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]);
        }
    }
    TriangleMesh::new("square", positions, triangles)
}

/// Planes of any tilt, size and distance: a point found by a camera ray and lifted never shadows itself, though
/// the light grazes at 89.9°.
#[test]
fn lifted_origins_do_not_shadow_themselves() {
    let random = &mut Random(21);
    for (half, offset) in [(1.0, 0.0), (0.01, 1.0), (150.0, 0.0), (150.0, 1000.0), (3.0, 10_000.0)] {
        for _ in 0..12 {
            let normal = random.point().normalize_or(Vec3::Y);
            let u = normal.any_orthonormal_vector();
            let v = normal.cross(u);
            let center = random.point().normalize_or(Vec3::X) * offset;
            let scene = scene_of(&square(center, u * half, v * half, 1 + (random.next() * 30.0) as u32));
            let bvh = Bvh::all(&scene);
            for _ in 0..400 {
                let aim = center + u * random.within(-half, half) + v * random.within(-half, half);
                let eye = aim
                    + normal * random.within(0.01, 2.0) * half
                    + (u - v) * random.within(-1.0, 1.0) * half;
                let Some(hit) = bvh.closest_hit(eye, aim - eye, 0.0, 2.0) else { continue };
                let [a, b, c] = scene.corners(hit.triangle as usize);
                let face = (b - a).cross(c - a).normalize();
                let face = if face.dot(eye - a) < 0.0 { -face } else { face };
                let magnitude = scene.bounds().magnitude().max(eye.abs().max_element());
                // Either way to reconstruct the position.
                let by_weights = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
                for position in [by_weights, eye + (aim - eye) * hit.t] {
                    let origin = shadow_origin(position, face, magnitude);
                    assert!(origin.distance(position) <= magnitude * 1.01 / 2_097_152.0 + magnitude * 1e-7);
                    let (sin, cos) = (std::f32::consts::TAU * random.next()).sin_cos();
                    let grazing = 0.1_f32.to_radians();
                    let direction = (u * cos + v * sin) * grazing.cos() + face * grazing.sin();
                    let far = origin + direction * random.within(1.0, 30.0) * half;
                    assert!(
                        !bvh.is_occluded(origin, LightPoint::Towards(direction)),
                        "{half} {offset} {origin}"
                    );
                    assert!(!bvh.is_occluded(origin, LightPoint::At(far)), "{half} {offset} {origin}");
                }
            }
        }
    }
}
