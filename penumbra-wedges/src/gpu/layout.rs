//! Uniforms as the shaders read them. Tests hold every offset against the linked WGSL.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3, Vec4};
use scene_core::Light;
use scene_core::light::LightPoint;
use scene_core::light::sampling::SampleKey;

use crate::area_light::{AreaLight, LightShape};
use crate::samples::PATTERNS;

/// `Wedges` of `wedges.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct WedgesUniform {
    /// The light's middle as a homogeneous point; of a light at infinity a unit direction.
    pub light_point: Vec4,
    /// From the middle of a flat light, or of a cone's circle at distance 1, to (1, 0) of its plane.
    pub half_u: Vec3,
    /// 0 to 4: square, disk, ball, cone, point.
    pub kind: u32,
    /// To (0, 1).
    pub half_v: Vec3,
    /// A ball's radius; the tangent of a cone's angle, 0 if that is too wide to be drawn on a plane.
    pub radius: f32,
    /// Lower corner of the box around a light at a place, with what rounding of its samples may add.
    pub light_low: Vec3,
    /// The sine of a cone's angle.
    pub sine: f32,
    /// Upper corner.
    pub light_high: Vec3,
    /// Largest coordinate of the scene.
    pub magnitude: f32,
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
    /// Samples of the light.
    pub views: u32,
    /// Edges of a tile above which its pixels are traced.
    pub dense: u32,
    /// Two seeds a pattern.
    pub seeds: [[u32; 2]; PATTERNS],
}

impl WedgesUniform {
    /// With what shaders need of a light; the rest is zero.
    pub fn of_light(light: &Light) -> Self {
        let light_point = match light.center() {
            LightPoint::At(place) => place.extend(1.0),
            LightPoint::Towards(direction) => direction.extend(0.0),
        };
        let light_point = if light_point.is_finite() { light_point } else { Vec4::ZERO };
        let point = Self { light_point, kind: 4, ..Self::zeroed() };
        let Some(area) = AreaLight::new(light) else { return point };
        let mut uniform = point;
        if let Some([low, high]) = area.bounds() {
            // Samples are rounded to f32 a few times.
            let margin = low.abs().max(high.abs()) * (4.0 * f64::from(f32::EPSILON));
            uniform.light_low = (low - margin).as_vec3();
            uniform.light_high = (high + margin).as_vec3();
        }
        match area.shape {
            LightShape::Rect { half: [x, y], .. } => {
                (uniform.kind, uniform.half_u, uniform.half_v) = (0, x.as_vec3(), y.as_vec3());
            }
            LightShape::Disk { half: [x, y], .. } => {
                (uniform.kind, uniform.half_u, uniform.half_v) = (1, x.as_vec3(), y.as_vec3());
            }
            LightShape::Ball { radius, .. } => (uniform.kind, uniform.radius) = (2, radius as f32),
            LightShape::Cone { angle, .. } => {
                uniform.kind = 3;
                uniform.sine = angle.min(std::f64::consts::FRAC_PI_2).sin() as f32;
                // The same frame from everywhere.
                if let Some(frame) = area.frame(DVec3::ZERO) {
                    let [x, y] = frame.half.map(|half: DVec3| half.as_vec3());
                    (uniform.half_u, uniform.half_v, uniform.radius) = (x, y, x.length());
                }
            }
        }
        uniform
    }

    /// The seeds of the patterns of samples ([`Samples`](crate::samples::Samples)).
    pub fn seeds(seed: u64) -> [[u32; 2]; PATTERNS] {
        std::array::from_fn(|pattern| {
            let bits = SampleKey::new(seed, pattern as u64).bits(u32::MAX);
            [(bits >> 32) as u32, bits as u32]
        })
    }
}

#[cfg(test)]
mod tests {
    use scene_core::assert_layout;
    use scene_core::gpu::testing::assert_constants;

    use super::*;
    use crate::gpu::BLOCK;
    use crate::gpu::shaders::{BLOCKS, EXACT, FACING};
    use crate::{area_light, cpu, shaft};

    #[test]
    fn layouts_are_those_of_the_shaders() {
        assert_layout!(
            WedgesUniform,
            FACING,
            "Wedges",
            [
                light_point,
                half_u,
                kind,
                half_v,
                radius,
                light_low,
                sine,
                light_high,
                magnitude,
                size,
                triangles,
                capacity,
                solid_nodes,
                nodes,
                views,
                dense,
                seeds
            ]
        );
    }

    #[test]
    fn constants_are_those_of_the_shaders() {
        assert_constants(
            EXACT,
            &[
                ("area_light_LARGEST_SIN", area_light::LARGEST_SIN),
                ("wedges_TILE", cpu::TILE as f64),
                ("shaft_PLANES", shaft::PLANES as f64),
                ("shaft_AROUND", shaft::AROUND as f64),
            ],
        );
        assert_constants(BLOCKS, &[("wedges_BLOCK", BLOCK as f64)]);
    }
}
