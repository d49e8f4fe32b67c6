//! Shadows that are known in closed form.

mod truth;

use glam::Vec3;
use gnomon_penumbra_wedges::{Variant, WedgeParams};
use scene_core::light::LightPoint;
use scene_core::{Camera, Light, Scene};
use truth::{camera, cube, rmse, scene_of, shade, sheet};

/// A floor under a half-plane at height 1 that ends at x = 0 and begins out of sight.
fn half_plane() -> (Scene, Camera) {
    let scene = scene_of(&[sheet(0.0, [-4.0, -4.0], [4.0, 4.0]), sheet(1.0, [-400.0, -400.0], [0.0, 400.0])]);
    // From the side, between floor and half-plane.
    (scene, camera(Vec3::new(0.6, 0.8, 3.5), Vec3::new(0.0, 0.0, 0.0), 160, 120))
}

/// The largest difference to `expected`, over pixels of the floor, and how many are in penumbra.
fn largest_error(light: &Light, params: WedgeParams, expected: impl Fn(Vec3) -> f64) -> (f64, usize) {
    let (scene, camera) = half_plane();
    let (gbuffer, visibility, _) = shade(&scene, light, &camera, params);
    let (mut worst, mut penumbra) = (0.0_f64, 0);
    for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.object[pixel] == 0) {
        let expected = expected(gbuffer.position[pixel]);
        worst = worst.max((f64::from(visibility.values[pixel]) - expected).abs());
        penumbra += usize::from(expected > 0.0 && expected < 1.0);
    }
    (worst, penumbra)
}

/// A receiver at x sees the edge at −x of the light's plane, at height 2.
#[test]
fn half_plane_under_a_rect_is_a_linear_ramp() {
    let light = Light::Rect {
        center: Vec3::new(0.0, 2.0, 0.0),
        half_u: Vec3::new(0.5, 0.0, 0.0),
        half_v: Vec3::new(0.0, 0.0, 0.3),
    };
    for variant in [Variant::Coverage, Variant::Exact] {
        let params = WedgeParams { variant, ..Default::default() };
        let (worst, penumbra) = largest_error(&light, params, |p| (0.5 + f64::from(p.x)).clamp(0.0, 1.0));
        assert!(penumbra > 2000, "{penumbra}");
        // Of 256 samples one lies in each 256th of the width.
        assert!(worst <= 1.0 / 255.0, "{variant:?}: {worst}");
    }
}

/// The share of the solid angle of a cap beyond a plane through the receiver at the angle `offset` from the cap's middle, by
/// rings of equal solid angle.
fn cap_beyond(angle: f64, offset: f64) -> f64 {
    const RINGS: u32 = 4000;
    let height = 1.0 - angle.cos();
    let ring = |i: u32| {
        let cos = 1.0 - height * (f64::from(i) + 0.5) / f64::from(RINGS);
        // At azimuth φ the direction is beyond if tan t · cos φ > tan offset.
        let ratio = offset.tan() * cos / (1.0 - cos * cos).sqrt();
        ratio.clamp(-1.0, 1.0).acos() / std::f64::consts::PI
    };
    (0..RINGS).map(ring).sum::<f64>() / f64::from(RINGS)
}

#[test]
fn half_plane_under_a_ball_is_a_part_of_a_cap() {
    let (center, radius) = (Vec3::new(0.0, 2.0, 0.0), 0.5_f32);
    let light = Light::Sphere { center, radius };
    // The visible side of the plane through receiver and edge: its normal is (y, −x) of the way to the edge.
    let expected = |p: Vec3| {
        let (p, c) = (p.as_dvec3(), center.as_dvec3());
        let to_middle = (c - p).normalize();
        let normal = glam::DVec3::new(1.0, p.x, 0.0).normalize();
        cap_beyond((f64::from(radius) / c.distance(p)).asin(), -normal.dot(to_middle).asin())
    };
    for (variant, views) in [(Variant::Coverage, 1), (Variant::Exact, 4096)] {
        let params = WedgeParams { variant, views, ..Default::default() };
        let (worst, penumbra) = largest_error(&light, params, expected);
        assert!(penumbra > 2000, "{penumbra}");
        assert!(worst <= 1.0 / 255.0, "{variant:?}: {worst}");
    }
}

fn lights(at: Vec3) -> [Light; 4] {
    [
        Light::Rect { center: at, half_u: Vec3::new(0.6, 0.0, 0.1), half_v: Vec3::new(0.1, 0.1, -0.4) },
        Light::Disk { center: at, normal: Vec3::new(-0.2, 1.0, 0.1), radius: 0.6 },
        Light::Sphere { center: at, radius: 0.6 },
        Light::Directional { direction: -at, angular_radius: 0.1 },
    ]
}

#[test]
fn a_single_convex_caster_is_right() {
    let floor = sheet(0.0, [-5.0, -5.0], [5.0, 5.0]);
    let view = camera(Vec3::new(1.5, 4.0, 6.0), Vec3::new(0.0, 0.4, 0.0), 128, 96);
    let ball = scene_core::scenes::build("ball", 0.0).expect("built in");
    for light in lights(Vec3::new(-1.0, 5.0, 1.0)) {
        let scene = scene_of(&[floor.clone(), cube(Vec3::new(0.0, 1.0, 0.0), 0.5)]);
        let errors = rmse(&scene, &light, &view, &[Variant::Coverage, Variant::Exact], 1024);
        println!("cube, {}: coverage {:.5}, exact {:.5}", light.kind(), errors[0], errors[1]);
        assert!(errors.iter().all(|&e| e < 0.01), "{light:?}: {errors:?}");
    }
    let view = ball.camera.with_size(128, 96);
    let LightPoint::At(at) = ball.lights[0].center() else { panic!("the ball's light is at a place") };
    for light in lights(at).into_iter().chain([ball.lights[0]]) {
        let errors = rmse(&ball.scene, &light, &view, &[Variant::Coverage, Variant::Exact], 1024);
        println!("ball, {}: coverage {:.5}, exact {:.5}", light.kind(), errors[0], errors[1]);
        assert!(errors.iter().all(|&e| e < 0.01), "{light:?}: {errors:?}");
    }
}

/// A smaller and smaller light comes down to the hard shadow of its middle, in proportion to its size.
#[test]
fn a_light_without_size_throws_the_hard_shadow() {
    let scene = scene_of(&[sheet(0.0, [-5.0, -5.0], [5.0, 5.0]), cube(Vec3::new(0.0, 1.0, 0.0), 0.5)]);
    let view = camera(Vec3::new(1.5, 4.0, 6.0), Vec3::new(0.0, 0.4, 0.0), 160, 120);
    let center = Vec3::new(-1.0, 5.0, 1.0);
    let (_, hard, _) = shade(&scene, &Light::Point { position: center }, &view, WedgeParams::default());
    for variant in [Variant::Interpolated, Variant::Coverage, Variant::Exact] {
        let mut last = f64::INFINITY;
        for radius in [0.4, 0.1, 0.025, 1e-6] {
            let light = Light::Sphere { center, radius };
            let params = WedgeParams { variant, ..Default::default() };
            let (_, soft, _) = shade(&scene, &light, &view, params);
            let seen = hard.values.iter().zip(&soft.values).filter(|(hard, _)| !hard.is_nan());
            let (sum, count) = seen
                .fold((0.0, 0.0), |(sum, n), (hard, soft)| (sum + f64::from((hard - soft).abs()), n + 1.0));
            let mean = sum / count;
            assert!(mean < last * 0.5, "{variant:?}, radius {radius}: {mean} after {last}");
            last = mean;
        }
        // Not a pixel is as close to the border as a light of a micron is wide.
        assert_eq!(last, 0.0, "{variant:?}");
    }
}
