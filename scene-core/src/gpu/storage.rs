//! Storage buffers of what the CPU has made, no larger than the device binds in one piece.

use super::GpuError;

/// Bytes that the device binds in one piece.
pub fn binding_limit(device: &wgpu::Device) -> u64 {
    let limits = device.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// A buffer that shaders read. For no bytes it holds 64 zeros, more than an element of any table, since a binding must not
/// be empty.
///
/// # Errors
/// [`GpuError::TooLarge`] if the device binds less in one piece; `what` names it.
pub fn storage_buffer(
    device: &wgpu::Device,
    what: &'static str,
    bytes: &[u8],
) -> Result<wgpu::Buffer, GpuError> {
    let contents = if bytes.is_empty() { &[0; 64] } else { bytes };
    storage_buffer_for(device, what, contents, wgpu::BufferUsages::empty())
}

/// A buffer that shaders read and that serves `usage` besides.
///
/// # Errors
/// As [`storage_buffer`].
pub(super) fn storage_buffer_for(
    device: &wgpu::Device,
    what: &'static str,
    contents: &[u8],
    usage: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, GpuError> {
    let (bytes, limit) = (contents.len() as u64, binding_limit(device));
    if bytes > limit {
        return Err(GpuError::TooLarge { what, bytes, limit });
    }
    Ok(filled_buffer(device, what, contents, usage | wgpu::BufferUsages::STORAGE))
}

/// A buffer that holds `contents`, of 4 bytes at least, and zeros up to a multiple of 4.
///
/// wgpu's own `create_buffer_init` panics where the device is lost or its memory has run out. Here the buffer is then an invalid
/// one, as all that is made there, and the device tells why: to an error scope, or to the callback for its loss.
pub fn filled_buffer(
    device: &wgpu::Device,
    label: &str,
    contents: &[u8],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (contents.len() as u64)
            .next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT)
            .max(wgpu::COPY_BUFFER_ALIGNMENT),
        usage,
        mapped_at_creation: true,
    });
    if let Ok(mut mapped) = buffer.get_mapped_range_mut(..) {
        mapped.slice(..contents.len()).copy_from_slice(contents);
        drop(mapped);
        buffer.unmap();
    }
    buffer
}
