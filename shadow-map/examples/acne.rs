//! Wrong pixels of every variant away from a shadow's edge, over angles of the light, sizes of the map and scales of the scene.
//!
//! `cargo run --release --example acne -- [STEPS] [MAP_SIZE…]` counts two things at each of STEPS angles from 0° to 89.9°:
//! pixels of a lit plane that are not lit, and pixels of a square's shadow on it that are wrong farther from its outline
//! than the filter reaches. Both must be 0; exits with an error otherwise. V of `moments` is a bound from above, so it is not asked
//! within the shadow, and may fall below 1 by 1/255.

use std::error::Error;

use glam::{Affine3A, Vec3};
use gnomon_shadow_map::{Kernel, ShadowMap, ShadowMapParams, Variant};
use rayon::prelude::*;
use scene_core::geometry::{ObjectFlags, SceneError};
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

fn settings() -> Vec<ShadowMapParams> {
    let of = |variant| ShadowMapParams { variant, taps: 16, views: 4, ..Default::default() };
    let mut all: Vec<_> = Variant::ALL.map(of).to_vec();
    all.push(ShadowMapParams { kernel: Kernel::PoissonDisk, filter: 9, ..of(Variant::Pcf) });
    all.push(ShadowMapParams { moments: 2, ..of(Variant::Moments) });
    all
}

fn shade(scene: &Scene, light: &Light, gbuffer: &GBuffer, params: ShadowMapParams) -> VisibilityImage {
    let (maps, _) = ShadowMap::new(params).prepare(scene, light);
    let mut visibility = VisibilityImage::new(gbuffer.width, gbuffer.height);
    maps.shade(gbuffer, &mut visibility);
    visibility
}

/// Whether V counts as lit.
fn is_lit(params: &ShadowMapParams, v: f32) -> bool {
    v >= if params.variant == Variant::Moments { 1.0 - 1.0 / 255.0 } else { 1.0 }
}

/// Images, and of the plane and of the shadow how many pixels were compared and how many were wrong.
fn sweep(params: &ShadowMapParams, steps: u16) -> Result<(u32, [[usize; 2]; 2]), SceneError> {
    let (mut images, mut counts) = (0u32, [[0usize; 2]; 2]);
    for scale in [1e-3, 1.0, 1e4f32] {
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
        let [seen_plane, seen_shadow] = [&plane, &shadow].map(|s| raster::render_gbuffer(s, &camera));
        let at_angle = |step: u16| {
            let mut counts = [[0usize; 2]; 2];
            let degrees = 89.9 * f32::from(step) / f32::from(steps.max(2) - 1);
            let tilt = degrees.to_radians();
            let direction = Vec3::new(tilt.sin() * 0.8, -tilt.cos(), tilt.sin() * 0.6);
            // The whole sun is above the plane.
            let angular_radius = 0.5 * (90.0 - degrees).to_radians().min(0.02);
            let light = Light::Directional { direction, angular_radius };
            let image = shade(&plane, &light, &seen_plane, *params);
            let on_ground = |gbuffer: &GBuffer, pixel: usize| gbuffer.object[pixel] == 0;
            for pixel in (0..seen_plane.pixel_count()).filter(|&p| on_ground(&seen_plane, p)) {
                counts[0][0] += 1;
                counts[0][1] += usize::from(!is_lit(params, image.values[pixel]));
            }
            let image = shade(&shadow, &light, &seen_shadow, *params);
            let shift = direction * (height / tilt.cos());
            // As in `tests/variants.rs`: texels stretched by the slope, the filter's and the penumbra's width.
            let texel = 2.0 * 2f32.sqrt() * scale / params.map_size as f32 * 2f32.sqrt() / tilt.cos();
            let penumbra = height / tilt.cos().powi(2) * angular_radius * 1.05;
            let reach = texel * (params.filter as f32 * 0.5 + 1.5) + penumbra;
            for pixel in (0..seen_shadow.pixel_count()).filter(|&p| on_ground(&seen_shadow, p)) {
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
            counts
        };
        let of_scale: Vec<_> = (0..steps).into_par_iter().map(at_angle).collect();
        images += 2 * u32::from(steps);
        for of_angle in of_scale {
            for (sum, count) in counts.iter_mut().flatten().zip(of_angle.iter().flatten()) {
                *sum += count;
            }
        }
    }
    Ok((images, counts))
}

fn name_of(params: &ShadowMapParams) -> &'static str {
    match (params.kernel, params.moments) {
        (Kernel::PoissonDisk, _) => "pcf, Poisson disk",
        (_, 2) => "moments, 2",
        _ => params.variant.name(),
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
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
        // Angles one beside the other: small pictures do not keep threads busy.
        let (images, [[plane, not_lit], [shadow, wrong]]) = sweep(&params, steps)?;
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
