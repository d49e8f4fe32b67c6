//! Why a pixel may differ between the backends: the CPU path is asked again, over the very triangles that the GPU's
//! rasteriser left in the maps, for receivers moved by no more than rounding moves them. V must lie among the answers.
//!
//! What is left then is neither the algorithm's nor the shader's but rounding's: a tap on the border of two texels, a point
//! that rises above a plane by as much as the tolerance.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use glam::{Vec2, Vec3};
use gnomon_shadow_map::gpu::ShadowMapOnGpu;
use gnomon_shadow_map::light_maps::{LightMaps, ShadowMapView};
use gnomon_shadow_map::{PreparedShadowMap, ShadowMap, ShadowMapParams};
use scene_core::gpu::Gpu;
use scene_core::{GBuffer, Light, Report, Scene, VisibilityImage};

/// Maps of what the GPU saw. Each depth is one of its triangle's plane.
pub(crate) fn maps_of_gpu<'a>(
    gpu: &Gpu,
    on_gpu: &ShadowMapOnGpu,
    scene: &'a Scene,
    light: &Light,
    params: &ShadowMapParams,
) -> LightMaps<'a> {
    let mut maps = LightMaps::draw(scene, light, params, &mut Report::default(), |_, _, _| None);
    let Some((buffer, stride)) = on_gpu.depths() else { panic!("no depths") };
    let depths: Vec<f32> = gpu.read_buffer(buffer).unwrap();
    for (layer, map) in (0..).zip(&mut maps.maps) {
        let ShadowMapView { view, map, triangles, .. } = map;
        *triangles = gpu.read_texture(on_gpu.layers().ids().unwrap(), layer).unwrap();
        let first = layer as usize * stride as usize;
        map.depth.copy_from_slice(&depths[first..first + triangles.len()]);
        for (index, (&depth, &triangle)) in map.depth.iter().zip(&*triangles).enumerate() {
            let (column, row) = (index as u32 % map.width, index as u32 / map.width);
            let center = (Vec2::new(column as f32, row as f32) + 0.5) * (2.0 / map.width as f32);
            let ndc = Vec2::new(center.x - 1.0, 1.0 - center.y);
            if triangle == GBuffer::NOTHING {
                assert_eq!(depth, 0.0);
                continue;
            }
            let corners = scene.corners(triangle as usize);
            let limits = corners.map(|corner| view.depth_of(corner));
            let (low, high) =
                (limits[0].min(limits[1]).min(limits[2]), limits[0].max(limits[1]).max(limits[2]));
            let slack = 1e-5 * high.abs() + 1e-6 * f32::from(u8::from(view.unproject(ndc, 0.0).is_finite()));
            // A corner behind the light has no depth.
            let has_range = low > 0.0 || slack > 1e-6;
            assert!(!has_range || (low - slack..=high + slack).contains(&depth), "{low} {depth} {high}");
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let height = normal.dot(view.unproject(ndc, depth) - a).abs();
            let is_clamped = !has_range || depth <= low + slack || depth >= high - slack;
            assert!(is_clamped || height <= maps.tolerance, "{height} of {}", maps.tolerance);
        }
    }
    maps
}

/// V of the pixels `asked`, least and most, for receivers moved by up to `reach` scene units in 26 directions, and for those
/// that are not. All others stay: maps may be fitted to them.
pub(crate) fn bracket(
    on_cpu: &PreparedShadowMap<'_>,
    gbuffer: &GBuffer,
    asked: &[usize],
    reach: impl Fn(usize) -> f32,
) -> Vec<[f32; 2]> {
    let mut found = vec![[f32::INFINITY, f32::NEG_INFINITY]; asked.len()];
    let mut moved = gbuffer.clone();
    if asked.is_empty() {
        return found;
    }
    let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
    let sides = || [-1.0f32, 0.0, 1.0].into_iter();
    let directions =
        sides().flat_map(|x| sides().flat_map(move |y| sides().map(move |z| Vec3::new(x, y, z))));
    for scale in [1.0, 0.3] {
        for direction in directions.clone() {
            for &pixel in asked {
                moved.position[pixel] = gbuffer.position[pixel] + direction * (scale * reach(pixel));
            }
            on_cpu.shade(&moved, &mut image);
            for (range, &pixel) in found.iter_mut().zip(asked) {
                let v = image.values[pixel];
                *range = [range[0].min(v), range[1].max(v)];
            }
        }
    }
    found
}

/// The CPU path over the GPU's maps.
pub(crate) fn over_gpu_maps<'a>(params: ShadowMapParams, maps: LightMaps<'a>) -> PreparedShadowMap<'a> {
    ShadowMap::new(params).prepare_maps(maps).0
}
