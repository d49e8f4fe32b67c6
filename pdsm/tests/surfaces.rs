//! Keeping V at surfaces alone, and in 16 bits: images that differ by the stated error at most.

use gnomon_pdsm::{Pdsm, PdsmParams, Precision};
use scene_core::{VisibilityImage, raster, scenes};

/// The image, and how many nodes it took in how many words.
fn image(name: &str, params: PdsmParams) -> (VisibilityImage, usize, usize) {
    let mut setup = scenes::build(name, 0.0).expect("a built-in scene");
    (setup.camera.width, setup.camera.height) = (160, 120);
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let (pdsm, _) = Pdsm::new(params).prepare(&setup.scene, &setup.lights[0]);
    let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
    pdsm.shade(&gbuffer, &mut image);
    let nodes = || pdsm.windows().iter().map(|window| window.functions.nodes());
    (image, nodes().map(|nodes| nodes.len()).sum(), nodes().map(|nodes| nodes.words().len()).sum())
}

fn largest_difference(a: &VisibilityImage, b: &VisibilityImage) -> f32 {
    let pairs = a.values.iter().zip(&b.values).filter(|(a, _)| !a.is_nan());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Without an error bound functions are exact where they are kept: the same V, but for steps that rounding of a depth
/// passes.
#[test]
fn surfaces_alone_make_the_same_image_of_fewer_nodes() {
    for name in ["quads", "ball", "cylinder", "knot", "park", "cornell"] {
        let exact =
            PdsmParams { views: 16, map_size: 128, pdsm_size: 128, max_error: 0.0, ..Default::default() };
        let (all, nodes, _) = image(name, exact);
        let (kept, fewer, _) = image(name, PdsmParams { only_surfaces: true, ..exact });
        println!("{name}: {nodes} nodes, {fewer} at surfaces");
        assert_eq!(largest_difference(&all, &kept), 0.0, "{name}");
        assert!(fewer < nodes, "{name}: {fewer} of {nodes}");
        let wide = PdsmParams { filter_radius: 3, ..exact };
        let (all_wide, ..) = image(name, wide);
        let (kept, ..) = image(name, PdsmParams { only_surfaces: true, ..wide });
        assert_eq!(largest_difference(&all_wide, &kept), 0.0, "{name}, wide");
        let bound = 0.03;
        let (kept, _, _) = image(name, PdsmParams { only_surfaces: true, max_error: bound, ..exact });
        assert!(largest_difference(&all, &kept) <= bound + 1e-5, "{name}");
    }
}

/// 16 bits halve the nodes' memory. Depth is read earlier by a step at most: where a surface lies in a step of V that
/// changes it by that step, so that the bound holds for all but a few pixels.
#[test]
fn half_precision_changes_few_pixels() {
    for name in ["quads", "ball", "knot"] {
        let full =
            PdsmParams { views: 16, map_size: 128, pdsm_size: 128, max_error: 0.02, ..Default::default() };
        let (a, _, words) = image(name, full);
        let (b, _, fewer) = image(name, PdsmParams { precision: Precision::Half, ..full });
        assert_eq!(fewer, words / 2, "{name}");
        let seen = a.values.iter().filter(|v| !v.is_nan()).count();
        let pairs = a.values.iter().zip(&b.values);
        let differ = pairs.filter(|(a, b)| (*a - *b).abs() > 1.0 / 255.0).count();
        println!("{name}: {differ} of {seen} pixels differ by more than 1/255");
        assert!(differ * 200 <= seen, "{name}: {differ} of {seen}");
    }
}
