//! Pixels that ground truth leaves out because they are proved lit or dark: the image must be the one in which
//! every sample is traced, bit for bit, on what tempts a proof to be wrong.

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use gnomon_scene_core::bvh::Bvh;
use gnomon_scene_core::geometry::{AlphaMask, ObjectFlags, TriangleMesh, Wrap};
use gnomon_scene_core::reference::{Reference, ReferenceSettings, no_progress, reference};
use gnomon_scene_core::{Camera, GBuffer, Light, Scene, raster, scenes};

fn truth(scene: &Scene, light: &Light, gbuffer: &GBuffer, skip: bool) -> Reference {
    let settings = ReferenceSettings { samples: 64, seed: 3, skip };
    reference(scene, &Bvh::casters(scene), light, gbuffer, &settings, &no_progress).unwrap()
}

/// The image with proofs, after comparing it with the one without.
fn proved(what: &str, scene: &Scene, light: &Light, gbuffer: &GBuffer) -> Reference {
    let (plain, proved) = (truth(scene, light, gbuffer, false), truth(scene, light, gbuffer, true));
    assert_eq!(plain.work.proved_lit + plain.work.proved_dark, 0);
    assert!(plain.visibility.bits() == proved.visibility.bits(), "{what} under {light:?}");
    let work = proved.work;
    assert_eq!(work.proved_lit + work.proved_dark + work.sampled, plain.work.sampled, "{what}");
    assert!(work.rays <= plain.work.rays);
    for (pixel, (&v, &error)) in proved.visibility.values.iter().zip(&proved.std_error).enumerate() {
        let certain = error == 0.0 && (v == 0.0 || v == 1.0);
        assert!(certain || error.to_bits() == plain.std_error[pixel].to_bits(), "{what}: {v} ± {error}");
    }
    proved
}

/// All kinds of extended light, about 4 above the ground.
fn lights() -> [Light; 6] {
    let center = Vec3::new(0.5, 4.0, -0.3);
    let direction = Vec3::new(0.3, -1.0, 0.2);
    [
        Light::Rect { center, half_u: Vec3::X * 0.5, half_v: Vec3::new(0.0, 0.2, 0.4) },
        Light::Rect { center, half_u: Vec3::new(0.2, 0.3, 0.1), half_v: Vec3::new(0.3, 0.2, 0.6) },
        Light::Disk { center, normal: direction, radius: 0.4 },
        Light::Sphere { center, radius: 0.5 },
        Light::Directional { direction, angular_radius: 0.01 },
        Light::Directional { direction, angular_radius: 0.3 },
    ]
}

/// A square of `half` a side about `center`, in the plane y = `center.y`, as an object of its own.
fn square(scene: &mut Scene, center: Vec3, half: Vec2, alpha: Option<Arc<AlphaMask>>) {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let positions = corners.map(|(x, z)| center + Vec3::new(x * half.x, 0.0, z * half.y));
    let mut mesh = TriangleMesh::new("square", positions.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    mesh.uvs = corners.map(|(x, z)| Vec2::new(x, z) * 0.5 + 0.5).to_vec();
    mesh.alpha = alpha;
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
}

fn ground() -> Scene {
    let mut scene = Scene::new();
    square(&mut scene, Vec3::ZERO, Vec2::splat(6.0), None);
    scene
}

fn view(scene: &Scene, eye: Vec3, size: u32) -> GBuffer {
    let camera = Camera {
        eye,
        target: Vec3::ZERO,
        up: Vec3::Z,
        fov_y: 1.2,
        near: 0.01,
        far: f32::INFINITY,
        width: size,
        height: size,
    };
    raster::render_gbuffer(scene, &camera)
}

#[test]
fn built_in_scenes_keep_every_bit() {
    let mut skipped = 0;
    for built_in in scenes::all().iter().filter(|scene| scene.name != "forest") {
        let mut setup = scenes::build(built_in.name, 0.0).unwrap();
        (setup.camera.width, setup.camera.height) = (40, 40);
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        for light in &setup.lights {
            let work = proved(built_in.name, &setup.scene, light, &gbuffer).work;
            skipped += work.proved_lit + work.proved_dark;
        }
    }
    assert!(skipped > 4000, "{skipped}");
}

#[test]
fn hair_thin_bars_are_never_skipped() {
    let mut scene = ground();
    for bar in -10..10 {
        let center = Vec3::new(bar as f32 * 0.31, 1.0 + 0.05 * bar as f32, 0.0);
        square(&mut scene, center, Vec2::new(1e-5, 3.0), None);
    }
    let gbuffer = view(&ground(), Vec3::Y * 6.0, 48);
    for light in lights() {
        let work = proved("bars", &scene, &light, &gbuffer).work;
        assert!(work.sampled > 0);
    }
}

/// A caster far beyond the others and smaller than any sample's share of the light.
#[test]
fn far_small_casters_are_never_skipped() {
    let gbuffer = view(&ground(), Vec3::Y * 6.0, 48);
    for light in lights() {
        let mut scene = ground();
        for i in 0..40 {
            let center =
                Vec3::new((i % 7) as f32 * 0.5 - 1.5, 3.0 + 0.01 * i as f32, (i / 7) as f32 * 0.5 - 1.2);
            square(&mut scene, center, Vec2::splat(0.004), None);
        }
        if let Light::Directional { direction, .. } = light {
            square(&mut scene, -direction * 1000.0, Vec2::splat(0.5), None);
        }
        let lit = proved("no casters", &ground(), &light, &gbuffer).work.proved_lit;
        let work = proved("small casters", &scene, &light, &gbuffer).work;
        assert!(work.proved_lit < lit, "{light:?}: {} of {lit}", work.proved_lit);
    }
}

/// A wall of eight triangles around a small hole.
#[test]
fn a_pinhole_keeps_its_light() {
    let (outer, inner, height) = (40.0, 0.04, 1.0);
    let ring = |half: f32| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, z)| Vec3::new(x * half, height, z * half))
    };
    let positions = [ring(inner), ring(outer)].concat();
    let triangles = (0..4).flat_map(|i| {
        let j = (i + 1) % 4;
        [[i, j, 4 + i], [j, 4 + j, 4 + i]]
    });
    let mut scene = ground();
    let wall = TriangleMesh::new("wall", positions, triangles.collect());
    scene.add(&wall, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    let gbuffer = view(&ground(), Vec3::Y * 3.0, 64);
    for light in lights() {
        let found = proved("pinhole", &scene, &light, &gbuffer);
        let seen = found.visibility.values.iter().any(|&v| v > 0.0);
        assert!(seen && found.work.proved_dark > 500, "{:?}", found.work);
    }
}

/// What a mask lets through is not dark, and its holes prove nothing.
#[test]
fn masks_prove_no_darkness() {
    let solid = (0..64).map(|i| (i % 8 + i / 8) % 2 == 0).collect();
    let mask = Arc::new(AlphaMask::from_solid(8, 8, solid, [Wrap::Clamp; 2]).unwrap());
    let mut scene = ground();
    square(&mut scene, Vec3::Y * 1.5, Vec2::splat(30.0), Some(mask));
    let gbuffer = view(&ground(), Vec3::Y * 1.4, 40);
    for light in lights() {
        let work = proved("mask", &scene, &light, &gbuffer).work;
        assert_eq!((work.proved_dark, work.proved_lit), (0, 0), "{light:?}");
    }
}

/// Far from the origin, where the last bits are coarse, and at grazing light.
#[test]
fn coarse_coordinates_and_grazing_light_keep_every_bit() {
    let offset = Vec3::new(3000.0, -700.0, 40.0);
    let mut scene = Scene::new();
    square(&mut scene, offset, Vec2::splat(6.0), None);
    square(&mut scene, offset + Vec3::new(0.4, 0.7, 0.1), Vec2::new(0.5, 0.3), None);
    let camera = Camera {
        eye: offset + Vec3::new(0.0, 5.0, 1.0),
        target: offset,
        up: Vec3::Z,
        fov_y: 1.2,
        near: 0.01,
        far: f32::INFINITY,
        width: 48,
        height: 48,
    };
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let (half_u, half_v) = (Vec3::X * 0.5, Vec3::Y * 0.3);
    for light in [
        Light::Rect { center: offset + Vec3::new(1.0, 3.0, 0.0), half_u, half_v: Vec3::Z * 0.5 },
        Light::Rect { center: offset + Vec3::new(7.0, 0.2, 0.0), half_u, half_v },
        Light::Disk { center: offset + Vec3::Y * 2.0, normal: Vec3::X, radius: 0.5 },
        Light::Sphere { center: offset + Vec3::Y * 0.5, radius: 0.6 },
        Light::Sphere { center: offset + Vec3::Y * 2.0, radius: 0.3 },
        Light::Directional { direction: Vec3::new(1.0, -0.02, 0.3), angular_radius: 0.05 },
    ] {
        proved("far away", &scene, &light, &gbuffer);
    }
}

#[test]
fn lights_without_extent_are_left_to_their_ray() {
    let scene = ground();
    let gbuffer = view(&scene, Vec3::Y * 5.0, 16);
    let work = proved("point", &scene, &Light::Point { position: Vec3::Y * 3.0 }, &gbuffer).work;
    assert_eq!((work.proved_lit, work.rays), (0, work.sampled));
}
