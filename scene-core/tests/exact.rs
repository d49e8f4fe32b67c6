//! Exact ground truth against points computed by hand.

use glam::Vec3;
use gnomon_scene_core::bvh::Bvh;
use gnomon_scene_core::reference::{ReferenceSettings, exact_reference, no_progress, valid_pixels};
use gnomon_scene_core::{GBuffer, SceneSetup, scenes};

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
/// farthest beyond. If it is so by s, a triangle of legs s/n_x and s/n_z is cut off, less what lies past
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
