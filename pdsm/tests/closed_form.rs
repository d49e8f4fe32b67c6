//! Shadows whose V is known in closed form.

use glam::{Affine3A, Vec3};
use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::geometry::ObjectFlags;
use scene_core::{Camera, Light, Scene, TriangleMesh, VisibilityImage, raster};

fn rectangle(name: &str, min: Vec3, max: Vec3) -> TriangleMesh {
    let y = min.y;
    let positions = [(min.x, min.z), (min.x, max.z), (max.x, max.z), (max.x, min.z)];
    let positions = positions.map(|(x, z)| Vec3::new(x, y, z)).to_vec();
    TriangleMesh::new(name, positions, vec![[0, 1, 2], [0, 2, 3]])
}

fn scene_of(meshes: &[TriangleMesh]) -> Scene {
    let mut scene = Scene::new();
    for mesh in meshes {
        scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
    }
    scene
}

/// A half-plane x < 0 at height 1 under a square light of side 2·HALF at height 4: on the floor V is linear in x, from
/// 0 at −HALF/3 to 1 at HALF/3.
///
/// Bound: `max_error`, half a level of V (1/(2·√views) along the one axis that matters, of whose strata one is cut), and
/// what a pixel of the PDSM spans of the penumbra, bilinear twice over.
#[test]
fn half_plane_under_a_rect_is_linear() {
    const HALF: f32 = 0.6;
    let light =
        Light::Rect { center: Vec3::new(0.0, 4.0, 0.0), half_u: Vec3::X * HALF, half_v: Vec3::Z * HALF };
    let scene = scene_of(&[
        rectangle("floor", Vec3::new(-2.0, 0.0, -2.0), Vec3::new(2.0, 0.0, 2.0)),
        rectangle("caster", Vec3::new(-1.5, 1.0, -1.5), Vec3::new(0.0, 1.0, 1.5)),
    ]);
    for (views, size) in [(64, 256), (256, 512)] {
        let params =
            PdsmParams { views, map_size: size, pdsm_size: size, max_error: 0.004, ..Default::default() };
        let (pdsm, _) = Pdsm::new(params).prepare(&scene, &light);
        let points: Vec<_> = (0..400).map(|i| Vec3::new(i as f32 / 400.0 - 0.5, 0.0, 0.01)).collect();
        let mut values = vec![f32::NAN; points.len()];
        pdsm.visibility_at(&points, &mut values);
        let width = 2.0 * HALF / 3.0;
        // The window spans less than 8 units of floor; two pixels of it.
        let pixel = 8.0 / size as f32;
        let bound = 0.004 + 0.5 / (views as f32).sqrt() + 2.0 * pixel / width;
        let mut worst = 0.0f32;
        for (point, v) in points.iter().zip(&values) {
            let expected = (point.x / width + 0.5).clamp(0.0, 1.0);
            worst = worst.max((v - expected).abs());
        }
        assert!(worst < bound, "{views} views, {size}²: {worst} for {bound}");
        assert!(values[0] <= 0.004 && values[399] == 1.0, "the ends are umbra and light");
    }
}

/// A lit plane that is also a caster shadows nothing of itself, whatever the angle, size of map, scale or place.
#[test]
fn no_acne_on_a_plane_at_any_angle_size_and_scale() {
    for scale in [1e-3, 1.0, 1e4] {
        // A second caster, far below, keeps the ground from being left out.
        let meshes = [("ground", 0.0), ("below", -1.0)].map(|(name, y)| {
            rectangle(name, Vec3::new(-4.0, y, -4.0) * scale, Vec3::new(4.0, y, 4.0) * scale)
        });
        let scene = scene_of(&meshes);
        let camera = Camera {
            eye: Vec3::new(1.0, 3.0, 5.0) * scale,
            target: Vec3::new(0.0, 0.0, 0.5) * scale,
            up: Vec3::Y,
            fov_y: 0.9,
            near: 0.01 * scale,
            far: f32::INFINITY,
            width: 64,
            height: 48,
        };
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        for degrees in [0.0f32, 30.0, 60.0, 80.0, 85.0] {
            let tilt = degrees.to_radians();
            let towards = Vec3::new(-tilt.sin() * 0.8, tilt.cos(), -tilt.sin() * 0.6);
            let center = towards * 12.0 * scale;
            let (u, v) = towards.any_orthonormal_pair();
            let lights = [
                Light::Directional { direction: -towards, angular_radius: 0.02 },
                Light::Rect { center, half_u: u * 0.3 * scale, half_v: v * 0.3 * scale },
                Light::Sphere { center, radius: 0.3 * scale },
            ];
            for light in lights {
                for size in [33, 128] {
                    let params = PdsmParams {
                        views: 9,
                        map_size: size,
                        pdsm_size: size,
                        max_error: 0.0,
                        ..Default::default()
                    };
                    let (pdsm, _) = Pdsm::new(params).prepare(&scene, &light);
                    let mut image = VisibilityImage::new(camera.width, camera.height);
                    pdsm.shade(&gbuffer, &mut image);
                    let ground: Vec<_> = (0..gbuffer.pixel_count())
                        .filter(|&pixel| gbuffer.object[pixel] == 0)
                        .filter(|&pixel| light.is_above_plane(gbuffer.position[pixel], gbuffer.normal[pixel]))
                        .collect();
                    let dark = ground.iter().filter(|&&pixel| image.values[pixel] != 1.0).count();
                    assert_eq!(dark, 0, "{degrees}°, map {size}, scale {scale}, {light:?}");
                    assert!(ground.len() > 1000);
                }
            }
        }
    }
}

/// With one view the light is a point, and the shadow the projection of its caster.
#[test]
fn one_view_of_a_point_light_is_a_hard_shadow() {
    let place = Vec3::new(0.3, 3.0, -0.2);
    let scene = scene_of(&[
        rectangle("floor", Vec3::new(-4.0, 0.0, -4.0), Vec3::new(4.0, 0.0, 4.0)),
        rectangle("caster", Vec3::new(-0.5, 1.0, -0.5), Vec3::new(0.5, 1.0, 0.5)),
    ]);
    let params = PdsmParams { map_size: 256, pdsm_size: 256, ..Default::default() };
    let (pdsm, report) = Pdsm::new(params).prepare(&scene, &Light::Point { position: place });
    assert_eq!(pdsm.windows()[0].layout.steps().len(), 1);
    assert_eq!(report.skipped["casters"], 1);
    let points: Vec<_> = (0..900)
        .map(|i| Vec3::new((i % 30) as f32 / 10.0 - 1.5, 0.0, (i / 30) as f32 / 10.0 - 1.5))
        .collect();
    let mut values = vec![f32::NAN; points.len()];
    pdsm.visibility_at(&points, &mut values);
    let (mut dark, mut lit) = (0, 0);
    for (point, &v) in points.iter().zip(&values) {
        let on_caster = (*point - place) * (2.0 / 3.0) + place;
        // A shadow of 1.5 units; three pixels of a window that is a little larger.
        let distance = (on_caster.x.abs().max(on_caster.z.abs()) - 0.5) * 1.5;
        if distance.abs() > 3.0 * 1.6 / 256.0 {
            assert_eq!(v, if distance < 0.0 { 0.0 } else { 1.0 }, "at {point}");
            (dark, lit) = (dark + usize::from(v == 0.0), lit + usize::from(v == 1.0));
        }
    }
    assert!(dark > 100 && lit > 100);
}
