//! Leaving rows of maps out, and lookups before all shadows and of what faces away, never changes an image, bit for bit.

use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::{VisibilityImage, raster, scenes};

#[test]
fn skipping_never_changes_the_image() {
    let mut all_below = 0;
    for spec in ["quads", "ball", "knot", "edges"] {
        let mut setup = scenes::build(spec, 0.0).expect("a built-in scene");
        (setup.camera.width, setup.camera.height) = (96, 72);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let shade = |skip| {
            let params = PdsmParams { views: 9, map_size: 96, pdsm_size: 96, skip, ..Default::default() };
            let (pdsm, report) = Pdsm::new(params).prepare(&setup.scene, &setup.lights[0]);
            let mut image = VisibilityImage::new(setup.camera.width, setup.camera.height);
            let shaded = pdsm.shade(&gbuffer, &mut image);
            (
                image.bits(),
                report.skipped["map rows without casters"],
                shaded.skipped["lookups before all shadows"],
                shaded.skipped["lookups of what faces away"],
            )
        };
        let ((with, rows, lit, below), (without, no_rows, none_lit, none_below)) =
            (shade(true), shade(false));
        assert!(rows > 0 && no_rows == 0, "{spec}: {rows}");
        assert!(lit > 0 && none_lit == 0, "{spec}: {lit}");
        assert!(none_below == 0, "{spec}: {none_below}");
        assert_eq!(with, without, "{spec}");
        all_below += below;
    }
    assert!(all_below > 0);
}
