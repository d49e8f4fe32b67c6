//! Cut-out masks at a pixel: perspective-correct texture coordinates.

use glam::{DVec2, DVec3, Vec2};

use super::projection::Projection;
use crate::Scene;
use crate::geometry::AlphaMask;

/// A triangle's mask and what finds the texture coordinate under a pixel.
///
/// The weights come from the corners in homogeneous coordinates before any clipping or snapping (Olano and
/// Greer 1997), so that a pixel sees the very texel a ray through its centre meets.
pub(super) struct Cutout<'a> {
    mask: &'a AlphaMask,
    weights: [DVec3; 3],
    uvs: [DVec2; 3],
}

impl<'a> Cutout<'a> {
    /// The cut-out of a triangle; `None` if it is solid.
    pub(super) fn new(scene: &'a Scene, projection: &Projection, triangle: usize) -> Option<Self> {
        let mask = scene.objects().get(scene.object_of(triangle) as usize)?.alpha.as_deref()?;
        let corners = scene.triangles()[triangle];
        let [a, b, c] = corners.map(|i| projection.plane_point(scene.positions()[i as usize]));
        let uvs = corners.map(|i| scene.uvs().get(i as usize).copied().unwrap_or(Vec2::NAN).as_dvec2());
        Some(Self { mask, weights: [b.cross(c), c.cross(a), a.cross(b)], uvs })
    }

    /// Whether the surface exists under the centre of pixel (`x`, `y`).
    pub(super) fn is_solid(&self, x: i32, y: i32) -> bool {
        let pixel = DVec3::new(f64::from(x) + 0.5, f64::from(y) + 0.5, 1.0);
        let [a, b, c] = self.weights.map(|w| w.dot(pixel));
        let sum = a + b + c;
        // A centre that only the snapped triangle covers lies a hair outside: it takes the nearest point inside.
        let [a, b, c] = [a / sum, b / sum, c / sum].map(|w| w.max(0.0));
        let uv = (self.uvs[0] * a + self.uvs[1] * b + self.uvs[2] * c) / (a + b + c);
        self.mask.is_solid(uv.as_vec2())
    }
}
