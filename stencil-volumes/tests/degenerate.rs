//! Input at the edge of what has a meaning: an answer, never a panic.

use glam::{Affine3A, Vec2, Vec3};
use gnomon_stencil_volumes::{Casters, StencilVolumes, Variant, VolumeParams};
use scene_core::geometry::{AlphaMask, ObjectFlags, Wrap};
use scene_core::technique::conformance;
use scene_core::{Scene, TriangleMesh, VisibilityImage, raster};

const VARIANTS: [Variant; 2] = [Variant::Planar, Variant::Volumes];

fn of(variant: Variant) -> StencilVolumes {
    StencilVolumes::new(VolumeParams { variant, ..Default::default() })
}

#[test]
fn every_scene_and_light_is_answered() {
    for variant in VARIANTS {
        conformance::assert_answers(&of(variant));
    }
}

#[test]
fn free_points_that_are_not_finite_stay_unknown() {
    for variant in VARIANTS {
        conformance::assert_answers_free_points(&of(variant));
    }
}

#[test]
fn buffers_of_the_wrong_size_are_refused() {
    for variant in VARIANTS {
        conformance::assert_refuses_wrong_sizes(&of(variant));
    }
}

/// Half of a leaf is cut out: the other half throws a shadow, as rays say.
#[test]
fn masks_are_asked_by_rays() {
    let corner = |x: f32, z: f32| Vec3::new(x, 1.0, z);
    let corners = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let mut leaf = TriangleMesh::new("leaf", corners.clone(), vec![[0, 1, 2], [0, 2, 3]]);
    leaf.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    leaf.alpha = AlphaMask::from_alpha(2, 1, &[0, 255], 0.5, [Wrap::Repeat; 2]).map(Into::into);
    let ground = corners.iter().map(|p| Vec3::new(p.x * 9.0, 0.0, p.z * 9.0)).collect();
    let ground = TriangleMesh::new("ground", ground, vec![[0, 1, 2], [0, 2, 3]]);
    let mut scene = Scene::new();
    for mesh in [&ground, &leaf] {
        scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    }
    let camera = conformance::CAMERA.with_size(160, 120);
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let casters = Casters::new(&scene).expect("few triangles");
    for variant in VARIANTS {
        let (prepared, _) = of(variant).prepare(&casters, &conformance::LIGHTS[0], &camera);
        let mut visibility = VisibilityImage::new(camera.width, camera.height);
        let report = prepared.shade(&gbuffer, &mut visibility);
        let (mut dark, mut lit) = (0, 0);
        for pixel in (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.object[pixel] == 0) {
            let place = gbuffer.position[pixel];
            // A pixel is 0.03 wide here; its outline is snapped to 1/256 of that by planar shadows.
            if (place.x.abs() - 1.0).abs() < 1e-3
                || (place.z.abs() - 1.0).abs() < 1e-3
                || place.x.abs() < 1e-3
            {
                continue;
            }
            let under = place.x > 0.0 && place.x < 1.0 && place.z.abs() < 1.0;
            assert_eq!(visibility.values[pixel], if under { 0.0 } else { 1.0 }, "{variant:?} at {place}");
            dark += usize::from(under);
            lit += usize::from(!under);
        }
        assert!(dark > 100 && lit > 1000, "{variant:?}: {dark} dark, {lit} lit");
        if variant == Variant::Volumes {
            assert!(report.skipped["pixels no mask is before"] > 1000);
        }
    }
}

/// Vertices are read from the second piece that they are bound in as from the first.
#[cfg(feature = "gpu")]
#[test]
fn scenes_bound_in_two_pieces_look_the_same() {
    for variant in VARIANTS {
        conformance::assert_same_in_two_pieces(&of(variant));
    }
}
