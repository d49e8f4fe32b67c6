//! Functions of the shared WESL modules against their Rust twins, in a compute kernel.

use bytemuck::{Pod, Zeroable};
use glam::{UVec2, Vec2, Vec3, Vec4};
use gnomon_scene_core::gpu::{CameraUniform, LightUniform, testing};
use gnomon_scene_core::light::sampling::{LightView, SampleKey, sobol_of_seeds};
use gnomon_scene_core::light::{Light, LightPoint};
use gnomon_scene_core::{Camera, geometry};

#[allow(dead_code, unreachable_pub, reason = "generated for any test to use")]
mod kernels {
    include!(concat!(env!("OUT_DIR"), "/test_shaders.rs"));
}

fn run<I: Pod, O: Pod>(kernel: &str, inputs: &[I]) -> Option<Vec<O>> {
    let gpu = testing::gpu()?;
    Some(testing::run_kernel(&gpu, kernel, inputs).unwrap())
}

fn random(count: u32, key: u64) -> Vec<Vec2> {
    (0..count).map(|i| SampleKey::new(11, key).square(i)).collect()
}

#[test]
fn sobol_is_its_twin_bit_for_bit() {
    let key = SampleKey::new(1, 2);
    // Low, high and scattered indices under different seeds: index, seed x, seed y.
    let inputs: Vec<[u32; 4]> = (0..4096)
        .map(|i| {
            let (index, seeds) = (key.bits(i), key.bits(i + 10_000));
            let index = if i % 2 == 0 { i / 2 } else { index as u32 };
            [index, (seeds >> 32) as u32, seeds as u32, 0]
        })
        .collect();
    let Some(points) = run::<_, Vec2>(kernels::SOBOL, &inputs) else { return };
    for (input, point) in inputs.iter().zip(points) {
        assert_eq!(point, sobol_of_seeds(input[0], [input[1], input[2]]), "{input:?}");
    }
}

/// Flipping any of the lower 24 bits of a key's words flips about half of the bits that sampling uses, the upper 24:
/// over 1,024 keys the share is 1/2 with a standard deviation of 0.002 if all were independent; those of one word
/// are not, so the bound is 0.05.
#[test]
fn the_hash_mixes_every_bit() {
    let keys: Vec<[u32; 4]> = (0..1024)
        .flat_map(|i| (0..97).map(move |bit| (i, bit)))
        .map(|(i, bit)| {
            let mut key = [i * 7, i / 3, 5, 0];
            if bit > 0 {
                key[(bit - 1) / 32] ^= 1 << ((bit - 1) % 32);
            }
            key
        })
        .collect();
    let Some(hashes) = run::<_, [u32; 4]>(kernels::HASH, &keys) else { return };
    for bit in (1..97).filter(|bit| (bit - 1) % 32 < 24) {
        let flips: u32 = hashes
            .chunks(97)
            .map(|block| (0..3).map(|w| ((block[0][w] ^ block[bit][w]) >> 8).count_ones()).sum::<u32>())
            .sum();
        let share = f64::from(flips) / (1024.0 * 72.0);
        assert!((share - 0.5).abs() < 0.05, "bit {bit}: {share}");
    }
}

fn lights() -> Vec<Light> {
    let center = Vec3::new(0.5, 4.0, -1.0);
    vec![
        Light::Directional { direction: Vec3::new(0.3, -2.0, 0.4), angular_radius: 0.0 },
        Light::Directional { direction: Vec3::new(0.3, -2.0, 0.4), angular_radius: 0.004_65 },
        Light::Directional { direction: Vec3::new(-0.3, 0.2, 0.4), angular_radius: 0.6 },
        Light::Point { position: center },
        Light::Spot { position: center, direction: Vec3::new(0.1, -3.0, 0.2), outer: 0.7, inner: 0.5 },
        Light::Sphere { center, radius: 0.75 },
        Light::Sphere { center, radius: 20.0 },
        Light::Rect { center, half_u: Vec3::new(0.5, 0.1, 0.0), half_v: Vec3::new(0.0, 0.2, 0.75) },
        Light::Disk { center, normal: Vec3::new(0.2, -3.0, 0.1), radius: 0.5 },
    ]
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct LightInput {
    light: LightUniform,
    receiver: Vec3,
    padding: u32,
    normal: Vec3,
    padding_2: u32,
    square: Vec2,
    padding_3: [u32; 2],
}

fn light_inputs() -> Vec<(Light, LightInput)> {
    let lights = lights();
    let (squares, places, heights) = (random(900, 1), random(900, 2), random(900, 3));
    let inputs = (0..900).map(|i| {
        let light = lights[i % lights.len()];
        let receiver = Vec3::new(places[i].x * 8.0 - 4.0, heights[i].x * 2.0 - 1.0, places[i].y * 8.0 - 4.0);
        let normal = Vec3::new(heights[i].y - 0.5, squares[i].y - 0.3, places[i].y - 0.5).normalize();
        let input = LightInput {
            light: LightUniform::new(&light),
            receiver,
            normal,
            square: squares[i],
            ..LightInput::zeroed()
        };
        (light, input)
    });
    inputs.collect()
}

/// Twins compute the same formulas in f32, in the same order up to fused operations, from frames rounded once
/// instead of in f64: a few dozen roundings of 2⁻²⁴ relative to the largest length in play.
#[test]
fn light_points_are_their_twins() {
    let inputs = light_inputs();
    let uniforms: Vec<_> = inputs.iter().map(|(_, input)| *input).collect();
    let Some(points) = run::<_, Vec4>(kernels::LIGHT_POINTS, &uniforms) else { return };
    for ((light, input), point) in inputs.iter().zip(points) {
        let expected = LightView::new(light, input.receiver).point(input.square);
        let (place, w) = match expected {
            LightPoint::At(place) => (place, 1.0),
            LightPoint::Towards(direction) => (direction, 0.0),
        };
        assert_eq!(point.w, w, "{light:?}");
        let size = match light {
            Light::Sphere { radius, center } => radius + center.length() + input.receiver.length(),
            _ => 1.0 + place.length(),
        };
        let error = (point.truncate() - place).length();
        assert!(error <= 64.0 * f32::EPSILON * size, "{light:?} {input:?}: {point} {place} {error}");
    }
}

#[test]
fn light_queries_are_their_twins() {
    let inputs = light_inputs();
    let uniforms: Vec<_> = inputs.iter().map(|(_, input)| *input).collect();
    let Some(answers) = run::<_, Vec4>(kernels::LIGHT_QUERIES, &uniforms) else { return };
    let (mut reached, mut above) = (0, 0);
    let mut differ = 0;
    for ((light, input), answer) in inputs.iter().zip(answers) {
        let (ray, _) = light.center().ray_from(input.receiver);
        assert!((answer.truncate() - ray).length() <= 4.0 * f32::EPSILON * (ray.length() + 8.0), "{light:?}");
        let expected = (light.reaches(input.receiver), light.is_above_plane(input.receiver, input.normal));
        let bits = answer.w as u32;
        differ += u32::from((bits & 1 == 1, bits & 2 == 2) != expected);
        reached += u32::from(expected.0);
        above += u32::from(expected.1);
    }
    // Only a receiver within rounding of a cone's or plane's rim may differ: none of 900 random ones.
    assert_eq!(differ, 0);
    assert!(reached < 900 && above > 100 && above < 800, "the inputs decide nothing: {reached} {above}");
}

#[test]
fn camera_rays_and_depths_are_their_twins() {
    let camera = Camera {
        eye: Vec3::new(100.0, 2.0, -60.0),
        target: Vec3::new(97.0, 1.0, -50.0),
        up: Vec3::Y,
        fov_y: 0.9,
        near: 0.1,
        far: 500.0,
        width: 640,
        height: 360,
    };
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    struct Input {
        camera: CameraUniform,
        pixel: UVec2,
        view_depth: f32,
        padding: u32,
    }
    let size = Vec2::new(camera.width as f32, camera.height as f32);
    for far in [500.0, f32::INFINITY] {
        let camera = Camera { far, ..camera };
        let uniform = CameraUniform::new(&camera);
        let inputs: Vec<_> = random(256, 5)
            .into_iter()
            .zip(random(256, 6))
            .map(|(p, d)| Input {
                camera: uniform,
                pixel: (p * size).as_uvec2(),
                view_depth: 0.1 + d.x * 400.0,
                padding: 0,
            })
            .collect();
        let Some(answers) = run::<_, Vec4>(kernels::CAMERA, &inputs) else { return };
        for (input, answer) in inputs.iter().zip(answers) {
            let expected = camera.eye + camera.ray_direction(input.pixel.as_vec2() + 0.5) * input.view_depth;
            let ulps = f32::EPSILON * (camera.eye.length() + 2.0 * input.view_depth);
            assert!((answer.truncate() - expected).length() <= 4.0 * ulps, "{answer} {expected}");
            // Depth is rounded relative to its largest term, which at far distances is the constant one.
            let scale = uniform.depth_scale;
            let depth = scale.y / input.view_depth;
            let relative = 4.0 * f32::EPSILON * (1.0 + 2.0 * scale.x.abs() / depth);
            assert!((answer.w / input.view_depth - 1.0).abs() <= relative, "{answer} {input:?}");
        }
    }
}

/// Every wrap mode, far outside, at texel corners and at broken coordinates.
#[test]
fn cut_outs_are_their_twins() {
    use geometry::{AlphaMask, Wrap};
    use gnomon_scene_core::gpu::scene::mask_words;
    use wgpu::util::DeviceExt as _;

    let Some(gpu) = testing::gpu() else { return };
    let alpha: Vec<u8> = (0..15u32).map(|i| if i * 7 % 5 < 2 { 255 } else { 0 }).collect();
    let wraps = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
    let masks = wraps.map(|u| AlphaMask::from_alpha(5, 3, &alpha, 0.5, [u, wraps[2]]).unwrap());
    let mut coordinates: Vec<Vec2> = random(500, 7).iter().map(|p| *p * 20.0 - 10.0).collect();
    coordinates.extend([
        Vec2::NAN,
        Vec2::new(f32::INFINITY, 0.1),
        Vec2::ZERO,
        Vec2::ONE,
        Vec2::new(-1e-30, 0.5),
    ]);
    let words = mask_words(&[Some(&masks[0]), Some(&masks[1]), Some(&masks[2]), None]);
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(kernels::CUTOUT.into()),
        }),
        entry_point: None,
        compilation_options: Default::default(),
        cache: None,
    });
    let buffer = |contents: &[u8]| {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents, usage })
    };
    let outputs = buffer(bytemuck::cast_slice(&vec![0u32; coordinates.len()]));
    let groups = [
        vec![&outputs],
        vec![&buffer(bytemuck::cast_slice(&coordinates)), &buffer(bytemuck::cast_slice(&words))],
    ]
    .map(|buffers| buffers.into_iter().cloned().collect::<Vec<_>>());
    let mut encoder = gpu.encoder();
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline);
    for (index, buffers) in [0, 2].into_iter().zip(&groups) {
        let entries: Vec<_> = (0..)
            .zip(buffers)
            .map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() })
            .collect();
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(index),
            entries: &entries,
        });
        pass.set_bind_group(index, &group, &[]);
    }
    pass.dispatch_workgroups(coordinates.len().div_ceil(64) as u32, 1, 1);
    drop(pass);
    gpu.submit(encoder).unwrap();
    let answers: Vec<u32> = gpu.read_buffer(&outputs).unwrap();
    for (uv, answer) in coordinates.iter().zip(answers) {
        let expected = (0..3).fold(8, |bits, mask| bits | u32::from(masks[mask].is_solid(*uv)) << mask);
        assert_eq!(answer, expected, "{uv}");
    }
}
