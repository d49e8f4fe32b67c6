//! A camera that goes around a scene, the light crossing its plane: nothing is NaN, and resolution does not jump.

use glam::Vec3;
use gnomon_psm::{Psm, PsmParams, Variant};
use scene_core::{Camera, Light, VisibilityImage, raster, scenes};

/// Mean d of every one of 360 frames.
fn mean_d(variant: Variant, light: &Light) -> Vec<f64> {
    let setup = scenes::build("chess", 0.0).expect("a built-in scene");
    let from_target = setup.camera.eye - setup.camera.target;
    let technique = Psm::new(PsmParams { variant, map_size: 256, ..Default::default() });
    (0..360)
        .map(|degrees| {
            let turn = glam::Quat::from_rotation_y((degrees as f32).to_radians());
            let eye = setup.camera.target + turn * from_target;
            let camera = Camera { eye, ..setup.camera }.with_size(96, 72);
            let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
            let (prepared, _) = technique.prepare(&setup.scene, light, &camera, &gbuffer);
            let mut image = VisibilityImage::new(camera.width, camera.height);
            prepared.shade(&gbuffer, &mut image);
            for (pixel, v) in image.values.iter().enumerate() {
                assert_eq!(
                    v.is_nan(),
                    !gbuffer.is_seen(pixel),
                    "{variant:?}, {degrees}°, pixel {pixel}: {v}"
                );
            }
            let [map] = prepared.maps() else { panic!("{} maps at {degrees}°", prepared.maps().len()) };
            map.view.aliasing.mean
        })
        .collect()
}

/// The largest change of mean d from one frame to the next, as a ratio.
fn largest_change(variant: Variant, light: &Light) -> f64 {
    let d = mean_d(variant, light);
    let change = |i: usize| (d[(i + 1) % 360] / d[i]).ln().abs().exp();
    (0..360).map(change).fold(1.0, f64::max)
}

/// A plain shadow map, fitted to what is seen, changes as the view does; a warped one may not flicker more than that.
#[test]
fn an_orbit_has_no_nan_and_changes_no_faster_than_a_uniform_map() {
    let sun = Light::Directional { direction: Vec3::new(0.6, -0.7, 0.4), angular_radius: 0.0 };
    let lamp = Light::Point { position: Vec3::new(0.4, 0.8, 0.3) };
    for light in [sun, lamp] {
        let uniform = largest_change(Variant::Uniform, &light);
        for variant in [Variant::Auto, Variant::Psm] {
            let largest = largest_change(variant, &light);
            assert!(largest <= uniform, "{variant:?}, {}: {largest}, uniform {uniform}", light.kind());
        }
    }
}
