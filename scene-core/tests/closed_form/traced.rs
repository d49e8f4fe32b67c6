//! The closed forms again with triangles and the ray tracer, by samples and exactly.

use std::f32::consts::{PI, TAU};

use glam::{Affine3A, DVec2, DVec3, Vec3};
use gnomon_scene_core::bvh::Bvh;
use gnomon_scene_core::geometry::ObjectFlags;
use gnomon_scene_core::reference::{ReferenceSettings, exact_reference, no_progress};
use gnomon_scene_core::{GBuffer, Light, Scene, TriangleMesh};

use super::{BALL, assert_agreement, ball_truth, floor, formulas, sample, square_over_plane};

/// A caster on a floor at y = 0. The floor casts too: points on it must not shadow themselves.
fn scene(caster: &TriangleMesh) -> Scene {
    let mut scene = Scene::new();
    let at = |x: f32, z: f32| Vec3::new(4.0 * x, 0.0, 4.0 * z);
    for mesh in [&quad([at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)]), caster] {
        scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    }
    scene
}

fn quad(corners: [Vec3; 4]) -> TriangleMesh {
    TriangleMesh::new("quad", corners.into(), vec![[0, 1, 2], [0, 2, 3]])
}

/// The part x < 0 of a sheet at height 1, large enough for every receiver.
fn half_plane() -> TriangleMesh {
    let at = |x: f32, z: f32| Vec3::new(x, 1.0, z);
    quad([at(-4.0, -4.0), at(0.0, -4.0), at(0.0, 4.0), at(-4.0, 4.0)])
}

fn assert_traced(scene: &Scene, light: &Light, gbuffer: &GBuffer, truth: impl Fn(DVec3) -> f64) {
    assert_agreement(scene, &Bvh::casters(scene), light, gbuffer, truth);
}

/// Exact V against the formula. Origins are lifted by 2⁻²¹ of the scene's largest coordinate, 4, which moves a shadow by
/// as much times how fast it moves over the light; f32 receivers and results add some 10⁻⁷.
fn assert_exact(scene: &Scene, light: &Light, gbuffer: &GBuffer, truth: impl Fn(DVec3) -> f64, bound: f64) {
    let settings = ReferenceSettings::default();
    let found =
        exact_reference(scene, &Bvh::casters(scene), light, gbuffer, &settings, &no_progress).unwrap();
    for (&position, &v) in gbuffer.position.iter().zip(&found.visibility.values) {
        let expected = truth(position.as_dvec3());
        assert!((f64::from(v) - expected).abs() < bound, "V at {position} is {v}, not {expected}");
    }
    assert!(found.std_error.iter().all(|&e| e == 0.0));
}

#[test]
fn half_plane_under_a_rect() {
    let light = Light::Rect { center: Vec3::Y * 2.0, half_u: Vec3::X * 0.5, half_v: Vec3::Z * 1.5 };
    let (scene, gbuffer) = (scene(&half_plane()), floor(3000, 0.7));
    let truth = |x: DVec3| (0.5 + x.x).clamp(0.0, 1.0);
    assert_traced(&scene, &light, &gbuffer, truth);
    assert_exact(&scene, &light, &gbuffer, truth, 1e-5);
}

#[test]
fn square_under_a_square() {
    let (_, light, truth) = square_over_plane();
    let corner = |u: f64, v: f64| {
        let p = DVec2::from_angle(0.5).rotate(DVec2::new(u, v) * 0.25);
        Vec3::new(p.x as f32, 1.0, p.y as f32)
    };
    let square = quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
    let (scene, gbuffer) = (scene(&square), floor(3000, 1.2));
    assert_traced(&scene, &light, &gbuffer, &truth);
    assert_exact(&scene, &light, &gbuffer, &truth, 1e-5);
}

/// A sphere of 2n by n faces inscribed in the ball, no deeper inside it than r·(π/n)²/2 in either direction: a ball
/// smaller by both fits inside the mesh. So V lies between those of the two balls; receiver by receiver
/// but for as many as sampling may put 3 standard errors off, and on average.
#[test]
fn ball_under_a_sphere() {
    let n = 60u32;
    let mut ball = TriangleMesh { name: "ball".into(), ..Default::default() };
    for row in 0..=n {
        for column in 0..2 * n {
            let (polar, turn) = (row as f32 / n as f32 * PI, column as f32 / (2 * n) as f32 * TAU);
            let at = Vec3::new(polar.sin() * turn.cos(), polar.cos(), polar.sin() * turn.sin());
            ball.positions.push(BALL.0.as_vec3() + at * BALL.1 as f32);
        }
    }
    for row in 0..n {
        for column in 0..2 * n {
            let corner = |r: u32, c: u32| (row + r) * 2 * n + (column + c) % (2 * n);
            ball.triangles.push([corner(0, 0), corner(1, 0), corner(1, 1)]);
            ball.triangles.push([corner(0, 0), corner(1, 1), corner(0, 1)]);
        }
    }
    let light = Light::Sphere { center: Vec3::Y * 3.0, radius: 0.9 };
    let (scene, gbuffer) = (scene(&ball), floor(1000, 1.3));
    let sampled = sample(&scene, &Bvh::casters(&scene), &light, &gbuffer);
    let truth = |x: DVec3, ball: f64| ball_truth(x, ball, DVec3::Y * 3.0, f64::from(0.9f32));
    let inner = BALL.1 * (1.0 - (std::f64::consts::PI / f64::from(n)).powi(2));

    let (mut outside, mut low, mut high, mut mean, mut variance) = (0, 0.0, 0.0, 0.0, 0.0);
    for (pixel, position) in gbuffer.position.iter().enumerate() {
        let (darkest, lightest) = (truth(position.as_dvec3(), BALL.1), truth(position.as_dvec3(), inner));
        let (v, error) = (f64::from(sampled.visibility.values[pixel]), f64::from(sampled.std_error[pixel]));
        assert!(lightest - darkest < 0.02);
        outside += usize::from(v < darkest - 3.0 * error || v > lightest + 3.0 * error);
        low += darkest;
        high += lightest;
        mean += v;
        variance += error * error;
    }
    assert!(outside <= gbuffer.pixel_count() / 50, "{outside} receivers are off");
    let error = 4.0 * variance.sqrt();
    assert!(mean > low - error && mean < high + error, "{mean} is not between {low} and {high}");
}

#[test]
fn half_plane_under_the_sun() {
    let (direction, angular_radius) = (Vec3::new(-0.2, -1.0, 0.3), 5f32.to_radians());
    let light = Light::Directional { direction, angular_radius };
    let (sun, radius) = (-direction.as_dvec3().normalize(), f64::from(angular_radius));
    assert_traced(&scene(&half_plane()), &light, &floor(6000, 0.35), |x| {
        let side = DVec3::new(1.0, x.x, 0.0);
        formulas::common_caps(radius, std::f64::consts::FRAC_PI_2, sun.angle_between(side))
            / formulas::cap(radius)
    });
}
