//! The far sides of solid casters as the light's centre sees them: a second map beside that of pass 1.
//!
//! One map holds what the light's centre sees. A line to another point of a large light may pass below that, through the caster: into
//! its side, out at its back. Of a [solid](crate::solids) all between the side that is seen and the nearest face turned away is
//! inside. Other casters are drawn into the second map as into the first: they are as thin there as they are.

use std::ops::Range;

use glam::Vec3;
use gnomon_shadow_map::light_maps::{LightMaps, ShadowMapView};
use scene_core::raster::{Cull, DepthMap, DepthOptions, RasterScratch, render_depth_into};

use crate::solids::is_solid;

/// Far sides, one map a view; none where no caster is solid.
#[derive(Clone, Debug, Default)]
pub struct Backs {
    maps: Vec<DepthMap>,
}

/// Casters as ranges of triangles.
#[derive(Clone, Debug, Default)]
pub struct Casters {
    /// Those that are solid.
    pub solid: Vec<Range<usize>>,
    /// The others.
    pub thin: Vec<Range<usize>>,
}

impl Casters {
    /// What `maps` are drawn of.
    pub fn of(maps: &LightMaps<'_>) -> Self {
        let mut casters = Self::default();
        let scene = &maps.scene;
        let is_backdrop =
            |range: &Range<usize>| maps.backdrops.iter().any(|backdrop| backdrop.triangles == *range);
        for object in scene.objects().iter().filter(|object| object.flags.casts) {
            if !is_backdrop(&object.triangles) {
                let kind = if is_solid(scene, object) { &mut casters.solid } else { &mut casters.thin };
                kind.push(object.triangles.clone());
            }
        }
        casters
    }
}

impl Backs {
    /// `prepare.backs`: draws them.
    pub fn draw(maps: &LightMaps<'_>) -> Self {
        let casters = Casters::of(maps);
        if casters.solid.is_empty() {
            return Self::default();
        }
        let mut scratch = RasterScratch::new();
        let mut thin = DepthMap::default();
        let draw = |view: &ShadowMapView| {
            let mut back = DepthMap { width: view.map.width, height: view.map.height, ..Default::default() };
            if view.map.depth.iter().all(|&depth| depth == 0.0) {
                return back;
            }
            let mut render = |ranges: &[Range<usize>], cull: Cull, target: &mut DepthMap| {
                let options = DepthOptions { triangles: Some(ranges), cull, ..Default::default() };
                let projection = view.view.projection_from_world;
                render_depth_into(&maps.scene, projection, &options, &mut scratch, target);
            };
            render(&casters.solid, Cull::Front, &mut back);
            if !casters.thin.is_empty() {
                (thin.width, thin.height) = (back.width, back.height);
                render(&casters.thin, Cull::None, &mut thin);
                for (depth, &thin) in back.depth.iter_mut().zip(&thin.depth) {
                    *depth = depth.max(thin);
                }
            }
            back
        };
        Self { maps: maps.maps.iter().map(draw).collect() }
    }

    /// The far side in a texel of `map`, the view of this index, if it holds any.
    #[inline]
    pub fn point(&self, map: &ShadowMapView, view: usize, [column, row]: [usize; 2]) -> Option<Vec3> {
        let back = self.maps.get(view)?;
        let depth =
            back.depth.get(row * back.width as usize + column).copied().filter(|&depth| depth > 0.0)?;
        Some(map.view.unproject(map.center([column, row]), depth))
    }

    /// Whether there are any.
    pub fn is_empty(&self) -> bool {
        self.maps.is_empty()
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        self.maps.iter().map(|map| size_of_val(map.depth.as_slice()) as u64).sum()
    }
}
