//! Leaving out what cannot matter never changes an image, bit for bit, and is counted.

use glam::{Affine3A, Vec3};
use gnomon_stencil_volumes::{Casters, Skips, StencilVolumes, Variant, VolumeParams};
use scene_core::geometry::ObjectFlags;
use scene_core::{Camera, Light, Report, Scene, TriangleMesh, VisibilityImage, raster, scenes};

/// Images without skipping, with each kind alone and with all; the reports of the last, counted and traced as by default.
fn compare(scene: &Scene, light: &Light, camera: &Camera, variant: Variant) -> Report {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let casters = Casters::new(scene).expect("few triangles");
    let mut kept = Report::default();
    let mut first: Option<Vec<u32>> = None;
    for rays in [false, true] {
        for (name, skips) in Skips::EACH {
            let params = VolumeParams { variant, rays, ..Default::default() };
            let technique = StencilVolumes::new(params).with_skips(skips);
            let (prepared, mut report) = technique.prepare(&casters, light, camera);
            let mut image = VisibilityImage::new(camera.width, camera.height);
            report.merge(&prepared.shade(&gbuffer, &mut image));
            kept = report;
            let bits = image.bits();
            let first = first.get_or_insert_with(|| bits.clone());
            let wrong = bits.iter().zip(first).filter(|(a, b)| a != b).count();
            assert_eq!(wrong, 0, "{light:?}, {variant:?}, rays {rays}, {name}");
        }
    }
    kept
}

#[test]
fn views_of_the_street() {
    let setup = scenes::build("street", 0.0).expect("built in");
    // Along the street and close to the ground: most of it is out of view.
    let target = setup.camera.target + Vec3::new(3.0, 0.0, 1.0);
    let camera = Camera { target, fov_y: 0.25, ..setup.camera.with_size(96, 64) };
    let report = compare(&setup.scene, &setup.lights[0], &camera, Variant::Volumes);
    assert!(report.skipped["caster triangles outside view"] > 0);
    assert!(report.skipped["caps"] > 0);
}

/// What each kind of skipping spares, in a scene that is counted: nothing else is spared with it.
#[test]
fn each_kind_spares_its_own_work() {
    let setup = scenes::build("chess", 0.0).expect("built in");
    let camera = setup.camera.with_size(192, 160);
    let light = setup.lights[0];
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let casters = Casters::new(&setup.scene).expect("few triangles");
    let report = |skips| {
        let technique = StencilVolumes::new(VolumeParams { rays: false, ..Default::default() });
        let (prepared, mut report) = technique.with_skips(skips).prepare(&casters, &light, &camera);
        let mut image = VisibilityImage::new(camera.width, camera.height);
        report.merge(&prepared.shade(&gbuffer, &mut image));
        let [skipped, counted] = [&report.skipped, &report.counted]
            .map(|all| move |what: &str| all.get(what).copied().unwrap_or_default());
        let kinds = [
            skipped("caster triangles outside view"),
            skipped("casters in another's shadow"),
            skipped("runs of edges beside a block"),
            skipped("pixels the light cannot reach"),
            skipped("caps"),
        ];
        (kinds, counted("pairs of side and pixel"), counted("pairs of run and block"))
    };
    let (off, pixels, runs) = report(Skips::NONE);
    assert_eq!(off, [0; 5]);
    for (kind, (name, skips)) in Skips::EACH[1..6].iter().enumerate() {
        let (found, ..) = report(*skips);
        let others = (0..5).filter(|&other| other != kind).all(|other| found[other] == 0);
        assert!(others, "{name}: {found:?}");
    }
    let (all, fewer_pixels, fewer_runs) = report(Skips::ALL);
    assert!(all[2] > 0 && all[3] > 0 && all[4] > 0, "{all:?}");
    assert!(fewer_pixels < pixels && fewer_runs < runs, "{fewer_pixels} {pixels}, {fewer_runs} {runs}");
}

#[test]
fn a_caster_under_a_roof_is_left_out() {
    let mut scene = Scene::new();
    for (height, half) in [(0.0, 6.0), (2.0, 3.0), (1.0, 0.2)] {
        let corner = |x: f32, z: f32| Vec3::new(x * half, height, z * half);
        // One large triangle hides the small one under it.
        let positions = vec![corner(-1.0, -1.0), corner(3.0, -1.0), corner(-1.0, 3.0)];
        let mesh = TriangleMesh::new("triangle", positions, vec![[0, 1, 2]]);
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    }
    let camera = Camera {
        eye: Vec3::new(0.0, 1.5, 7.0),
        target: Vec3::Y * 0.5,
        up: Vec3::Y,
        fov_y: 0.9,
        near: 0.01,
        far: f32::INFINITY,
        width: 160,
        height: 120,
    };
    for light in [
        Light::Point { position: Vec3::new(0.1, 5.0, 0.2) },
        Light::Directional { direction: Vec3::new(0.1, -1.0, 0.05), angular_radius: 0.0 },
    ] {
        let report = compare(&scene, &light, &camera, Variant::Volumes);
        assert_eq!(report.skipped["casters in another's shadow"], 1, "{light:?}");
        assert!(report.skipped["tiles of one count"] > 100, "{light:?}");
        let report = compare(&scene, &light, &camera, Variant::Planar);
        assert!(report.skipped.contains_key("receivers nobody sees"));
    }
}
