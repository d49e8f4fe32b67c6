//! Leaving casters out never changes an image, bit for bit, whatever the view.

mod views;

use gnomon_shadow_map::{ShadowMap, ShadowMapParams};
use scene_core::relevance::CasterChunks;
use scene_core::{Light, Scene, VisibilityImage, raster, scenes};
use views::random_view;

/// Images of `count` random views by maps of all casters and by maps of those that the view needs. Returns how
/// many triangles were left out, of all views together, and how many pixels were in shadow.
fn compare(scene: &Scene, light: &Light, count: u64) -> (u64, usize) {
    let technique = ShadowMap::new(ShadowMapParams { map_size: 256, ..Default::default() });
    let (full, _) = technique.prepare(scene, light);
    let chunks = CasterChunks::new(scene);
    let (mut culled, mut dark) = (0, 0);
    for seed in 0..count {
        let camera = random_view(scene, seed);
        let gbuffer = raster::render_gbuffer(scene, &camera);
        let (part, report) = technique.prepare_for_view(scene, light, &camera, &chunks);
        culled += report.skipped["caster triangles outside view"];
        let mut images = [(); 2].map(|()| VisibilityImage::new(camera.width, camera.height));
        full.shade(&gbuffer, &mut images[0]);
        part.shade(&gbuffer, &mut images[1]);
        let [full, part] = images.map(|i| i.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
        let wrong = full.iter().zip(&part).filter(|(a, b)| a != b).count();
        assert_eq!(wrong, 0, "{light:?}, view {seed}: {camera:?}");
        dark += full.iter().filter(|&&v| v == 0).count();
    }
    (culled, dark)
}

fn compare_scene(spec: &str) {
    let setup = scenes::build(spec, 1.0).expect("a built-in scene");
    let bounds = setup.scene.bounds();
    let inside = bounds.center() + 0.2 * bounds.size();
    let spot = Light::Spot {
        position: inside,
        direction: bounds.center() - inside - glam::Vec3::Y,
        outer: 0.6,
        inner: 0.3,
    };
    for light in [setup.lights[0], Light::Point { position: inside }, spot] {
        let (culled, dark) = compare(&setup.scene, &light, 8);
        assert!(culled > 0 && dark > 0, "{spec}, {light:?}: {culled} left out, {dark} dark pixels");
    }
}

#[test]
fn street() {
    compare_scene("street");
}

#[test]
fn park() {
    compare_scene("park:leaves=2000");
}

#[test]
fn forest() {
    compare_scene("forest:triangles=100000");
}
