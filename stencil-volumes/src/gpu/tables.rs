//! What lives on the device as long as the scene does: edges with their faces, which triangles cast, the casters' trees.

use scene_core::Scene;
use scene_core::bvh::Bvh;
use scene_core::geometry::EdgeTopology;
use scene_core::gpu::{
    CasterTrees, GeometryBuffers, GpuError, GpuScene, binding_limit, storage_buffer, table_buffer,
};

use crate::error::VolumeError;

/// Why the tables of a scene were not made.
#[derive(Debug, thiserror::Error)]
pub enum TablesError {
    /// The device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The scene.
    #[error(transparent)]
    Volumes(#[from] VolumeError),
}

/// Buffers that depend on the geometry alone.
#[derive(Debug)]
pub struct Tables {
    /// What they were made from.
    pub made_for: GeometryBuffers,
    /// Two vertices an edge. Passes take it and the next in [`pieces`](scene_core::gpu::pieces).
    pub vertices: wgpu::Buffer,
    /// Where an edge's incidences start, and one more.
    pub first: wgpu::Buffer,
    /// Twice the face, and 1 if it runs along the edge.
    pub incident: wgpu::Buffer,
    /// One bit a triangle: whether it is a solid caster.
    pub casts: wgpu::Buffer,
    /// Nodes of the trees.
    pub nodes: wgpu::Buffer,
    /// Their triangles and objects.
    pub leaves: wgpu::Buffer,
    /// Edges.
    pub edges: u32,
    /// Triangles of the scene.
    pub triangles: u32,
    /// Nodes of solid casters.
    pub solid_nodes: u32,
    /// Nodes in all.
    pub all_nodes: u32,
}

impl Tables {
    /// Builds and uploads the tables of `scene`, whose geometry is `geometry`.
    ///
    /// # Errors
    /// More triangles than can be numbered, or an array larger than the device binds in one piece.
    pub fn new(device: &wgpu::Device, scene: &GpuScene<'_>, geometry: &Scene) -> Result<Self, TablesError> {
        let is_solid = |o: &scene_core::geometry::Object| o.flags.casts && o.alpha.is_none();
        let (topology, trees) = rayon::join(
            || EdgeTopology::of_scene(geometry, is_solid),
            || CasterTrees::new(geometry, &Bvh::casters(geometry), binding_limit(device)),
        );
        let topology = topology.map_err(VolumeError::from)?;
        let (mut first, mut incident) = (vec![0_u32], Vec::new());
        for edge in 0..topology.len() {
            incident.extend(topology.faces(edge).iter().map(|f| f.face() << 1 | u32::from(f.sign() > 0)));
            first.push(incident.len() as u32);
        }
        let triangles = geometry.triangles().len();
        let mut casts = vec![0_u32; triangles.div_ceil(32)];
        for triangle in geometry.objects().iter().filter(|o| is_solid(o)).flat_map(|o| o.triangles.clone()) {
            casts[triangle / 32] |= 1 << (triangle % 32);
        }
        let buffer = |what, bytes| storage_buffer(device, what, bytes);
        Ok(Self {
            made_for: GeometryBuffers::new(scene),
            vertices: table_buffer(device, "vertices of edges", bytemuck::cast_slice(topology.vertices()))?,
            first: table_buffer(device, "faces of edges", bytemuck::cast_slice(&first))?,
            incident: buffer("faces of edges", bytemuck::cast_slice(&incident))?,
            casts: buffer("solid casters", bytemuck::cast_slice(&casts))?,
            nodes: buffer("nodes of the casters' tree", bytemuck::cast_slice(&trees.nodes))?,
            leaves: buffer("leaves of the casters' tree", bytemuck::cast_slice(&trees.leaves))?,
            edges: topology.len() as u32,
            triangles: triangles as u32,
            solid_nodes: trees.solid,
            all_nodes: trees.nodes.len() as u32,
        })
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> u64 {
        [&self.vertices, &self.first, &self.incident, &self.casts, &self.nodes, &self.leaves]
            .into_iter()
            .map(wgpu::Buffer::size)
            .sum()
    }
}
