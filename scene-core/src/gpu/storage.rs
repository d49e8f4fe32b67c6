//! Storage buffers of what the CPU has made, no larger than the device binds in one piece.

use wgpu::util::DeviceExt as _;

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
    Ok(device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some(what),
        contents,
        usage: usage | wgpu::BufferUsages::STORAGE,
    }))
}
