//! Penumbrae that are known in closed form.

use glam::{Affine3A, Vec3};
use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams};
use scene_core::geometry::ObjectFlags;
use scene_core::technique::ShadowQuery;
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};

fn square(name: &str, center: Vec3, half: f32) -> TriangleMesh {
    let corner = |x: f32, z: f32| center + Vec3::new(x * half, 0.0, z * half);
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    TriangleMesh::new(name, positions, vec![[0, 1, 2], [0, 2, 3]])
}

fn shade(
    scene: &Scene,
    light: &Light,
    camera: &Camera,
    params: ContactHardeningParams,
) -> (GBuffer, VisibilityImage) {
    let gbuffer = raster::render_gbuffer(scene, camera);
    let query = ShadowQuery { scene, light, camera };
    let (prepared, _) = ContactHardening::new(params).prepare(&query).expect("own map");
    let mut visibility = VisibilityImage::new(camera.width, camera.height);
    prepared.shade(camera, &gbuffer, &mut visibility).expect("sizes match");
    (gbuffer, visibility)
}

/// A half-plane at height 1 whose edge is x = 0, a rect light of half width ½ at height 4: the line from x on the
/// ground through the edge meets the light's plane at −3x, so V = ½ + 3x.
///
/// Bound: 64 points of a (0, 2)-sequence, shifted, miss the length of an interval by 2/64 at most. S is that of the
/// nearest pixel, half a pixel off, and its edge half a texel more: shares of a penumbra ⅓ wide.
#[test]
fn a_half_plane_under_a_rect_has_a_linear_penumbra() {
    let mut scene = Scene::new();
    for mesh in [square("ground", Vec3::ZERO, 8.0), square("caster", Vec3::new(-8.0, 1.0, 0.0), 8.0)] {
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
    }
    let light = Light::Rect { center: Vec3::Y * 4.0, half_u: Vec3::X * 0.5, half_v: Vec3::Z * 0.3 };
    let eye = Vec3::new(3.0, 5.0, 0.0);
    let camera = Camera {
        eye,
        target: Vec3::ZERO,
        up: Vec3::Z,
        fov_y: 0.2,
        near: 0.01,
        far: f32::INFINITY,
        width: 160,
        height: 120,
    };
    // Seen aslant, a pixel is longer by 1/cos.
    let pixel = 2.0 * camera.tan_half_fov().y / 120.0 * eye.length() * (eye.length() / eye.y);
    let texel = 16.0 / 2048.0 * (4.0 / 3.0);
    let bound = 2.0 / 64.0 + 3.0 * (0.5 * pixel + 0.5 * texel) + 1e-3;
    for fill in [true, false] {
        let params = ContactHardeningParams { fill, ..Default::default() };
        let (gbuffer, visibility) = shade(&scene, &light, &camera, params);
        let (mut penumbra, mut worst) = (0, 0.0f32);
        for (p, v) in gbuffer.position.iter().zip(&visibility.values) {
            // Away from the border, beyond which there is no S, and on the ground.
            if p.y < 0.5 && p.z.abs() < 0.4 && p.x.abs() < 0.3 {
                let expected = (0.5 + 3.0 * p.x).clamp(0.0, 1.0);
                worst = worst.max((v - expected).abs());
                penumbra += usize::from(expected > 0.0 && expected < 1.0);
            }
        }
        assert!(worst <= bound && penumbra > 1000, "fill {fill}: {worst} > {bound}, {penumbra} in penumbra");
    }
}

/// The umbra shrinks and the penumbra grows with the light, on both sides of the hard shadow's edge.
#[test]
fn the_umbra_shrinks_as_the_light_grows() {
    let mut last: Option<(usize, usize)> = None;
    for size in ["0.05", "0.2", "0.4", "0.7"] {
        let mut setup = scenes::build(&format!("ball:light={size}"), 0.0).expect("built in");
        (setup.camera.width, setup.camera.height) = (160, 120);
        let params = ContactHardeningParams::default();
        let (gbuffer, image) = shade(&setup.scene, &setup.lights[0], &setup.camera, params);
        let count = |accepts: fn(f32) -> bool| {
            let on_slab = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.object[pixel] == 0);
            on_slab.filter(|&pixel| accepts(image.values[pixel])).count()
        };
        let (umbra, shaded) = (count(|v| v < 0.01), count(|v| v < 0.99));
        if let Some((umbra_before, shaded_before)) = last {
            assert!(umbra < umbra_before && shaded > shaded_before, "{size}: {umbra}, {shaded}");
        }
        last = Some((umbra, shaded));
    }
}
