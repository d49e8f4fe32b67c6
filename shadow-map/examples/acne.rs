//! Wrong pixels of every variant away from a shadow's edge, over angles of the light, sizes of the map and scales of the scene.
//!
//! `cargo run --release --example acne -- [gpu] [STEPS] [MAP_SIZE…]` counts two things at each of STEPS angles from 0° to 89.9°:
//! pixels of a lit plane that are not lit, and pixels of a square's shadow on it that are wrong farther from its outline
//! than the filter reaches. Both must be 0; exits with an error otherwise. V of `moments` is a bound from above, so it is not asked
//! within the shadow, and may fall below 1 by 1/255. With `gpu` the GPU path answers, about the same G-buffers; maps larger than the
//! device binds in one piece are named and left out.

use std::error::Error;

use glam::{Affine3A, Vec3};
#[cfg(feature = "gpu")]
use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::{Kernel, ShadowMap, ShadowMapParams, Variant};
use rayon::prelude::*;
use scene_core::geometry::{ObjectFlags, SceneError};
#[cfg(feature = "gpu")]
use scene_core::gpu::{Gpu, GpuError, HeadlessError, headless::VISIBILITY_FORMAT};
#[cfg(feature = "gpu")]
use scene_core::technique::TechniqueError;
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster};

fn square(name: &str, center: Vec3, half: f32) -> TriangleMesh {
    let corner = |x: f32, z: f32| center + Vec3::new(x, 0.0, z) * half;
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    TriangleMesh::new(name, positions, vec![[0, 2, 1], [0, 3, 2]])
}

fn scene_of(meshes: [TriangleMesh; 2]) -> Result<Scene, SceneError> {
    let mut scene = Scene::new();
    for mesh in meshes {
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default())?;
    }
    Ok(scene)
}

/// Every variant, and those whose kernels or moments differ.
pub(crate) fn settings() -> Vec<ShadowMapParams> {
    let of = |variant| ShadowMapParams { variant, taps: 16, views: 4, ..Default::default() };
    let mut all: Vec<_> = Variant::ALL.map(of).to_vec();
    all.push(ShadowMapParams { kernel: Kernel::PoissonDisk, filter: 9, ..of(Variant::Pcf) });
    all.push(ShadowMapParams { moments: 2, ..of(Variant::Moments) });
    all
}

/// Who answers.
#[derive(Debug)]
pub(crate) enum Backend {
    Cpu,
    #[cfg(feature = "gpu")]
    Gpu(Box<Gpu>),
}

impl Backend {
    /// Calls `at_angle` with each of `steps` and with what shades, for a light, the scene of that place in `scenes`.
    fn sweep(
        &self,
        params: ShadowMapParams,
        scenes: &[(Scene, GBuffer); 2],
        camera: &Camera,
        steps: u16,
        at_angle: impl Fn(u16, &mut Shade<'_>) -> Result<Counts, Box<dyn Error>> + Sync,
    ) -> Result<Vec<Counts>, Box<dyn Error>> {
        match self {
            Self::Cpu => {
                let shade = |index: usize, light: &Light| {
                    let (scene, gbuffer) = &scenes[index];
                    let (maps, _) = ShadowMap::new(params).prepare(scene, light);
                    let mut visibility = VisibilityImage::new(camera.width, camera.height);
                    maps.shade(gbuffer, &mut visibility);
                    Ok(visibility)
                };
                // Angles one beside the other: small pictures do not keep threads busy.
                let counts = (0..steps).into_par_iter().map(|step| {
                    at_angle(step, &mut |index, light| shade(index, light)).map_err(|error| error.to_string())
                });
                Ok(counts.collect::<Result<_, _>>()?)
            }
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => {
                let mut on_gpu = ShadowMapOnGpu::new(&gpu.device, params, VISIBILITY_FORMAT)?;
                let mut views = Vec::new();
                for (scene, gbuffer) in scenes {
                    let mut view = gpu.view(scene, camera)?;
                    view.upload_gbuffer(gbuffer)?;
                    views.push(view);
                }
                let mut shade = |index: usize, light: &Light| {
                    Ok(views[index].run(&mut on_gpu, light, &scenes[index].1)?.visibility)
                };
                (0..steps).map(|step| at_angle(step, &mut shade)).collect()
            }
        }
    }
}

type Shade<'a> = dyn FnMut(usize, &Light) -> Result<VisibilityImage, Box<dyn Error>> + 'a;

/// Of the plane and of the shadow how many pixels were compared and how many were wrong.
pub(crate) type Counts = [[usize; 2]; 2];

/// Whether V counts as lit.
fn is_lit(params: &ShadowMapParams, v: f32) -> bool {
    v >= if params.variant == Variant::Moments { 1.0 - 1.0 / 255.0 } else { 1.0 }
}

/// How many images were made at `scales`, and their counts.
pub(crate) fn sweep(
    backend: &Backend,
    params: &ShadowMapParams,
    steps: u16,
    scales: &[f32],
) -> Result<(u32, Counts), Box<dyn Error>> {
    let (mut images, mut counts) = (0u32, Counts::default());
    for &scale in scales {
        let camera = Camera {
            eye: Vec3::new(1.0, 3.0, 5.0) * scale,
            target: Vec3::new(0.0, 0.0, 0.5) * scale,
            up: Vec3::Y,
            fov_y: 0.9,
            near: 0.01 * scale,
            far: f32::INFINITY,
            width: 96,
            height: 72,
        };
        let ground = square("ground", Vec3::ZERO, 4.0 * scale);
        let plane = scene_of([ground.clone(), square("below", Vec3::NEG_Y * scale, 4.0 * scale)])?;
        let height = 0.5 * scale;
        let shadow = scene_of([ground, square("caster", Vec3::Y * height, scale)])?;
        let scenes = [plane, shadow].map(|scene| {
            let gbuffer = raster::render_gbuffer(&scene, &camera);
            (scene, gbuffer)
        });
        let [(_, seen_plane), (_, seen_shadow)] = &scenes;
        let at_angle = |step: u16, shade: &mut Shade<'_>| {
            let mut counts = Counts::default();
            let degrees = 89.9 * f32::from(step) / f32::from(steps.max(2) - 1);
            let tilt = degrees.to_radians();
            let direction = Vec3::new(tilt.sin() * 0.8, -tilt.cos(), tilt.sin() * 0.6);
            // The whole sun is above the plane.
            let angular_radius = 0.5 * (90.0 - degrees).to_radians().min(0.02);
            let light = Light::Directional { direction, angular_radius };
            let image = shade(0, &light)?;
            let on_ground = |gbuffer: &GBuffer, pixel: usize| gbuffer.object[pixel] == 0;
            for pixel in (0..seen_plane.pixel_count()).filter(|&p| on_ground(seen_plane, p)) {
                counts[0][0] += 1;
                counts[0][1] += usize::from(!is_lit(params, image.values[pixel]));
            }
            let image = shade(1, &light)?;
            let shift = direction * (height / tilt.cos());
            // As in `tests/variants.rs`: texels stretched by the slope, the filter's and the penumbra's width.
            let texel = 2.0 * 2f32.sqrt() * scale / params.map_size as f32 * 2f32.sqrt() / tilt.cos();
            let penumbra = height / tilt.cos().powi(2) * angular_radius * 1.05;
            let reach = texel * (params.filter as f32 * 0.5 + 1.5) + penumbra;
            for pixel in (0..seen_shadow.pixel_count()).filter(|&p| on_ground(seen_shadow, p)) {
                let on_caster = seen_shadow.position[pixel] - shift;
                let outside = on_caster.x.abs().max(on_caster.z.abs()) - scale;
                let v = image.values[pixel];
                let is_right = if outside > reach {
                    is_lit(params, v)
                } else {
                    outside >= -reach || v == 0.0 || params.variant == Variant::Moments
                };
                counts[1][0] += usize::from(outside.abs() > reach);
                counts[1][1] += usize::from(!is_right);
            }
            Ok(counts)
        };
        let of_scale = backend.sweep(*params, &scenes, &camera, steps, at_angle)?;
        images += 2 * u32::from(steps);
        for of_angle in of_scale {
            for (sum, count) in counts.iter_mut().flatten().zip(of_angle.iter().flatten()) {
                *sum += count;
            }
        }
    }
    Ok((images, counts))
}

pub(crate) fn name_of(params: &ShadowMapParams) -> &'static str {
    match (params.kernel, params.moments) {
        (Kernel::PoissonDisk, _) => "pcf, Poisson disk",
        (_, 2) => "moments, 2",
        _ => params.variant.name(),
    }
}

/// Whether the device binds less in one piece than these maps take.
#[cfg(feature = "gpu")]
fn is_too_large(error: &(dyn Error + 'static)) -> bool {
    let too_large = |error: &HeadlessError| {
        matches!(
            error,
            HeadlessError::Gpu(GpuError::TooLarge { .. })
                | HeadlessError::Technique(TechniqueError::Gpu(GpuError::TooLarge { .. }))
        )
    };
    error.downcast_ref().is_some_and(too_large)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).peekable();
    #[cfg(feature = "gpu")]
    let backend = match arguments.next_if(|argument| argument == "gpu") {
        Some(_) => Backend::Gpu(Box::new(Gpu::open()?)),
        None => Backend::Cpu,
    };
    #[cfg(not(feature = "gpu"))]
    let backend = Backend::Cpu;
    let steps: u16 = arguments.next().map_or(Ok(10), |count| count.parse())?;
    let mut sizes = arguments.map(|size| size.parse()).collect::<Result<Vec<u32>, _>>()?;
    if sizes.is_empty() {
        sizes = vec![64, 256, 1024, 4096];
    }
    println!("variant | map | images | pixels of the plane | not lit | pixels of the shadow | wrong");
    let with_size =
        |params: ShadowMapParams| sizes.iter().map(move |&map_size| ShadowMapParams { map_size, ..params });
    let mut wrong_ones = 0;
    for params in settings().into_iter().flat_map(with_size) {
        let swept = sweep(&backend, &params, steps, &[1e-3, 1.0, 1e4]);
        #[cfg(feature = "gpu")]
        if let Err(error) = &swept
            && is_too_large(error.as_ref())
        {
            println!("{} | {} | – | {error}", name_of(&params), params.map_size);
            continue;
        }
        let (images, [[plane, not_lit], [shadow, wrong]]) = swept?;
        println!(
            "{} | {} | {images} | {plane} | {not_lit} | {shadow} | {wrong}",
            name_of(&params),
            params.map_size
        );
        wrong_ones += not_lit + wrong;
    }
    if wrong_ones > 0 {
        return Err(format!("{wrong_ones} wrong pixels").into());
    }
    Ok(())
}
