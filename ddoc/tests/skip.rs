//! Skipping changes nothing, whatever the variant, and leaves something out.

use gnomon_ddoc::{Ddoc, DdocParams, Variant};
use scene_core::{VisibilityImage, raster, scenes};

#[test]
fn skipping_never_changes_the_image() {
    for scene in ["ball", "fence", "quads", "cornell"] {
        let mut setup = scenes::build(scene, 0.0).expect("built in");
        (setup.camera.width, setup.camera.height) = (131, 97);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        for variant in Variant::ALL {
            let image = |skip: bool| {
                let params = DdocParams { variant, map_size: 256, taps: 16, skip, ..Default::default() };
                let (prepared, _) =
                    Ddoc::new(params).prepare(&setup.scene, &setup.lights[0]).expect("few triangles");
                let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
                let report = prepared.shade(&gbuffer, &mut image);
                let bits: Vec<u32> = image.values.iter().map(|v| v.to_bits()).collect();
                (bits, report.skipped.values().sum::<u64>())
            };
            let ((with, left_out), (without, none)) = (image(true), image(false));
            let differ = with.iter().zip(&without).filter(|(a, b)| a != b).count();
            assert_eq!(differ, 0, "{scene} {variant:?}");
            assert_eq!(none, 0);
            assert!(left_out > 0, "{scene} {variant:?} skips nothing");
        }
    }
}
