//! Windows of what a camera sees: finer where it looks, and what they do not hold stays what it was.

use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::bvh::Bvh;
use scene_core::geometry::Aabb;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::scenes;
use scene_core::{GBuffer, SceneSetup, VisibilityImage, metrics, raster};

const PARAMS: PdsmParams = PdsmParams {
    views: 16,
    map_size: 256,
    pdsm_size: 256,
    cascades: 3,
    max_error: 0.03,
    error_measure: gnomon_pdsm::ErrorMeasure::Visibility,
    segments: gnomon_pdsm::compression::Segments::Greedy,
    bilinear: true,
    filter_radius: 1,
    precision: gnomon_pdsm::Precision::Full,
    only_surfaces: false,
    skip: true,
    seed: 0,
};

fn setup(name: &str) -> (SceneSetup, GBuffer) {
    let mut setup = scenes::build(name, 0.0).expect("a built-in scene");
    (setup.camera.width, setup.camera.height) = (160, 120);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    (setup, gbuffer)
}

/// Where one window of the scene is coarse, those of parts take away more than a third of the error.
#[test]
fn parts_take_away_a_third_of_the_error() {
    for (name, nearer) in [("street", 0.0), ("park", 0.8)] {
        let (mut setup, _) = setup(name);
        setup.camera.eye = setup.camera.eye.lerp(setup.camera.target, nearer);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let (scene, light) = (&setup.scene, &setup.lights[0]);
        let sampling = ReferenceSettings { samples: 256, ..Default::default() };
        let truth =
            reference::reference(scene, &Bvh::casters(scene), light, &gbuffer, &sampling, &no_progress)
                .expect("nobody cancels");
        let valid = reference::valid_pixels(&gbuffer, light);
        let rmse = |camera| {
            let (pdsm, report) = Pdsm::new(PARAMS).prepare_for(scene, light, camera);
            assert_eq!(pdsm.survives_camera(), camera.is_none(), "{name}");
            assert_eq!(report.bytes, pdsm.bytes());
            let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
            pdsm.shade(&gbuffer, &mut image);
            metrics::errors(&image, &truth.visibility, &valid).expect("images of one size").rmse
        };
        let (of_scene, of_view) = (rmse(None), rmse(Some(&setup.camera)));
        println!("{name}: {of_scene:.4}, {of_view:.4}");
        assert!(3.0 * of_view < 2.0 * of_scene, "{name}: {of_view} of {of_scene}");
    }
}

/// Parts keep V at surfaces alone: free points, also those beside a seen surface, are answered as without them.
#[test]
fn free_points_do_not_see_parts() {
    let (setup, gbuffer) = setup("street");
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let seen = Aabb::from_points(
        (0..gbuffer.pixel_count()).filter(|&p| gbuffer.is_seen(p)).map(|p| gbuffer.position[p]),
    );
    let points: Vec<_> = (0..1000u32)
        .map(|i| {
            let share = |prime: u32| (i * prime % 1009) as f32 / 1009.0;
            seen.min + seen.size() * glam::Vec3::new(share(37), share(101), share(499))
        })
        .collect();
    let answers = |camera| {
        let (pdsm, _) = Pdsm::new(PARAMS).prepare_for(scene, light, camera);
        let mut visibility = vec![0.0; points.len()];
        pdsm.visibility_at(&points, &mut visibility);
        visibility
    };
    let of_view = answers(Some(&setup.camera));
    assert_eq!(of_view, answers(None));
    assert!(of_view.iter().any(|&v| v < 0.5) && of_view.iter().any(|&v| v > 0.5));
}

/// A window that shows no more than the scene's is not made: what one window resolves stays for any camera.
#[test]
fn a_scene_that_one_window_resolves_has_no_parts() {
    let (setup, _) = setup("ball");
    let params = PdsmParams { map_size: 512, pdsm_size: 512, views: 2, ..PARAMS };
    let (pdsm, _) = Pdsm::new(params).prepare_for(&setup.scene, &setup.lights[0], Some(&setup.camera));
    assert!(pdsm.survives_camera());
    let none = PdsmParams { cascades: 0, ..PARAMS };
    let (street, _) = self::setup("street");
    let (pdsm, _) = Pdsm::new(none).prepare_for(&street.scene, &street.lights[0], Some(&street.camera));
    assert!(pdsm.survives_camera());
}
