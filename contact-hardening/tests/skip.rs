//! Skipping changes nothing, whatever the variant, and leaves something out.

use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, Scaling, Variant};
use scene_core::technique::ShadowQuery;
use scene_core::{VisibilityImage, raster, scenes};

#[test]
fn skipping_never_changes_the_image() {
    for scene in ["ball", "fence", "quads", "street", "edges"] {
        let mut setup = scenes::build(scene, 0.0).expect("built in");
        (setup.camera.width, setup.camera.height) = (131, 97);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let query = ShadowQuery { scene: &setup.scene, light: &setup.lights[0], camera: &setup.camera };
        for variant in Variant::ALL {
            for scaling in [Scaling::Physical, Scaling::Paper] {
                let image = |skip: bool| {
                    let params = ContactHardeningParams {
                        variant,
                        scaling,
                        map_size: 512,
                        taps: 16,
                        dilate: 9,
                        skip,
                        ..Default::default()
                    };
                    let (prepared, _) = ContactHardening::new(params).prepare(&query).expect("own map");
                    let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
                    let report = prepared.shade(&setup.camera, &gbuffer, &mut image).expect("sizes match");
                    let bits = image.bits();
                    (bits, report.skipped.values().sum::<u64>())
                };
                let ((with, left_out), (without, none)) = (image(true), image(false));
                let differ = with.iter().zip(&without).filter(|(a, b)| a != b).count();
                assert_eq!(differ, 0, "{scene} {variant:?} {scaling:?}");
                assert_eq!(none, 0);
                assert!(left_out > 0, "{scene} {variant:?} {scaling:?} skips nothing");
            }
        }
    }
}
