//! Leaving out what cannot matter never changes an image, bit for bit, and is counted.

mod truth;

use gnomon_penumbra_wedges::{Casters, PenumbraWedges, Variant, WedgeParams};
use scene_core::{Camera, Light, Report, Scene, VisibilityImage, raster, scenes};
use truth::shade;

/// Images with skipping on and off; the report of the first.
fn compare(scene: &Scene, light: &Light, camera: &Camera, params: WedgeParams) -> Report {
    let (_, with, report) = shade(scene, light, camera, params);
    let (_, without, _) = shade(scene, light, camera, WedgeParams { skip: false, ..params });
    let wrong = with.values.iter().zip(&without.values).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
    assert_eq!(wrong, 0, "{params:?}");
    report
}

#[test]
fn wedges_are_left_out_for_tiles_and_pixels() {
    for (spec, size) in
        [("log-cabin", [96, 72]), ("quads", [96, 72]), ("cylinder", [48, 36]), ("park:leaves=300", [32, 24])]
    {
        let setup = scenes::build(spec, 0.0).expect("built in");
        let camera = setup.camera.with_size(size[0], size[1]);
        for variant in [Variant::Interpolated, Variant::Coverage, Variant::Exact] {
            compare(&setup.scene, &setup.lights[0], &camera, WedgeParams { variant, ..Default::default() });
            // With tiles that are traced, no pixel is asked about a wedge.
            let params = WedgeParams { variant, rays: false, ..Default::default() };
            let report = compare(&setup.scene, &setup.lights[0], &camera, params);
            assert!(report.skipped["wedges outside of a tile"] > 0, "{spec}");
            assert!(report.skipped["pixels outside of a wedge"] > 0, "{spec}");
        }
    }
}

/// A sample on an edge may be counted otherwise than it is traced, so that which pixels are traced must not hang on what is left out.
#[test]
fn the_same_pixels_are_traced() {
    let setup = scenes::build("park:leaves=300", 0.0).expect("built in");
    let camera = setup.camera.with_size(32, 24);
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let casters = Casters::new(&setup.scene).expect("few triangles");
    let [with, without] = [true, false].map(|skip| {
        let params = WedgeParams { skip, views: 16, ..Default::default() };
        let (prepared, _) =
            PenumbraWedges::new(params).prepare(&casters, &setup.lights[0], &camera).expect("in its limits");
        prepared.shade_and_count(&gbuffer, &mut VisibilityImage::new(32, 24)).1
    });
    assert!(with.traced > 0 && with.traced < with.asked, "{with:?}");
    assert_eq!(with.traced, without.traced);
}

#[test]
fn casters_out_of_view_are_left_out() {
    let setup = scenes::build("log-cabin", 0.0).expect("built in");
    let camera = Camera { fov_y: 0.1, ..setup.camera.with_size(48, 36) };
    let report = compare(&setup.scene, &setup.lights[0], &camera, WedgeParams::default());
    assert!(report.skipped["casters outside view"] > 0);
}
