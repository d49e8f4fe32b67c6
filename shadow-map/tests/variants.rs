//! What all variants must do: no acne on planes, known penumbrae, skipping that changes nothing, answers to anything.

use glam::{Affine3A, Vec3};
use gnomon_shadow_map::{Kernel, ShadowMap, ShadowMapParams, Variant};
use scene_core::geometry::ObjectFlags;
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};

fn square(name: &str, center: Vec3, half: f32) -> TriangleMesh {
    let corner = |x: f32, z: f32| center + Vec3::new(x * half, 0.0, z * half);
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    TriangleMesh::new(name, positions, vec![[0, 1, 2], [0, 2, 3]])
}

fn scene_of(meshes: &[TriangleMesh]) -> Scene {
    let mut scene = Scene::new();
    for mesh in meshes {
        scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
    }
    scene
}

fn camera(eye: Vec3, target: Vec3, scale: f32) -> Camera {
    let near = 0.01 * scale;
    Camera { eye, target, up: Vec3::Y, fov_y: 0.9, near, far: f32::INFINITY, width: 96, height: 72 }
}

fn settings() -> Vec<ShadowMapParams> {
    let of = |variant| ShadowMapParams { variant, taps: 16, views: 4, ..Default::default() };
    let mut all: Vec<_> = Variant::ALL.map(of).to_vec();
    all.push(ShadowMapParams { kernel: Kernel::PoissonDisk, filter: 9, ..of(Variant::Pcf) });
    all.push(ShadowMapParams { moments: 2, ..of(Variant::Moments) });
    all
}

fn shade(scene: &Scene, light: &Light, gbuffer: &GBuffer, params: ShadowMapParams) -> VisibilityImage {
    let (maps, _) = ShadowMap::new(params).prepare(scene, light);
    let mut visibility = VisibilityImage::new(gbuffer.width, gbuffer.height);
    maps.shade(gbuffer, &mut visibility);
    visibility
}

/// A lit plane is lit, from any angle, at any size of map and scale. V of `moments` is a bound that its rounding moves:
/// by less than 1/255.
#[test]
fn no_variant_has_acne_on_a_plane() {
    for scale in [1e-3, 1.0, 1e4] {
        let ground = square("ground", Vec3::ZERO, 4.0 * scale);
        let scene = scene_of(&[ground, square("below", Vec3::NEG_Y * scale, 4.0 * scale)]);
        let camera = camera(Vec3::new(1.0, 3.0, 5.0) * scale, Vec3::new(0.0, 0.0, 0.5) * scale, scale);
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        for degrees in [0.0f32, 15.0, 45.0, 70.0, 85.0, 89.0, 89.9] {
            let tilt = degrees.to_radians();
            let direction = Vec3::new(tilt.sin() * 0.8, -tilt.cos(), tilt.sin() * 0.6);
            // The whole sun is above the plane.
            let angular_radius = 0.5 * (90.0 - degrees).to_radians().min(0.02);
            let light = Light::Directional { direction, angular_radius };
            for map_size in [64, 1024] {
                for params in settings() {
                    let params = ShadowMapParams { map_size, ..params };
                    let visibility = shade(&scene, &light, &gbuffer, params);
                    let bound = if params.variant == Variant::Moments { 1.0 - 1.0 / 255.0 } else { 1.0 };
                    let ground = (0..gbuffer.pixel_count()).filter(|&i| gbuffer.object[i] == 0);
                    let dark = ground
                        .clone()
                        .filter(|&i| visibility.values[i].is_nan() || visibility.values[i] < bound)
                        .count();
                    let least = ground.map(|i| visibility.values[i]).fold(1.0, f32::min);
                    assert_eq!(dark, 0, "{degrees}°, scale {scale}, down to {least}: {params:?}");
                }
            }
        }
    }
}

/// Half a plane over the ground under a rect light: V falls linearly over the penumbra, which is as wide as the light
/// seen through the edge. Points of the light are stratified, so V of 256 is off by at most one row of them, 1/16, and
/// the map by a texel of its 1024, here 0.004 of a penumbra 0.5 wide.
#[test]
fn pcss_has_the_penumbra_of_a_half_plane() {
    // The caster is so long that its other edges are out of reach.
    let scene =
        scene_of(&[square("ground", Vec3::ZERO, 3.0), square("caster", Vec3::new(-2.0, 1.0, 0.0), 2.0)]);
    let center = Vec3::new(0.0, 3.0, 0.0);
    let light = Light::Rect { center, half_u: Vec3::X * 0.5, half_v: Vec3::Z * 0.5 };
    let camera = camera(Vec3::new(0.5, 0.6, 0.0), Vec3::new(-0.1, 0.0, 0.0), 1.0);
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let params = ShadowMapParams { variant: Variant::Pcss, taps: 256, ..Default::default() };
    let visibility = shade(&scene, &light, &gbuffer, params);
    let (mut compared, mut partial) = (0, 0);
    for pixel in (0..gbuffer.pixel_count()).filter(|&i| gbuffer.object[i] == 0) {
        let p = gbuffer.position[pixel];
        if p.z.abs() > 0.5 {
            continue;
        }
        // The light's point at x is hidden if the line to it crosses height 1 at a negative x: x < −2·p.x.
        let expected = (0.5 + 2.0 * p.x).clamp(0.0, 1.0);
        let got = visibility.values[pixel];
        assert!((got - expected).abs() <= 1.0 / 16.0 + 0.02, "{p}: {got} for {expected}");
        compared += 1;
        partial += usize::from(expected > 0.0 && expected < 1.0);
    }
    assert!(compared > 500 && partial > 200, "{partial} of {compared} in the penumbra");
}

/// Skipping changes no bit of any variant; under a light in a room, and from outside.
#[test]
fn skipping_changes_nothing() {
    for spec in ["chess", "cornell", "fence"] {
        let mut setup = scenes::build(spec, 0.0).expect("a built-in scene");
        (setup.camera.width, setup.camera.height) = (96, 72);
        let scene = &setup.scene;
        let gbuffer = raster::render_gbuffer(scene, &setup.camera);
        let inside = scene.bounds().center() + scene.bounds().size() * 0.1;
        for light in
            [setup.lights[0], Light::Sphere { center: inside, radius: scene.bounds().size().length() * 0.02 }]
        {
            for params in settings() {
                let params = ShadowMapParams { map_size: 256, ..params };
                let bits = [true, false].map(|skip| {
                    let image = shade(scene, &light, &gbuffer, ShadowMapParams { skip, ..params });
                    image.bits()
                });
                let different = bits[0].iter().zip(&bits[1]).filter(|(a, b)| a != b).count();
                assert_eq!(different, 0, "{spec}, {light:?}: {params:?}");
            }
        }
    }
}

/// Every variant answers for scenes without area, lights on the geometry and points that are none.
#[test]
fn anything_is_answered() {
    let x = Vec3::X;
    let triangle =
        |corners: [Vec3; 3]| scene_of(&[TriangleMesh::new("t", corners.to_vec(), vec![[0, 1, 2]])]);
    let scenes = [
        Scene::new(),
        triangle([Vec3::ZERO, x, Vec3::Z]),
        triangle([Vec3::ZERO; 3]),
        triangle([x * 1e30, Vec3::Z * 1e30, -x * 1e30]),
        triangle([x * 1e-30, Vec3::Z * 1e-30, -x * 1e-30]),
    ];
    let lights = [
        Light::Directional { direction: Vec3::NEG_Y, angular_radius: 1.5 },
        Light::Sphere { center: Vec3::ZERO, radius: 0.5 },
        Light::Rect { center: Vec3::Y, half_u: x, half_v: Vec3::Y },
        Light::Disk { center: Vec3::Y * 2.0, normal: Vec3::NEG_Y, radius: 1.0 },
        Light::Point { position: Vec3::ZERO },
        Light::Spot { position: Vec3::Y, direction: Vec3::NEG_Y, outer: 1.57, inner: 0.1 },
    ];
    let camera = camera(Vec3::new(0.0, 2.0, 4.0), Vec3::ZERO, 1.0);
    for (scene, light) in scenes.iter().flat_map(|scene| lights.iter().map(move |light| (scene, light))) {
        let gbuffer = raster::render_gbuffer(scene, &camera);
        for params in settings() {
            for map_size in [1, 64] {
                let params = ShadowMapParams { map_size, ..params };
                let image = shade(scene, light, &gbuffer, params);
                for (pixel, &v) in image.values.iter().enumerate() {
                    let sound = gbuffer.is_seen(pixel) == (0.0..=1.0).contains(&v);
                    assert!(sound, "{light:?}, {params:?}: pixel {pixel} is {v}");
                }
                let (maps, _) = ShadowMap::new(params).prepare(scene, light);
                let mut values = [7.0; 3];
                maps.visibility_at(&[Vec3::NAN, Vec3::splat(f32::INFINITY), x * 0.3], &mut values);
                assert!(
                    values[0].is_nan() && values[1].is_nan() && (0.0..=1.0).contains(&values[2]),
                    "{values:?}"
                );
            }
        }
    }
}

/// Around a light between the faces of its cube, the filters go on without a seam: over the floor of a room with a
/// post in it, pixels on both sides of a face's border differ no more than V does within a filter.
#[test]
fn filters_cross_the_borders_of_faces() {
    let bar = square("bar", Vec3::new(0.0, 0.4, 0.0), 0.3);
    let room = [square("floor", Vec3::ZERO, 3.0), square("ceiling", Vec3::Y * 3.0, 3.0), bar];
    let scene = scene_of(&room);
    let center = Vec3::new(0.9, 1.3, 0.0);
    let light = Light::Sphere { center, radius: 0.15 };
    let camera = camera(Vec3::new(-0.5, 1.6, 1.5), Vec3::new(-0.2, 0.0, 0.0), 1.0);
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let truth = ShadowMapParams { variant: Variant::Pcss, taps: 64, map_size: 512, ..Default::default() };
    let cube = shade(&scene, &light, &gbuffer, truth);
    // The same without the ceiling: one view, no border.
    let scene = scene_of(&[square("floor", Vec3::ZERO, 3.0), square("bar", Vec3::new(0.0, 0.4, 0.0), 0.3)]);
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let lone = shade(&scene, &light, &gbuffer, truth);
    let floor = (0..gbuffer.pixel_count()).filter(|&i| gbuffer.object[i] == 0);
    let sum: f32 = floor.clone().map(|i| (cube.values[i] - lone.values[i]).powi(2)).sum();
    let rmse = (sum / floor.count() as f32).sqrt();
    // Both are estimates by 64 points, each off by 1/8 in V at worst and by far less where the light is whole.
    assert!(rmse < 0.03, "{rmse}");
}

/// A square over the ground, from a sun at many angles: every pixel farther from the shadow's outline than the filter
/// reaches is wholly lit or wholly dark. `moments` is a bound of V from above and is not asked in the shadow.
#[test]
fn shadows_are_whole_away_from_their_edges() {
    for scale in [1e-3, 1.0, 1e4] {
        let height = 0.5 * scale;
        let caster = square("caster", Vec3::Y * height, 1.0 * scale);
        let scene = scene_of(&[square("ground", Vec3::ZERO, 4.0 * scale), caster]);
        let camera = camera(Vec3::new(1.0, 3.0, 5.0) * scale, Vec3::new(0.0, 0.0, 0.5) * scale, scale);
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        for degrees in [0.0f32, 30.0, 60.0, 75.0] {
            let tilt = degrees.to_radians();
            let angular_radius = 0.005;
            let direction = Vec3::new(tilt.sin() * 0.8, -tilt.cos(), tilt.sin() * 0.6);
            let light = Light::Directional { direction, angular_radius };
            let shift = direction * (height / tilt.cos());
            for map_size in [64, 256, 1024] {
                for params in settings() {
                    let params = ShadowMapParams { map_size, ..params };
                    let visibility = shade(&scene, &light, &gbuffer, params);
                    // The map spans the square's diagonal at most; a texel's footprint is stretched by the slope. The
                    // filter reaches half its width and a texel, the penumbra half of its own.
                    let texel = 2.0 * 2f32.sqrt() * scale / map_size as f32 * 2f32.sqrt() / tilt.cos();
                    let penumbra = height / tilt.cos().powi(2) * angular_radius * 1.05;
                    let reach = texel * (params.filter as f32 * 0.5 + 1.5) + penumbra;
                    for pixel in (0..gbuffer.pixel_count()).filter(|&i| gbuffer.object[i] == 0) {
                        let on_caster = gbuffer.position[pixel] - shift;
                        let outside = on_caster.x.abs().max(on_caster.z.abs()) - scale;
                        let v = visibility.values[pixel];
                        let is_right = if outside > reach {
                            v > 1.0 - 1.0 / 255.0
                        } else {
                            outside >= -reach || v == 0.0 || params.variant == Variant::Moments
                        };
                        assert!(is_right, "{v}, {outside} outside, {degrees}°, scale {scale}: {params:?}");
                    }
                }
            }
        }
    }
}
