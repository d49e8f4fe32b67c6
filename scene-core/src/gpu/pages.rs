//! Tables that are more than the device binds in one piece, in the layers of a texture: a device that binds 128 MiB of a buffer holds
//! gigabytes of those. A shader that reads any place of a table, where one that goes through it takes [`pieces`](super::pieces).

use std::marker::PhantomData;

use bytemuck::Pod;

use super::GpuError;

/// Most bytes of a page. Little is lost at the end of the last, and the 256 that any device holds are more than [`MOST_BYTES`].
const MOST_PAGE_BYTES: u32 = 1 << 24;

/// Bytes of one texture: drivers exist that find texels by signed offsets of 32 bits.
const MOST_BYTES: u64 = 1 << 31;

/// An element of a table that lies in pages, as shaders load it.
pub trait Texel: Pod {
    /// The texture's format, of as many bytes.
    const FORMAT: wgpu::TextureFormat;
}

/// `texture_2d_array<u32>`, its x.
impl Texel for u32 {
    const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;
}

/// `texture_2d_array<f32>`.
impl Texel for [f32; 4] {
    const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
}

/// Pages as a device holds them, and what shaders find elements by: element i lies in column i mod 2^bits, in the row of the next as
/// many bits, on the page of all others.
#[derive(Clone, Copy, Debug)]
pub struct Pages<T> {
    /// Texels a side of a page are 2 to this.
    bits: u32,
    /// Pages of one texture.
    count: u32,
    of: PhantomData<T>,
}

impl<T: Texel> Pages<T> {
    /// As many and as large as the device's limits allow.
    pub fn of(device: &wgpu::Device) -> Self {
        let limits = device.limits();
        let most_bits = (MOST_PAGE_BYTES / size_of::<T>() as u32).ilog2() / 2;
        let bits = limits.max_texture_dimension_2d.ilog2().min(most_bits);
        let pages = Self { bits, count: 1, of: PhantomData };
        let count = (MOST_BYTES / pages.most_bytes()) as u32;
        Self { count: count.min(limits.max_texture_array_layers), ..pages }
    }

    /// Bytes that they hold.
    pub fn most_bytes(self) -> u64 {
        u64::from(self.count) * size_of::<T>() as u64 * (1 << (2 * self.bits))
    }

    /// A texture of what lies in `pieces`, one after the other, to be bound as an array of layers, and its bytes.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if these pages do not hold it; `what` names it.
    pub fn texture(
        self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        what: &'static str,
        pieces: &[&[T]],
    ) -> Result<(wgpu::TextureView, u64), GpuError> {
        let bytes: u64 = pieces.iter().map(|piece| size_of_val(*piece) as u64).sum();
        let limit = self.most_bytes();
        if bytes > limit {
            return Err(GpuError::TooLarge { what, bytes, limit });
        }
        let side = 1u32 << self.bits;
        let page = size_of::<T>() as u64 * u64::from(side) * u64::from(side);
        let layers = bytes.div_ceil(page).max(1);
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some(what),
            size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers as u32 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: T::FORMAT,
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
                        bytes_per_row: Some(size_of::<T>() as u32 * width),
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

    /// Column, row and page of an element: twin of `page_place` of `pages.wesl`.
    fn place(self, element: u32) -> [u32; 3] {
        let last = (1 << self.bits) - 1;
        [element & last, (element >> self.bits) & last, element >> (2 * self.bits)]
    }
}

/// What reads a table from buffers, and what reads it from [`Pages`], made for the first table that wants them.
#[derive(Debug)]
pub struct Readers<R> {
    from_buffers: R,
    from_pages: Option<R>,
    is_paged: bool,
}

impl<R> Readers<R> {
    /// Buffers are chosen.
    pub fn new(from_buffers: R) -> Self {
        Self { from_buffers, from_pages: None, is_paged: false }
    }

    /// The reader of buffers or of pages, made if it is not there, from now on the one that is [`chosen`](Self::chosen).
    pub fn choose(&mut self, is_paged: bool, of_pages: impl FnOnce() -> R) -> &mut R {
        self.is_paged = is_paged;
        if is_paged { self.from_pages.get_or_insert_with(of_pages) } else { &mut self.from_buffers }
    }

    /// The one chosen last.
    pub fn chosen(&mut self) -> &mut R {
        match &mut self.from_pages {
            Some(from_pages) if self.is_paged => from_pages,
            _ => &mut self.from_buffers,
        }
    }

    /// All there are.
    pub fn each(&mut self) -> impl Iterator<Item = &mut R> {
        self.from_pages.iter_mut().chain([&mut self.from_buffers])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing;

    #[test]
    fn pages_are_as_large_as_texels_let_them() {
        let Some(gpu) = testing::gpu() else { return };
        assert_eq!(Pages::<u32>::of(&gpu.device).bits, 11);
        assert_eq!(Pages::<[f32; 4]>::of(&gpu.device).bits, 10);
        let pages = Pages::<[f32; 4]>::of(&gpu.device);
        assert!(pages.most_bytes() <= MOST_BYTES);
        assert_eq!(pages.place(3 + (5 << 10) + (7 << 20)), [3, 5, 7]);
    }

    #[test]
    fn a_reader_of_pages_is_made_once() {
        let mut readers = Readers::new("buffers");
        assert_eq!(*readers.choose(false, || unreachable!()), "buffers");
        assert_eq!(*readers.choose(true, || "pages"), "pages");
        assert_eq!(*readers.choose(false, || unreachable!()), "buffers");
        assert_eq!(*readers.chosen(), "buffers");
        assert_eq!(*readers.choose(true, || unreachable!()), "pages");
        assert_eq!(*readers.chosen(), "pages");
        assert_eq!(readers.each().count(), 2);
    }

    #[test]
    fn what_pages_do_not_hold_is_refused() {
        let Some(gpu) = testing::gpu_with_pages(1 << 20, 512, 2) else { return };
        let pages = Pages::<u32>::of(&gpu.device);
        assert_eq!(pages.most_bytes(), 2 << 20);
        let words = vec![0; 1 << 18];
        let texture = |pieces: &[&[u32]]| pages.texture(&gpu.device, &gpu.queue, "words", pieces);
        assert_eq!(texture(&[&words, &words[1..]]).map(|(_, bytes)| bytes), Ok(2 << 20));
        let refused = texture(&[&words, &words, &words[..1]]).map(|(_, bytes)| bytes);
        assert_eq!(refused, Err(GpuError::TooLarge { what: "words", bytes: (2 << 20) + 4, limit: 2 << 20 }));
    }
}
