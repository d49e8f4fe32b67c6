//! Square depth maps as layers of one texture, ids beside them if wanted: cube faces, cascades, views of an
//! extended light.

use std::ops::Range;

use glam::Mat4;

use super::{Bound, DepthIds, DepthTarget, GpuError};

/// Depth maps that are kept from frame to frame, and made anew only for another size or more layers.
#[derive(Debug)]
pub struct DepthLayers {
    ids: DepthIds,
    held: Option<Held>,
}

#[derive(Debug)]
struct Held {
    size: u32,
    depth: Layered,
    ids: Option<Layered>,
}

/// A texture with views of all layers and of each.
#[derive(Debug)]
struct Layered {
    texture: wgpu::Texture,
    whole: wgpu::TextureView,
    each: Vec<wgpu::TextureView>,
}

impl Layered {
    fn new(device: &wgpu::Device, label: &str, format: wgpu::TextureFormat, size: u32, layers: u32) -> Self {
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let whole = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        let layer = |layer| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..Default::default()
            })
        };
        let each = (0..layers).map(layer).collect();
        Self { texture, whole, each }
    }
}

impl DepthLayers {
    /// No maps yet. `ids` is what [`DepthPass`](super::DepthPass) stores beside depth.
    pub fn new(ids: DepthIds) -> Self {
        Self { ids, held: None }
    }

    /// Makes room for `layers` maps (one at least) of `size` texels a side. More layers than asked for are kept
    /// if they are there: the number of faces that a light needs changes as it moves.
    ///
    /// # Errors
    /// [`GpuError::Beyond`] if the device has no texture of that size, or not as many layers.
    pub fn resize(&mut self, device: &wgpu::Device, size: u32, layers: u32) -> Result<(), GpuError> {
        let (limits, layers) = (device.limits(), layers.max(1));
        GpuError::within("texels a side of a map", size, limits.max_texture_dimension_2d)?;
        GpuError::within("maps", layers, limits.max_texture_array_layers)?;
        if self
            .held
            .as_ref()
            .is_some_and(|held| held.size == size && held.depth.each.len() >= layers as usize)
        {
            return Ok(());
        }
        // What was there is given back first: both together may not fit.
        self.held = None;
        let layered = |label, format| Layered::new(device, label, format, size, layers);
        self.held = Some(Held {
            size,
            depth: layered("depth maps", wgpu::TextureFormat::Depth32Float),
            ids: (self.ids != DepthIds::None)
                .then(|| layered("ids of depth maps", wgpu::TextureFormat::R32Uint)),
        });
        Ok(())
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let Some(held) = &self.held else { return 0 };
        let texels = u64::from(held.size) * u64::from(held.size) * held.depth.each.len() as u64;
        texels * if held.ids.is_some() { 8 } else { 4 }
    }

    /// The depth maps: one `Depth32Float` texture; `None` before [`resize`](Self::resize).
    pub fn depth(&self) -> Option<&wgpu::Texture> {
        self.held.as_ref().map(|held| &held.depth.texture)
    }

    /// Their ids, if wanted.
    pub fn ids(&self) -> Option<&wgpu::Texture> {
        self.held.as_ref().and_then(|held| held.ids.as_ref()).map(|ids| &ids.texture)
    }

    /// All layers, to be bound as `texture_depth_2d_array`.
    pub fn bound_depth(&self) -> Option<Bound> {
        self.held.as_ref().map(|held| (&held.depth.whole).into())
    }

    /// All layers of ids, to be bound as `texture_2d_array<u32>`.
    pub fn bound_ids(&self) -> Option<Bound> {
        self.held.as_ref().and_then(|held| held.ids.as_ref()).map(|ids| (&ids.whole).into())
    }

    /// What to draw: layer i through the i-th projection, with these triangles only (all, if not given).
    /// Projections beyond the layers are left out.
    pub fn targets<'a>(
        &'a self,
        projections: impl IntoIterator<Item = Mat4>,
        triangles: Option<&'a [Range<u32>]>,
    ) -> Vec<DepthTarget<'a>> {
        let Some(held) = &self.held else { return Vec::new() };
        let layer = |(index, clip_from_world): (usize, Mat4)| {
            let depth = held.depth.each.get(index)?;
            let ids = held.ids.as_ref().and_then(|ids| ids.each.get(index));
            Some(DepthTarget { ids, triangles, ..DepthTarget::new(depth, clip_from_world) })
        };
        projections.into_iter().enumerate().filter_map(layer).collect()
    }
}
