//! Input at the edge of what has a meaning: an answer, never a panic.

use glam::{Affine3A, Vec3};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant};
use scene_core::geometry::ObjectFlags;
use scene_core::technique::conformance;
use scene_core::{Light, TriangleMesh, VisibilityImage, raster};

fn small(variant: Variant) -> ShadowMap {
    ShadowMap::new(ShadowMapParams { variant, map_size: 64, views: 4, ..Default::default() })
}

#[test]
fn every_scene_and_light_is_answered() {
    for variant in Variant::ALL {
        conformance::assert_answers(&small(variant));
    }
}

#[test]
fn free_points_that_are_not_finite_stay_unknown() {
    for variant in Variant::ALL {
        conformance::assert_answers_free_points(&small(variant));
    }
}

#[test]
fn buffers_of_the_wrong_size_are_refused() {
    for variant in Variant::ALL {
        conformance::assert_refuses_wrong_sizes(&small(variant));
    }
}

#[test]
fn skipping_never_changes_the_image() {
    // A light between floor and ceiling: the faces to the sides are empty.
    let mut scene = conformance::triangle([
        Vec3::new(-0.5, -1.0, -0.5),
        Vec3::new(0.5, -1.0, -0.5),
        Vec3::new(0.0, -1.0, 0.5),
    ]);
    for height in [-0.8, 0.8, 1.0] {
        let small = TriangleMesh::new("s", vec![Vec3::ZERO, Vec3::X * 0.2, Vec3::Z * 0.2], vec![[0, 1, 2]]);
        let place = Affine3A::from_translation(Vec3::new(0.0, height, -0.2));
        scene.add(&small, place, ObjectFlags::default()).expect("finite");
    }
    let gbuffer = raster::render_gbuffer(&scene, &conformance::CAMERA);
    let light = Light::Point { position: Vec3::new(0.0, 0.1, 0.0) };
    let mut images = Vec::new();
    for skip in [true, false] {
        let (maps, report) =
            ShadowMap::new(ShadowMapParams { skip, ..Default::default() }).prepare(&scene, &light);
        assert_eq!(report.skipped["faces"] > 0, skip);
        let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
        maps.shade(&gbuffer, &mut image);
        images.push(image.bits());
    }
    assert_eq!(images[0], images[1]);
}

/// A scene far from zero is shaded about as well as at zero: half as much again. `AliasFree` answers as shadow rays in the world do, and
/// so does `Cascaded` under a light without a place; the spot is looked up in maps by all others.
#[test]
fn far_from_zero_shadows_stay() {
    for variant in Variant::ALL.into_iter().filter(|&variant| variant != Variant::AliasFree) {
        let error =
            conformance::far_from_zero(&ShadowMap::new(ShadowMapParams { variant, ..Default::default() }));
        assert!(error.there <= 1.5 * error.here, "{variant:?}: {error:?}");
    }
}

/// Vertices are read from the second piece that they are bound in as from the first.
#[cfg(feature = "gpu")]
#[test]
fn scenes_bound_in_two_pieces_look_the_same() {
    for variant in Variant::ALL {
        let params = ShadowMapParams { variant, map_size: 128, views: 4, ..Default::default() };
        conformance::assert_same_in_two_pieces(&ShadowMap::new(params));
    }
}
