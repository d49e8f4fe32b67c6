//! Ground truth against visibility that is known in closed form, with analytic casters.
//!
//! What is compared is statistics over many receivers with fixed seeds, see [`agreement`]; that it can fail is
//! shown by planted faults.

mod formulas;
mod traced;

use glam::{DVec2, DVec3, Vec3};
use gnomon_scene_core::light::LightPoint;
use gnomon_scene_core::light::sampling::SampleKey;
use gnomon_scene_core::reference::{Occlusion, Reference, ReferenceSettings, no_progress, reference};
use gnomon_scene_core::{GBuffer, Light, Scene};

const SAMPLES: u32 = 1024;

/// A caster given by a formula: whether the ray `origin + t·direction`, 0 < t < `end`, meets it.
struct Analytic(Box<dyn Fn(DVec3, DVec3, f64) -> bool + Sync>);

impl Analytic {
    fn new(meets: impl Fn(DVec3, DVec3, f64) -> bool + Sync + 'static) -> Self {
        Self(Box::new(meets))
    }
}

impl Occlusion for Analytic {
    fn occluded_from(&self, origin: Vec3, targets: &[LightPoint], blocked: &mut [bool]) {
        for (target, blocked) in targets.iter().zip(blocked) {
            let (direction, end) = target.ray_from(origin);
            *blocked = (self.0)(origin.as_dvec3(), direction.as_dvec3(), f64::from(end));
        }
    }
}

/// The horizontal plane at `height`, where `inside` holds in (x, z).
fn sheet(height: f64, inside: impl Fn(DVec2) -> bool + Sync + 'static) -> Analytic {
    Analytic::new(move |origin, direction, end| {
        let t = (height - origin.y) / direction.y;
        let hit = origin + t * direction;
        t > 0.0 && t < end && inside(DVec2::new(hit.x, hit.z))
    })
}

fn ball(center: DVec3, radius: f64) -> Analytic {
    Analytic::new(move |origin, direction, end| {
        let nearest = (center - origin).dot(direction) / direction.length_squared();
        nearest > 0.0 && nearest < end && (origin + nearest * direction).distance(center) < radius
    })
}

/// A floor at y = 0 seen from above, at `count` random places of the square |x|, |z| < `half_side`.
fn floor(count: u32, half_side: f32) -> GBuffer {
    let mut gbuffer = GBuffer::new(count, 1);
    for pixel in 0..gbuffer.pixel_count() {
        let place = (SampleKey::new(77, pixel as u64).square(0) * 2.0 - 1.0) * half_side;
        gbuffer.position[pixel] = Vec3::new(place.x, 0.0, place.y);
        gbuffer.normal[pixel] = Vec3::Y;
        gbuffer.triangle[pixel] = 0;
        gbuffer.object[pixel] = 0;
    }
    gbuffer
}

/// What [`agreement`] measured, over the receivers in penumbra.
#[derive(Debug)]
struct Agreement {
    /// Receivers in penumbra.
    penumbra: usize,
    /// Share of them off by more than 3 standard errors.
    beyond_three: f64,
    /// The largest error in standard errors.
    worst: f64,
    /// Mean squared error over mean squared standard error: 1 if calibrated.
    calibration: f64,
    /// Mean error in units of its own standard error.
    bias: f64,
}

/// Holds sampled V against the truth, receiver by receiver.
///
/// - Where the truth is exactly 0 or 1, V is exactly that, and its standard error that of unanimous samples, or 0
///   if it was proved.
/// - At most 2 % of the receivers in penumbra differ by more than 3 standard errors, and none by more than 10. The
///   standard errors are estimates from the 8 or so strata that disagree; by Student's t with 8 degrees of freedom
///   1.7 % would lie beyond 3, and 10⁻⁵ beyond 10.
/// - The squared errors match the squared standard errors on average within 15 %: they are not
///   inflated to pass. Over ≥ 1000 receivers the ratio has a relative standard deviation of at most √(3/1000) = 5.5 %.
/// - The mean error is within 4 of its own standard errors.
fn agreement(
    truth: impl Fn(DVec3) -> f64,
    gbuffer: &GBuffer,
    sampled: &Reference,
) -> Result<Agreement, String> {
    let (mut penumbra, mut beyond, mut worst) = (0usize, 0, 0f64);
    let (mut errors, mut squares, mut variances) = (0.0, 0.0, 0.0);
    for (pixel, position) in gbuffer.position.iter().enumerate() {
        let expected = truth(position.as_dvec3());
        let (v, std_error) =
            (f64::from(sampled.visibility.values[pixel]), f64::from(sampled.std_error[pixel]));
        if expected == 0.0 || expected == 1.0 {
            if v != expected || ![0.0, 1.0 / f64::from(SAMPLES)].contains(&std_error) {
                return Err(format!("V at {position} is {v} ± {std_error}, but must be {expected}"));
            }
            continue;
        }
        let error = v - expected;
        penumbra += 1;
        beyond += usize::from(error.abs() > 3.0 * std_error);
        worst = worst.max(error.abs() / std_error);
        errors += error;
        squares += error * error;
        variances += std_error * std_error;
    }
    let found = Agreement {
        penumbra,
        beyond_three: beyond as f64 / penumbra as f64,
        worst,
        calibration: squares / variances,
        bias: errors / variances.sqrt(),
    };
    let fine = found.penumbra >= 1000
        && found.beyond_three <= 0.02
        && found.worst <= 10.0
        && (found.calibration - 1.0).abs() <= 0.15
        && found.bias.abs() <= 4.0;
    if fine { Ok(found) } else { Err(format!("{found:?}")) }
}

fn sample(scene: &Scene, casters: &impl Occlusion, light: &Light, gbuffer: &GBuffer) -> Reference {
    let settings = ReferenceSettings { samples: SAMPLES, seed: 3, ..Default::default() };
    light.validate().unwrap();
    reference(scene, casters, light, gbuffer, &settings, &no_progress).unwrap()
}

#[track_caller]
fn assert_agreement(
    scene: &Scene,
    casters: &impl Occlusion,
    light: &Light,
    gbuffer: &GBuffer,
    truth: impl Fn(DVec3) -> f64,
) {
    match agreement(truth, gbuffer, &sample(scene, casters, light, gbuffer)) {
        Ok(found) => println!("{found:?}"),
        Err(why) => panic!("{why}"),
    }
}

/// A 1 × 3 light at height 2 over the half-plane x < 0 at height 1: on the light's plane the edge's shadow moves
/// against the receiver at the same speed, so V is linear in x.
#[test]
fn half_plane_under_a_rect_is_linear() {
    let light = Light::Rect { center: Vec3::Y * 2.0, half_u: Vec3::X * 0.5, half_v: Vec3::Z * 1.5 };
    let casters = sheet(1.0, |p| p.x < 0.0);
    assert_agreement(&Scene::new(), &casters, &light, &floor(3000, 0.7), |x| (0.5 + x.x).clamp(0.0, 1.0));
}

/// The same edge across a skewed light: a clipped parallelogram.
#[test]
fn half_plane_under_a_skewed_rect_is_a_clipped_polygon() {
    let light = Light::Rect {
        center: Vec3::Y * 2.0,
        half_u: Vec3::new(0.4, 0.0, 0.2),
        half_v: Vec3::new(0.3, 0.0, -0.6),
    };
    let corners =
        [DVec2::new(0.7, -0.4), DVec2::new(0.1, -0.8), DVec2::new(-0.7, 0.4), DVec2::new(-0.1, 0.8)];
    let casters = sheet(1.0, |p| p.x < 0.0);
    assert_agreement(&Scene::new(), &casters, &light, &floor(3000, 0.8), |x| {
        let seen = formulas::clip(&corners, |p| p.x + x.x);
        formulas::area(&seen) / formulas::area(&corners)
    });
}

/// A turned square at height 1 under a square light at height 3: from the receiver its image on the light's plane
/// is three times as large.
fn square_over_plane() -> (Analytic, Light, impl Fn(DVec3) -> f64) {
    let (turn, half) = (0.5, 0.25);
    let square = sheet(1.0, move |p| DVec2::from_angle(-turn).rotate(p).abs().max_element() < half);
    let light = Light::Rect { center: Vec3::Y * 3.0, half_u: Vec3::X * 0.8, half_v: Vec3::Z * 0.8 };
    let truth = move |x: DVec3| {
        let x = DVec2::new(x.x, x.z);
        let corner = |u: f64, v: f64| x + 3.0 * (DVec2::from_angle(turn).rotate(DVec2::new(u, v) * half) - x);
        let image = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let mut covered = formulas::clip(&image, |p| 0.8 - p.x);
        covered = formulas::clip(&covered, |p| 0.8 + p.x);
        covered = formulas::clip(&covered, |p| 0.8 - p.y);
        covered = formulas::clip(&covered, |p| 0.8 + p.y);
        1.0 - formulas::area(&covered) / (1.6 * 1.6)
    };
    (square, light, truth)
}

#[test]
fn square_under_a_square_is_a_clipped_polygon() {
    let (casters, light, truth) = square_over_plane();
    assert_agreement(&Scene::new(), &casters, &light, &floor(3000, 1.2), truth);
}

/// A disk of radius 0.3 at height 1 under a disk of radius 0.5 at height 2: two circles' lens.
#[test]
fn disk_under_a_disk_is_a_lens() {
    let light = Light::Disk { center: Vec3::Y * 2.0, normal: Vec3::NEG_Y * 3.0, radius: 0.5 };
    let casters = sheet(1.0, |p| p.length() < 0.3);
    assert_agreement(&Scene::new(), &casters, &light, &floor(3000, 1.0), |x| {
        // The caster's image: radius 0.6 about −x.
        1.0 - formulas::lens(0.5, 0.6, x.length()) / (std::f64::consts::PI * 0.25)
    });
}

const BALL: (DVec3, f64) = (DVec3::new(0.0, 1.0, 0.0), 0.35);

/// V of a sphere light for a ball of radius `ball` about [`BALL`]'s middle.
fn ball_truth(x: DVec3, ball: f64, light: DVec3, radius: f64) -> f64 {
    let to_light = light - x;
    let to_ball = BALL.0 - x;
    let (a, b) = ((radius / to_light.length()).asin(), (ball / to_ball.length()).asin());
    1.0 - formulas::common_caps(a, b, to_light.angle_between(to_ball)) / formulas::cap(a)
}

#[test]
fn ball_under_a_sphere_is_two_caps() {
    // A light that outshines the ball, and one that the ball can hide.
    for (radius, reach) in [(0.9, 1.3), (0.4, 1.0)] {
        let light = Light::Sphere { center: Vec3::new(0.0, 3.0, 0.2), radius: radius as f32 };
        let gbuffer = floor(3000, reach);
        assert_agreement(&Scene::new(), &ball(BALL.0, BALL.1), &light, &gbuffer, |x| {
            ball_truth(x, BALL.1, DVec3::new(0.0, 3.0, f64::from(0.2f32)), f64::from(radius as f32))
        });
    }
}

/// The same ball a million times as large under a sphere: nothing in the maths has a length of its own.
#[test]
fn scale_does_not_matter() {
    let scale = 1e6;
    let light = Light::Sphere { center: Vec3::Y * 3.0 * scale, radius: 0.5 * scale };
    let mut gbuffer = floor(3000, 1.0);
    gbuffer.position.iter_mut().for_each(|p| *p *= scale);
    let scale = f64::from(scale);
    assert_agreement(&Scene::new(), &ball(BALL.0 * scale, BALL.1 * scale), &light, &gbuffer, |x| {
        ball_truth(x / scale, BALL.1, DVec3::Y * 3.0, 0.5)
    });
}

/// A straight edge seen from a point is half of a great circle, so V is the share of the sun's cap on one side
/// of it; for a small sun the segment of a circle.
#[test]
fn half_plane_under_the_sun_is_a_segment() {
    for (degrees, half_side) in [(0.266f32, 0.02), (5.0, 0.35), (30.0, 2.5)] {
        let (direction, angular_radius) = (Vec3::new(-0.2, -1.0, 0.3), degrees.to_radians());
        let light = Light::Directional { direction, angular_radius };
        // The edge passes where the sun's middle stands over the origin, with a height of 2.
        let edge = 0.4;
        let casters = sheet(2.0, move |p| p.x < edge);
        let (sun, radius) = (-direction.as_dvec3().normalize(), f64::from(angular_radius));
        let side = |x: DVec3| DVec3::new(2.0, x.x - edge, 0.0).normalize();
        let gbuffer = floor(3000, half_side);
        assert_agreement(&Scene::new(), &casters, &light, &gbuffer, |x| {
            let hemisphere = std::f64::consts::FRAC_PI_2;
            formulas::common_caps(radius, hemisphere, sun.angle_between(side(x))) / formulas::cap(radius)
        });
        if degrees < 1.0 {
            let x = DVec3::new(0.004, 0.0, 0.0);
            let height = (sun.dot(side(x))).asin() / radius;
            let segment =
                1.0 - ((height).acos() - height * (1.0 - height * height).sqrt()) / std::f64::consts::PI;
            let cap = formulas::common_caps(radius, std::f64::consts::FRAC_PI_2, sun.angle_between(side(x)))
                / formulas::cap(radius);
            assert!((segment - cap).abs() < radius * radius, "{segment} {cap}");
        }
    }
}

/// The yardstick can fail: each planted fault is noticed, and the sampled truth without it is not.
#[test]
fn planted_faults_are_noticed() {
    let (casters, light, truth) = square_over_plane();
    let gbuffer = floor(3000, 1.2);
    let honest = sample(&Scene::new(), &casters, &light, &gbuffer);
    assert!(agreement(&truth, &gbuffer, &honest).is_ok());

    let spoiled = |spoil: &dyn Fn(&mut f32, &mut f32)| {
        let mut spoiled = honest.clone();
        for (v, e) in spoiled.visibility.values.iter_mut().zip(&mut spoiled.std_error) {
            spoil(v, e);
        }
        agreement(&truth, &gbuffer, &spoiled)
    };
    let partly = |v: f32| v > 0.0 && v < 1.0;
    assert!(
        spoiled(&|v, _| if partly(*v) {
            *v += 0.001;
        })
        .is_err(),
        "a bias of 0.001"
    );
    assert!(spoiled(&|_, e| *e *= 0.9).is_err(), "errors understated by a tenth");
    assert!(spoiled(&|_, e| *e *= 1.1).is_err(), "errors overstated by a tenth");
    assert!(spoiled(&|v, _| *v = 1.0 - *v).is_err(), "inverted");
    assert!(
        spoiled(&|v, _| if *v == 1.0 {
            *v = 0.999;
        })
        .is_err(),
        "lit pixels not quite lit"
    );
    assert!(spoiled(&|v, _| *v = f32::NAN).is_err(), "no values at all");

    // Light, caster and measure wrong by a per cent or so.
    let larger = Light::Rect { center: Vec3::Y * 3.0, half_u: Vec3::X * 0.81, half_v: Vec3::Z * 0.8 };
    assert!(agreement(&truth, &gbuffer, &sample(&Scene::new(), &casters, &larger, &gbuffer)).is_err());
    let higher = sheet(1.01, |p| DVec2::from_angle(-0.5).rotate(p).abs().max_element() < 0.25);
    assert!(agreement(&truth, &gbuffer, &sample(&Scene::new(), &higher, &light, &gbuffer)).is_err());
    let wide = |x: DVec3| ball_truth(x, BALL.1, DVec3::Y * 3.0, 0.9);
    let disk = Light::Disk { center: Vec3::Y * 3.0, normal: Vec3::Y, radius: 0.9 };
    let gbuffer = floor(3000, 1.3);
    assert!(
        agreement(wide, &gbuffer, &sample(&Scene::new(), &ball(BALL.0, BALL.1), &disk, &gbuffer)).is_err()
    );
}
