//! Step 3, the distortion map: for every tile of the light's image the splats that reach it.
//!
//! The paper keeps one splat a pixel, and points under several layers of casters get the wrong one. Here a tile keeps all
//! of them ([`grid`](crate::grid)); which counts is decided for each receiver by its depth.
//!
//! # What is left out
//! A tile on which no receiver falls keeps nothing, nor one whose farthest receiver lies before the edge; and an edge's
//! splat is cut to the farthest receiver within its own reach, unless it lies over so few tiles that the cut costs more than it
//! saves. None of this changes an image.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::Vec3;
use rayon::prelude::*;
use scene_core::Scene;
use scene_core::light::LightHull;

use crate::grid::{Grid, RATIO, Range, TileLists};
use crate::light_image::{Bounds, LightImage};
use crate::splat::{Cast, Splat};

/// How often a splat is cut to the receivers within its reach.
const CUTS: usize = 3;

/// Tiles of the finest grid that a splat lies over and is not cut, where lists are gone through once: a cut throws the edge's ends
/// from all corners of the light again and saves a few entries. Over `pool` and `street` `shade.splat` takes half the time or less,
/// `shade.penumbra` up to a tenth more.
pub(crate) const FEW_TILES: u32 = 16;

/// How far beyond its bounds a surface is taken to reach, in texels, for the rounding of image coordinates.
const SLACK: f32 = 0.25;

/// The farthest receiver of every tile of every grid.
#[derive(Debug)]
pub struct Farthest {
    grid: Grid,
    /// Order-preserving bits of distances, 0 for none.
    bits: Vec<AtomicU32>,
}

/// Bits of a float that order as the float does, none of them 0.
fn ordered(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits >> 31 == 1 { !bits | 1 } else { bits | 1 << 31 }
}

fn unordered(bits: u32) -> f32 {
    if bits == 0 {
        f32::NEG_INFINITY
    } else {
        f32::from_bits(if bits >> 31 == 1 { bits & !(1 << 31) } else { !bits })
    }
}

impl Farthest {
    /// No receivers yet.
    pub fn new(grid: Grid) -> Self {
        let all = grid.count_all();
        Self { grid, bits: (0..all).map(|_| AtomicU32::new(0)).collect() }
    }

    /// A receiver of a tile at a distance. The order of calls, and from which thread, does not matter.
    #[inline]
    pub fn add(&self, tile: u32, along: f32) {
        let bits = ordered(along);
        let held = &self.bits[tile as usize];
        if held.load(Ordering::Relaxed) < bits {
            held.fetch_max(bits, Ordering::Relaxed);
        }
    }

    /// Of all surfaces of a scene that receive shadows, whatever a camera sees of them: a triangle's farthest corner for
    /// every tile that its image may touch.
    pub fn of_scene(scene: &Scene, image: &LightImage, grid: Grid) -> Self {
        let this = Self::new(grid);
        let receives = scene.objects().iter().filter(|object| object.flags.receives);
        for object in receives {
            object.triangles.clone().into_par_iter().for_each(|triangle| {
                let (mut bounds, mut along) = (Bounds::NONE, f32::NEG_INFINITY);
                for corner in scene.corners(triangle) {
                    // What reaches behind the light's plane may be seen anywhere.
                    bounds = match image.place(corner) {
                        Some(place) if bounds != Bounds::ALL => bounds.with(place),
                        _ => Bounds::ALL,
                    };
                    along = along.max(image.along(corner));
                }
                grid.each_tile(bounds.grown(SLACK), &mut |tile| this.add(tile, along));
            });
        }
        // What lies over a tile lies over the finer ones within.
        for level in (1..grid.levels()).rev() {
            let (below, above) = (grid.tiles_at(level - 1), grid.tiles_at(level));
            let (to, from) = (grid.first_of(level - 1), grid.first_of(level));
            for row in 0..below {
                for column in 0..below {
                    let at = from + ((row >> RATIO) * above + (column >> RATIO)) as usize;
                    let held = this.bits[at].load(Ordering::Relaxed);
                    this.bits[to + (row * below + column) as usize].fetch_max(held, Ordering::Relaxed);
                }
            }
        }
        this.finish();
        this
    }

    /// Fills the coarser grids.
    pub fn finish(&self) {
        for level in 1..self.grid.levels() {
            let (below, above) = (self.grid.tiles_at(level - 1), self.grid.tiles_at(level));
            let (from, to) = (self.grid.first_of(level - 1), self.grid.first_of(level));
            for row in 0..below {
                for column in 0..below {
                    let bits = self.bits[from + (row * below + column) as usize].load(Ordering::Relaxed);
                    let at = to + ((row >> RATIO) * above + (column >> RATIO)) as usize;
                    self.bits[at].fetch_max(bits, Ordering::Relaxed);
                }
            }
        }
    }

    /// With a margin for the rounding of distances, which are sums of four products: 2⁻¹⁸ is 64 half ulps.
    fn of(&self, tile: usize) -> f32 {
        let far = unordered(self.bits[tile].load(Ordering::Relaxed));
        far + far.abs() * (1.0 / 262_144.0)
    }

    /// The farthest of all.
    pub fn all(&self) -> f32 {
        (self.grid.first_of(self.grid.levels() - 1)..self.bits.len())
            .map(|tile| self.of(tile))
            .fold(f32::NEG_INFINITY, f32::max)
    }

    fn within(&self, range: Range) -> f32 {
        let (first, side) = (self.grid.first_of(range.level), self.grid.tiles_at(range.level));
        let rows = range.first[1]..=range.last[1];
        rows.flat_map(|row| (range.first[0]..=range.last[0]).map(move |column| row * side + column))
            .map(|tile| self.of(first + tile as usize))
            .fold(f32::NEG_INFINITY, f32::max)
    }
}

/// The splats of one view.
///
/// Splats `edges` over the receivers of `farthest`. Without `skip` every tile is taken to have receivers as far as the
/// farthest of all. `reach` may say to which distance an edge's splat goes, whatever the receivers. `skip` says how
/// many tiles of the finest grid a splat may lie over that is not cut.
pub fn distortion_map(
    image: &LightImage,
    edges: &(impl Fn(usize) -> [Vec3; 2] + Sync),
    reach: &(impl Fn(usize) -> Option<f32> + Sync),
    count: usize,
    hull: Option<&LightHull>,
    farthest: &Farthest,
    skip: Option<u32>,
) -> TileLists {
    let far = farthest.all();
    TileLists::new(farthest.grid, count, |edge, enter| {
        let cast = Cast::new(image, edges(edge), hull);
        splat_edge(&cast, farthest, reach(edge).ok_or(far), skip, enter);
    })
}

fn splat_edge(
    cast: &Cast<'_>,
    farthest: &Farthest,
    far: Result<f32, f32>,
    skip: Option<u32>,
    mut entry: impl FnMut(u32),
) {
    let grid = &farthest.grid;
    let (Ok(mut reach) | Err(mut reach)) = far;
    let Some(Splat { bounds, beyond }) = cast.splat(reach) else { return };
    let mut range = grid.range(bounds);
    if let (Some(few), Err(_)) = (skip, far) {
        for _ in 0..CUTS {
            if range.finest_tiles() <= few {
                break;
            }
            let within = farthest.within(range);
            if within >= reach {
                break;
            }
            reach = within;
            let Some(Splat { bounds, .. }) = cast.splat(reach) else { return };
            range = grid.range(bounds);
        }
    }
    let (first, side) = (grid.first_of(range.level), grid.tiles_at(range.level));
    for row in range.first[1]..=range.last[1] {
        for column in range.first[0]..=range.last[0] {
            let tile = first + (row * side + column) as usize;
            if skip.is_none() || farthest.of(tile) > beyond {
                entry(tile as u32);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_order_as_their_bits() {
        let values = [f32::NEG_INFINITY, -2.0, -1e-30, 0.0, 1e-30, 0.5, 7.0, f32::INFINITY];
        for pair in values.windows(2) {
            assert!(ordered(pair[0]) < ordered(pair[1]) && ordered(pair[0]) > 0);
        }
        for value in values {
            let back = unordered(ordered(value));
            assert!((back - value).abs() <= 1e-37 || back == value, "{value} came back as {back}");
        }
        assert_eq!(unordered(0), f32::NEG_INFINITY);
    }
}
