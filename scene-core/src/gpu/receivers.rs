//! What is asked, pixel by pixel: the surfaces a camera sees, and the light, as group 3 of every shader that finds V.

use super::held::{Bound, HeldBuffer, HeldGroup, binding};
use super::layout::{CameraUniform, LightUniform};
use super::{GpuGBuffer, GpuObject, GpuShadowQuery};
use crate::Camera;

/// Group 3 of `receivers.wesl`, kept from frame to frame.
#[derive(Debug)]
pub struct Receivers {
    group: HeldGroup,
    camera: HeldBuffer,
    light: HeldBuffer,
    unshadowed: HeldBuffer,
    prepared: Option<[wgpu::Buffer; 2]>,
}

impl Receivers {
    /// The layout, for fragment and compute stages.
    pub fn new(device: &wgpu::Device) -> Self {
        let stages = wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::COMPUTE;
        let types = [binding::UNIFORM, binding::UNIFORM, binding::FLOATS, binding::IDS, binding::STORAGE];
        Self {
            group: HeldGroup::new(device, "receivers", stages, &types),
            camera: HeldBuffer::uniform("camera"),
            light: HeldBuffer::uniform("light"),
            unshadowed: HeldBuffer::storage("objects without shadows"),
            prepared: None,
        }
    }

    /// The layout of group 3.
    pub fn layout(&self) -> &wgpu::BindGroupLayout {
        self.group.layout()
    }

    /// Takes over the light, and which objects show shadows.
    pub fn prepare(&mut self, device: &wgpu::Device, query: &GpuShadowQuery<'_>) {
        let light = self.light.get(device, bytemuck::bytes_of(&LightUniform::new(query.light)));
        let words = unshadowed_words(query.scene.objects);
        let unshadowed = self.unshadowed.get(device, bytemuck::cast_slice(&words));
        self.prepared = Some([light, unshadowed]);
    }

    /// Group 3 for what `camera` sees; `None` if nothing was prepared.
    pub fn group(
        &mut self,
        device: &wgpu::Device,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
    ) -> Option<wgpu::BindGroup> {
        let [light, unshadowed] = self.prepared.clone()?;
        let camera = CameraUniform { lift: gbuffer.lift, ..CameraUniform::new(camera) };
        let camera = self.camera.get(device, bytemuck::bytes_of(&camera));
        let bound: [Bound; 5] =
            [camera.into(), light.into(), gbuffer.surface.into(), gbuffer.object.into(), unshadowed.into()];
        Some(self.group.get(device, &bound))
    }
}

/// One bit an object that does not receive, up to the last such one; a binding must not be empty.
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
