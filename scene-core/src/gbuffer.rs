//! The G-buffer: per camera pixel what surface is seen.

use glam::Vec3;

/// Per pixel, row by row from the top left: what the camera sees there. A pixel that sees nothing has
/// [`GBuffer::NOTHING`] as its triangle and object, and NaN position and normal.
#[derive(Clone, Debug, PartialEq)]
pub struct GBuffer {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// World-space position on the surface, where the ray through the pixel's centre meets it.
    pub position: Vec<Vec3>,
    /// Unit geometric normal of the triangle in world space, turned to the camera.
    pub normal: Vec<Vec3>,
    /// Distance along the view direction, in scene units; infinite where nothing is seen.
    pub depth: Vec<f32>,
    /// The triangle seen, as an index into [`Scene::triangles`](crate::Scene::triangles).
    pub triangle: Vec<u32>,
    /// The object seen, as an index into [`Scene::objects`](crate::Scene::objects).
    pub object: Vec<u32>,
}

impl GBuffer {
    /// Triangle and object of a pixel that sees nothing.
    pub const NOTHING: u32 = u32::MAX;

    /// A G-buffer in which every pixel sees nothing.
    pub fn new(width: u32, height: u32) -> Self {
        let pixels = width as usize * height as usize;
        Self {
            width,
            height,
            position: vec![Vec3::NAN; pixels],
            normal: vec![Vec3::NAN; pixels],
            depth: vec![f32::INFINITY; pixels],
            triangle: vec![Self::NOTHING; pixels],
            object: vec![Self::NOTHING; pixels],
        }
    }

    /// Pixels in all.
    pub fn pixel_count(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Whether a pixel sees a surface.
    #[inline]
    pub fn is_seen(&self, pixel: usize) -> bool {
        self.triangle[pixel] != Self::NOTHING
    }
}
