//! All pixels by rays, where that costs less than counting: as in foliage.
//!
//! No tile is proved lit or dark before ([`scene_core::relevance::classify_tiles`]): of `street` at 512² shafts prove a fifth of the
//! pixels, of `forest` three pixels, and the proofs take longer than the rays that they spare.

use rayon::prelude::*;
use scene_core::bvh::shadow_origin;
use scene_core::{Report, VisibilityImage};

use super::{Asked, Receivers, TILE, Work};
use crate::volumes::Volumes;

/// Fills `visibility`, of the G-buffer's size: V where a surface is seen, NaN elsewhere.
pub(super) fn shade(
    volumes: &Volumes,
    receivers: &Receivers<'_>,
    report: &mut Report,
    visibility: &mut VisibilityImage,
) -> Work {
    let (gbuffer, light) = (receivers.gbuffer, receivers.light.center());
    let width = gbuffer.width as usize;
    let of_band = |(band, values): (usize, &mut [f32])| {
        let mut work = Work::default();
        // Tile by tile: neighbours walk through the same nodes.
        for tile in 0..width.div_ceil(TILE) {
            for (row, values) in values.chunks_mut(width).enumerate() {
                let first = (band * TILE + row) * width;
                for (x, value) in values.iter_mut().enumerate().skip(tile * TILE).take(TILE) {
                    let pixel = first + x;
                    let asked = receivers.ask(pixel);
                    *value = match asked {
                        Asked::Nothing => f32::NAN,
                        Asked::Lit => 1.0,
                        Asked::Dark if receivers.skip_unlit => {
                            work.unreached += 1;
                            0.0
                        }
                        Asked::Dark | Asked::Yes => {
                            work.traced += 1;
                            let (place, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
                            let origin = shadow_origin(place, normal, receivers.magnitude);
                            let lit = !volumes.tree.is_occluded(origin, light);
                            f32::from(u8::from(lit && asked == Asked::Yes))
                        }
                    };
                }
            }
        }
        work.asked = work.traced;
        work
    };
    report.time("shade.rays", |_| {
        let bands = visibility.values.par_chunks_mut(width * TILE).enumerate();
        bands.map(of_band).reduce(Work::default, |mut sum, work| {
            sum += work;
            sum
        })
    })
}
