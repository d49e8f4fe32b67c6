//! The scene on the GPU: what techniques are given, and the upload of a [`Scene`].

use std::borrow::Cow;
use std::ops::Range;

use glam::Affine3A;

use super::GpuError;
use super::pipeline::count_layout;
use super::storage::{binding_limit, buffer_within, page_bytes, storage_buffer_for};
use crate::geometry::{Aabb, AlphaMask, ObjectFlags, Wrap};
use crate::{Scene, TriangleMesh};

/// An object of a [`GpuScene`]; its id is its place there, as in [`Scene::objects`].
#[derive(Clone, Debug, PartialEq)]
pub struct GpuObject {
    /// Its triangles.
    pub triangles: Range<u32>,
    /// World-space bounds of its vertices.
    pub bounds: Aabb,
    /// What it takes part in.
    pub flags: ObjectFlags,
    /// Whether it has a cut-out mask, in [`GpuScene::cutouts`].
    pub has_mask: bool,
}

/// A scene in the caller's buffers, world space, as [`Scene`] holds it.
///
/// Positions are bound in two pieces where they are more than the device binds in one: up to twice its
/// `max_storage_buffer_binding_size`, which is 256 MiB and 22 million vertices by WebGPU's defaults. All else is bound in one.
#[derive(Clone, Copy, Debug)]
pub struct GpuScene<'a> {
    /// Vertex positions: three tightly packed f32 each. Usages `VERTEX | STORAGE`.
    pub positions: &'a wgpu::Buffer,
    /// Triangles: three u32 each. Usages `INDEX | STORAGE`.
    pub triangles: &'a wgpu::Buffer,
    /// Objects; their triangles do not overlap. An object without triangles is allowed.
    pub objects: &'a [GpuObject],
    /// Bounds of all objects, world space.
    pub bounds: Aabb,
    /// Cut-out masks, where any object has one.
    pub cutouts: Option<GpuCutouts<'a>>,
    /// The same geometry in memory, for techniques that build topology or hierarchies from it. Without it those
    /// answer [`TechniqueError::Unsupported`](crate::technique::TechniqueError::Unsupported).
    pub geometry: Option<&'a Scene>,
}

/// Cut-out masks of a [`GpuScene`].
#[derive(Clone, Copy, Debug)]
pub struct GpuCutouts<'a> {
    /// Texture coordinates: two f32 a vertex. Usage `STORAGE`.
    pub uvs: &'a wgpu::Buffer,
    /// Masks, as `cutout.wesl` reads them; see [`mask_words`]. Usage `STORAGE`.
    pub masks: &'a wgpu::Buffer,
}

impl GpuScene<'_> {
    /// How many triangles there are.
    pub fn triangle_count(&self) -> u32 {
        self.objects.iter().map(|object| object.triangles.end).max().unwrap_or(0)
    }

    /// The geometry in memory or, without it, a scene in its place that holds the bounds of each object as a box: for
    /// what only needs to know where objects are, as fitting the views of a light. Object ids are the same, triangles
    /// are not. An object without triangles, or whose bounds are not finite, is empty there.
    pub fn geometry_or_boxes(&self) -> Cow<'_, Scene> {
        if let Some(geometry) = self.geometry {
            return Cow::Borrowed(geometry);
        }
        let mut boxes = Scene::new();
        for object in self.objects {
            let is_there = !object.triangles.is_empty() && !object.bounds.is_empty();
            let mesh = if is_there { box_mesh(object.bounds) } else { TriangleMesh::default() };
            if boxes.add(&mesh, Affine3A::IDENTITY, object.flags).is_err() {
                // An empty mesh is always taken.
                let _ = boxes.add(&TriangleMesh::default(), Affine3A::IDENTITY, object.flags);
            }
        }
        Cow::Owned(boxes)
    }
}

/// The buffers and objects of a [`GpuScene`] without the geometry in memory, to be kept from `prepare` to `shade`: buffers are
/// handles, and cloning them copies nothing.
#[derive(Clone, Debug)]
pub struct SceneHandles {
    positions: wgpu::Buffer,
    triangles: wgpu::Buffer,
    cutouts: Option<[wgpu::Buffer; 2]>,
    objects: Vec<GpuObject>,
    bounds: Aabb,
}

impl SceneHandles {
    /// Those of `scene`.
    pub fn new(scene: &GpuScene<'_>) -> Self {
        Self {
            positions: scene.positions.clone(),
            triangles: scene.triangles.clone(),
            cutouts: scene.cutouts.map(|cutouts| [cutouts.uvs.clone(), cutouts.masks.clone()]),
            objects: scene.objects.to_vec(),
            bounds: scene.bounds,
        }
    }

    /// The scene, to be drawn.
    pub fn view(&self) -> GpuScene<'_> {
        GpuScene {
            positions: &self.positions,
            triangles: &self.triangles,
            objects: &self.objects,
            bounds: self.bounds,
            cutouts: self.cutouts.as_ref().map(|[uvs, masks]| GpuCutouts { uvs, masks }),
            geometry: None,
        }
    }
}

/// The buffers that something was made from: kept from frame to frame it holds for these, and is made anew for others.
#[derive(Clone, Debug)]
pub struct GeometryBuffers {
    positions: wgpu::Buffer,
    triangles: wgpu::Buffer,
}

impl GeometryBuffers {
    /// Those of `scene`.
    pub fn new(scene: &GpuScene<'_>) -> Self {
        Self { positions: scene.positions.clone(), triangles: scene.triangles.clone() }
    }

    /// Whether they are those of `scene`, too.
    pub fn are_of(&self, scene: &GpuScene<'_>) -> bool {
        self.positions == *scene.positions && self.triangles == *scene.triangles
    }
}

/// The faces of a box.
fn box_mesh(bounds: Aabb) -> TriangleMesh {
    // Bit 0 of a corner is x, bit 1 y, bit 2 z.
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    TriangleMesh::new("box", bounds.corners().to_vec(), triangles.collect())
}

/// A [`Scene`] uploaded: owns the buffers that a [`GpuScene`] borrows.
#[derive(Debug)]
pub struct SceneBuffers(SceneHandles);

impl SceneBuffers {
    /// Copies `scene` to `device`.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if an array is larger than the device binds in one piece, or positions in two.
    pub fn new(device: &wgpu::Device, scene: &Scene) -> Result<Self, GpuError> {
        let buffer = |what: &'static str, bytes: &[u8], usage| {
            // A binding must not be empty: an empty scene has one vertex and one triangle that nobody draws.
            let contents = if bytes.is_empty() { &[0; 12] } else { bytes };
            storage_buffer_for(device, what, contents, usage)
        };
        let positions = position_buffer(device, bytemuck::cast_slice(scene.positions()))?;
        let triangles =
            buffer("triangles", bytemuck::cast_slice(scene.triangles()), wgpu::BufferUsages::INDEX)?;
        let none = wgpu::BufferUsages::empty();
        let cutouts = if scene.has_alpha() {
            let masks: Vec<_> = scene.objects().iter().map(|object| object.alpha.as_deref()).collect();
            Some([
                buffer("texture coordinates", bytemuck::cast_slice(scene.uvs()), none)?,
                buffer("cut-out masks", bytemuck::cast_slice(&mask_words(&masks)), none)?,
            ])
        } else {
            None
        };
        let objects = scene.objects().iter().map(|object| GpuObject {
            // A scene's indices fit 32 bits.
            triangles: object.triangles.start as u32..object.triangles.end as u32,
            bounds: object.bounds,
            flags: object.flags,
            has_mask: object.alpha.is_some(),
        });
        let (objects, bounds) = (objects.collect(), scene.bounds());
        Ok(Self(SceneHandles { positions, triangles, cutouts, objects, bounds }))
    }

    /// What techniques are given. `geometry` is the scene this was made from, if it is still there.
    pub fn view<'a>(&'a self, geometry: Option<&'a Scene>) -> GpuScene<'a> {
        GpuScene { geometry, ..self.0.view() }
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> u64 {
        let cutouts = self.0.cutouts.iter().flatten().map(wgpu::Buffer::size).sum::<u64>();
        self.0.positions.size() + self.0.triangles.size() + cutouts
    }
}

/// A vertex position.
const POSITION_BYTES: u64 = 12;

/// Vertex positions, no more than the device binds in two pieces.
fn position_buffer(device: &wgpu::Device, bytes: &[u8]) -> Result<wgpu::Buffer, GpuError> {
    // A binding must not be empty: an empty scene has one vertex that nobody draws.
    let contents = if bytes.is_empty() { &[0; POSITION_BYTES as usize] } else { bytes };
    let pieces = page_bytes(device, POSITION_BYTES) + binding_limit(device);
    let limit = pieces.min(device.limits().max_buffer_size);
    buffer_within(device, "vertex positions", contents, wgpu::BufferUsages::VERTEX, limit)
}

/// The two pieces that positions are bound in: `positions` and `positions_beyond` of `scene.wesl`. Where one is enough the other
/// is the first vertex again, which nobody reads.
fn position_pieces<'a>(device: &wgpu::Device, positions: &'a wgpu::Buffer) -> [wgpu::BindingResource<'a>; 2] {
    let piece = |range: Range<u64>| {
        let size = std::num::NonZeroU64::new(range.end - range.start);
        wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer: positions, offset: range.start, size })
    };
    let (bytes, first) = (positions.size(), page_bytes(device, POSITION_BYTES));
    if bytes > binding_limit(device) && first > 0 {
        [piece(0..first), piece(first..bytes)]
    } else {
        [piece(0..bytes), piece(0..POSITION_BYTES.min(bytes))]
    }
}

/// The words of [`GpuCutouts::masks`] for objects with these masks.
///
/// One word an object says where its mask starts, `u32::MAX` for none. A mask is four words (width, height, wrap
/// of u and of v: 0 repeat, 1 mirror, 2 clamp) and one bit a texel, row by row, the lowest bit of a word first.
pub fn mask_words(masks: &[Option<&AlphaMask>]) -> Vec<u32> {
    let mut words = vec![u32::MAX; masks.len()];
    // Objects that share a mask share its words.
    let mut known: Vec<(&AlphaMask, u32)> = Vec::new();
    for (object, mask) in masks.iter().enumerate() {
        let Some(mask) = *mask else { continue };
        if let Some((_, start)) = known.iter().find(|(other, _)| std::ptr::eq(*other, mask)) {
            words[object] = *start;
            continue;
        }
        let start = words.len() as u32;
        known.push((mask, start));
        words[object] = start;
        let wrap = mask.wrap().map(|wrap| match wrap {
            Wrap::Repeat => 0,
            Wrap::Mirror => 1,
            Wrap::Clamp => 2,
        });
        words.extend([mask.width(), mask.height(), wrap[0], wrap[1]]);
        let bits = mask.texels().chunks(32).map(|texels| {
            texels.iter().zip(0..).fold(0u32, |word, (&solid, bit)| word | u32::from(solid) << bit)
        });
        words.extend(bits);
    }
    words
}

// Places in group 1, `scene.wesl`, and in group 2, `cutout.wesl`.
const POSITIONS: u32 = 0;
const TRIANGLES: u32 = 1;
const POSITIONS_BEYOND: u32 = 2;
const UVS: u32 = 0;
const MASKS: u32 = 1;

/// Bind group layouts of a [`GpuScene`], and the groups of the scene last used: group 1 is its triangles, group
/// 2 its cut-outs, in every shader (`scene.wesl`, `cutout.wesl`).
#[derive(Debug)]
pub struct SceneBindings {
    /// Group 1: positions, triangles, and positions beyond what is bound in one piece.
    pub triangles_layout: wgpu::BindGroupLayout,
    /// Group 1 of what reads positions alone, and of the eight storage buffers of a stage needs one more.
    pub positions_layout: wgpu::BindGroupLayout,
    /// Group 2: texture coordinates, masks.
    pub cutouts_layout: wgpu::BindGroupLayout,
    held: Option<HeldGroups>,
}

#[derive(Debug)]
struct HeldGroups {
    buffers: [Option<wgpu::Buffer>; 4],
    groups: SceneGroups,
}

/// The bind groups of one scene.
#[derive(Clone, Debug)]
pub struct SceneGroups {
    /// Group 1.
    pub triangles: wgpu::BindGroup,
    /// Group 1 without the triangles.
    pub positions: wgpu::BindGroup,
    /// Group 2, where there are cut-outs.
    pub cutouts: Option<wgpu::BindGroup>,
}

impl SceneBindings {
    /// Layouts that `stages` may read.
    pub fn new(device: &wgpu::Device, stages: wgpu::ShaderStages) -> Self {
        let layout = |label, bindings: &[u32]| {
            let entry = |binding| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: stages,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only: true },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            };
            let entries: Vec<_> = bindings.iter().map(|&binding| entry(binding)).collect();
            count_layout();
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries: &entries,
            })
        };
        Self {
            triangles_layout: layout("triangles", &[POSITIONS, TRIANGLES, POSITIONS_BEYOND]),
            positions_layout: layout("positions", &[POSITIONS, POSITIONS_BEYOND]),
            cutouts_layout: layout("cut-outs", &[UVS, MASKS]),
            held: None,
        }
    }

    /// The groups of `scene`; made anew only if its buffers are others than last time.
    pub fn groups(&mut self, device: &wgpu::Device, scene: &GpuScene<'_>) -> SceneGroups {
        let cutouts = scene.cutouts;
        let buffers = [
            Some(scene.positions.clone()),
            Some(scene.triangles.clone()),
            cutouts.map(|cutouts| cutouts.uvs.clone()),
            cutouts.map(|cutouts| cutouts.masks.clone()),
        ];
        if let Some(held) = self.held.as_ref().filter(|held| held.buffers == buffers) {
            return held.groups.clone();
        }
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let group = |layout, entries: &[wgpu::BindGroupEntry<'_>]| {
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("scene"), layout, entries })
        };
        let [positions, beyond] = position_pieces(device, scene.positions);
        let positions = [entry(POSITIONS, positions), entry(POSITIONS_BEYOND, beyond)];
        let triangles = [entry(TRIANGLES, scene.triangles.as_entire_binding())];
        let groups = SceneGroups {
            triangles: group(&self.triangles_layout, &[&positions[..], &triangles].concat()),
            positions: group(&self.positions_layout, &positions),
            cutouts: cutouts.map(|GpuCutouts { uvs, masks }| {
                let bound = [entry(UVS, uvs.as_entire_binding()), entry(MASKS, masks.as_entire_binding())];
                group(&self.cutouts_layout, &bound)
            }),
        };
        self.held = Some(HeldGroups { buffers, groups: groups.clone() });
        groups
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_stand_in_for_geometry() {
        let Some(gpu) = crate::gpu::testing::gpu() else { return };
        let mut scene = Scene::new();
        let corners = vec![glam::Vec3::ZERO, glam::Vec3::new(1.0, 2.0, 3.0), glam::Vec3::new(-1.0, 0.5, 0.0)];
        let mesh = TriangleMesh::new("t", corners, vec![[0, 1, 2]]);
        scene.add(&TriangleMesh::default(), Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags { casts: false, ..Default::default() }).unwrap();
        let buffers = SceneBuffers::new(&gpu.device, &scene).unwrap();
        assert!(std::ptr::eq(&*buffers.view(Some(&scene)).geometry_or_boxes(), &scene));
        let view = buffers.view(None);
        let boxes = view.geometry_or_boxes();
        assert_eq!(boxes.objects().len(), 2);
        assert!(boxes.objects()[0].triangles.is_empty() && !boxes.objects()[1].flags.casts);
        assert_eq!(boxes.objects()[1].bounds, scene.objects()[1].bounds);
        // Each face's normal points away from the middle.
        for triangle in 0..boxes.triangles().len() {
            let [a, b, c] = boxes.corners(triangle);
            assert!((b - a).cross(c - a).dot(a - boxes.bounds().center()) > 0.0, "{triangle}");
        }
        // What is not finite is nowhere.
        let broken = [GpuObject {
            triangles: 0..1,
            bounds: Aabb { min: glam::Vec3::ZERO, max: glam::Vec3::INFINITY },
            flags: ObjectFlags::default(),
            has_mask: false,
        }];
        let boxes = GpuScene { objects: &broken, ..view };
        assert!(boxes.geometry_or_boxes().triangles().is_empty());
    }

    #[test]
    fn masks_are_packed_and_shared() {
        let alpha: Vec<u8> = (0..40).map(|i| if i % 3 == 0 { 255 } else { 0 }).collect();
        let mask = AlphaMask::from_alpha(8, 5, &alpha, 0.5, [Wrap::Mirror, Wrap::Clamp]).unwrap();
        let words = mask_words(&[None, Some(&mask), Some(&mask)]);
        assert_eq!(words[..7], [u32::MAX, 3, 3, 8, 5, 1, 2]);
        assert_eq!(words.len(), 9);
        for (texel, &solid) in mask.texels().iter().enumerate() {
            assert_eq!(words[7 + texel / 32] >> (texel % 32) & 1 == 1, solid);
        }
        assert!(mask_words(&[]).is_empty());
    }
}
