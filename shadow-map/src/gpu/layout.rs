//! Uniforms as the shaders read them. A test holds every offset against the linked WGSL.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};
use scene_core::Light;

use super::filter_maps::LevelTable;
use crate::light_views::{LightView, Unprojection};
use crate::pcss::light_pattern;
use crate::poisson_disk::poisson_disk;
use crate::{Kernel, ShadowMapParams, Variant};

/// `LightView` of `light_views.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ViewUniform {
    /// World to clip space.
    pub projection_from_world: Mat4,
    /// Where a central view sees from; the far, middle point of a parallel one.
    pub origin: Vec3,
    /// Distance at which reversed depth is 1; 0 for a parallel view.
    pub near: f32,
    /// World-space vector of a unit of NDC x.
    pub x: Vec3,
    /// Half the longer diagonal of the map: everywhere, or of a central view at distance 1.
    pub half_diagonal: f32,
    /// World-space vector of a unit of NDC y.
    pub y: Vec3,
    /// Zero.
    pub padding: u32,
    /// World-space vector of a unit of depth, or of a central view's axis to the middle of its map.
    pub z: Vec3,
    /// Zero.
    pub padding_2: u32,
}

impl ViewUniform {
    /// What shaders need of `view`.
    pub fn new(view: &LightView) -> Self {
        let (origin, near, x, y, z) = match view.unprojection() {
            Unprojection::Parallel { origin, x, y, z } => (origin, 0.0, x, y, z),
            Unprojection::Central { eye, forward, x, y, near } => (eye, near, x, y, forward),
        };
        Self {
            projection_from_world: view.projection_from_world,
            origin,
            near,
            x,
            half_diagonal: (x.length_squared() + y.length_squared()).sqrt(),
            y,
            padding: 0,
            z,
            padding_2: 0,
        }
    }
}

/// `Maps` of `light_views.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MapsUniform {
    /// Views, of which each has a layer.
    pub count: u32,
    /// [`plane_tolerance`](crate::receiver_plane::plane_tolerance).
    pub tolerance: f32,
    /// 1 where what cannot change V is left out.
    pub skip: u32,
    /// Numbers that a view has in the buffer of depths.
    pub layer: u32,
    /// Where each level starts there, as many as the largest map has and one to spare.
    pub levels: [u32; 16],
}

impl MapsUniform {
    /// What shaders must know of `count` maps.
    pub fn new(count: u32, tolerance: f32, params: &ShadowMapParams, table: &LevelTable) -> Self {
        let mut levels = [0; 16];
        for (start, level) in levels.iter_mut().zip(&table.levels) {
            *start = level.1;
        }
        Self { count, tolerance, skip: u32::from(params.skip), layer: table.layer, levels }
    }
}

/// `Level` of `prepare_depths.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LevelUniform {
    /// Texels a side.
    pub side: u32,
    /// Texels a side of the level below.
    pub side_below: u32,
    /// Where it starts in a view's depths.
    pub start: u32,
    /// Where the level below starts.
    pub start_below: u32,
}

/// `Filter` of `pcf.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FilterUniform {
    /// Texels a side of the grid; 0 for the disk.
    pub side: i32,
    /// Offsets of the disk.
    pub taps: u32,
    /// What a pixel's angle is drawn from.
    pub seed: u32,
    /// 1 where a caster's object is asked and not whether it is near.
    pub by_object: u32,
    /// Half the width of grid or disk in texels.
    pub radius: f32,
    /// Zero.
    pub padding: [u32; 3],
    /// In texels: as many as the setting `taps` may have.
    pub offsets: [[f32; 2]; 1024],
}

impl FilterUniform {
    /// The filter of these settings.
    pub fn new(params: &ShadowMapParams) -> Self {
        let mut filter = Self { seed: params.seed, ..Zeroable::zeroed() };
        filter.by_object = u32::from(params.variant == Variant::ObjectId);
        filter.radius = params.filter as f32 * 0.5;
        match params.kernel {
            Kernel::Grid => filter.side = params.filter as i32,
            Kernel::PoissonDisk => {
                filter.taps = params.taps.min(filter.offsets.len() as u32);
                let radius = filter.radius;
                for (offset, point) in filter.offsets.iter_mut().zip(poisson_disk(filter.taps, params.seed)) {
                    *offset = (point * radius).to_array();
                }
            }
        }
        filter
    }
}

/// `Soft` of `pcss.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SoftUniform {
    /// Points of the light.
    pub taps: u32,
    /// What a pixel's random numbers are drawn from.
    pub seed: u32,
    /// Zero.
    pub padding: [u32; 2],
    /// A point of the light, and where in a texel it is looked up: as many as the setting `taps` may have.
    pub points: [[f32; 4]; 1024],
}

impl SoftUniform {
    /// The points that stand for `light`.
    pub fn new(light: &Light, params: &ShadowMapParams) -> Self {
        let mut soft = Self { seed: params.seed, ..Zeroable::zeroed() };
        soft.taps = params.taps.min(soft.points.len() as u32);
        let (points, jitter) = light_pattern(light, params);
        for ((to, point), jitter) in soft.points.iter_mut().zip(points).zip(jitter) {
            *to = [point.x, point.y, jitter.x, jitter.y];
        }
        soft
    }
}

/// `Fit` of `cascades.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FitUniform {
    /// The light's axes: across.
    pub x: Vec3,
    /// How many cascades.
    pub count: u32,
    /// Upwards.
    pub y: Vec3,
    /// Texels a side of a map.
    pub size: f32,
    /// Towards the light.
    pub z: Vec3,
    /// How far a window reaches beyond its samples, in texels.
    pub border: f32,
    /// Of the casters drawn, in the light's axes.
    pub casters_min: Vec3,
    /// Zero.
    pub padding: u32,
    /// The other end.
    pub casters_max: Vec3,
    /// Zero.
    pub padding_2: u32,
    /// What positions are drawn relative to, world space.
    pub origin: Vec3,
    /// Zero.
    pub padding_3: u32,
}

/// `Irregular` of `irregular.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct IrregularUniform {
    /// Across a parallel view.
    pub x: Vec3,
    /// Windows: 1, or the 6 faces of a cube.
    pub windows: u32,
    /// Upwards in a parallel view.
    pub y: Vec3,
    /// Cells a side of a window.
    pub side: u32,
    /// Largest coordinate of scene and light.
    pub magnitude: f32,
    /// Triangles that cast.
    pub casters: u32,
    /// Rows of the table of casters.
    pub rows: u32,
    /// Pixels a row.
    pub width: u32,
}

/// `Row` of `irregular.wesl`: a run of triangles that cast.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct CasterRow {
    /// How many are in the rows before.
    pub before: u32,
    /// The first.
    pub first: u32,
    /// Their object, if that is cut out.
    pub object: u32,
    /// 1 if it is.
    pub has_mask: u32,
}

/// `Blur` of `prepare_moments.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BlurUniform {
    /// The view.
    pub view: u32,
    /// Texels a side of the window.
    pub window: u32,
    /// Half of them, rounded down.
    pub half: u32,
    /// Texels around the map that windows reach.
    pub border: u32,
    /// Texels a side of the moments.
    pub side: u32,
    /// Texels a side of what their windows cover.
    pub wide: u32,
    /// Where the view's moments begin.
    pub start: u32,
    /// Zero.
    pub padding: u32,
}

/// `Bound` of `moments.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BoundUniform {
    /// Texels a side of the window.
    pub window: f32,
    /// 4 or 2.
    pub moments: u32,
    /// V up to which light is taken for leaked.
    pub light_bleeding: f32,
    /// Texels a side of the moments.
    pub side: u32,
}

/// `Point` of `multi_view.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PointUniform {
    /// Middle of the sphere that the point is on.
    pub center: Vec3,
    /// Its radius; 0 where all points count alike.
    pub radius: f32,
    /// 1 for the first point.
    pub is_first: u32,
    /// Zero.
    pub padding: [u32; 3],
}

impl PointUniform {
    /// What shaders must know of `light` to weigh a point of it.
    pub fn new(light: &Light, is_first: bool) -> Self {
        let (center, radius) = match *light {
            Light::Sphere { center, radius } => (center, radius),
            _ => (Vec3::ZERO, 0.0),
        };
        Self { center, radius, is_first: u32::from(is_first), padding: [0; 3] }
    }
}

#[cfg(test)]
mod tests {
    use scene_core::assert_layout;
    use scene_core::gpu::testing::assert_constants;
    use scene_core::raster::DEPTH_POSITION_ERROR;

    use super::*;
    use crate::cascades::MAX_CASCADES;
    use crate::gpu::alias_free::{FIRST_CELL, MAX_GROUPS, MOST_LISTED, WORKGROUPS};
    use crate::gpu::shaders::{
        CASCADES, HARD, IRREGULAR, MOMENTS, MULTI_VIEW, PCF, PCSS, PREPARE_DEPTHS, PREPARE_MOMENTS,
    };
    use crate::{light_maps, light_views, moments, search_region};

    #[test]
    fn layouts_are_those_of_the_shaders() {
        assert_layout!(
            ViewUniform,
            HARD,
            "LightView",
            [projection_from_world, origin, near, x, half_diagonal, y, z]
        );
        assert_layout!(MapsUniform, HARD, "Maps", [count, tolerance, skip, layer, levels]);
        assert_layout!(LevelUniform, PREPARE_DEPTHS, "Level", [side, side_below, start, start_below]);
        assert_layout!(FilterUniform, PCF, "Filter", [side, taps, seed, by_object, radius, offsets]);
        assert_layout!(
            FitUniform,
            CASCADES,
            "Fit",
            [x, count, y, size, z, border, casters_min, casters_max, origin]
        );
        assert_layout!(
            IrregularUniform,
            IRREGULAR,
            "Irregular",
            [x, windows, y, side, magnitude, casters, rows, width]
        );
        assert_layout!(CasterRow, IRREGULAR, "Row", [before, first, object, has_mask]);
        // A struct of seven numbers has no padding in a shader; a uniform of it may have.
        let (members, _) = scene_core::gpu::testing::struct_layout(PREPARE_MOMENTS, "Blur");
        assert_eq!(members.last(), Some(&("start".to_owned(), core::mem::offset_of!(BlurUniform, start))));
        assert_layout!(BoundUniform, MOMENTS, "Bound", [window, moments, light_bleeding, side]);
        assert_layout!(PointUniform, MULTI_VIEW, "Point", [center, radius, is_first]);
        assert_layout!(SoftUniform, PCSS, "Soft", [taps, seed, points]);
    }

    #[test]
    fn constants_are_those_of_the_shaders() {
        assert_constants(HARD, &[("hard_lookup_DEPTH_POSITION_ERROR", f64::from(DEPTH_POSITION_ERROR))]);
        assert_constants(
            PCF,
            &[
                ("taps_FAR_TEXEL", f64::from(light_maps::FAR_TEXEL)),
                ("texel_plane_DEPTH_POSITION_ERROR", f64::from(DEPTH_POSITION_ERROR)),
            ],
        );
        assert_constants(PCSS, &[("search_region_CUTS", search_region::CUTS as f64)]);
        assert_constants(
            PREPARE_MOMENTS,
            &[("depth_scale_NEAR_FRACTION", f64::from(light_views::NEAR_FRACTION))],
        );
        assert_constants(
            MOMENTS,
            &[
                ("moment_window_MOMENT_BIAS", f64::from(moments::MOMENT_BIAS)),
                ("moment_window_LEAST_SPREAD", f64::from(moments::LEAST_SPREAD)),
            ],
        );
        assert_constants(
            CASCADES,
            &[("MAX_CASCADES", MAX_CASCADES as f64), ("MARGIN", f64::from(light_views::MARGIN))],
        );
        assert_constants(
            IRREGULAR,
            &[
                ("FIRST_CELL", f64::from(FIRST_CELL)),
                ("MOST_LISTED", f64::from(MOST_LISTED)),
                ("WORKGROUPS", f64::from(WORKGROUPS)),
                ("MAX_GROUPS", f64::from(MAX_GROUPS)),
            ],
        );
    }
}
