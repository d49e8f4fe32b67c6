//! Leaving out what cannot matter never changes an image, bit for bit, and is counted.

mod truth;

use glam::Vec3;
use gnomon_penumbra_wedges::{Casters, PenumbraWedges, Variant, WedgeParams};
use scene_core::{Camera, Light, Report, Scene, TriangleMesh, VisibilityImage, raster, scenes};
use truth::{camera, scene_of, shade, sheet};

/// How many pixels differ by a bit between the images with skipping on and off; the report of the first.
fn differing(scene: &Scene, light: &Light, camera: &Camera, params: WedgeParams) -> (usize, Report) {
    let (_, with, report) = shade(scene, light, camera, params);
    let (_, without, _) = shade(scene, light, camera, WedgeParams { skip: false, ..params });
    let differ = with.values.iter().zip(&without.values).filter(|(a, b)| a.to_bits() != b.to_bits());
    (differ.count(), report)
}

/// The report with skipping on; no pixel may differ.
fn compare(scene: &Scene, light: &Light, camera: &Camera, params: WedgeParams) -> Report {
    let (wrong, report) = differing(scene, light, camera, params);
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
            assert!(report.counted["penumbra pixels"] > 0, "{spec}");
        }
    }
}

/// A sample on an edge may be counted otherwise than it is traced, so that which pixels are traced must not hang on what is left out.
#[test]
fn the_same_pixels_are_traced() {
    let setup = scenes::build("park:leaves=300", 0.0).expect("built in");
    let camera = setup.camera.with_size(64, 48);
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let casters = Casters::new(&setup.scene).expect("few triangles");
    let [with, without] = [true, false].map(|skip| {
        let params = WedgeParams { skip, views: 64, ..Default::default() };
        let (prepared, _) =
            PenumbraWedges::new(params).prepare(&casters, &setup.lights[0], &camera).expect("in its limits");
        prepared.shade_and_count(&gbuffer, &mut VisibilityImage::new(64, 48)).1
    });
    assert!(with.traced > 0 && with.traced < with.asked, "{with:?}");
    assert_eq!(with.traced, without.traced);
}

/// Every built-in scene by every variant that takes it, seen whole and by a narrow view that most casters are out of.
#[test]
fn no_built_in_scene_changes() {
    let mut changed = Vec::new();
    for built_in in scenes::all() {
        // Small plants: without skipping, every pixel asks every edge.
        let spec = match built_in.name {
            "forest" => "forest:triangles=20000",
            "park" => "park:leaves=200",
            "street" => "street:length=60",
            name => name,
        };
        let setup = scenes::build(spec, 0.0).expect("built in");
        let takes_all = Casters::new(&setup.scene).expect("edges").masked().is_none();
        for fov_y in [setup.camera.fov_y, 0.15 * setup.camera.fov_y] {
            let camera = Camera { fov_y, ..setup.camera.with_size(40, 30) };
            let variants = [Variant::Exact, Variant::Coverage, Variant::Interpolated];
            for &variant in if takes_all { &variants[..] } else { &variants[..1] } {
                let params = WedgeParams { variant, rays: false, ..Default::default() };
                for light in &setup.lights {
                    let (wrong, _) = differing(&setup.scene, light, &camera, params);
                    if wrong > 0 {
                        changed.push(format!("{spec}, {variant:?}, {fov_y} rad: {wrong} of 1200 pixels"));
                    }
                }
            }
        }
    }
    assert!(changed.is_empty(), "{changed:#?}");
}

#[test]
fn casters_out_of_view_are_left_out() {
    let setup = scenes::build("log-cabin", 0.0).expect("built in");
    let camera = Camera { fov_y: 0.1, ..setup.camera.with_size(48, 36) };
    let report = compare(&setup.scene, &setup.lights[0], &camera, WedgeParams::default());
    assert!(report.skipped["casters outside view"] > 0);
}

/// The wedges of `interpolated` reach beyond the ways to a flat light: along a normal askew to a long light's sides they are as wide as the
/// light's shadow on that normal, though nothing of the light is there. A caster beside all ways from what is seen to the light counts.
#[test]
fn casters_beside_the_ways_to_the_light_count_for_interpolated() {
    let light = Light::Rect { center: Vec3::Y * 4.0, half_u: Vec3::X * 1.5, half_v: Vec3::Z * 0.02 };
    // Askew by an eighth of a turn, from its edge through the middle line away from what is seen.
    let (along, out) = (Vec3::new(0.21, 0.0, -0.21), Vec3::new(1.0, 0.0, 1.0));
    let corners = [-along, along, along + out, -along + out].map(|p| p + Vec3::Y * 2.0);
    let scene = scene_of(&[
        sheet(0.0, [-4.0, -4.0], [4.0, 4.0]),
        TriangleMesh::new("askew", corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]),
    ]);
    let seen = Vec3::new(-0.64, 0.0, -0.64);
    let view = Camera { up: Vec3::X, fov_y: 0.1, ..camera(seen + Vec3::Y * 0.5, seen, 12, 12) };
    let exact = WedgeParams { variant: Variant::Exact, ..Default::default() };
    let (_, image, report) = shade(&scene, &light, &view, exact);
    assert!(report.skipped["casters outside view"] > 0 && image.values.iter().all(|&v| v == 1.0));
    let params = WedgeParams { variant: Variant::Interpolated, ..exact };
    compare(&scene, &light, &view, params);
    let (_, image, _) = shade(&scene, &light, &view, params);
    assert!(image.values.iter().all(|&v| v < 0.99), "its wedge holds all that is seen: {:?}", image.values);
}
