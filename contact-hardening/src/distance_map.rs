//! The distance map of pass 2: S and D of every pixel.

use glam::Vec3;
use rayon::prelude::*;
use scene_core::light::LightPoint;
use scene_core::{GBuffer, VisibilityImage};

use gnomon_shadow_map::cpu::receiver;
use gnomon_shadow_map::light_maps::LightMaps;

/// Per pixel, row by row from the top left.
#[derive(Clone, Debug, Default)]
pub struct DistanceMap {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// S: 0 lit, 1 shadowed; NaN where nothing is seen or V needs no shadow (a surface turned away, for one).
    pub shadow: Vec<f32>,
    /// D: how far along the way to the light's centre the blocker is, as a share; of parallel light in scene units. 0
    /// where there is none.
    pub distance: Vec<f32>,
}

impl DistanceMap {
    /// A map in which nothing is seen.
    pub fn new(width: usize, height: usize) -> Self {
        let pixels = width * height;
        Self { width, height, shadow: vec![f32::NAN; pixels], distance: vec![0.0; pixels] }
    }
}

/// From `point` to the light's centre; of parallel light a unit vector.
#[inline]
pub fn to_light(center: LightPoint, point: Vec3) -> Vec3 {
    match center {
        LightPoint::At(place) => place - point,
        LightPoint::Towards(direction) => direction,
    }
}

/// `shade.distance`, pass 2: S from `hard` where there is one, V of some technique, or else from the maps; D from the
/// maps. Writes the V that is known without a shadow to `visibility`.
///
/// V below one half counts as shadowed. A pixel that `hard` shadows and no map does has D = 0: what its texel holds is not what
/// hides the light, but a surface beside the blocker or the receiver's own.
pub fn distance_map(
    maps: &LightMaps<'_>,
    gbuffer: &GBuffer,
    hard: Option<&VisibilityImage>,
    visibility: &mut VisibilityImage,
) -> DistanceMap {
    let (width, height) = (gbuffer.width as usize, gbuffer.height as usize);
    let mut result = DistanceMap::new(width, height);
    let center = maps.light.center();
    let rows = visibility.values.par_chunks_mut(width.max(1)).zip(result.shadow.par_chunks_mut(width.max(1)));
    let rows = rows.zip(result.distance.par_chunks_mut(width.max(1)));
    rows.enumerate().for_each(|(row, ((values, shadow), distance))| {
        for column in 0..width {
            let pixel = row * width + column;
            let receiver = match receiver(maps, gbuffer, pixel) {
                Ok(receiver) => receiver,
                Err(known) => {
                    // Whether a spot's cone reaches a pixel on its border is the source's matter, too.
                    values[column] = hard.map_or(known, |hard| hard.values[pixel]);
                    continue;
                }
            };
            let by_map = || maps.hard(&receiver) < 0.5;
            let is_shadowed = hard.map_or_else(by_map, |hard| hard.values[pixel] < 0.5);
            shadow[column] = f32::from(u8::from(is_shadowed));
            values[column] = 1.0 - shadow[column];
            let is_held = is_shadowed && (hard.is_none() || by_map());
            if is_held && let Some(blocker) = maps.occluder(receiver.point) {
                let way = to_light(center, receiver.point);
                let share = (blocker.point - receiver.point).dot(way) / way.length_squared();
                // A blocker beyond the light, or below its own receiver by a texel's slope, has no penumbra.
                distance[column] = if share > 0.0 && share.is_finite() { share } else { 0.0 };
            }
        }
    });
    result
}
