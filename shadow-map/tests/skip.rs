//! Leaving casters out never changes an image, bit for bit, whatever the view.

mod views;

use glam::Vec3;
use gnomon_shadow_map::{Kernel, ShadowMap, ShadowMapParams, Variant};
use scene_core::relevance::CasterChunks;
use scene_core::{Camera, Light, Scene, VisibilityImage, raster, scenes};
use views::random_view;

/// All but those that choose what they draw while they shade.
const VARIANTS: [Variant; 5] =
    [Variant::Hard, Variant::Pcf, Variant::ObjectId, Variant::Moments, Variant::Pcss];

/// Images of `count` random views by maps of all casters and by maps of those that the view needs. Returns how
/// many triangles were left out, of all views together, and how many pixels were in shadow.
fn compare(scene: &Scene, light: &Light, params: ShadowMapParams, count: u64) -> (u64, usize) {
    let technique = ShadowMap::new(ShadowMapParams { map_size: 256, ..params });
    let without = ShadowMapParams { map_size: 256, skip: false, ..params };
    let (full, _) = ShadowMap::new(without).prepare(scene, light);
    let chunks = CasterChunks::new(scene);
    let (mut culled, mut dark) = (0, 0);
    for seed in 0..count {
        let camera = random_view(scene, seed);
        let gbuffer = raster::render_gbuffer(scene, &camera);
        let (part, report) = technique.prepare_for_view(scene, light, &camera, &chunks);
        culled += report.skipped.get("caster triangles outside view").copied().unwrap_or(0);
        let mut images = [(); 2].map(|()| VisibilityImage::new(camera.width, camera.height));
        full.shade(&gbuffer, &mut images[0]);
        part.shade(&gbuffer, &mut images[1]);
        // Points that the camera does not see have some answer.
        let mut free = [f32::NAN; 8];
        part.visibility_at(&scene.bounds().corners(), &mut free);
        assert!(free.iter().all(|v| (0.0..=1.0).contains(v)), "{:?}, {light:?}: {free:?}", params.variant);
        let [full, part] = images.map(|i| i.bits());
        let wrong = full.iter().zip(&part).filter(|(a, b)| a != b).count();
        assert_eq!(wrong, 0, "{:?}, {light:?}, view {seed}: {camera:?}", params.variant);
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
        direction: bounds.center() - inside - Vec3::Y,
        outer: 0.6,
        inner: 0.3,
    };
    let lamp = Light::Sphere { center: inside, radius: 0.01 * bounds.diagonal() };
    for light in [setup.lights[0], Light::Point { position: inside }, spot, lamp] {
        for variant in VARIANTS {
            let params = ShadowMapParams { variant, taps: 16, ..Default::default() };
            let (culled, dark) = compare(&setup.scene, &light, params, 8);
            // `pcss` reads a lone map all over where cones open towards a lamp, and all faces where casters are near it.
            let has_bound = variant != Variant::Pcss
                || matches!(light, Light::Directional { .. } | Light::Point { .. } | Light::Spot { .. });
            let is_shown = dark > 0 || variant == Variant::Moments;
            assert!(
                (culled > 0 || !has_bound) && is_shown,
                "{spec}, {variant:?}, {light:?}: {culled} left out, {dark} dark pixels"
            );
        }
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

/// A lamp in the middle of what a narrow camera sees a part of: faces that look elsewhere are not drawn, filters or not.
#[test]
fn faces_that_nobody_sees_are_not_drawn() {
    let setup = scenes::build("forest:triangles=20000", 0.0).expect("a built-in scene");
    let camera = Camera { fov_y: 0.1, ..setup.camera.with_size(64, 64) };
    let center = setup.scene.bounds().center();
    let chunks = CasterChunks::new(&setup.scene);
    let lamp = Light::Sphere { center, radius: 0.002 };
    let point = Light::Point { position: center };
    for (variant, light) in
        VARIANTS.map(|variant| (variant, point)).into_iter().chain([(Variant::Pcss, lamp)])
    {
        let technique = ShadowMap::new(ShadowMapParams { map_size: 256, variant, ..Default::default() });
        let (maps, report) = technique.prepare_for_view(&setup.scene, &light, &camera, &chunks);
        let drawn = maps.maps().iter().filter(|map| map.map.depth.iter().any(|&depth| depth > 0.0)).count();
        let skipped = report.skipped["faces"] + report.skipped["undrawn faces"];
        assert!(drawn < 6 && skipped > 0 && drawn as u64 + skipped <= 6, "{variant:?}: {drawn} {report:?}");
        let (all, report) = technique.prepare(&setup.scene, &light);
        let drawn_all = all.maps().iter().filter(|map| map.map.depth.iter().any(|&d| d > 0.0)).count();
        assert!(drawn_all > drawn, "{variant:?}: {drawn_all} {report:?}");
    }
    // Near the lamp and far from it, whatever is seen.
    let params = ShadowMapParams { variant: Variant::Pcss, taps: 16, ..Default::default() };
    let (culled, dark) = compare(&setup.scene, &lamp, params, 24);
    assert!(culled > 0 && dark > 0, "{culled} left out, {dark} dark pixels");
}

/// Texels much larger than pixels, so that tiles ask about the same ones: any width of a filter, also under a lamp from all sides.
#[test]
fn coarse_maps_are_looked_up_together() {
    let (mut known, mut shaded) = ([0; 3], 0);
    for spec in ["forest:triangles=20000", "street", "layers", "edges", "chess", "log-cabin", "knot"] {
        let setup = scenes::build(spec, 0.0).expect("a built-in scene");
        let (scene, bounds) = (&setup.scene, setup.scene.bounds());
        let lamp = Light::Point { position: bounds.center() + 0.2 * bounds.size() };
        let views = (0..5).map(|seed| random_view(scene, seed)).chain([setup.camera.with_size(90, 70)]);
        let gbuffers: Vec<_> = views.map(|camera| raster::render_gbuffer(scene, &camera)).collect();
        for (light, filter) in [(setup.lights[0], 5), (setup.lights[0], 2), (lamp, 3), (lamp, 1)] {
            let cases = [
                (Variant::Hard, Kernel::Grid),
                (Variant::Pcf, Kernel::Grid),
                (Variant::Pcf, Kernel::PoissonDisk),
                (Variant::ObjectId, Kernel::Grid),
                (Variant::Moments, Kernel::Grid),
            ];
            for (variant, kernel) in cases {
                let params =
                    ShadowMapParams { variant, kernel, filter, map_size: 48, taps: 12, ..Default::default() };
                let without = ShadowMapParams { skip: false, ..params };
                let [(on, _), (off, _)] =
                    [params, without].map(|params| ShadowMap::new(params).prepare(scene, &light));
                for gbuffer in &gbuffers {
                    let mut images = [(); 2].map(|()| VisibilityImage::new(gbuffer.width, gbuffer.height));
                    let report = on.shade(gbuffer, &mut images[0]);
                    off.shade(gbuffer, &mut images[1]);
                    let [a, b] = images.map(|i| i.bits());
                    let wrong = a.iter().zip(&b).filter(|(a, b)| a != b).count();
                    assert_eq!(wrong, 0, "{spec}, {light:?}, {params:?}");
                    let skipped = |what| report.skipped.get(what).copied().unwrap_or(0);
                    match variant {
                        Variant::Hard => known[0] += skipped("lookups"),
                        Variant::Pcf => known[1] += skipped("filters"),
                        _ => known[2] += skipped("filters"),
                    }
                    shaded += gbuffer.pixel_count() as u64;
                }
            }
        }
    }
    println!("{known:?} of {shaded} pixels known from tables");
    assert!(known.iter().all(|&known| known * 40 > shaded), "{known:?} of {shaded}");
}

/// A step from hilly ground under trees: texels wider than a tile, and ground beside ground that is flat but for a little.
#[test]
fn ground_seen_close_up() {
    let setup = scenes::build("forest:triangles=100000", 0.0).expect("a built-in scene");
    let camera = Camera {
        eye: Vec3::new(2.0, 1.7, 1.0),
        target: Vec3::new(2.8, 0.0, 0.2),
        fov_y: 0.7,
        ..setup.camera.with_size(256, 256)
    };
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    for (variant, map_size) in [(Variant::Pcf, 1024), (Variant::Pcf, 256), (Variant::ObjectId, 512)] {
        let params = ShadowMapParams { variant, map_size, ..Default::default() };
        let [on, off] = [true, false].map(|skip| {
            let technique = ShadowMap::new(ShadowMapParams { skip, ..params });
            let (maps, _) = technique.prepare(&setup.scene, &setup.lights[0]);
            let mut image = VisibilityImage::new(camera.width, camera.height);
            maps.shade(&gbuffer, &mut image);
            image.bits()
        });
        assert_eq!(on.iter().zip(&off).filter(|(a, b)| a != b).count(), 0, "{params:?}");
    }
}
