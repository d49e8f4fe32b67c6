//! Pixels shared among threads by tiles, the same for every way to find the truth.

use std::ops::{AddAssign, ControlFlow};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use thiserror::Error;

use crate::{GBuffer, Light, Scene, VisibilityImage};

/// Ground truth with an estimate of its own error.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// V of every pixel that sees a surface; NaN elsewhere.
    pub visibility: VisibilityImage,
    /// Per pixel the estimated standard error of V; NaN where nothing is seen, 0 where V is exact.
    ///
    /// Its square estimates the variance of V without bias: the two samples of a stratum are independent, so their
    /// differences measure what stratification leaves. Where no stratum disagrees, that would be 0, though light or
    /// shadow too thin for any sample can remain; the error is then given as 1 / samples, its standard deviation
    /// given that all samples agree and nothing else is known. It is 0 only where V is certain: for a light without
    /// extent, where no ray was needed, where it is proved, and in exact truth.
    pub std_error: Vec<f32>,
    /// How it was found.
    pub work: Work,
}

/// What ground truth took. Pixels that receive no shadow or lie outside a spot's cone take nothing and are in none
/// of the counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Shadow rays traced. Samples below a surface's tangent plane need none.
    pub rays: u64,
    /// Pixels proved wholly lit.
    pub proved_lit: u64,
    /// Pixels proved wholly dark.
    pub proved_dark: u64,
    /// Pixels whose samples were all looked at.
    pub sampled: u64,
    /// Pixels whose V was computed from areas.
    pub exact: u64,
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.proved_lit += other.proved_lit;
        self.proved_dark += other.proved_dark;
        self.sampled += other.sampled;
        self.exact += other.exact;
    }
}

/// The work was stopped by its progress callback.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("cancelled")]
pub struct Cancelled;

/// A progress callback that does nothing.
pub fn no_progress(_fraction: f32) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Side of the tiles that threads take, in pixels: small enough to balance, large enough that neighbours' rays
/// find the same nodes in the cache.
pub(super) const TILE: u32 = 16;

/// What was found for one pixel.
#[derive(Clone, Copy)]
pub(super) struct Estimate {
    pub(super) visibility: f32,
    pub(super) std_error: f32,
}

impl Estimate {
    pub(super) fn certain(visibility: f32) -> Self {
        Self { visibility, std_error: 0.0 }
    }
}

/// A finished tile: an estimate for each pixel that sees a surface.
struct Tile {
    estimates: Vec<Option<Estimate>>,
    work: Work,
}

/// Calls `estimate` for every pixel of `gbuffer` whose V is in question, with a thread's buffers and a tally to
/// add to; `begin` is called before those of a tile, with its first column and row. Objects that do not receive are lit and points that the light does not reach are dark without asking.
pub(super) fn estimate_tiles<B>(
    scene: &Scene,
    light: &Light,
    gbuffer: &GBuffer,
    progress: &(dyn Fn(f32) -> ControlFlow<()> + Sync),
    buffers: impl Fn() -> B + Sync + Send,
    begin: impl Fn(u32, u32, &mut B) + Sync,
    estimate: impl Fn(usize, &mut B, &mut Work) -> Estimate + Sync,
) -> Result<Reference, Cancelled> {
    let tiles_x = gbuffer.width.div_ceil(TILE);
    let tiles = tiles_x as usize * gbuffer.height.div_ceil(TILE) as usize;
    let pixels =
        |tile: usize| tile_pixels(gbuffer, tile as u32 % tiles_x * TILE, tile as u32 / tiles_x * TILE);
    let receives = |pixel: usize| {
        let object = scene.objects().get(gbuffer.object[pixel] as usize);
        object.is_none_or(|o| o.flags.receives)
    };
    let done = AtomicUsize::new(0);
    let estimated: Vec<Tile> = (0..tiles)
        .into_par_iter()
        .map_init(buffers, |buffers, tile| {
            let mut work = Work::default();
            begin(tile as u32 % tiles_x * TILE, tile as u32 / tiles_x * TILE, buffers);
            let one = |pixel| {
                if !gbuffer.is_seen(pixel) {
                    None
                } else if !receives(pixel) {
                    Some(Estimate::certain(1.0))
                } else if !light.reaches(gbuffer.position[pixel]) {
                    Some(Estimate::certain(0.0))
                } else {
                    Some(estimate(pixel, buffers, &mut work))
                }
            };
            let estimates = pixels(tile).map(one).collect();
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            match progress(done as f32 / tiles as f32) {
                ControlFlow::Continue(()) => Ok(Tile { estimates, work }),
                ControlFlow::Break(()) => Err(Cancelled),
            }
        })
        .collect::<Result<_, _>>()?;

    let mut visibility = VisibilityImage::new(gbuffer.width, gbuffer.height);
    let mut std_error = visibility.values.clone();
    let mut work = Work::default();
    for (tile, Tile { estimates, work: of_tile }) in estimated.iter().enumerate() {
        work += *of_tile;
        for (pixel, estimate) in pixels(tile).zip(estimates) {
            if let Some(estimate) = estimate {
                visibility.values[pixel] = estimate.visibility;
                std_error[pixel] = estimate.std_error;
            }
        }
    }
    Ok(Reference { visibility, std_error, work })
}

/// Indices of the pixels of the tile whose first one is (`x`, `y`), row by row.
fn tile_pixels(gbuffer: &GBuffer, x: u32, y: u32) -> impl Iterator<Item = usize> + use<> {
    let width = gbuffer.width;
    let columns = x..(x + TILE).min(width);
    (y..(y + TILE).min(gbuffer.height)).flat_map(move |row| {
        columns.clone().map(move |column| row as usize * width as usize + column as usize)
    })
}
