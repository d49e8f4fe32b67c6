//! Uniforms as the shaders read them. Tests hold every offset against the linked WGSL.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3, Vec4};

/// `Volumes` of `volumes.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct VolumesUniform {
    /// Centre of projection.
    pub eye: Vec3,
    /// Distance of the near plane.
    pub near: f32,
    /// The light's middle as a homogeneous point.
    pub light_point: Vec4,
    /// Lower corner of the box around the eye and the near rectangle.
    pub near_low: Vec3,
    /// Largest coordinate of the scene.
    pub magnitude: f32,
    /// Upper corner.
    pub near_high: Vec3,
    /// 1 if the eye's own count is taken.
    pub eye_counts: u32,
    /// Pixels a row and rows.
    pub size: [u32; 2],
    /// Triangles of the scene.
    pub triangles: u32,
    /// Edges that a block has room for.
    pub capacity: u32,
    /// Nodes of the tree of solid casters.
    pub solid_nodes: u32,
    /// Those of both trees.
    pub nodes: u32,
    /// Sides a tile above which its pixels are traced.
    pub dense: u32,
    /// Edges above which all pixels are.
    pub most_edges: u32,
    /// 1 if pixels that the light cannot reach are left out.
    pub skip_unlit: u32,
    /// 1 if runs of edges are asked before their edges.
    pub skip_runs: u32,
    /// Ranges of triangles that lie in another's shadow.
    pub shadowed: u32,
    /// Zero.
    pub padding: u32,
}

/// `Projection` of `planar.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ProjectionUniform {
    /// Clip space of a caster's image, from positions relative to `origin`.
    pub clip_from_relative: Mat4,
    /// The receiver's plane: n·x + d with x relative to `origin`.
    pub plane: Vec4,
    /// A place near what is drawn, world space.
    pub origin: Vec3,
    /// Heights up to this are on the plane.
    pub tolerance: f32,
    /// The receiver's object.
    pub object: u32,
    /// Zero.
    pub padding: [u32; 3],
}

#[cfg(test)]
mod tests {
    use scene_core::assert_layout;
    use scene_core::gpu::testing::assert_constants;

    use super::*;
    use crate::gpu::shaders::{ASK, BLOCKS, FACING, PLANAR, RUNS, TILES};
    use crate::{cpu, outline, runs};

    #[test]
    fn layouts_are_those_of_the_shaders() {
        assert_layout!(
            VolumesUniform,
            FACING,
            "Volumes",
            [
                eye,
                near,
                light_point,
                near_low,
                magnitude,
                near_high,
                eye_counts,
                size,
                triangles,
                capacity,
                solid_nodes,
                nodes,
                dense,
                most_edges,
                skip_unlit,
                skip_runs,
                shadowed
            ]
        );
        assert_layout!(
            ProjectionUniform,
            PLANAR,
            "Projection",
            [clip_from_relative, plane, origin, tolerance, object]
        );
    }

    #[test]
    fn constants_are_those_of_the_shaders() {
        assert_constants(
            TILES,
            &[("volumes_TILE", cpu::TILE as f64), ("volumes_BLOCK_TILES", cpu::BLOCK_TILES as f64)],
        );
        assert_constants(BLOCKS, &[("volumes_BLOCK", cpu::BLOCK as f64)]);
        assert_constants(RUNS, &[("volumes_RUN", runs::RUN as f64)]);
        assert_constants(
            ASK,
            &[("sides_CLOSE", outline::CLOSE / 256.0), ("sides_OFF_CENTER", outline::OFF_CENTER / 256.0)],
        );
    }
}
