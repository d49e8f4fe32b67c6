//! Areas in closed form: clipped polygons, the lens of two circles, the common part of two spherical caps.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec2;

/// The part of a convex polygon where `height`, linear in the position, is at least 0.
pub(crate) fn clip(polygon: &[DVec2], height: impl Fn(DVec2) -> f64) -> Vec<DVec2> {
    let mut kept = Vec::new();
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (ha, hb) = (height(a), height(b));
        if ha >= 0.0 {
            kept.push(a);
        }
        if (ha >= 0.0) != (hb >= 0.0) {
            kept.push(a.lerp(b, ha / (ha - hb)));
        }
    }
    kept
}

/// Area of a simple polygon of either winding.
pub(crate) fn area(polygon: &[DVec2]) -> f64 {
    let twice =
        (0..polygon.len()).map(|i| polygon[i].perp_dot(polygon[(i + 1) % polygon.len()])).sum::<f64>();
    0.5 * twice.abs()
}

/// Common area of two circles of radii `a` and `b` with their middles `d` apart.
pub(crate) fn lens(a: f64, b: f64, d: f64) -> f64 {
    if d >= a + b {
        return 0.0;
    }
    if d <= (a - b).abs() {
        return PI * a.min(b).powi(2);
    }
    let half_angle = |r: f64, other: f64| ((d * d + r * r - other * other) / (2.0 * d * r)).acos();
    let segment = |r: f64, half: f64| r * r * (half - half.sin() * half.cos());
    segment(a, half_angle(a, b)) + segment(b, half_angle(b, a))
}

/// Solid angle of a cone of half angle `a`.
pub(crate) fn cap(a: f64) -> f64 {
    2.0 * TAU * (0.5 * a).sin().powi(2)
}

/// Solid angle common to two cones of half angles `a` and `b`, at most 90° each, with `c` between their axes.
///
/// By Gauss–Bonnet: a region of the unit sphere has the area 2π less the turns at its corners less the
/// integral of its rim's geodesic curvature, which is cot a along a circle of angular radius a. The two rims
/// meet twice, at equal corners; an arc of a rim that spans the angle 2p at its cone's axis has the
/// length 2p·sin a and so bends by 2p·cos a.
pub(crate) fn common_caps(a: f64, b: f64, c: f64) -> f64 {
    if c >= a + b {
        return 0.0;
    }
    if c <= (a - b).abs() {
        return cap(a.min(b));
    }
    // An angle of the spherical triangle with sides `left` and `right` around it and `opposite` beyond it, by
    // its half's tangent: cosines would lose all digits of small caps.
    let angle = |left: f64, right: f64, opposite: f64| {
        let half = 0.5 * (left + right + opposite);
        let beside = (half - left).sin() * (half - right).sin();
        2.0 * beside.max(0.0).sqrt().atan2((half.sin() * (half - opposite).sin()).max(0.0).sqrt())
    };
    let corner_turn = angle(a, b, c);
    TAU - 2.0 * corner_turn - 2.0 * angle(a, c, b) * a.cos() - 2.0 * angle(b, c, a) * b.cos()
}

#[test]
fn formulas_agree_with_each_other() {
    // Small caps are circles.
    let scale = 1e-3;
    let (flat, curved) = (lens(0.5, 0.6, 0.7), common_caps(0.5 * scale, 0.6 * scale, 0.7 * scale));
    assert!((curved / (scale * scale) - flat).abs() < 1e-5, "{curved} {flat}");
    // A hemisphere through the axis halves a cap; two hemispheres share a lune.
    assert!((common_caps(0.8, FRAC_PI_2, FRAC_PI_2) - 0.5 * cap(0.8)).abs() < 1e-12);
    assert!((common_caps(FRAC_PI_2, FRAC_PI_2, 1.0) - 2.0 * (PI - 1.0)).abs() < 1e-12);
    // Continuous where the cases meet.
    assert!((common_caps(0.5, 0.3, 0.2 + 1e-9) - cap(0.3)).abs() < 1e-8);
    assert!(common_caps(0.5, 0.3, 0.8 - 1e-9) < 1e-8);
    assert!((lens(0.5, 0.3, 0.2 + 1e-9) - PI * 0.09).abs() < 1e-8);
    let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
    assert_eq!(area(&clip(&square, |p| p.x + p.y - 1.5)), 0.125);
    assert_eq!(area(&clip(&square, |p| p.x - 2.0)), 0.0);
}
