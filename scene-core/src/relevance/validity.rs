//! What stays valid from one frame to the next.

use crate::Scene;

/// What is different from the frame before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Change<'a> {
    /// The camera moved or its image has another size.
    pub camera: bool,
    /// The light moved or changed its extent.
    pub light: bool,
    /// Ids of objects whose vertices moved. Objects that came or went, or changed their flags or mask, make another
    /// scene: everything is remade.
    pub objects: &'a [u32],
}

/// What must be made again; what is `false` is still exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Remake {
    /// The G-buffer, and with it [`TileBounds`](super::TileBounds) and the valid pixels' view of it.
    pub gbuffer: bool,
    /// Bounds and trees over casters: [`CasterChunks`](super::CasterChunks), [`Bvh::casters`](crate::bvh::Bvh::casters).
    pub caster_bounds: bool,
    /// A preparation that depends on light and scene only
    /// ([`survives_camera`](crate::PreparedShadow::survives_camera)): maps, silhouettes.
    pub preparation: bool,
    /// [`CasterRegion`](super::CasterRegion), the choice of casters by it, and every preparation that depends on the
    /// camera.
    pub view_preparation: bool,
    /// The visibility image, and with it the [`TileClasses`](super::TileClasses).
    pub visibility: bool,
}

/// What `change` leaves invalid in `scene`.
///
/// | moves | stays |
/// | --- | --- |
/// | the camera | trees, chunks, preparations that do not depend on it |
/// | the light | G-buffer, tiles, trees, chunks |
/// | a caster | nothing but what has no casters in it |
/// | a receiver that does not cast | trees, chunks |
/// | an object that does neither | all but G-buffer and what follows from it |
///
/// A receiver that moves takes a preparation with it, because casters are left out by what lies behind them
/// ([`told_apart`](super::told_apart)). An id that the scene does not have counts as a caster. A moved caster whose
/// bounds before and after do not [`touch`](super::CasterRegion::touches) the region changes no visibility of
/// surfaces it does not carry; that is for the caller to ask.
pub fn what_remains(scene: &Scene, change: Change<'_>) -> Remake {
    let any = |test: fn(&crate::geometry::ObjectFlags) -> bool| {
        let flags = |&id: &u32| scene.objects().get(id as usize).map(|o| o.flags);
        change.objects.iter().any(|id| flags(id).is_none_or(|flags| test(&flags)))
    };
    let moved = !change.objects.is_empty();
    let shadows = any(|flags| flags.casts || flags.receives);
    Remake {
        gbuffer: change.camera || moved,
        caster_bounds: any(|flags| flags.casts),
        preparation: change.light || shadows,
        view_preparation: change.camera || change.light || shadows,
        visibility: change.camera || change.light || moved,
    }
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, Vec3};

    use super::*;
    use crate::TriangleMesh;
    use crate::geometry::ObjectFlags;

    /// Objects: 0 casts and receives, 1 receives, 2 casts, 3 does neither.
    fn scene() -> Scene {
        let mesh = TriangleMesh::new("t", vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        let mut scene = Scene::new();
        for (casts, receives) in [(true, true), (false, true), (true, false), (false, false)] {
            scene
                .add(
                    &mesh,
                    Affine3A::IDENTITY,
                    ObjectFlags { casts, receives, dynamic: true, ..Default::default() },
                )
                .unwrap();
        }
        scene
    }

    #[test]
    fn nothing_moved_nothing_remade() {
        assert_eq!(what_remains(&scene(), Change::default()), Remake::default());
    }

    #[test]
    fn a_camera_keeps_maps_and_a_light_keeps_the_gbuffer() {
        let camera = what_remains(&scene(), Change { camera: true, ..Default::default() });
        let all = Remake {
            gbuffer: true,
            caster_bounds: true,
            preparation: true,
            view_preparation: true,
            visibility: true,
        };
        assert_eq!(camera, Remake { caster_bounds: false, preparation: false, ..all });
        let light = what_remains(&scene(), Change { light: true, ..Default::default() });
        assert_eq!(light, Remake { gbuffer: false, caster_bounds: false, ..all });
    }

    #[test]
    fn an_objects_flags_decide() {
        let moved = |objects: &[u32]| {
            let r = what_remains(&scene(), Change { objects, ..Default::default() });
            (r.gbuffer, r.caster_bounds, r.preparation, r.view_preparation, r.visibility)
        };
        assert_eq!(moved(&[0]), (true, true, true, true, true));
        assert_eq!(moved(&[1]), (true, false, true, true, true));
        assert_eq!(moved(&[2]), (true, true, true, true, true));
        assert_eq!(moved(&[3]), (true, false, false, false, true));
        assert_eq!(moved(&[3, 9]), moved(&[0]));
    }
}
