//! Uniforms as the shaders read them. A test holds every offset against the linked WGSL.

use bytemuck::{Pod, Zeroable};

use crate::kernel::Kernel;
use crate::params::{Blocker, ContactHardeningParams, Scaling, Show};
use crate::shadow_pyramid::TILE;

/// Most levels of a pyramid: a side of 2¹⁶ tiles is beyond any texture.
pub const MOST_LEVELS: usize = 16;

/// Most points of a kernel.
pub const MOST_POINTS: usize = 64;

/// `Settings` of `settings.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SettingsTable {
    /// Pixels a row and rows.
    pub size: [u32; 2],
    /// Points of the kernel.
    pub taps: u32,
    /// What random numbers are drawn from.
    pub seed: u32,
    /// [`Kernel::reach`].
    pub reach: f32,
    /// [`Kernel::is_square`].
    pub is_square: u32,
    /// 1 for parallel light.
    pub is_parallel: u32,
    /// 0, 1, 2 in the order of [`Blocker`].
    pub blocker: u32,
    /// 1 where the setting is on.
    pub geometry: u32,
    /// Likewise.
    pub smooth_wide: u32,
    /// Likewise.
    pub fill: u32,
    /// 1 where S is another technique's.
    pub has_source: u32,
    /// Most passes.
    pub passes: u32,
    /// 0, 1, 2 in the order of [`Show`].
    pub show: u32,
    /// Levels of the pyramid.
    pub levels: u32,
    /// 1 with `paper` scaling.
    pub is_paper: u32,
    /// Power of the distance.
    pub distance_power: f32,
    /// Its factor.
    pub distance_multiplier: f32,
    /// Pixels to each side that the dilation of D reaches.
    pub dilate: u32,
    /// Widest kernel.
    pub kernel_size: u32,
    /// Start, columns and rows of each level.
    pub level: [[u32; 4]; MOST_LEVELS],
    /// Points and weights.
    pub points: [[f32; 4]; MOST_POINTS],
    /// The same of twice as many.
    pub fine: [[f32; 4]; 2 * MOST_POINTS],
}

impl SettingsTable {
    /// What shaders must know of the settings, for an image of `size` pixels.
    pub fn new(
        params: &ContactHardeningParams,
        kernel: &Kernel,
        fine: &Kernel,
        is_parallel: bool,
        has_source: bool,
        size: [u32; 2],
    ) -> Self {
        let mut level = [[0; 4]; MOST_LEVELS];
        let levels = levels(size);
        for (into, from) in level.iter_mut().zip(&levels) {
            *into = [from.start, from.tiles[0], from.tiles[1], 0];
        }
        Self {
            size,
            taps: kernel.points.len().min(MOST_POINTS) as u32,
            seed: params.seed,
            reach: kernel.reach,
            is_square: u32::from(kernel.is_square),
            is_parallel: u32::from(is_parallel),
            blocker: match params.blocker {
                Blocker::Each => 0,
                Blocker::Average => 1,
                Blocker::Minimum => 2,
            },
            geometry: u32::from(params.geometry),
            smooth_wide: u32::from(params.smooth),
            fill: u32::from(params.fill),
            has_source: u32::from(has_source),
            passes: params.passes,
            show: match params.show {
                Show::Visibility => 0,
                Show::Distance => 1,
                Show::Penumbra => 2,
            },
            levels: levels.len().min(MOST_LEVELS) as u32,
            is_paper: u32::from(params.scaling == Scaling::Paper),
            distance_power: params.distance_power,
            distance_multiplier: params.distance_multiplier,
            dilate: params.dilate / 2,
            kernel_size: params.kernel_size,
            level,
            points: points_of(kernel),
            fine: points_of(fine),
        }
    }
}

fn points_of<const MOST: usize>(kernel: &Kernel) -> [[f32; 4]; MOST] {
    let mut points = [[0.0; 4]; MOST];
    for (into, (point, weight)) in points.iter_mut().zip(kernel.points.iter().zip(&kernel.weights)) {
        *into = [point.x, point.y, *weight, 0.0];
    }
    points
}

/// `Level` of `pyramid.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct LevelUniform {
    /// Of the image.
    pub pixels: [u32; 2],
    /// Columns and rows of tiles.
    pub tiles: [u32; 2],
    /// Those of the level below.
    pub below: [u32; 2],
    /// Where this level starts.
    pub start: u32,
    /// Where the one below does.
    pub start_below: u32,
}

/// The levels of an image's pyramid, as [`ShadowPyramid`](crate::shadow_pyramid::ShadowPyramid) has them.
pub fn levels(pixels: [u32; 2]) -> Vec<LevelUniform> {
    let mut level = LevelUniform {
        pixels,
        tiles: pixels.map(|side| side.div_ceil(TILE as u32).max(1)),
        below: [0; 2],
        start: 0,
        start_below: 0,
    };
    let mut levels = vec![level];
    while level.tiles != [1, 1] {
        level = LevelUniform {
            pixels,
            tiles: level.tiles.map(|side| side.div_ceil(2)),
            below: level.tiles,
            start: level.start + level.tiles[0] * level.tiles[1],
            start_below: level.start,
        };
        levels.push(level);
    }
    levels
}

/// `Pass` of `pass.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PassUniform {
    /// Which one.
    pub index: u32,
    /// Width of the kernel in pixels, with `paper` scaling; 0 where D is the width.
    pub width: f32,
    /// 1 where D is counted down.
    pub counts_down: u32,
}

#[cfg(test)]
mod tests {
    use scene_core::assert_layout;
    use scene_core::gpu::testing::assert_constants;

    use super::*;
    use crate::gpu::shaders::{FILTER, FINISH, MULTI_PASS, PYRAMID};
    use crate::shadow_pyramid::TILE;
    use crate::{filter, physical, search};

    #[test]
    fn layouts_are_those_of_the_shaders() {
        assert_layout!(
            SettingsTable,
            FINISH,
            "Settings",
            [
                size,
                taps,
                seed,
                reach,
                is_square,
                is_parallel,
                blocker,
                geometry,
                smooth_wide,
                fill,
                has_source,
                passes,
                show,
                levels,
                is_paper,
                distance_power,
                distance_multiplier,
                dilate,
                kernel_size,
                level,
                points,
                fine
            ]
        );
        assert_layout!(LevelUniform, PYRAMID, "Level", [pixels, tiles, below, start, start_below]);
        assert_layout!(PassUniform, MULTI_PASS, "Pass", [index, width, counts_down]);
    }

    #[test]
    fn constants_are_those_of_the_shaders() {
        assert_constants(
            FILTER,
            &[
                ("search_GOLDEN", search::GOLDEN as f64),
                ("filter_light_MAX_LAYERS", filter::MAX_LAYERS as f64),
                ("filter_light_CLOSE", f64::from(filter::CLOSE)),
                ("physical_CUTS", physical::CUTS as f64),
                ("pyramid_TILE", TILE as f64),
            ],
        );
        assert_constants(PYRAMID, &[("TILE", TILE as f64)]);
    }

    #[test]
    fn levels_halve_until_one_tile_is_left() {
        let tiles: Vec<_> = levels([33, 9]).iter().map(|level| (level.tiles, level.start)).collect();
        assert_eq!(tiles, [([9, 3], 0), ([5, 2], 27), ([3, 1], 37), ([2, 1], 40), ([1, 1], 42)]);
        assert!(levels([16_384, 16_384]).len() <= MOST_LEVELS);
    }
}
