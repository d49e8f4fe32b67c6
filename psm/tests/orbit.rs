//! A camera that goes around a scene, the light crossing its plane: nothing is NaN, and error does not jump.

use glam::Vec3;
use gnomon_psm::{Psm, PsmParams, Variant};
use rayon::prelude::*;
use scene_core::bvh::Bvh;
use scene_core::reference::{ReferenceSettings, no_progress, reference, valid_pixels};
use scene_core::{Camera, Light, VisibilityImage, raster, scenes};

/// Shares of valid pixels that the variants get wrong in each of 360 frames.
fn errors(variants: [Variant; 3], light: &Light) -> [Vec<f64>; 3] {
    let setup = scenes::build("chess", 0.0).expect("a built-in scene");
    let from_target = setup.camera.eye - setup.camera.target;
    let casters = Bvh::casters(&setup.scene);
    let frames: Vec<[f64; 3]> = (0..360)
        .into_par_iter()
        .map(|degrees| {
            let turn = glam::Quat::from_rotation_y((degrees as f32).to_radians());
            let eye = setup.camera.target + turn * from_target;
            let camera = Camera { eye, ..setup.camera }.with_size(240, 180);
            let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
            let settings = ReferenceSettings::default();
            let truth = reference(&setup.scene, &casters, light, &gbuffer, &settings, &no_progress)
                .expect("nobody cancels")
                .visibility;
            let valid = valid_pixels(&gbuffer, light);
            variants.map(|variant| {
                let technique = Psm::new(PsmParams { variant, map_size: 256, ..Default::default() });
                let (prepared, _) = technique.prepare(&setup.scene, light, &camera, &gbuffer);
                let mut image = VisibilityImage::new(camera.width, camera.height);
                prepared.shade(&gbuffer, &mut image);
                let (mut wrong, mut compared) = (0, 0);
                for (pixel, v) in image.values.iter().enumerate() {
                    assert_eq!(v.is_nan(), !gbuffer.is_seen(pixel), "{variant:?}, {degrees}°, {pixel}: {v}");
                    compared += usize::from(valid[pixel]);
                    wrong += usize::from(valid[pixel] && (v - truth.values[pixel]).abs() > 0.5);
                }
                wrong as f64 / compared as f64
            })
        })
        .collect();
    [0, 1, 2].map(|i| frames.iter().map(|frame| frame[i]).collect())
}

/// Changes of error from one frame to the next: the largest and the median.
fn changes(errors: &[f64]) -> [f64; 2] {
    let change = |i: usize| (errors[(i + 1) % errors.len()] - errors[i]).abs();
    let mut changes: Vec<f64> = (0..errors.len()).map(change).collect();
    changes.sort_by(f64::total_cmp);
    [changes[changes.len() - 1], changes[changes.len() / 2]]
}

/// A uniform map that is fitted to what is seen changes as the view does, and where edges fall in its texels is chance in every
/// frame: a warped map, and one that may be warped or not, jumps no farther than that.
#[test]
fn an_orbit_has_no_nan_and_error_jumps_no_farther_than_with_a_uniform_map() {
    let sun = Light::Directional { direction: Vec3::new(0.6, -0.7, 0.4), angular_radius: 0.0 };
    let lamp = Light::Point { position: Vec3::new(0.4, 0.8, 0.3) };
    for light in [sun, lamp] {
        let [uniform, auto, psm] = errors([Variant::Uniform, Variant::Auto, Variant::Psm], &light);
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        let [limit, _] = changes(&uniform);
        for (name, errors) in [("uniform", &uniform), ("auto", &auto), ("psm", &psm)] {
            let [largest, median] = changes(errors);
            println!(
                "{}, {name}: mean {:.5}, change median {median:.5}, largest {largest:.5} = {:.1} medians",
                light.kind(),
                mean(errors),
                largest / median
            );
            assert!(largest <= limit, "{}, {name}: {largest}, uniform {limit}", light.kind());
        }
        assert!(mean(&auto) < mean(&uniform), "{}", light.kind());
    }
}
