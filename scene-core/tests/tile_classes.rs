//! Tiles proved lit or in umbra: ground truth, with every sample traced, must agree at every pixel of theirs, on what
//! tempts a proof to be wrong.

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use gnomon_scene_core::bvh::Bvh;
use gnomon_scene_core::geometry::{AlphaMask, ObjectFlags, TriangleMesh, Wrap};
use gnomon_scene_core::reference::{ReferenceSettings, no_progress, reference};
use gnomon_scene_core::relevance::{TILE, TileBounds, TileClass, TileClasses, classify_tiles};
use gnomon_scene_core::{Camera, GBuffer, Light, Report, Scene, raster, scenes};

/// Tiles that are lit, in umbra, and mixed.
type Counts = [usize; 3];

fn counts(classes: &TileClasses) -> Counts {
    [TileClass::Lit, TileClass::Umbra, TileClass::Mixed].map(|class| classes.count(class))
}

/// Classes, after comparing them with ground truth.
fn proved(what: &str, scene: &Scene, light: &Light, gbuffer: &GBuffer) -> Counts {
    let casters = Bvh::casters(scene);
    let tiles = TileBounds::of_receivers(scene, gbuffer);
    let classes = classify_tiles(scene, &casters, light, gbuffer, &tiles);
    let settings = ReferenceSettings { samples: 32, seed: 5, skip: false };
    let truth = reference(scene, &casters, light, gbuffer, &settings, &no_progress).unwrap().visibility;
    for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel)) {
        let receives = scene.objects()[gbuffer.object[pixel] as usize].flags.receives;
        let (x, y) = (pixel as u32 % gbuffer.width, pixel as u32 / gbuffer.width);
        let (class, v) = (classes.of_pixel(x, y), truth.values[pixel]);
        match class {
            TileClass::Lit => assert!(v == 1.0, "{what}, {light:?}: {v} at ({x}, {y}) of a lit tile"),
            TileClass::Umbra => {
                assert!(!receives || v == 0.0, "{what}, {light:?}: {v} at ({x}, {y}) of a dark tile");
            }
            TileClass::Empty => assert!(!receives, "{what}: ({x}, {y}) is seen"),
            TileClass::Mixed => {}
        }
    }
    counts(&classes)
}

/// All kinds of light, about 4 above the ground.
fn lights() -> [Light; 8] {
    let center = Vec3::new(0.5, 4.0, -0.3);
    let direction = Vec3::new(0.3, -1.0, 0.2);
    [
        Light::Rect { center, half_u: Vec3::X * 0.5, half_v: Vec3::new(0.0, 0.2, 0.4) },
        Light::Disk { center, normal: direction, radius: 0.4 },
        Light::Sphere { center, radius: 0.5 },
        Light::Directional { direction, angular_radius: 0.01 },
        Light::Directional { direction, angular_radius: 0.2 },
        Light::Directional { direction, angular_radius: 0.0 },
        Light::Point { position: center },
        Light::Spot { position: center, direction, outer: 0.5, inner: 0.2 },
    ]
}

fn add(scene: &mut Scene, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) {
    let mesh = TriangleMesh::new("part", positions, triangles);
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
}

/// A square of `half` a side about `center`, level, as an object of its own.
fn square(scene: &mut Scene, center: Vec3, half: Vec2) {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let positions = corners.map(|(x, z)| center + Vec3::new(x * half.x, 0.0, z * half.y));
    add(scene, positions.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
}

/// A level sheet of `cells` squares a side, wavy, whose triangles `keep` accepts by their number. Every second one is
/// wound the other way round.
fn sheet(scene: &mut Scene, height: f32, half: f32, cells: u32, keep: impl Fn(u32) -> bool) {
    let at = |i: u32, j: u32| {
        let [x, z] = [i, j].map(|k| (k as f32 / cells as f32 * 2.0 - 1.0) * half);
        Vec3::new(x, height + 0.05 * (x * 3.0).sin() * (z * 2.0).cos(), z)
    };
    let positions = (0..=cells).flat_map(|j| (0..=cells).map(move |i| at(i, j))).collect();
    let triangles = (0..cells)
        .flat_map(|j| (0..cells).map(move |i| j * (cells + 1) + i))
        .flat_map(|a| [[a, a + 1, a + cells + 2], [a, a + cells + 1, a + cells + 2]])
        .zip(0..)
        .filter_map(|(triangle, number)| keep(number).then_some(triangle))
        .collect();
    add(scene, positions, triangles);
}

fn ground() -> Scene {
    let mut scene = Scene::new();
    square(&mut scene, Vec3::ZERO, Vec2::splat(6.0));
    scene
}

fn view(scene: &Scene, eye: Vec3, size: u32) -> GBuffer {
    let (fov_y, near, far) = (1.2, 0.01, f32::INFINITY);
    let camera = Camera { eye, target: Vec3::ZERO, up: Vec3::Z, fov_y, near, far, width: size, height: size };
    raster::render_gbuffer(scene, &camera)
}

#[test]
fn built_in_scenes_agree_with_ground_truth() {
    let mut sum = [0; 3];
    for built_in in scenes::all() {
        let spec = if built_in.name == "forest" { "forest:triangles=60000" } else { built_in.name };
        let setup = scenes::build(spec, 0.0).unwrap();
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera.with_size(150, 150));
        let bounds = setup.scene.bounds();
        let position = bounds.center() + bounds.size() * Vec3::new(0.1, 0.6, 0.2);
        for light in [setup.lights[0], Light::Point { position }] {
            let found = proved(spec, &setup.scene, &light, &gbuffer);
            sum = [sum[0] + found[0], sum[1] + found[1], sum[2] + found[2]];
        }
    }
    assert!(sum[0] > 300 && sum[1] > 100, "lit, umbra, mixed: {sum:?}");
}

#[test]
fn an_open_ground_is_lit_and_a_covered_one_dark() {
    let gbuffer = view(&ground(), Vec3::Y * 3.0, 128);
    for light in lights() {
        let lit = proved("ground", &ground(), &light, &gbuffer);
        let spot = matches!(light, Light::Spot { .. });
        assert!(if spot { lit[0] > 8 && lit[1] > 8 } else { lit == [64, 0, 0] }, "{light:?}: {lit:?}");
        // One triangle would not do, and no winding helps.
        let mut covered = ground();
        sheet(&mut covered, 1.0, 40.0, 100, |_| true);
        let dark = proved("sheet", &covered, &light, &gbuffer);
        assert!(dark[1] > 55, "{light:?}: {dark:?}");
    }
}

#[test]
fn a_hole_of_one_triangle_is_found() {
    let gbuffer = view(&ground(), Vec3::Y * 3.0, 128);
    for light in lights() {
        let dark = |missing: u32| {
            let mut scene = ground();
            sheet(&mut scene, 1.0, 40.0, 100, |number| number != missing);
            proved("holed sheet", &scene, &light, &gbuffer)[1]
        };
        // In the middle of the sheet, and beyond all that is seen.
        let (open, whole) = (dark(100 * 100 + 100), dark(0));
        assert!(open < whole, "{light:?}: {open} of {whole}");
    }
}

#[test]
fn hair_thin_bars_and_cracks_are_never_skipped() {
    let gbuffer = view(&ground(), Vec3::Y * 6.0, 96);
    for light in lights() {
        let mut bars = ground();
        for bar in -10..10 {
            let center = Vec3::new(bar as f32 * 0.31, 1.0 + 0.05 * bar as f32, 0.0);
            square(&mut bars, center, Vec2::new(1e-5, 3.0));
        }
        assert!(proved("bars", &bars, &light, &gbuffer)[2] > 4, "{light:?}");
        // Two sheets whose border is nearly, but not the same.
        let mut cracked = ground();
        for (side, gap) in [(-1.0, 0.0), (1.0, 1e-4)] {
            let positions = [(0.0, -40.0), (40.0, -40.0), (40.0, 40.0), (0.0, 40.0)]
                .map(|(x, z)| Vec3::new(side * (x + gap), 1.0, z));
            add(&mut cracked, positions.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
        }
        let found = proved("crack", &cracked, &light, &gbuffer);
        assert!(found[2] > 0 && found[1] > 8, "{light:?}: {found:?}");
    }
}

#[test]
fn far_small_casters_are_never_skipped() {
    let gbuffer = view(&ground(), Vec3::Y * 6.0, 96);
    for light in lights() {
        let mut scene = ground();
        for i in 0..40 {
            let center =
                Vec3::new((i % 7) as f32 * 0.5 - 1.5, 3.0 + 0.01 * i as f32, (i / 7) as f32 * 0.5 - 1.2);
            square(&mut scene, center, Vec2::splat(0.004));
        }
        let (open, found) = (
            proved("no casters", &ground(), &light, &gbuffer),
            proved("small casters", &scene, &light, &gbuffer),
        );
        assert!(found[0] < open[0], "{light:?}: {found:?} of {open:?}");
    }
}

/// A wall of eight triangles around a small hole.
#[test]
fn a_pinhole_keeps_its_light() {
    let ring = |half: f32| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| Vec3::new(x * half, 1.0, z * half))
    };
    let triangles = (0..4).flat_map(|i| {
        let j = (i + 1) % 4;
        [[i, j, 4 + i], [j, 4 + j, 4 + i]]
    });
    let mut scene = ground();
    add(&mut scene, [ring(0.04), ring(40.0)].concat(), triangles.collect());
    let gbuffer = view(&ground(), Vec3::Y * 3.0, 128);
    for light in lights() {
        let found = proved("pinhole", &scene, &light, &gbuffer);
        assert!(found[2] > 0 && found[1] > 20, "{light:?}: {found:?}");
    }
}

/// A sheet that is folded back over itself hides nothing beyond its fold, though its edges are all shared there.
#[test]
fn folds_are_borders() {
    let gbuffer = view(&ground(), Vec3::Y * 6.0, 96);
    let row = |x: f32, y: f32| [Vec3::new(x, y, -40.0), Vec3::new(x, y, 40.0)];
    let positions = [row(-40.0, 1.0), row(0.2, 1.2), row(-40.0, 1.4)].concat();
    let triangles = vec![[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]];
    let mut scene = ground();
    add(&mut scene, positions, triangles);
    for light in lights() {
        let found = proved("fold", &scene, &light, &gbuffer);
        assert!(found[1] > 4 && found[2] > 0, "{light:?}: {found:?}");
    }
}

#[test]
fn masks_prove_no_darkness() {
    let solid = (0..64).map(|i| (i % 8 + i / 8) % 2 == 0).collect();
    let mask = AlphaMask::from_solid(8, 8, solid, [Wrap::Clamp; 2]).unwrap();
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let positions = corners.map(|(x, z)| Vec3::new(x * 30.0, 1.5, z * 30.0)).to_vec();
    let mut mesh = TriangleMesh::new("mask", positions, vec![[0, 1, 2], [0, 2, 3]]);
    mesh.uvs = corners.map(|(x, z)| Vec2::new(x, z) * 0.5 + 0.5).to_vec();
    mesh.alpha = Some(Arc::new(mask));
    let mut scene = ground();
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    let gbuffer = view(&ground(), Vec3::Y * 1.4, 64);
    for light in &lights()[..7] {
        assert_eq!(proved("mask", &scene, light, &gbuffer)[..2], [0, 0], "{light:?}");
    }
}

/// Far from the origin, where the last bits are coarse.
#[test]
fn coarse_coordinates_agree_with_ground_truth() {
    let offset = Vec3::new(3000.0, -700.0, 40.0);
    let mut scene = Scene::new();
    square(&mut scene, offset, Vec2::splat(6.0));
    square(&mut scene, offset + Vec3::new(0.4, 1.2, 0.1), Vec2::new(1.8, 1.6));
    let camera = Camera {
        eye: offset + Vec3::new(0.0, 2.0, 5.0),
        target: offset,
        up: Vec3::Y,
        fov_y: 1.2,
        near: 0.01,
        far: f32::INFINITY,
        width: 128,
        height: 128,
    };
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let mut sum = [0; 2];
    for light in [
        Light::Rect { center: offset + Vec3::Y * 3.0, half_u: Vec3::X * 0.5, half_v: Vec3::Z * 0.5 },
        Light::Sphere { center: offset + Vec3::Y * 2.0, radius: 0.3 },
        Light::Directional { direction: Vec3::new(0.5, -1.0, 0.3), angular_radius: 0.02 },
        Light::Point { position: offset + Vec3::new(1.0, 4.0, 0.0) },
    ] {
        let found = proved("far away", &scene, &light, &gbuffer);
        sum = [sum[0] + found[0], sum[1] + found[1]];
    }
    assert!(sum[0] > 10 && sum[1] > 10, "lit and umbra: {sum:?}");
}

/// Triangles of all sizes and places over and through the ground.
#[test]
fn soups_agree_with_ground_truth() {
    let unit = |i: u32, step: f64| ((f64::from(i) * step).fract() * 2.0 - 1.0) as f32;
    let point = |i: u32| {
        Vec3::new(unit(i, 0.819_172_513), unit(i, 0.671_043_607).abs() * 1.2, unit(i, 0.549_700_478)) * 3.0
    };
    let gbuffer = view(&ground(), Vec3::new(0.5, 7.0, 1.0), 96);
    let mut umbra = 0;
    for seed in 0..6 {
        let mut scene = ground();
        for i in 0..30 {
            let at = seed * 1000 + i * 7;
            let size = 0.1 + 2.0 * unit(at, 0.754_877_666).abs();
            let corners = [0, 1, 2].map(|k| point(at) + point(at * 3 + k + 77) * size);
            add(&mut scene, corners.to_vec(), vec![[0, 1, 2]]);
        }
        for light in lights() {
            umbra += proved("soup", &scene, &light, &gbuffer)[1];
        }
    }
    assert!(umbra > 20, "{umbra}");
}

#[test]
fn odd_input_is_mixed_or_empty() {
    let scene = ground();
    let gbuffer = view(&scene, Vec3::Y * 3.0, 40);
    let classes = |scene: &Scene, light: &Light, gbuffer: &GBuffer| {
        let tiles = TileBounds::of_receivers(scene, gbuffer);
        classify_tiles(scene, &Bvh::casters(scene), light, gbuffer, &tiles)
    };
    let sun = Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.01 };
    for light in [
        Light::Point { position: Vec3::NAN },
        Light::Sphere { center: Vec3::INFINITY, radius: 1.0 },
        Light::Directional { direction: Vec3::ZERO, angular_radius: 0.1 },
        Light::Directional { direction: Vec3::NEG_Y, angular_radius: 1.5 },
    ] {
        assert_eq!(counts(&classes(&scene, &light, &gbuffer)), [0, 0, 9], "{light:?}");
    }
    let mut broken = gbuffer.clone();
    broken.position[5] = Vec3::splat(f32::NAN);
    broken.position[30] = Vec3::splat(1e30);
    let found = classes(&scene, &sun, &broken);
    assert_eq!((found.of_pixel(5, 0), found.of_pixel(30, 0)), (TileClass::Mixed, TileClass::Mixed));
    assert_eq!(found.of_pixel(0, TILE), TileClass::Lit);
    assert_eq!(found.of_pixel(1000, 1000), TileClass::Mixed);

    assert!(classes(&scene, &sun, &GBuffer::new(0, 0)).classes.is_empty());
    let nothing = classes(&scene, &sun, &GBuffer::new(33, 17));
    assert_eq!((nothing.classes.len(), nothing.count(TileClass::Empty)), (6, 6));
    // Tiles of another image.
    let other = TileBounds::of(&GBuffer::new(100, 100));
    let found = classify_tiles(&scene, &Bvh::casters(&scene), &sun, &gbuffer, &other);
    assert_eq!(found.count(TileClass::Mixed), 9);
    // Without casters all is lit; what does not receive is nobody's.
    let mut bare = Scene::new();
    let flags = ObjectFlags { casts: false, ..Default::default() };
    let corners = [(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)].map(|(x, z)| Vec3::new(x * 9.0, 0.0, z * 9.0));
    let mesh = TriangleMesh::new("floor", corners.to_vec(), vec![[0, 1, 2]]);
    bare.add(&mesh, Affine3A::IDENTITY, flags).unwrap();
    let gbuffer = view(&bare, Vec3::Y, 32);
    let mut report = Report::default();
    classes(&bare, &sun, &gbuffer).book(&mut report);
    assert_eq!((report.skipped["lit tiles"], report.skipped["umbra tiles"]), (4, 0));
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let setup = scenes::build("street", 0.0).unwrap();
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera.with_size(200, 200));
    let (casters, tiles) = (Bvh::casters(&setup.scene), TileBounds::of_receivers(&setup.scene, &gbuffer));
    let found = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| classify_tiles(&setup.scene, &casters, &setup.lights[0], &gbuffer, &tiles))
    });
    assert_eq!(found[0], found[1]);
}
