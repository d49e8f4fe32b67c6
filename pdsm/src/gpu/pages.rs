//! Words that are more than the device binds in one piece, in the layers of a texture: a device that binds 128 MiB of a
//! buffer holds gigabytes of those.

use scene_core::gpu::GpuError;

/// Most texels a side of a page. Of 16 MiB little is lost at the end, and the 256 that any device holds are more than
/// [`MOST_BYTES`].
const MOST_BITS: u32 = 11;

/// Bytes of one texture: drivers exist that find texels by signed offsets of 32 bits.
const MOST_BYTES: u64 = 1 << 31;

/// Pages as a device holds them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pages {
    /// Texels a side are 2 to this.
    pub(super) bits: u32,
    /// Pages of one texture.
    count: u32,
}

impl Pages {
    pub(super) fn of(device: &wgpu::Device) -> Self {
        let limits = device.limits();
        let bits = limits.max_texture_dimension_2d.ilog2().min(MOST_BITS);
        let count = (MOST_BYTES >> (2 * bits + 2)) as u32;
        Self { bits, count: count.min(limits.max_texture_array_layers) }
    }

    /// Bytes that they hold.
    pub(super) fn most_bytes(self) -> u64 {
        u64::from(self.count) << (2 * self.bits + 2)
    }

    /// A texture of what lies in `pieces`, one after the other, to be bound as `texture_2d_array<u32>`, and its bytes.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if these pages do not hold it; `what` names it.
    pub(super) fn texture(
        self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        what: &'static str,
        pieces: &[&[u32]],
    ) -> Result<(wgpu::TextureView, u64), GpuError> {
        let bytes: u64 = pieces.iter().map(|piece| size_of_val(*piece) as u64).sum();
        let limit = self.most_bytes();
        if bytes > limit {
            return Err(GpuError::TooLarge { what, bytes, limit });
        }
        let side = 1u32 << self.bits;
        let page = 4 * u64::from(side) * u64::from(side);
        let layers = bytes.div_ceil(page).max(1);
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some(what),
            size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers as u32 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let mut first = 0;
        for &piece in pieces {
            let mut rest = piece;
            while !rest.is_empty() {
                let [x, y, layer] = self.place(first);
                // Whole rows up to the page's end; what is left of one, where a piece begins or ends within it.
                let (width, height) = match (x, rest.len() as u32 >> self.bits) {
                    (0, rows @ 1..) => (side, rows.min(side - y)),
                    _ => ((side - x).min(rest.len() as u32), 1),
                };
                let (now, later) = rest.split_at((width * height) as usize);
                queue.write_texture(
                    wgpu::TexelCopyTextureInfo {
                        texture: &texture,
                        mip_level: 0,
                        origin: wgpu::Origin3d { x, y, z: layer },
                        aspect: wgpu::TextureAspect::All,
                    },
                    bytemuck::cast_slice(now),
                    wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: Some(4 * width),
                        rows_per_image: None,
                    },
                    wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                );
                first += width * height;
                rest = later;
            }
        }
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        Ok((view, layers * page))
    }

    /// Column, row and page of a word: twin of `word_at` of `functions.wesl`.
    fn place(self, word: u32) -> [u32; 3] {
        let last = (1 << self.bits) - 1;
        [word & last, (word >> self.bits) & last, word >> (2 * self.bits)]
    }
}
