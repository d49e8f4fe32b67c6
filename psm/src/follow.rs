//! From the triangle that a texel keeps over its surface to the receiver's own ray.
//!
//! A texel says what the light sees at its centre, and the receiver lies up to half a diagonal beside it. Between the two the
//! surface goes on from triangle to triangle, or it ends: at a boundary, or where it turns from the light. So it is followed over
//! the edge beyond which the ray lies, until a triangle is met by the ray or there is none, and the outline of the shadow is the
//! mesh's, not the texels'.

use glam::Vec3;
use gnomon_shadow_map::receiver_plane::{edge_volumes, is_behind};
use scene_core::Scene;
use scene_core::geometry::{NO_TRIANGLE, Surfaces};
use scene_core::light::LightPoint;

/// Triangles looked at before a surface is given up: of a mesh whose triangles are a fifth of a texel's diagonal wide, as many as
/// lie between a texel's centre and its corner.
pub const STEPS: u32 = 16;

/// Where a surface leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Followed {
    /// The receiver's ray meets it before it reaches the light.
    Shadows,
    /// The receiver's ray meets it where the receiver is not behind it.
    InFront,
    /// It ends before the ray.
    Ends,
    /// Not known: the triangle is in no surface, or the ray is too many triangles away.
    Lost,
}

/// Follows the surface from the triangle `from` to the ray of `point` towards `light`. A receiver is behind a triangle if it is by more
/// than `tolerance`.
pub fn follow(
    scene: &Scene,
    surfaces: &Surfaces,
    from: u32,
    (point, tolerance): (Vec3, f32),
    light: LightPoint,
) -> Followed {
    if surfaces.of(from as usize).extent == 0.0 {
        return Followed::Lost;
    }
    let (mut triangle, mut before, mut facing) = (from, NO_TRIANGLE, 0.0);
    for _ in 0..STEPS {
        let corners = scene.corners(triangle as usize);
        let sides = edge_volumes(corners, point, light);
        let sum: f32 = sides.iter().sum();
        // Turned from the light, or edge-on: here it ends.
        if sum == 0.0 || sum * facing < 0.0 {
            return Followed::Ends;
        }
        facing = sum.signum();
        let sides = sides.map(|side| side * facing);
        if sides.iter().all(|&side| side >= 0.0) {
            let shadows = is_behind(corners, point, light, tolerance);
            return if shadows { Followed::Shadows } else { Followed::InFront };
        }
        // Over the edge that the ray is farthest beyond; not back.
        let across = surfaces.of(triangle as usize).across;
        let (mut farthest, mut next) = (0.0, NO_TRIANGLE);
        for (side, across) in sides.into_iter().zip(across) {
            if side < farthest && (across != before || across == NO_TRIANGLE) {
                (farthest, next) = (side, across);
            }
        }
        if next == NO_TRIANGLE {
            return Followed::Ends;
        }
        (before, triangle) = (triangle, next);
    }
    Followed::Lost
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;
    use scene_core::TriangleMesh;
    use scene_core::geometry::ObjectFlags;

    use super::*;

    const SUN: LightPoint = LightPoint::Towards(Vec3::new(0.3, 1.0, 0.2));
    const SIDE: u32 = 6;

    /// A square of `SIDE` × `SIDE` unit squares of two triangles each, at height 1 and bent up to `fold` beyond its middle column.
    fn sheet(fold: f32) -> (Scene, Surfaces) {
        let position = |i: u32| {
            let (x, z) = ((i % (SIDE + 1)) as f32, (i / (SIDE + 1)) as f32);
            let beyond = (x - 0.5 * SIDE as f32).max(0.0);
            Vec3::new(x - beyond * fold, 1.0 + beyond * fold, z)
        };
        let square = |i: u32| {
            let a = i / SIDE * (SIDE + 1) + i % SIDE;
            [[a, a + SIDE + 1, a + 1], [a + 1, a + SIDE + 1, a + SIDE + 2]]
        };
        let positions = (0..(SIDE + 1) * (SIDE + 1)).map(position).collect();
        let mesh = TriangleMesh::new("sheet", positions, (0..SIDE * SIDE).flat_map(square).collect());
        let mut scene = Scene::new();
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        let surfaces = Surfaces::new(&scene).unwrap();
        (scene, surfaces)
    }

    /// Where the ray of the point below leaves the sheet's plane.
    fn below([x, z]: [f32; 2]) -> Vec3 {
        let LightPoint::Towards(towards) = SUN else { unreachable!("a sun") };
        Vec3::new(x, 1.0, z) - towards
    }

    #[test]
    fn every_triangle_of_a_sheet_leads_to_the_ray_or_to_its_border() {
        let (scene, surfaces) = sheet(0.0);
        let triangles = 0..scene.triangles().len() as u32;
        for (place, expected) in [
            ([2.3, 4.6], Followed::Shadows),
            ([5.9, 0.1], Followed::Shadows),
            ([6.1, 2.0], Followed::Ends),
            ([-0.1, 6.2], Followed::Ends),
        ] {
            let led = triangles.clone().map(|t| follow(&scene, &surfaces, t, (below(place), 1e-5), SUN));
            assert!(led.clone().all(|led| led == expected || led == Followed::Lost), "{place:?}");
            assert!(led.filter(|&led| led == expected).count() > 40, "{place:?}");
        }
        // Above it nothing is before the light.
        let above = below([2.3, 4.6]) + Vec3::new(0.3, 1.0, 0.2) * 1.5;
        assert_eq!(follow(&scene, &surfaces, 0, (above, 1e-5), SUN), Followed::InFront);
        // On it, too, the sheet does not shadow itself.
        assert_eq!(follow(&scene, &surfaces, 0, (Vec3::new(2.3, 1.0, 4.6), 1e-5), SUN), Followed::InFront);
    }

    #[test]
    fn a_surface_ends_where_it_turns_from_the_light() {
        // Back over itself: seen from the other side beyond the middle.
        let (scene, surfaces) = sheet(1.5);
        let led = |place| follow(&scene, &surfaces, 0, (below(place), 1e-5), SUN);
        assert_eq!(led([2.9, 0.5]), Followed::Shadows);
        assert_eq!(led([3.4, 0.5]), Followed::Ends);
    }

    #[test]
    fn what_is_in_no_surface_leads_nowhere() {
        let (scene, _) = sheet(0.0);
        let flags = ObjectFlags { casts: false, ..Default::default() };
        let mut idle = Scene::new();
        let corners = scene.corners(0).to_vec();
        idle.add(&TriangleMesh::new("t", corners, vec![[0, 1, 2]]), Affine3A::IDENTITY, flags).unwrap();
        let surfaces = Surfaces::new(&idle).unwrap();
        assert_eq!(follow(&idle, &surfaces, 0, (below([0.2, 0.2]), 1e-5), SUN), Followed::Lost);
    }
}
