//! What lives as long as the scene does.

use std::sync::Arc;

use scene_core::geometry::Surfaces;
use scene_core::{Report, Scene};

use crate::points::PointClouds;
use crate::{Lookup, PsmParams};

/// Point clouds and surfaces of a scene's casters. Independent of light and camera.
#[derive(Clone, Debug, Default)]
pub struct Casters {
    /// Of the objects that are marked to be drawn as points.
    pub clouds: PointClouds,
    /// Where lookups follow them: [`Lookup::Surface`].
    pub surfaces: Option<Arc<Surfaces>>,
}

impl Casters {
    /// Those of `scene`, as far as these settings need them. `prepare.points`, `prepare.surfaces`.
    pub fn new(scene: &Scene, params: &PsmParams, report: &mut Report) -> Self {
        let clouds = report.time("prepare.points", |_| PointClouds::new(scene));
        let surfaces = (params.lookup == Lookup::Surface).then(|| {
            report.time("prepare.surfaces", |_| {
                // More triangles than can be numbered are looked up by texels.
                Surfaces::new(scene).ok().map(Arc::new)
            })
        });
        let casters = Self { clouds, surfaces: surfaces.flatten() };
        report.bytes += casters.bytes();
        casters
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        self.clouds.bytes() + self.surfaces.as_ref().map_or(0, |surfaces| surfaces.bytes())
    }
}
