//! Shadows whose outline is known in closed form.

use std::path::Path;

use glam::{Affine3A, Vec3};
use gnomon_stencil_volumes::{Casters, StencilVolumes, Variant, VolumeParams};
use scene_core::geometry::ObjectFlags;
use scene_core::{Camera, GBuffer, Light, Scene, SceneSetup, TriangleMesh, VisibilityImage, io, raster};

/// A horizontal square around `center` with sides 2·`half`.
fn square(center: Vec3, half: f32) -> TriangleMesh {
    let corner = |x: f32, z: f32| center + Vec3::new(x * half, 0.0, z * half);
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    TriangleMesh::new("square", positions, vec![[0, 1, 2], [0, 2, 3]])
}

fn scene_of(meshes: &[TriangleMesh]) -> Scene {
    let mut scene = Scene::new();
    for mesh in meshes {
        scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
    }
    scene
}

const CAMERA: Camera = Camera {
    eye: Vec3::new(0.0, 6.0, 7.0),
    target: Vec3::ZERO,
    up: Vec3::Y,
    fov_y: 0.9,
    near: 0.01,
    far: f32::INFINITY,
    width: 160,
    height: 120,
};

fn shade(scene: &Scene, light: &Light, variant: Variant) -> (GBuffer, VisibilityImage) {
    let gbuffer = raster::render_gbuffer(scene, &CAMERA);
    let casters = Casters::new(scene).expect("few triangles");
    let technique = StencilVolumes::new(VolumeParams { variant, ..Default::default() });
    let (prepared, _) = technique.prepare(&casters, light, &CAMERA);
    let mut visibility = VisibilityImage::new(CAMERA.width, CAMERA.height);
    prepared.shade(&gbuffer, &mut visibility);
    (gbuffer, visibility)
}

/// The square of half side 1 at height 1 over the ground throws a square, scaled from the light by h/(h − 1).
#[test]
fn square_over_a_plane_is_its_projection() {
    let place = Vec3::new(0.4, 3.0, -0.3);
    let scene = scene_of(&[square(Vec3::ZERO, 8.0), square(Vec3::Y, 1.0)]);
    let scale = place.y / (place.y - 1.0);
    for variant in [Variant::Planar, Variant::Volumes] {
        let (gbuffer, visibility) = shade(&scene, &Light::Point { position: place }, variant);
        // A pixel's footprint on the ground is below 0.2; planar's outline is snapped to half of 1/256 pixel.
        let margin = if variant == Variant::Planar { 0.2 / 256.0 } else { 2e-5 };
        let (mut inside, mut compared) = (0, 0);
        for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.object[pixel] == 0) {
            let on_caster = (gbuffer.position[pixel] - place) / scale + place;
            let distance = (on_caster.x.abs().max(on_caster.z.abs()) - 1.0) * scale;
            if distance.abs() > margin {
                let expected = if distance < 0.0 { 0.0 } else { 1.0 };
                assert_eq!(visibility.values[pixel], expected, "{variant:?}, {distance} off the edge");
                compared += 1;
                inside += usize::from(distance < 0.0);
            }
        }
        assert!(inside > 500 && compared > 10_000, "the test sees its shadow: {inside} of {compared}");
    }
}

/// What is above the light or under the receiver throws no shadow on it.
#[test]
fn no_false_shadows_on_the_plane() {
    let light = Light::Point { position: Vec3::new(0.1, 2.0, 0.2) };
    let mut wall = square(Vec3::ZERO, 1.0);
    // A wall that crosses the light's height and the ground.
    wall.positions =
        [(-1.0, -1.0), (-1.0, 1.0), (5.0, 1.0), (5.0, -1.0)].map(|(y, z)| Vec3::new(2.0, y, z)).to_vec();
    let scene =
        scene_of(&[square(Vec3::ZERO, 8.0), square(Vec3::Y * 3.0, 1.5), square(Vec3::NEG_Y, 1.5), wall]);
    let (gbuffer, planar) = shade(&scene, &light, Variant::Planar);
    let (_, volumes) = shade(&scene, &light, Variant::Volumes);
    let ground = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.object[pixel] == 0);
    let (mut dark, mut differ) = (0, 0);
    for pixel in ground {
        if gbuffer.position[pixel].x < 1.9 {
            assert_eq!(planar.values[pixel], 1.0, "at {}", gbuffer.position[pixel]);
        }
        dark += usize::from(volumes.values[pixel] == 0.0);
        differ += usize::from(volumes.values[pixel] != planar.values[pixel]);
    }
    // Snapping moves the outline by half of 1/256 pixel: of its few hundred pixels one or two lie there.
    assert!(dark > 100 && differ <= 4, "{dark} dark, {differ} differ");
}

/// Two floors under one caster: both show its shadow if nothing is said, and only the one that the scene file names.
#[test]
fn planar_shadows_fall_on_the_receivers_that_a_scene_file_names() {
    let setup = |file: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes").join(file);
        io::load_setup(&path).expect("a sound scene file")
    };
    let dark = |setup: &SceneSetup, object: &str| {
        let (scene, camera) = (&setup.scene, &setup.camera);
        let gbuffer = raster::render_gbuffer(scene, camera);
        let casters = Casters::new(scene).expect("few triangles");
        let technique = StencilVolumes::new(VolumeParams { variant: Variant::Planar, ..Default::default() });
        let mut visibility = VisibilityImage::new(camera.width, camera.height);
        technique.prepare(&casters, &setup.lights[0], camera).0.shade(&gbuffer, &mut visibility);
        let on = |p: usize| gbuffer.is_seen(p) && scene.objects()[gbuffer.object[p] as usize].name == object;
        (0..gbuffer.pixel_count()).filter(|&p| on(p) && visibility.values[p] == 0.0).count()
    };
    let (found, named) = (setup("two_floors.toml"), setup("two_floors_one_named.toml"));
    assert!(dark(&found, "left") > 50 && dark(&found, "right") > 50);
    assert_eq!(dark(&found, "left"), dark(&named, "left"));
    assert_eq!(dark(&named, "right"), 0);
}
