//! Faults of devices are errors, not panics.

use gnomon_scene_core::Scene;
use gnomon_scene_core::gpu::{Gpu, GpuError, SceneBuffers, filled_buffer, storage_buffer, testing};

fn texture(gpu: &Gpu, side: u32, layers: u32) -> Result<wgpu::Texture, GpuError> {
    gpu.scoped("a texture", || {
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        })
    })
}

#[test]
fn a_texture_beyond_the_limits_is_an_error() {
    let Some(gpu) = testing::gpu() else { return };
    let error = texture(&gpu, 1 << 20, 1).unwrap_err();
    assert!(matches!(&error, GpuError::Validation { what, .. } if what == "a texture"), "{error}");
    // The device goes on.
    assert!(texture(&gpu, 16, 1).is_ok() && gpu.check().is_ok());
}

#[test]
fn memory_that_is_not_there_is_an_error() {
    let Some(gpu) = testing::gpu() else { return };
    let limits = gpu.device.limits();
    // Within the limits, and terabytes on most adapters; one that has as much proves nothing here.
    let result = texture(&gpu, limits.max_texture_dimension_2d, limits.max_texture_array_layers);
    if let Err(error) = result {
        assert!(matches!(error, GpuError::OutOfMemory { .. }), "{error}");
    }
    assert!(texture(&gpu, 16, 1).is_ok());
}

#[test]
fn a_lost_device_says_so_from_then_on() {
    let Some(gpu) = testing::gpu() else { return };
    gpu.check().unwrap();
    gpu.device.destroy();
    // The loss is told when the device is polled.
    let _ = gpu.device.poll(wgpu::PollType::Poll);
    assert!(matches!(gpu.check(), Err(GpuError::Lost { .. })), "{:?}", gpu.check());
    assert!(matches!(texture(&gpu, 16, 1), Err(GpuError::Lost { .. })));
    assert!(matches!(gpu.wait(), Err(GpuError::Lost { .. })));
}

#[test]
fn faults_outside_of_scopes_are_kept() {
    let Some(gpu) = testing::gpu() else { return };
    let too_large = gpu.device.limits().max_buffer_size + 4;
    let _ = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: too_large,
        usage: wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    assert!(gpu.check().is_err());
}

#[test]
fn an_adapter_that_is_not_there_is_named() {
    if testing::gpu().is_none() {
        return;
    }
    let error = Gpu::open_adapter(Some("no adapter has this name")).unwrap_err();
    assert!(error.is_missing() && error.to_string().contains("no adapter has this name"), "{error}");
}

#[test]
fn an_array_too_large_to_bind_is_refused_before_it_is_made() {
    let Some(gpu) = testing::gpu() else { return };
    // A device that binds less than the scene needs.
    let Some(small) = testing::gpu_that_binds(1 << 12) else { return };
    let mut scene = Scene::new();
    let corners = vec![glam::Vec3::ZERO; 3];
    let mesh = gnomon_scene_core::TriangleMesh::new("many", corners, vec![[0, 1, 2]; 400]);
    scene.add(&mesh, glam::Affine3A::IDENTITY, Default::default()).unwrap();
    let error = SceneBuffers::new(&small.device, &scene).unwrap_err();
    assert_eq!(error, GpuError::TooLarge { what: "triangles", bytes: 4800, limit: 4096 });
    let text = error.to_string();
    for word in ["triangles need 4800 bytes", "4096", "fewer triangles", "GNOMON_ADAPTER", "--backend cpu"] {
        assert!(text.contains(word), "{text}");
    }
    assert!(SceneBuffers::new(&gpu.device, &scene).is_ok());
    // Positions are bound in two pieces, the first of whole vertices.
    for (vertices, is_taken) in [(597, true), (598, false)] {
        let mut scene = Scene::new();
        let mesh =
            gnomon_scene_core::TriangleMesh::new("many", vec![glam::Vec3::ZERO; vertices], vec![[0, 1, 2]]);
        scene.add(&mesh, glam::Affine3A::IDENTITY, Default::default()).unwrap();
        let made = SceneBuffers::new(&small.device, &scene);
        assert_eq!(made.is_ok(), is_taken, "{vertices} vertices: {made:?}");
        if let Err(error) = made {
            assert_eq!(error, GpuError::TooLarge { what: "vertex positions", bytes: 7176, limit: 7168 });
        }
    }
}

/// Ten million triangles and more are a matter of the adapter, not of what is asked of it.
#[test]
fn a_device_binds_all_that_its_adapter_offers() {
    let Some(gpu) = testing::gpu() else { return };
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let adapter = adapters.iter().find(|a| a.get_info() == gpu.adapter).unwrap();
    let (has, offered) = (gpu.device.limits(), adapter.limits());
    assert_eq!(has.max_storage_buffer_binding_size, offered.max_storage_buffer_binding_size);
    assert_eq!(has.max_buffer_size, offered.max_buffer_size);
}

#[test]
fn buffers_are_filled_whatever_their_length() {
    let Some(gpu) = testing::gpu() else { return };
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    for (bytes, read) in [(&[][..], &[0; 4][..]), (&[1, 2, 3], &[1, 2, 3, 0]), (&[9; 8], &[9; 8])] {
        let buffer = filled_buffer(&gpu.device, "test", bytes, usage);
        assert_eq!(gpu.read_buffer::<u8>(&buffer).unwrap(), read);
    }
}

/// wgpu's own way to fill a buffer panics here.
#[test]
fn uploads_to_a_lost_device_are_errors() {
    let Some(gpu) = testing::gpu() else { return };
    let setup = gnomon_scene_core::scenes::build("ball", 0.0).unwrap();
    let mut view = gpu.view(&setup.scene, &setup.camera).unwrap();
    gpu.device.destroy();
    let is_lost = |error: &GpuError| matches!(error, GpuError::Lost { .. });
    let error = gpu.scoped("a buffer", || storage_buffer(&gpu.device, "test", &[1; 16])).unwrap_err();
    assert!(is_lost(&error), "{error}");
    let error = gpu.view(&setup.scene, &setup.camera).unwrap_err();
    assert!(is_lost(&error), "{error}");
    let error = view.draw_gbuffer().unwrap_err().to_string();
    assert!(error.contains("lost"), "{error}");
    let buffer = filled_buffer(&gpu.device, "test", &[1; 16], wgpu::BufferUsages::COPY_SRC);
    assert!(is_lost(&gpu.read_buffer::<u32>(&buffer).unwrap_err()));
}
