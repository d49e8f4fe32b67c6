//! What lives on the device as long as the scene does: edges with their faces, what each triangle is, the casters' trees.

use scene_core::Scene;
use scene_core::gpu::{
    CasterTrees, GeometryBuffers, GpuError, GpuScene, binding_limit, storage_buffer, table_buffer,
};

use crate::Variant;
use crate::bodies::FaceKind;
use crate::casters::{Casters, has_edges};
use crate::edges::is_flat;
use crate::error::WedgeError;

/// Why the tables of a scene were not made.
#[derive(Debug, thiserror::Error)]
pub enum TablesError {
    /// The device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The scene.
    #[error(transparent)]
    Wedges(#[from] WedgeError),
}

/// Buffers that depend on the geometry alone.
#[derive(Debug)]
pub struct Tables {
    /// What they were made from.
    pub made_for: GeometryBuffers,
    /// Four words an edge: two vertices; twice where its incidences start, and 1 if its two faces lie in one plane on both
    /// sides of it; how many incidences. Passes take it in [`pieces`](scene_core::gpu::pieces), but for those of `interpolated`, which find
    /// neighbours in it.
    pub edges: wgpu::Buffer,
    /// Twice the face, and 1 if it runs along the edge.
    pub incident: wgpu::Buffer,
    /// Four bits a triangle: whether it is a solid caster, and twice its [`FaceKind`], for variants that ask for it.
    pub kinds: wgpu::Buffer,
    /// Nodes of the trees.
    pub nodes: wgpu::Buffer,
    /// Their triangles and objects.
    pub leaves: wgpu::Buffer,
    /// Edges.
    pub edge_count: u32,
    /// Incidences.
    pub incident_count: u32,
    /// Triangles of the scene.
    pub triangles: u32,
    /// Vertices of the scene.
    pub vertices: u32,
    /// Nodes of solid casters.
    pub solid_nodes: u32,
    /// Nodes in all.
    pub all_nodes: u32,
    /// The first caster with a mask.
    pub masked: Option<String>,
}

impl Tables {
    /// Builds and uploads the tables of `scene`, whose geometry is `geometry`, for `variant`.
    ///
    /// # Errors
    /// More triangles than can be numbered, or an array larger than the device binds in one piece.
    pub fn new(
        device: &wgpu::Device,
        scene: &GpuScene<'_>,
        geometry: &Scene,
        variant: Variant,
    ) -> Result<Self, TablesError> {
        let casters = Casters::new(geometry)?;
        let bodies = (variant != Variant::Exact).then(|| casters.bodies());
        let trees = CasterTrees::new(geometry, &casters.tree, binding_limit(device));
        let topology = bodies.map_or(&*casters.topology, |bodies| &bodies.topology);
        let (mut edges, mut incident) = (Vec::with_capacity(topology.len()), Vec::new());
        for (edge, [a, b]) in topology.vertices().iter().enumerate() {
            let faces = topology.faces(edge);
            let lies_flat = matches!(faces, [x, y] if is_flat(geometry, topology, edge, *x, *y));
            edges.push([*a, *b, (incident.len() as u32) << 1 | u32::from(lies_flat), faces.len() as u32]);
            incident.extend(faces.iter().map(|f| f.face() << 1 | u32::from(f.sign() > 0)));
        }
        let triangles = geometry.triangles().len();
        let mut kinds = vec![0_u32; triangles.div_ceil(8)];
        for triangle in geometry.objects().iter().filter(|o| has_edges(o)).flat_map(|o| o.triangles.clone()) {
            let kind = bodies.map_or(FaceKind::Nothing, |bodies| bodies.kinds[triangle]);
            kinds[triangle / 8] |= (1 | (kind as u32) << 1) << (4 * (triangle % 8));
        }
        let buffer = |what, bytes| storage_buffer(device, what, bytes);
        Ok(Self {
            made_for: GeometryBuffers::new(scene),
            edges: if variant == Variant::Interpolated {
                buffer("edges", bytemuck::cast_slice(&edges))?
            } else {
                table_buffer(device, "edges", bytemuck::cast_slice(&edges))?
            },
            incident: buffer("faces of edges", bytemuck::cast_slice(&incident))?,
            kinds: buffer("kinds of triangles", bytemuck::cast_slice(&kinds))?,
            nodes: buffer("nodes of the casters' tree", bytemuck::cast_slice(&trees.nodes))?,
            leaves: buffer("leaves of the casters' tree", bytemuck::cast_slice(&trees.leaves))?,
            edge_count: edges.len() as u32,
            incident_count: incident.len() as u32,
            triangles: triangles as u32,
            vertices: geometry.positions().len() as u32,
            solid_nodes: trees.solid,
            all_nodes: trees.nodes.len() as u32,
            masked: casters.masked().map(|object| object.name.clone()),
        })
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> u64 {
        [&self.edges, &self.incident, &self.kinds, &self.nodes, &self.leaves]
            .into_iter()
            .map(wgpu::Buffer::size)
            .sum()
    }
}
