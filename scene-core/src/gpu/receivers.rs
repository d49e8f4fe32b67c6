//! What is asked, pixel by pixel: the surfaces a camera sees, and the light, as group 3 of every shader that finds V.

use super::held::{Bound, HeldBuffer, HeldGroup, binding};
use super::layout::{CameraUniform, LightUniform};
use super::{GpuGBuffer, GpuObject, GpuShadowQuery, Recorder};
use crate::Camera;

/// Group 3 of `receivers.wesl`, kept from frame to frame.
#[derive(Debug)]
pub struct Receivers {
    group: HeldGroup,
    camera: HeldBuffer,
    light: HeldBuffer,
    unshadowed: Option<(Vec<u32>, wgpu::TextureView)>,
    prepared: Option<(wgpu::Buffer, wgpu::TextureView)>,
}

/// Words a row of the texture of objects that show no shadows: a width that every device has, and as many rows hold 2²⁷ objects.
const ROW_WORDS: usize = 2048;

impl Receivers {
    /// The layout, for fragment and compute stages.
    pub fn new(device: &wgpu::Device) -> Self {
        let stages = wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::COMPUTE;
        let types = [binding::UNIFORM, binding::UNIFORM, binding::FLOATS, binding::IDS, binding::IDS];
        Self {
            group: HeldGroup::new(device, "receivers", stages, &types),
            camera: HeldBuffer::uniform("camera"),
            light: HeldBuffer::uniform("light"),
            unshadowed: None,
            prepared: None,
        }
    }

    /// The layout of group 3.
    pub fn layout(&self) -> &wgpu::BindGroupLayout {
        self.group.layout()
    }

    /// Takes over the light, and which objects show shadows.
    pub fn prepare(&mut self, recorder: &Recorder<'_>, query: &GpuShadowQuery<'_>) {
        let light = self.light.get(recorder.device, bytemuck::bytes_of(&LightUniform::new(query.light)));
        let words = unshadowed_words(query.scene.objects);
        let held = self.unshadowed.take().filter(|(held, _)| *held == words);
        let (words, unshadowed) = held.unwrap_or_else(|| {
            let texture = unshadowed_texture(recorder, &words);
            (words, texture)
        });
        self.prepared = Some((light, unshadowed.clone()));
        self.unshadowed = Some((words, unshadowed));
    }

    /// Group 3 for what `camera` sees; `None` if nothing was prepared.
    pub fn group(
        &mut self,
        device: &wgpu::Device,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
    ) -> Option<wgpu::BindGroup> {
        let (light, unshadowed) = self.prepared.clone()?;
        let camera = CameraUniform { lift: gbuffer.lift, ..CameraUniform::new(camera) };
        let camera = self.camera.get(device, bytemuck::bytes_of(&camera));
        let bound: [Bound; 5] = [
            camera.into(),
            light.into(),
            gbuffer.surface.into(),
            gbuffer.object.into(),
            (&unshadowed).into(),
        ];
        Some(self.group.get(device, &bound))
    }
}

/// A texture of these words, row by row. One is made for each change and filled once, before whatever was recorded.
fn unshadowed_texture(recorder: &Recorder<'_>, words: &[u32]) -> wgpu::TextureView {
    let width = words.len().min(ROW_WORDS);
    let mut words = words.to_vec();
    words.resize(words.len().next_multiple_of(width), 0);
    let size = wgpu::Extent3d {
        width: width as u32,
        height: (words.len() / width) as u32,
        depth_or_array_layers: 1,
    };
    let texture = recorder.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("objects without shadows"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R32Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * size.width), rows_per_image: None };
    recorder.queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(&words), layout, size);
    texture.create_view(&Default::default())
}

/// One bit an object that does not receive, up to the last such one; a texture must not be empty.
fn unshadowed_words(objects: &[GpuObject]) -> Vec<u32> {
    let mut words = vec![0; 1];
    for id in (0..objects.len()).filter(|&id| !objects[id].flags.receives) {
        words.resize(words.len().max(id / 32 + 1), 0u32);
        words[id / 32] |= 1 << (id % 32);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Aabb, ObjectFlags};

    #[test]
    fn objects_without_shadows_are_bits() {
        let object = |receives| GpuObject {
            triangles: 0..0,
            bounds: Aabb::EMPTY,
            flags: ObjectFlags { receives, ..Default::default() },
            has_mask: false,
        };
        assert_eq!(unshadowed_words(&[]), [0]);
        let objects: Vec<_> = (0..70).map(|id| object(id != 3 && id != 33)).collect();
        assert_eq!(unshadowed_words(&objects), [1 << 3, 1 << 1]);
    }
}
