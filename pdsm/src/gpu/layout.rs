//! Uniforms as the shaders read them. A test holds every offset against the linked WGSL.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use scene_core::geometry::Aabb;

use crate::cpu::Window;
use crate::layout::{Depth, Held};
use crate::nodes::{DepthSteps, Nodes};

/// Most windows of one light: the faces of a cube, and as many over casters that move or of parts of what is seen.
pub const MOST_WINDOWS: usize = 12;

/// What stands for an infinite tangent: shaders need not know infinities, and no point is seen at it.
const ANY_TAN: f32 = 1e30;

/// What stands for an infinite coordinate.
const ANYWHERE: f32 = 3e38;

/// `Window` of `functions.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct WindowUniform {
    /// Origin of the axes.
    pub origin: Vec3,
    /// Pixels a side.
    pub size: u32,
    /// Axes of the window.
    pub x: Vec3,
    /// Texels a pixel along each side.
    pub ratio: u32,
    /// Likewise.
    pub y: Vec3,
    /// z of the window.
    pub focus: f32,
    /// The way that light travels.
    pub z: Vec3,
    /// t per unit of z in parallel light; 0 in central light.
    pub per_unit: f32,
    /// Lower corner on the window's plane.
    pub corner: Vec2,
    /// Texels per unit there.
    pub texels_per_unit: Vec2,
    /// The largest offset of a sample along each axis.
    pub reach: Vec2,
    /// Largest tangent from the axis of points that belong here.
    pub max_tan: f32,
    /// Where the window's pixels begin in the index array.
    pub first_index: u32,
    /// Where its samples begin among the offsets.
    pub first_offset: u32,
    /// Samples of the light.
    pub views: u32,
    /// t of packed nodes: that of step 0.
    pub t_start: f32,
    /// t a step of packed nodes; 0 for nodes of floats.
    pub t_step: f32,
    /// Where the window's nodes begin in the data array, in its words.
    pub first_word: u32,
    /// By how much t of a node may be off.
    pub t_error: f32,
    /// Zero.
    pub padding: [u32; 2],
    /// Lower corner of the world-space box that points of this window lie in.
    pub low: Vec3,
    /// Zero.
    pub padding_low: f32,
    /// Its upper corner.
    pub high: Vec3,
    /// Zero.
    pub padding_high: f32,
    /// Where their rays lie on the window, in texels: from.
    pub first_texel: Vec2,
    /// And to.
    pub last_texel: Vec2,
}

impl WindowUniform {
    /// What shaders need of `window`, whose entries of the index, samples and words of nodes follow as many others.
    pub fn new(window: &Window, [first_index, first_offset, first_word]: [u32; 3]) -> Self {
        let layout = &window.layout;
        let [x, y, z] = layout.placement.axes;
        let (focus, per_unit) = match layout.placement.depth {
            Depth::Central { focus } => (focus, 0.0),
            Depth::Parallel { focus, per_unit } => (focus, per_unit),
        };
        let steps = match window.functions.nodes() {
            Nodes::Full(_) => DepthSteps { start: 0.0, step: 0.0 },
            Nodes::Packed(_, steps) => *steps,
        };
        let everywhere = Held {
            bounds: Aabb { min: Vec3::splat(-ANYWHERE), max: Vec3::splat(ANYWHERE) },
            texels: [Vec2::splat(-ANYWHERE), Vec2::splat(ANYWHERE)],
        };
        let Held { bounds, texels: [first_texel, last_texel] } = layout.placement.part.unwrap_or(everywhere);
        Self {
            origin: layout.placement.origin,
            size: window.grid.size,
            x,
            ratio: window.grid.ratio,
            y,
            focus,
            z,
            per_unit,
            corner: layout.placement.corner,
            texels_per_unit: layout.placement.texels_per_unit,
            reach: layout.placement.reach,
            max_tan: layout.placement.max_tan.min(ANY_TAN),
            first_index,
            first_offset,
            views: layout.offsets.len() as u32,
            t_start: steps.start,
            t_step: steps.step,
            first_word,
            t_error: window.functions.nodes().depth_error(),
            padding: [0; 2],
            low: bounds.min,
            padding_low: 0.0,
            high: bounds.max,
            padding_high: 0.0,
            first_texel,
            last_texel,
        }
    }
}

/// `Pdsm` of `functions.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PdsmUniform {
    /// The windows, of which the first `count` are there.
    pub windows: [WindowUniform; MOST_WINDOWS],
    /// How many there are.
    pub count: u32,
    /// How many of them are over casters that stand still, the first ones.
    pub still: u32,
    /// [`plane_tolerance`](gnomon_shadow_map::receiver_plane::plane_tolerance).
    pub tolerance: f32,
    /// Pixels that interpolation reaches: 1 reads four pixels, 0 the nearest one.
    pub radius: u32,
}

#[cfg(test)]
mod tests {
    use scene_core::assert_layout;
    use scene_core::gpu::testing::assert_constants;

    use super::*;
    use crate::gpu::shaders::SHADE;
    use crate::lookup;

    #[test]
    fn layouts_are_those_of_the_shaders() {
        assert_layout!(
            WindowUniform,
            SHADE,
            "Window",
            [
                origin,
                size,
                x,
                ratio,
                y,
                focus,
                z,
                per_unit,
                corner,
                texels_per_unit,
                reach,
                max_tan,
                first_index,
                first_offset,
                views,
                t_start,
                t_step,
                first_word,
                t_error,
                low,
                high,
                first_texel,
                last_texel
            ]
        );
        assert_layout!(PdsmUniform, SHADE, "Pdsm", [windows, count, still, tolerance, radius]);
    }

    #[test]
    fn constants_are_those_of_the_shaders() {
        assert_constants(
            SHADE,
            &[("READ_DISTANCE", f64::from(lookup::READ_DISTANCE)), ("T_ERROR", f64::from(lookup::T_ERROR))],
        );
    }
}
