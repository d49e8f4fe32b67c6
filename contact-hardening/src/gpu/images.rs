//! Images between passes, kept from frame to frame.

/// S and D, V and role, t and passes: two floats a pixel.
pub(super) const PAIRS: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Float;

/// V of the source.
pub(super) const ONE: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;

/// An image that a pass writes and later ones read.
#[derive(Debug)]
pub(super) struct Image {
    label: &'static str,
    format: wgpu::TextureFormat,
    held: Option<([u32; 2], wgpu::TextureView)>,
}

impl Image {
    /// None yet.
    pub(super) fn new(label: &'static str, format: wgpu::TextureFormat) -> Self {
        Self { label, format, held: None }
    }

    /// The image, made anew only for another size.
    pub(super) fn get(&mut self, device: &wgpu::Device, [width, height]: [u32; 2]) -> wgpu::TextureView {
        if let Some((_, view)) = self.held.as_ref().filter(|(size, _)| *size == [width, height]) {
            return view.clone();
        }
        // What was there is given back first: both together may not fit.
        self.held = None;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some(self.label),
            size: wgpu::Extent3d { width: width.max(1), height: height.max(1), depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: self.format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = texture.create_view(&Default::default());
        self.held = Some(([width, height], view.clone()));
        view
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        let texel = u64::from(self.format.block_copy_size(None).unwrap_or(0));
        self.held.as_ref().map_or(0, |([width, height], _)| u64::from(*width) * u64::from(*height) * texel)
    }
}
