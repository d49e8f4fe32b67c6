//! Pixels whose V is proved to be 0 or 1 for every sample there could be, so that none need be traced.
//!
//! Blocks of pixels are tried first: if no caster reaches into the shaft from all their surfaces to the light, all are
//! lit. What is left is tried pixel by pixel.

use glam::Vec3;

use super::outline::LightOutline;
use super::shaft::LightShaft;
use super::tiles::TILE;
use crate::bvh::{Bvh, Cover, LastCover, shadow_origin};
use crate::{GBuffer, Light};

/// What holds for every sample of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Proof {
    /// Above the tangent plane and not blocked: V = 1.
    Lit,
    /// Below the tangent plane or blocked: V = 0.
    Dark,
}

/// Side of the smallest blocks, in pixels.
const BLOCK: u32 = 4;

/// Receivers are on the scene's surfaces and so within its largest coordinate, but for rounding; those that lie farther
/// out than this many times that are no one's and not proved.
const REACH: f32 = 1.0 + 1.0 / 1024.0;

/// Smallest blocks along the side of a tile.
const BLOCKS: u32 = TILE / BLOCK;

/// What a thread keeps from pixel to pixel.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    last: LastCover,
    /// Per block of the tile, row by row, whether it is lit.
    lit: u32,
    origins: Vec<Vec3>,
}

impl<'a> Prover<'a> {
    /// `magnitude` is the largest coordinate of the scene.
    pub(super) fn new(tree: &'a Bvh, light: &'a Light, gbuffer: &'a GBuffer, magnitude: f32) -> Self {
        // What is farther out is not proved, so this holds for all receivers.
        let outline = LightOutline::of_all(light, Vec3::splat(REACH * magnitude), magnitude);
        Self { tree, light, gbuffer, magnitude, outline }
    }
}

/// Proves pixels of one image.
pub(super) struct Prover<'a> {
    tree: &'a Bvh,
    light: &'a Light,
    gbuffer: &'a GBuffer,
    /// Largest coordinate of the scene.
    magnitude: f32,
    /// What holds the light for all receivers.
    outline: Option<LightOutline>,
}

impl Prover<'_> {
    /// Tries the blocks of the tile whose first pixel is (`x`, `y`).
    pub(super) fn begin_tile(&self, x: u32, y: u32, memory: &mut Memory) {
        memory.lit = 0;
        self.block(x, y, TILE, memory);
    }

    fn block(&self, x: u32, y: u32, side: u32, memory: &mut Memory) {
        let (width, height) = (self.gbuffer.width, self.gbuffer.height);
        if x >= width || y >= height {
            return;
        }
        memory.origins.clear();
        let Some(outline) = &self.outline else { return };
        let mut all_above = true;
        let mut first = None;
        for row in y..(y + side).min(height) {
            for column in x..(x + side).min(width) {
                let pixel = row as usize * width as usize + column as usize;
                if !self.gbuffer.is_seen(pixel) {
                    continue;
                }
                let (position, normal) = (self.gbuffer.position[pixel], self.gbuffer.normal[pixel]);
                let origin = shadow_origin(position, normal, self.magnitude);
                first.get_or_insert(normal);
                let (lowest, _, margin) = outline.heights(position, normal);
                all_above &= lowest > margin && self.is_near(origin);
                memory.origins.push(origin);
            }
        }
        let Some(normal) = first else { return };
        let shaft = || LightShaft::new(&memory.origins, normal, outline, self.magnitude);
        if all_above && self.tree.misses(shaft().sides()) {
            for row in 0..side / BLOCK {
                for column in 0..side / BLOCK {
                    memory.lit |= 1 << ((y % TILE / BLOCK + row) * BLOCKS + x % TILE / BLOCK + column);
                }
            }
        } else if side > BLOCK {
            let half = side / 2;
            for (dx, dy) in [(0, 0), (half, 0), (0, half), (half, half)] {
                self.block(x + dx, y + dy, half, memory);
            }
        }
    }

    fn is_near(&self, origin: Vec3) -> bool {
        origin.abs().max_element() <= REACH * self.magnitude
    }

    /// Tries to settle a pixel of the tile begun last. Lights without extent take one ray and are left to it.
    pub(super) fn prove(&self, pixel: usize, memory: &mut Memory) -> Option<Proof> {
        let (x, y) = (pixel as u32 % self.gbuffer.width, pixel as u32 / self.gbuffer.width);
        if memory.lit >> (y % TILE / BLOCK * BLOCKS + x % TILE / BLOCK) & 1 == 1 {
            return Some(Proof::Lit);
        }
        let (position, normal) = (self.gbuffer.position[pixel], self.gbuffer.normal[pixel]);
        let origin = shadow_origin(position, normal, self.magnitude);
        if !self.is_near(origin) {
            return None;
        }
        let outline = match self.light {
            // Of a sphere every receiver sees another part.
            Light::Sphere { .. } => LightOutline::new(self.light, origin, self.magnitude),
            _ => self.outline,
        }?;
        let (lowest, highest, margin) = outline.heights(position, normal);
        if highest < -margin {
            return Some(Proof::Dark);
        }
        match self.tree.cover(origin, outline.points(), &mut memory.last) {
            Cover::Clear if lowest > margin => Some(Proof::Lit),
            Cover::Covered => Some(Proof::Dark),
            Cover::Clear | Cover::Unknown => None,
        }
    }
}
