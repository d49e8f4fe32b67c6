//! The GPU half of the interface: techniques record into the caller's encoder and write the caller's view.
//!
//! Nothing here creates a device, submits work or reads back: a technique lives inside somebody else's frame.
//! Textures and buffers are the caller's; their formats are stated per field.

use crate::technique::TechniqueError;
use crate::{Camera, Light, Report};

/// A scene in the caller's buffers, world space, as [`Scene`](crate::Scene) holds it.
#[derive(Clone, Copy, Debug)]
pub struct GpuScene<'a> {
    /// Vertex positions: three tightly packed f32 each. Usages `VERTEX | STORAGE`.
    pub positions: &'a wgpu::Buffer,
    /// Triangles: three u32 each. Usages `INDEX | STORAGE`.
    pub triangles: &'a wgpu::Buffer,
    /// How many triangles there are.
    pub triangle_count: u32,
}

/// What the camera sees, in the caller's textures, all of the same size.
#[derive(Clone, Copy, Debug)]
pub struct GpuGBuffer<'a> {
    /// Pixels a row and rows.
    pub size: [u32; 2],
    /// `Depth32Float`, reversed Z by [`Camera::projection_from_view`]; 0 where nothing is seen.
    pub depth: &'a wgpu::TextureView,
    /// `Rgba32Float` or `Rgba16Float`: unit geometric normal in world space, turned to the camera.
    pub normal: &'a wgpu::TextureView,
    /// `R32Uint`: object id.
    pub object: &'a wgpu::TextureView,
}

/// [`ShadowQuery`](crate::technique::ShadowQuery) on the GPU.
#[derive(Clone, Copy, Debug)]
pub struct GpuShadowQuery<'a> {
    /// Geometry.
    pub scene: GpuScene<'a>,
    /// The light whose visibility is asked for.
    pub light: &'a Light,
    /// The camera that the G-buffer is seen by.
    pub camera: &'a Camera,
}

/// A technique on one device: its pipelines and the textures it keeps between frames. Made by
/// [`ShadowTechnique::gpu`](crate::ShadowTechnique::gpu).
pub trait GpuShadowTechnique: Send {
    /// Records what depends on scene and light (and, for view-dependent techniques, on the camera).
    ///
    /// # Errors
    /// [`TechniqueError::Unsupported`] for inputs that the technique excludes.
    fn prepare(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError>;

    /// Records the pass that writes V of every pixel to `visibility` (`R32Float` or `R8Unorm`, usage
    /// `RENDER_ATTACHMENT`).
    ///
    /// # Errors
    /// If nothing was prepared.
    fn shade(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError>;
}
