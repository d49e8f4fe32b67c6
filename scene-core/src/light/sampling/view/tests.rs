//! Points of each kind of light: on the light, and uniform in the measure that V is defined by.

use glam::DVec2;

use super::*;
use crate::light::sampling::{SampleKey, low_discrepancy, stratified};

/// 99.9 % quantile of chi-square with 255 degrees of freedom.
const CHI2_255: f64 = 330.5;
const CELLS: usize = 16;

/// Where a point lies in coordinates that are uniform over [0, 1)² if the point is uniform in the measure of V.
/// Also asserts that it lies on the light, on the side that the receiver sees.
fn coordinates(light: &Light, receiver: Vec3, point: LightPoint) -> DVec2 {
    let turn = |p: DVec2| p.y.atan2(p.x) / std::f64::consts::TAU + 0.5;
    match (*light, point) {
        (Light::Rect { center, half_u, half_v }, LightPoint::At(p)) => {
            let (p, u, v) = ((p.as_dvec3() - center.as_dvec3()), half_u.as_dvec3(), half_v.as_dvec3());
            let normal = u.cross(v);
            let tolerance = ulps(center.length() + half_u.length() + half_v.length());
            assert!(p.dot(normal.normalize()).abs() <= tolerance);
            // Skewed axes too: Cramer's rule in the plane.
            let a = p.cross(v).dot(normal) / normal.length_squared();
            let b = u.cross(p).dot(normal) / normal.length_squared();
            assert!(a.abs() <= 1.0 + 1e-6 && b.abs() <= 1.0 + 1e-6, "{a} {b}");
            DVec2::new(a, b) * 0.5 + 0.5
        }
        (Light::Disk { center, normal, radius }, LightPoint::At(p)) => {
            let p = p.as_dvec3() - center.as_dvec3();
            let w = normal.as_dvec3().normalize();
            assert!(p.dot(w).abs() <= ulps(center.length() + radius));
            let (u, v) = w.any_orthonormal_pair();
            let plane = DVec2::new(p.dot(u), p.dot(v)) / f64::from(radius);
            assert!(plane.length() <= 1.0 + 1e-6);
            DVec2::new(plane.length_squared(), turn(plane))
        }
        (Light::Sphere { center, radius }, LightPoint::At(p)) => {
            let (c, x, p, r) = (center.as_dvec3(), receiver.as_dvec3(), p.as_dvec3(), f64::from(radius));
            assert!((p.distance(c) - r).abs() <= ulps(center.length() + radius), "off the sphere");
            let w = (c - x).normalize();
            let (u, v) = w.any_orthonormal_pair();
            let d = (p - x).normalize();
            let side = DVec2::new(d.dot(u), d.dot(v));
            let distance = c.distance(x);
            let share = if distance > r {
                // The near side: the tangent plane at the point has the receiver above it, within rounding.
                assert!((p - c).dot(x - p) >= -ulps(center.length() + radius) * distance, "the far side");
                // 1 − cos as sin² / (1 + cos), as far spheres would be all rounding otherwise.
                let sin_max = r / distance;
                let height = |sin_squared: f64| sin_squared / (1.0 + (1.0 - sin_squared).max(0.0).sqrt());
                height(side.length_squared()) / height(sin_max * sin_max)
            } else {
                0.5 * (1.0 - d.dot(w))
            };
            DVec2::new(share, turn(side))
        }
        (Light::Directional { direction, angular_radius }, LightPoint::Towards(d)) => {
            let w = -direction.as_dvec3().normalize();
            let (u, v) = w.any_orthonormal_pair();
            let d = d.as_dvec3();
            assert!((d.length() - 1.0).abs() < 2e-7);
            let side = DVec2::new(d.dot(u), d.dot(v));
            let height = |sin_squared: f64| sin_squared / (1.0 + (1.0 - sin_squared).max(0.0).sqrt());
            let sin_max = f64::from(angular_radius).sin();
            DVec2::new(height(side.length_squared()) / height(sin_max * sin_max), turn(side))
        }
        other => panic!("a point of another kind: {other:?}"),
    }
}

/// A few roundings of coordinates of this magnitude.
fn ulps(magnitude: f32) -> f64 {
    8.0 * f64::from(magnitude) * f64::from(f32::EPSILON)
}

fn chi_square(points: impl Iterator<Item = DVec2>) -> f64 {
    let mut counts = [0u32; CELLS * CELLS];
    let mut total = 0;
    for p in points {
        // Rounding may put a point of the rim one cell too far.
        let cell = (p * CELLS as f64).floor().clamp(DVec2::ZERO, DVec2::splat(CELLS as f64 - 1.0));
        counts[cell.y as usize * CELLS + cell.x as usize] += 1;
        total += 1;
    }
    let expected = f64::from(total) / counts.len() as f64;
    counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum()
}

fn extended_lights() -> Vec<(&'static str, Light, Vec3)> {
    let sphere = |center, radius| Light::Sphere { center, radius };
    let sun = |degrees: f32| Light::Directional {
        direction: Vec3::new(1.0, -3.0, 0.5),
        angular_radius: degrees.to_radians(),
    };
    let x = Vec3::new(0.3, -0.2, 0.1);
    vec![
        (
            "skewed rect",
            Light::Rect {
                center: Vec3::new(1.0, 5.0, 2.0),
                half_u: Vec3::new(0.5, 0.1, 0.0),
                half_v: Vec3::new(0.3, 0.0, 2.0),
            },
            x,
        ),
        ("disk", Light::Disk { center: Vec3::Y, normal: Vec3::new(1.0, 2.0, 3.0), radius: 0.7 }, x),
        ("sphere", sphere(Vec3::new(0.0, 3.0, 1.0), 0.8), x),
        ("sphere, a hundred thousand radii away", sphere(Vec3::ZERO, 1.0), Vec3::new(1e5, 2e4, 3e4)),
        ("huge sphere", sphere(Vec3::ZERO, 1e8), Vec3::new(0.0, 3e8, 0.0)),
        ("sphere, close", sphere(Vec3::ZERO, 1.0), Vec3::new(1.001, 0.0, 0.0)),
        ("sphere, inside", sphere(Vec3::ZERO, 1.0), Vec3::new(0.2, -0.5, 0.3)),
        ("sphere, from its middle", sphere(Vec3::ZERO, 1.0), Vec3::new(0.0, -1e-3, 0.0)),
        ("the sun", sun(0.266), x),
        ("a pinprick", sun(0.001), x),
        ("a wide sky", sun(80.0), x),
    ]
}

/// Chi-square of 200,000 random points in 256 cells of equal measure, significance 10⁻³ a light.
#[test]
fn random_points_are_uniform_in_the_measure_of_v() {
    for (name, light, receiver) in extended_lights() {
        let view = LightView::new(&light, receiver);
        let key = SampleKey::new(11, 0);
        let chi2 = chi_square((0..200_000).map(|i| {
            let point = view.point(key.square(i));
            coordinates(&light, receiver, point)
        }));
        assert!(chi2 < CHI2_255, "{name}: {chi2}");
    }
}

/// The same of both patterns over the keys of many pixels. Their points are more even than random ones, so the
/// quantile is an upper bound for them; a bias would still break it.
#[test]
fn patterns_are_uniform_over_pixels() {
    for (name, light, receiver) in extended_lights() {
        let view = LightView::new(&light, receiver);
        for (pattern, count) in [
            (stratified as fn(&_, _, &mut [_]), 13),
            (stratified, 16),
            (low_discrepancy, 16),
            (low_discrepancy, 7),
        ] {
            let mut points = vec![LightPoint::At(Vec3::NAN); count];
            let chi2 = chi_square((0..5000).flat_map(|pixel| {
                pattern(&view, SampleKey::new(2, pixel), &mut points);
                points.iter().map(|&p| coordinates(&light, receiver, p)).collect::<Vec<_>>()
            }));
            assert!(chi2 < CHI2_255, "{name}, {count}: {chi2}");
        }
    }
}

/// The yardstick can fail: area-uniform points on a near sphere are not uniform in solid angle, nor are
/// polar coordinates without the square root uniform on a disk.
#[test]
fn a_wrong_measure_is_noticed() {
    let (center, receiver) = (Vec3::ZERO, Vec3::new(3.0, 0.0, 0.0));
    let sphere = Light::Sphere { center, radius: 1.0 };
    let key = SampleKey::new(11, 0);
    // The cap that the receiver sees reaches up to cos a = 1/3; uniform heights are uniform areas.
    let chi2 = chi_square((0..20_000).map(|i| {
        let p = key.square(i);
        let height = 1.0 - p.x * (2.0 / 3.0);
        let (sin, cos) = (p.y * std::f32::consts::TAU).sin_cos();
        let side = (1.0 - height * height).sqrt();
        coordinates(&sphere, receiver, LightPoint::At(Vec3::new(height, side * cos, side * sin)))
    }));
    assert!(chi2 > 2.0 * CHI2_255, "{chi2}");
    let disk = Light::Disk { center, normal: Vec3::Z, radius: 1.0 };
    let chi2 = chi_square((0..20_000).map(|i| {
        let p = key.square(i);
        let (sin, cos) = (p.y * std::f32::consts::TAU).sin_cos();
        coordinates(&disk, receiver, LightPoint::At(Vec3::new(p.x * cos, p.x * sin, 0.0)))
    }));
    assert!(chi2 > 2.0 * CHI2_255, "{chi2}");
}

/// A fine grid of the square, its rim included, stays on the light; asserted by [`coordinates`].
#[test]
fn the_rim_of_the_square_stays_on_the_light() {
    for (name, light, receiver) in extended_lights() {
        let view = LightView::new(&light, receiver);
        // The share goes with the angle squared; unit vectors in f32 have angles to about an ulp or two.
        let tolerance = match light {
            Light::Directional { angular_radius, .. } => {
                1e-5 + 4.0 * f64::from(f32::EPSILON / angular_radius)
            }
            _ => 1e-5,
        };
        for i in 0..=64 {
            for j in 0..=64 {
                let p = coordinates(&light, receiver, view.point(Vec2::new(i as f32, j as f32) / 64.0));
                assert!(p.is_finite() && p.x < 1.0 + tolerance, "{name}: {p}");
            }
        }
    }
}

#[test]
fn lights_without_extent_have_one_point() {
    let receiver = Vec3::new(1.0, 2.0, 3.0);
    let position = Vec3::new(4.0, 5.0, 6.0);
    for (light, expected) in [
        (Light::Point { position }, LightPoint::At(position)),
        (Light::Spot { position, direction: Vec3::X, outer: 0.5, inner: 0.1 }, LightPoint::At(position)),
        (
            Light::Directional { direction: Vec3::new(0.0, -2.0, 0.0), angular_radius: 0.0 },
            LightPoint::Towards(Vec3::Y),
        ),
    ] {
        let view = LightView::new(&light, receiver);
        assert!(view.is_single());
        assert_eq!(view.point(Vec2::new(0.3, 0.9)), expected);
    }
}

/// Neighbouring points of the square are neighbours on the disk: what keeps strata compact.
#[test]
fn the_concentric_map_is_continuous() {
    let step = 1.0 / 256.0;
    for i in 0..256 {
        for j in 0..256 {
            let p = Vec2::new(i as f32, j as f32) * step;
            let (a, u) = concentric(p);
            assert!((a.length_squared() - u).abs() < 1e-6);
            for next in [Vec2::new(step, 0.0), Vec2::new(0.0, step)] {
                let (b, _) = concentric(p + next);
                // On a ray through the middle the radius grows by 2 a step and the point moves sideways by at most
                // π/4 of that: 2·√(1 + (π/4)²) = 2.54 in all.
                assert!(a.distance(b) < 2.6 * step, "{p}");
            }
        }
    }
}

#[test]
fn broken_input_never_panics() {
    let broken = [f32::NAN, f32::INFINITY, f32::MAX, 0.0, -1.0];
    for value in broken {
        let at = Vec3::splat(value);
        for light in [
            Light::Sphere { center: at, radius: value },
            Light::Sphere { center: Vec3::ZERO, radius: value },
            Light::Disk { center: at, normal: at, radius: value },
            Light::Rect { center: at, half_u: at, half_v: at },
            Light::Directional { direction: at, angular_radius: value },
            Light::Point { position: at },
        ] {
            for receiver in [Vec3::ZERO, at] {
                let view = LightView::new(&light, receiver);
                let mut points = [LightPoint::At(Vec3::ZERO); 5];
                stratified(&view, SampleKey::new(0, 0), &mut points);
                low_discrepancy(&view, SampleKey::new(0, 0), &mut points);
            }
        }
    }
}
