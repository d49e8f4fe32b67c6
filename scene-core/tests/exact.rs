//! Exact ground truth: against samples on the built-in scenes, and against points computed by hand.

use glam::Vec3;
use gnomon_scene_core::bvh::Bvh;
use gnomon_scene_core::reference::{
    ReferenceSettings, exact_reference, no_progress, reference, valid_pixels,
};
use gnomon_scene_core::{GBuffer, Light, SceneSetup, raster, scenes};

const SAMPLES: u32 = 4096;

/// A scene's own light if it is flat, and otherwise a square of its size at its place, turned to the middle of the picture.
fn flat_light(setup: &SceneSetup) -> Light {
    let target = setup.camera.target;
    let away = setup.camera.eye.distance(target);
    let square = |center: Vec3, half: f32| {
        let (u, v) = (target - center).normalize().any_orthonormal_pair();
        Light::Rect { center, half_u: u * half, half_v: v * half }
    };
    match setup.lights[0] {
        light @ (Light::Rect { .. } | Light::Disk { .. }) => light,
        light @ Light::Directional { angular_radius, .. }
            if angular_radius > 0.0 && angular_radius < 0.01 =>
        {
            light
        }
        Light::Sphere { center, radius } => square(center, 0.886 * radius),
        Light::Point { position } | Light::Spot { position, .. } => {
            square(position, 0.05 * position.distance(target))
        }
        Light::Directional { direction, angular_radius } => {
            let half = away * angular_radius.tan().max(0.05);
            square(target - direction.normalize() * away, half)
        }
    }
}

/// Sums over the pixels in penumbra.
#[derive(Debug, Default)]
struct Sums {
    pixels: f64,
    beyond_three: f64,
    differences: f64,
    squares: f64,
    variances: f64,
    squared_variances: f64,
}

/// Exact V against 4,096 samples, pixel by pixel, on every built-in scene.
///
/// With n samples, those that disagree with their pair number x, and their mean λ = n² σ² is n² times the variance of V.
/// Bounds that hold for any mixture of independent samples:
/// - every pixel: by Chernoff √λ ≤ √x + √L but for a chance of e^−L, and by Bernstein (each stratum is off by at most 2)
///   the error times n is at most 2L/3 + √((2L/3)² + 2Lλ) but for 2e^−L; L = 22 leaves 10⁻⁹ a pixel;
/// - at most 2.2 % are off by more than 3 standard errors: where few strata disagree their number, and with it the
///   claimed error, is too low just when V is too low. For a Poisson number the chance is largest near λ = 9, where 3 or
///   fewer disagree in 2.1 % of all cases. Four standard deviations of that count are allowed on top;
/// - squares of errors are on average those claimed, with a standard deviation of √(3 Σσ⁴)/Σσ² (as in the closed
///   forms: 2 of a normal error's square, 1 of the claim);
/// - the mean error is within 4 of its own standard errors and below 10⁻⁴, and these are small enough for that to
///   mean something: 4 of them are no more than 10⁻⁴.
#[test]
fn every_scene_agrees_with_samples() {
    let mut sums = Sums::default();
    for (spec, side) in [
        ("cornell", 64),
        ("quads", 64),
        ("cylinder", 48),
        ("ball", 48),
        ("chess", 32),
        ("fence", 32),
        ("log-cabin", 32),
        ("pool", 24),
        ("street", 32),
        ("park", 20),
        ("forest:triangles=30000", 20),
        ("knot", 40),
        ("layers", 48),
        ("edges", 64),
    ] {
        let mut setup = scenes::build(spec, 0.0).unwrap();
        (setup.camera.width, setup.camera.height) = (side, side);
        let light = flat_light(&setup);
        light.validate().unwrap();
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let casters = Bvh::casters(&setup.scene);
        let settings = ReferenceSettings { samples: SAMPLES, seed: 11, ..Default::default() };
        let sampled = reference(&setup.scene, &casters, &light, &gbuffer, &settings, &no_progress).unwrap();
        let few = ReferenceSettings { samples: 2, ..settings };
        let exact = exact_reference(&setup.scene, &casters, &light, &gbuffer, &few, &no_progress).unwrap();
        let certain = exact.work.exact + exact.work.proved_lit + exact.work.proved_dark;
        assert!(
            certain > 0 && (exact.work.sampled == 0 || setup.scene.has_alpha()),
            "{spec}: {:?}",
            exact.work
        );
        // 256 sides stand for a disk.
        let bound = if matches!(light, Light::Disk { .. }) { 2e-5 } else { 0.0 };
        for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| exact.std_error[pixel] == 0.0) {
            let v = f64::from(exact.visibility.values[pixel]);
            let difference = f64::from(sampled.visibility.values[pixel]) - v;
            let error = f64::from(sampled.std_error[pixel]);
            let n = f64::from(SAMPLES);
            // Of unanimous samples the error is 1/n, as if one disagreed.
            let lambda = (error * n + 22f64.sqrt()).powi(2);
            let third = 2.0 * 22.0 / 3.0;
            let most = if error == 0.0 { 0.0 } else { (third + (third * third + 44.0 * lambda).sqrt()) / n };
            // V is rounded to f32.
            assert!(difference.abs() <= most + bound + 1e-7, "{spec} {pixel}: {difference} ± {error} at {v}");
            if v > 0.0 && v < 1.0 {
                sums.pixels += 1.0;
                sums.beyond_three += f64::from(u8::from(difference.abs() > 3.0 * error + bound));
                sums.differences += difference;
                sums.squares += difference * difference;
                sums.variances += error * error;
                sums.squared_variances += error.powi(4);
            }
        }
    }
    println!("{sums:?}");
    assert!(sums.pixels > 2000.0);
    let expected = 0.022 * sums.pixels;
    assert!(sums.beyond_three <= expected + 4.0 * expected.sqrt(), "{sums:?}");
    let deviation = (3.0 * sums.squared_variances).sqrt() / sums.variances;
    assert!((sums.squares / sums.variances - 1.0).abs() <= 4.0 * deviation, "{sums:?}");
    let (bias, of_bias) = (sums.differences / sums.pixels, sums.variances.sqrt() / sums.pixels);
    assert!(of_bias <= 2.5e-5, "{sums:?}");
    assert!(bias.abs() <= 4.0 * of_bias && bias.abs() <= 1e-4, "{bias} ± {of_bias}");
}

/// V on a horizontal floor of a scene, at places (x, z).
fn on_the_floor(setup: &SceneSetup, places: &[[f32; 2]]) -> Vec<f64> {
    let mut gbuffer = GBuffer::new(places.len() as u32, 1);
    for (pixel, &[x, z]) in places.iter().enumerate() {
        gbuffer.position[pixel] = Vec3::new(x, 0.0, z);
        gbuffer.normal[pixel] = Vec3::Y;
        gbuffer.triangle[pixel] = 0;
        gbuffer.object[pixel] = 0;
    }
    let (light, settings) = (&setup.lights[0], ReferenceSettings::default());
    assert!(valid_pixels(&gbuffer, light).iter().all(|&valid| valid));
    let casters = Bvh::casters(&setup.scene);
    let truth = exact_reference(&setup.scene, &casters, light, &gbuffer, &settings, &no_progress).unwrap();
    truth.visibility.values.iter().map(|&v| f64::from(v)).collect()
}

/// Squares of side 0.9 at heights h under a light of side 1 at height 5. From (x, z) the edge at q of one is seen at
/// x + (q − x)·5/h on the light.
///
/// - (0.5, 0.5), the square at h = 1.6 from 0.3 to 1.2: 5/h = 3.125, its edges are at 0.5 − 0.2·3.125 = −0.125 and at 2.69, beyond
///   the light's own 0.5: 0.625 of the light's width is hidden, and of its depth: V = 1 − 0.625².
/// - (0.25, 0.6), the same: 0.25 + 0.05·3.125 = 0.40625 hides 0.09375; 0.6 − 0.3·3.125 = −0.3375 hides 0.8375.
/// - (−0.45, 0.45), the square at h = 13/12, x from −1.2 to −0.3, z from 0.3 to 1.2: 5/h = 60/13;
///   −0.45 + 0.15·60/13 = 3.15/13 hides 9.65/13 of the width, and by symmetry of the depth.
/// - (0.36, −0.36), the square at h = 17/30: 5/h = 150/17; 0.36 − 0.06·150/17 = −2.88/17 hides 11.38/17 both ways.
/// - (−0.75, −0.75) lies under the middle of the lowest, and from (0, 0) every square is seen beside the light (its edge at
///   0.3·3.125 = 0.94 at least).
#[test]
fn squares_are_as_computed_by_hand() {
    let setup = scenes::build("quads", 0.0).unwrap();
    let places = [[0.5, 0.5], [0.25, 0.6], [-0.45, 0.45], [0.36, -0.36], [-0.75, -0.75], [0.0, 0.0]];
    let expected = [
        1.0 - 0.625 * 0.625,
        1.0 - 0.09375 * 0.8375,
        1.0 - (9.65f64 / 13.0).powi(2),
        1.0 - (11.38f64 / 17.0).powi(2),
        0.0,
        1.0,
    ];
    for ((place, v), expected) in places.iter().zip(on_the_floor(&setup, &places)).zip(expected) {
        assert!((v - expected).abs() < 1e-5, "{place:?}: {v} {expected}");
    }
}

/// Beside the short block of the Cornell box: the edge of its top from (2.40, 2.72) to (2.90, 1.14), at height 1.65, is seen on
/// the light, at 5.487, as a line parallel to it, and all beyond is hidden.
///
/// With n = (1.58, 0.50)/√2.7464 out of that side and d the point's distance from it, the line is where n·q = n·a − d·(k − 1),
/// a an end of the edge, k = 5.487/1.65. Of the light, x from 2.13 to 3.43 and z from 2.27 to 3.32, the corner (2.13, 2.27) is the
/// farthest beyond. If it is so by s, a triangle of legs `s/n_x` and `s/n_z` is cut off, less what lies past
/// the light's far end in z, a triangle of the same shape. The ends of the edge's image lie beyond the light: from 0.7 along it
/// from the origin of its direction, those are 2 and 2.7 away. The tall block is seen beside the light.
#[test]
fn the_cornell_box_is_as_computed_by_hand() {
    let setup = scenes::build("cornell", 0.0).unwrap();
    let length = 2.7464f64.sqrt();
    let (nx, nz) = (1.58 / length, 0.5 / length);
    let at_edge = nx * 2.40 + nz * 2.72;
    let (mut places, mut expected) = (Vec::new(), Vec::new());
    for distance in [0.02, 0.05, 0.1, 0.3] {
        let across = at_edge + distance;
        places.push([(across * nx - 0.7 * nz) as f32, (across * nz + 0.7 * nx) as f32]);
        let line = at_edge - distance * (5.487 / 1.65 - 1.0);
        let beyond = |x: f64, z: f64| (line - nx * x - nz * z).max(0.0);
        let triangle = |s: f64| 0.5 * (s / nx) * (s / nz);
        let hidden = triangle(beyond(2.13, 2.27)) - triangle(beyond(2.13, 3.32));
        expected.push(1.0 - hidden / (1.30 * 1.05));
    }
    assert!(expected[0] < 0.85 && expected[2] < 0.97 && expected[3] == 1.0, "{expected:?}");
    for ((place, v), expected) in places.iter().zip(on_the_floor(&setup, &places)).zip(expected) {
        assert!((v - expected).abs() < 1e-5, "{place:?}: {v} {expected}");
    }
}
