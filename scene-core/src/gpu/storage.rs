//! Storage buffers of what the CPU has made, no larger than the device binds in one piece.

use std::ops::Range;

use super::GpuError;

/// Bytes that the device binds in one piece.
pub fn binding_limit(device: &wgpu::Device) -> u64 {
    let limits = device.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// Bytes of the first of the two pieces that a buffer of `element` bytes each is bound in where one would be more than the device
/// binds: whole elements, as many as fit, and a place that every device takes for the start of a binding.
pub(super) fn page_bytes(device: &wgpu::Device, element: u64) -> u64 {
    // WebGPU asks for no more than 256; a multiple of both, the least one or not.
    let step = 256 * element;
    binding_limit(device) / step * step
}

/// Ranges of a table's elements, of `bytes` bytes each, that a pass which goes through it takes one after the other: all at once where the
/// device binds so much in one piece. Starts are multiples of 64 elements, which every device takes for the start of a binding, and a
/// binding may hold one element more than a range.
pub fn pieces(device: &wgpu::Device, elements: u32, bytes: u64) -> impl Iterator<Item = Range<u32>> {
    let room = (binding_limit(device) / bytes).saturating_sub(1).max(64) / 64 * 64;
    let step = u32::try_from(room).unwrap_or(u32::MAX / 64 * 64);
    (0..elements).step_by(step as usize).map(move |first| first..elements.min(first.saturating_add(step)))
}

/// A buffer of what passes go through in [`pieces`], which may be larger than the device binds in one. For no bytes as
/// [`storage_buffer`].
///
/// # Errors
/// [`GpuError::TooLarge`] if the device has no buffer of this size; `what` names it.
pub fn table_buffer(
    device: &wgpu::Device,
    what: &'static str,
    bytes: &[u8],
) -> Result<wgpu::Buffer, GpuError> {
    let contents = if bytes.is_empty() { &[0; 64] } else { bytes };
    buffer_within(device, what, contents, wgpu::BufferUsages::empty(), device.limits().max_buffer_size)
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
    buffer_within(device, what, contents, usage, binding_limit(device))
}

/// As [`storage_buffer_for`], up to `limit` bytes.
pub(super) fn buffer_within(
    device: &wgpu::Device,
    what: &'static str,
    contents: &[u8],
    usage: wgpu::BufferUsages,
    limit: u64,
) -> Result<wgpu::Buffer, GpuError> {
    let bytes = contents.len() as u64;
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
