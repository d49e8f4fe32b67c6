//! Buffers and bind groups that are kept from frame to frame and made anew only when what they hold changes.
//!
//! Nothing is overwritten in place: a frame that was recorded but not yet submitted keeps what it was recorded with.

use std::ops::Range;

use super::pipeline::count_layout;
use super::storage::filled_buffer;

/// A small buffer of what the CPU knows: uniforms, tables of views or lights.
#[derive(Debug)]
pub struct HeldBuffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    held: Option<(Vec<u8>, wgpu::Buffer)>,
}

impl HeldBuffer {
    /// A uniform buffer.
    pub fn uniform(label: &'static str) -> Self {
        Self { label, usage: wgpu::BufferUsages::UNIFORM, held: None }
    }

    /// A storage buffer.
    pub fn storage(label: &'static str) -> Self {
        Self { label, usage: wgpu::BufferUsages::STORAGE, held: None }
    }

    /// A buffer that holds `contents`: the one of the last call if that held the same. For none it holds 256 bytes of zeros,
    /// more than an element of any table, since a binding must not be empty.
    pub fn get(&mut self, device: &wgpu::Device, contents: &[u8]) -> wgpu::Buffer {
        if let Some((_, buffer)) = self.held.as_ref().filter(|(held, _)| held == contents) {
            return buffer.clone();
        }
        let bytes = if contents.is_empty() { &[0; 256] } else { contents };
        let buffer = filled_buffer(device, self.label, bytes, self.usage);
        self.held = Some((contents.to_vec(), buffer.clone()));
        buffer
    }
}

/// What is bound at one place of a group. Cloning it clones a handle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Bound {
    /// A whole buffer.
    Buffer(wgpu::Buffer),
    /// Part of a buffer.
    Part {
        /// The buffer.
        buffer: wgpu::Buffer,
        /// Where it starts, in bytes, aligned as the device asks.
        offset: u64,
        /// Bytes, more than 0.
        size: u64,
    },
    /// A view of a texture.
    Texture(wgpu::TextureView),
    /// A sampler.
    Sampler(wgpu::Sampler),
}

impl Bound {
    fn resource(&self) -> wgpu::BindingResource<'_> {
        match self {
            Self::Buffer(buffer) => buffer.as_entire_binding(),
            Self::Part { buffer, offset, size } => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset: *offset,
                size: std::num::NonZeroU64::new(*size),
            }),
            Self::Texture(view) => wgpu::BindingResource::TextureView(view),
            Self::Sampler(sampler) => wgpu::BindingResource::Sampler(sampler),
        }
    }
}

impl Bound {
    /// Elements of a table, of `bytes` bytes each: a range as [`pieces`](super::pieces) gives them, or with one element more.
    pub fn elements(buffer: &wgpu::Buffer, range: Range<u32>, bytes: u64) -> Self {
        let [start, end] = [range.start, range.end].map(|element| u64::from(element) * bytes);
        Self::Part { buffer: buffer.clone(), offset: start, size: end - start }
    }
}

impl From<wgpu::Buffer> for Bound {
    fn from(buffer: wgpu::Buffer) -> Self {
        Self::Buffer(buffer)
    }
}

impl From<&wgpu::TextureView> for Bound {
    fn from(view: &wgpu::TextureView) -> Self {
        Self::Texture(view.clone())
    }
}

impl From<&wgpu::Sampler> for Bound {
    fn from(sampler: &wgpu::Sampler) -> Self {
        Self::Sampler(sampler.clone())
    }
}

/// Binding types in the few shapes that techniques need.
pub mod binding {
    use wgpu::{BindingType, BufferBindingType, TextureSampleType, TextureViewDimension};

    const fn buffer(ty: BufferBindingType) -> BindingType {
        BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
    }

    const fn texture(sample_type: TextureSampleType, view_dimension: TextureViewDimension) -> BindingType {
        BindingType::Texture { sample_type, view_dimension, multisampled: false }
    }

    /// `var<uniform>`.
    pub const UNIFORM: BindingType = buffer(BufferBindingType::Uniform);
    /// `var<storage, read>`.
    pub const STORAGE: BindingType = buffer(BufferBindingType::Storage { read_only: true });
    /// `var<storage, read_write>`.
    pub const STORAGE_WRITE: BindingType = buffer(BufferBindingType::Storage { read_only: false });
    /// `texture_2d<f32>`, to be loaded from: 32-bit floats cannot be filtered everywhere.
    pub const FLOATS: BindingType =
        texture(TextureSampleType::Float { filterable: false }, TextureViewDimension::D2);
    /// `texture_2d_array<f32>`, to be loaded from.
    pub const FLOAT_LAYERS: BindingType =
        texture(TextureSampleType::Float { filterable: false }, TextureViewDimension::D2Array);
    /// `texture_2d<u32>`.
    pub const IDS: BindingType = texture(TextureSampleType::Uint, TextureViewDimension::D2);
    /// `texture_2d_array<u32>`.
    pub const ID_LAYERS: BindingType = texture(TextureSampleType::Uint, TextureViewDimension::D2Array);
    /// `texture_depth_2d`, for comparison samplers: its texels cannot be loaded in what GL understands.
    pub const DEPTH: BindingType = texture(TextureSampleType::Depth, TextureViewDimension::D2);
    /// `texture_depth_2d_array`, likewise.
    pub const DEPTH_LAYERS: BindingType = texture(TextureSampleType::Depth, TextureViewDimension::D2Array);
    /// `sampler_comparison`.
    pub const COMPARISON: BindingType = BindingType::Sampler(wgpu::SamplerBindingType::Comparison);
}

/// A bind group with its layout.
#[derive(Debug)]
pub struct HeldGroup {
    label: &'static str,
    layout: wgpu::BindGroupLayout,
    held: Option<(Vec<Bound>, wgpu::BindGroup)>,
}

impl HeldGroup {
    /// A layout that binds `types[i]` at place i, for `stages`.
    pub fn new(
        device: &wgpu::Device,
        label: &'static str,
        stages: wgpu::ShaderStages,
        types: &[wgpu::BindingType],
    ) -> Self {
        let entry = |(binding, ty): (u32, &wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: stages,
            ty: *ty,
            count: None,
        };
        let entries: Vec<_> = (0..).zip(types).map(entry).collect();
        count_layout();
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(label),
            entries: &entries,
        });
        Self { label, layout, held: None }
    }

    /// Another group of the same layout, that holds nothing yet.
    pub fn another(&self) -> Self {
        Self { label: self.label, layout: self.layout.clone(), held: None }
    }

    /// The layout.
    pub fn layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// The group that binds `bound[i]` at place i: the one of the last call if that bound the same.
    pub fn get(&mut self, device: &wgpu::Device, bound: &[Bound]) -> wgpu::BindGroup {
        if let Some((_, group)) = self.held.as_ref().filter(|(held, _)| held == bound) {
            return group.clone();
        }
        let entries: Vec<_> = (0..)
            .zip(bound)
            .map(|(binding, bound)| wgpu::BindGroupEntry { binding, resource: bound.resource() })
            .collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(self.label),
            layout: &self.layout,
            entries: &entries,
        });
        self.held = Some((bound.to_vec(), group.clone()));
        group
    }
}

/// Groups of one layout, for what a pass takes piece by piece.
#[derive(Debug)]
pub struct HeldGroups(Vec<HeldGroup>);

impl HeldGroups {
    /// As many as will be asked for, of the layout of `first`.
    pub fn new(first: HeldGroup) -> Self {
        Self(vec![first])
    }

    /// The group of piece `index`, counted from 0, as [`HeldGroup::get`].
    pub fn get(&mut self, device: &wgpu::Device, index: usize, bound: &[Bound]) -> wgpu::BindGroup {
        while self.0.len() <= index {
            self.0.push(self.0[0].another());
        }
        self.0[index].get(device, bound)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing;

    #[test]
    fn what_holds_the_same_is_the_same() {
        let Some(gpu) = testing::gpu() else { return };
        let mut buffer = HeldBuffer::uniform("test");
        let first = buffer.get(&gpu.device, &[1; 16]);
        assert_eq!(buffer.get(&gpu.device, &[1; 16]), first);
        let second = buffer.get(&gpu.device, &[2; 16]);
        assert_ne!(second, first);
        // What was handed out keeps what it held.
        let stages = wgpu::ShaderStages::FRAGMENT;
        let mut group = HeldGroup::new(&gpu.device, "test", stages, &[binding::UNIFORM]);
        let of_first = group.get(&gpu.device, &[first.clone().into()]);
        assert_eq!(group.get(&gpu.device, &[first.into()]), of_first);
        assert_ne!(group.get(&gpu.device, &[second.into()]), of_first);
    }
}
