//! What ground truth asks of a spatial index. The [`Bvh`] answers; in tests an analytic shape can.

use glam::Vec3;

use crate::bvh::Bvh;
use crate::geometry::Aabb;
use crate::light::LightPoint;

/// Something that blocks light.
pub trait Occlusion: Sync {
    /// Sets `blocked[i]` to whether anything lies between `origin` and `targets[i]`. Slices of equal length.
    fn occluded_from(&self, origin: Vec3, targets: &[LightPoint], blocked: &mut [bool]);

    /// The tree that answers, if there is one: whole lights are proved seen or hidden with it, and no sample of
    /// them is traced.
    fn tree(&self) -> Option<&Bvh> {
        None
    }
}

/// Something that finds the casters near a region.
pub trait CasterSearch: Sync {
    /// Walks nested boxes from the outside in: `enter` says of each whether to look inside, `triangle` is given
    /// every triangle (an index into [`Scene::triangles`](crate::Scene::triangles)) that throws shadows in the boxes
    /// entered.
    fn visit(&self, enter: impl FnMut(Aabb) -> bool, triangle: impl FnMut(u32));
}

impl Occlusion for Bvh {
    fn occluded_from(&self, origin: Vec3, targets: &[LightPoint], blocked: &mut [bool]) {
        self.occluded_from(origin, targets, blocked);
    }

    fn tree(&self) -> Option<&Bvh> {
        Some(self)
    }
}

impl CasterSearch for Bvh {
    fn visit(&self, enter: impl FnMut(Aabb) -> bool, triangle: impl FnMut(u32)) {
        self.visit(enter, triangle);
    }
}
