//! From the second frame on nothing is made that the first has made: no pipeline, no layout of bind groups.

#![cfg(feature = "gpu")]

use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::{Kernel, ShadowMapParams, Variant};
use scene_core::gpu::headless::VISIBILITY_FORMAT;
use scene_core::gpu::testing::{self, pipelines_and_layouts_made};
use scene_core::{Light, raster, scenes};

const VARIANTS: [(Variant, Kernel); 9] = [
    (Variant::Hard, Kernel::Grid),
    (Variant::Pcf, Kernel::Grid),
    (Variant::Pcf, Kernel::PoissonDisk),
    (Variant::ObjectId, Kernel::Grid),
    (Variant::Pcss, Kernel::Grid),
    (Variant::Moments, Kernel::Grid),
    (Variant::Cascaded, Kernel::Grid),
    (Variant::MultiView, Kernel::Grid),
    (Variant::AliasFree, Kernel::Grid),
];

#[test]
fn frames_reuse_pipelines_and_layouts() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("fence", 0.0).unwrap();
    let (center, size) = (setup.scene.bounds().center(), setup.scene.bounds().size());
    let sun = |x| Light::Directional { direction: glam::Vec3::new(x, -1.0, 0.2), angular_radius: 0.01 };
    let sphere = |height| Light::Sphere { center: center + height * size, radius: 0.01 * size.max_element() };
    // A light of the other kind, in the scene and beside it, moving; the first kind again.
    let lights = [
        sun(0.3),
        sun(0.3),
        Light::Point { position: center },
        sphere(0.9),
        sphere(0.8),
        sun(0.4),
        Light::Point { position: center + 0.7 * size },
    ];
    let camera = setup.camera.with_size(24, 16);
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let mut view = gpu.view(&setup.scene, &camera).unwrap();
    view.upload_gbuffer(&gbuffer).unwrap();
    for (variant, kernel) in VARIANTS {
        for view_dependent in [false, true] {
            let params = ShadowMapParams {
                variant,
                kernel,
                view_dependent,
                map_size: 32,
                views: 2,
                taps: 4,
                ..Default::default()
            };
            let start = pipelines_and_layouts_made();
            let mut technique = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT).unwrap();
            let made = pipelines_and_layouts_made();
            // The counter counts: what is drawn with was made, and is all made here.
            assert!(made[0] >= start[0] + 2 && made[1] >= start[1] + 3, "{variant:?}: {start:?}, {made:?}");
            for (frame, light) in lights.iter().enumerate() {
                view.run(&mut technique, light, &gbuffer).unwrap();
                assert_eq!(pipelines_and_layouts_made(), made, "{variant:?}, {kernel:?}, frame {frame}");
            }
        }
    }
}

#[test]
fn the_gbuffer_is_drawn_with_the_same_pipelines_again() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = scenes::build("ball", 0.0).unwrap();
    let camera = setup.camera.with_size(24, 16);
    let mut view = gpu.view(&setup.scene, &camera).unwrap();
    let start = pipelines_and_layouts_made();
    let (first, _) = view.draw_gbuffer().unwrap();
    let made = pipelines_and_layouts_made();
    assert!(made[0] == start[0] + 2, "{start:?}, {made:?}");
    let (second, _) = view.draw_gbuffer().unwrap();
    assert_eq!(pipelines_and_layouts_made(), made);
    assert_eq!(first.triangle, second.triangle);
}
