//! Reading back: the only place that copies from the GPU and waits for it. Renderers never need it.

use std::sync::mpsc;

use bytemuck::Pod;
use glam::{Vec2, Vec4};

use super::{GBufferTargets, Gpu, GpuError, StageTimer};
use crate::{Camera, GBuffer, Report, VisibilityImage};

impl Gpu {
    /// What `buffer` holds (usage `COPY_SRC`), as whole values of `T`; bytes left over are dropped.
    ///
    /// # Errors
    /// What went wrong on the device.
    pub fn read_buffer<T: Pod>(&self, buffer: &wgpu::Buffer) -> Result<Vec<T>, GpuError> {
        let size = buffer.size() / 4 * 4;
        let staging = self.staging(size)?;
        let mut encoder = self.encoder();
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size);
        self.submit(encoder)?;
        Ok(cast(&self.map(&staging)?))
    }

    /// One layer of the first mip level of `texture` (usage `COPY_SRC`), row by row from the top, as values of
    /// `T`, which must have the size of a texel.
    ///
    /// # Errors
    /// [`GpuError::Validation`] if the sizes differ; what went wrong on the device.
    pub fn read_texture<T: Pod>(&self, texture: &wgpu::Texture, layer: u32) -> Result<Vec<T>, GpuError> {
        let aspect = if texture.format().has_depth_aspect() {
            wgpu::TextureAspect::DepthOnly
        } else {
            wgpu::TextureAspect::All
        };
        let texel = texture.format().block_copy_size(Some(aspect)).unwrap_or(0);
        if texel as usize != size_of::<T>() {
            return Err(GpuError::Validation {
                what: "reading a texture".to_owned(),
                message: format!("texels have {texel} bytes, values {}", size_of::<T>()),
            });
        }
        let (width, height) = (texture.width(), texture.height());
        let row = width * texel;
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let staging = self.staging(u64::from(padded) * u64::from(height))?;
        let mut encoder = self.encoder();
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
                aspect,
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &staging,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        self.submit(encoder)?;
        let bytes = self.map(&staging)?;
        Ok(bytes.chunks(padded as usize).flat_map(|padded| cast(&padded[..row as usize])).collect())
    }

    /// A visibility texture (`R32Float` or `R8Unorm`, usage `COPY_SRC`) as an image; NaN where `gbuffer` sees
    /// nothing.
    ///
    /// # Errors
    /// [`GpuError::Validation`] for another format or size; what went wrong on the device.
    pub fn read_visibility(
        &self,
        texture: &wgpu::Texture,
        gbuffer: &GBuffer,
    ) -> Result<VisibilityImage, GpuError> {
        let mut image = VisibilityImage::new(texture.width(), texture.height());
        if (image.width, image.height) != (gbuffer.width, gbuffer.height) {
            return Err(GpuError::Validation {
                what: "reading visibility".to_owned(),
                message: "texture and G-buffer differ in size".to_owned(),
            });
        }
        let values: Vec<f32> = if texture.format() == wgpu::TextureFormat::R8Unorm {
            self.read_texture::<u8>(texture, 0)?.into_iter().map(|v| f32::from(v) / 255.0).collect()
        } else {
            self.read_texture(texture, 0)?
        };
        for (pixel, value) in values.into_iter().enumerate() {
            if gbuffer.is_seen(pixel) {
                image.values[pixel] = value;
            }
        }
        Ok(image)
    }

    /// A G-buffer drawn by [`GBufferPass`](super::GBufferPass) for `camera`.
    ///
    /// # Errors
    /// What went wrong on the device.
    pub fn read_gbuffer(&self, targets: &GBufferTargets, camera: &Camera) -> Result<GBuffer, GpuError> {
        let (width, height) = (targets.surface.width(), targets.surface.height());
        let mut gbuffer = GBuffer::new(width, height);
        gbuffer.object = self.read_texture(&targets.object, 0)?;
        gbuffer.triangle = self.read_texture(&targets.triangle, 0)?;
        let surface: Vec<Vec4> = self.read_texture(&targets.surface, 0)?;
        for (pixel, texel) in surface.into_iter().enumerate().filter(|(_, texel)| texel.w > 0.0) {
            let (x, y) = (pixel as u32 % width, pixel as u32 / width);
            let direction = camera.ray_direction(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
            gbuffer.position[pixel] = camera.eye + direction * texel.w;
            gbuffer.normal[pixel] = texel.truncate();
            gbuffer.depth[pixel] = texel.w;
        }
        Ok(gbuffer)
    }

    /// Milliseconds per stage of the frame that `timer` was last resolved for, after it was submitted.
    ///
    /// # Errors
    /// What went wrong on the device.
    pub fn read_times(&self, timer: &mut StageTimer) -> Result<Report, GpuError> {
        let ticks = timer.buffer().map(|buffer| self.read_buffer(buffer)).transpose()?;
        Ok(timer.take(&ticks.unwrap_or_default()))
    }

    fn staging(&self, size: u64) -> Result<wgpu::Buffer, GpuError> {
        self.scoped("read-back", || {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("read-back"),
                size,
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            })
        })
    }

    fn map(&self, staging: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        let failed =
            |message: String| GpuError::Validation { what: "mapping a read-back buffer".to_owned(), message };
        if staging.size() == 0 {
            return Ok(Vec::new());
        }
        let (send, receive) = mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |result| {
            // The receiver is gone only if waiting failed, which is told on its own.
            let _ = send.send(result);
        });
        self.wait()?;
        match receive.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(failed(error.to_string())),
            Err(error) => return Err(failed(error.to_string())),
        }
        let range = staging.get_mapped_range(..).map_err(|error| failed(error.to_string()))?;
        Ok(range.to_vec())
    }
}

/// Bytes as values, whatever their alignment.
fn cast<T: Pod>(bytes: &[u8]) -> Vec<T> {
    bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()
}
