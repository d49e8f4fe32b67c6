//! What ground truth asks of a spatial index. The [`Bvh`] answers; in tests an analytic shape can.

use std::ops::ControlFlow;

use glam::Vec3;

use crate::bvh::{Bvh, HalfSpace};
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

/// Something that finds the casters in a region.
pub trait CasterSearch: Sync {
    /// Calls `found` with every triangle (an index into [`Scene::triangles`](crate::Scene::triangles)) that throws
    /// shadows and may reach into what the half-spaces have in common, each once. All for none.
    fn each_in(&self, region: &[HalfSpace], found: impl FnMut(u32));
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
    fn each_in(&self, region: &[HalfSpace], mut found: impl FnMut(u32)) {
        let _never_breaks = self.visit_region(region, |triangle| {
            found(triangle);
            ControlFlow::Continue(())
        });
    }
}
