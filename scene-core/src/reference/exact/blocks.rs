//! Pixels of a tile that share what they gather.
//!
//! Neighbours see the light through nearly the same triangles, so those of a block of pixels are gathered once, by the
//! shaft from all of them to the light, and each pixel looks only at these. Where neighbours lie far apart the
//! shaft holds much that no pixel needs; the block is then split in four.

use glam::Vec3;

use super::apexes::Apexes;
use super::cone::Outline;
use super::patch::Patch;
use crate::Scene;
use crate::bvh::HalfSpace;
use crate::reference::CasterSearch;
use crate::reference::outline::LightOutline;
use crate::reference::shaft::LightShaft;

/// A pixel that is not settled by a proof.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receiver {
    /// In the image.
    pub(super) pixel: usize,
    /// Column and row in the tile.
    pub(super) at: [u32; 2],
    /// Where its shadow rays start.
    pub(super) origin: Vec3,
    /// Of the surface, turned to the camera.
    pub(super) normal: Vec3,
}

/// Gathering and connecting a triangle costs as much as looking from so many points at what is left of it.
const CONNECTING: usize = 24;

/// Blocks of several pixels that gather more triangles than this are split without asking whether it pays.
const MANY: usize = 1 << 18;

pub(super) struct Gatherer<'a, C> {
    pub(super) scene: &'a Scene,
    pub(super) casters: &'a C,
    /// Of the scene's vertices, the first at the same position.
    pub(super) representative: Vec<u32>,
    pub(super) outline: &'a Outline,
    /// What holds the light for all receivers, if anything does.
    pub(super) hull: Option<LightOutline>,
    /// Largest coordinate of the scene.
    pub(super) magnitude: f32,
}

/// Some pixels and the triangles in their shaft.
struct Block {
    receivers: Vec<Receiver>,
    triangles: Vec<u32>,
}

impl Block {
    fn cost(&self) -> usize {
        self.triangles.len() * (self.receivers.len() + CONNECTING)
    }
}

impl<C: CasterSearch> Gatherer<'_, C> {
    /// Calls `solve` with every receiver of a tile of `side` pixels and the triangles that it may see before the light.
    pub(super) fn each(
        &self,
        receivers: Vec<Receiver>,
        side: u32,
        solve: &mut impl FnMut(&Receiver, &Patch),
    ) {
        if !receivers.is_empty() {
            let whole = self.gather(receivers);
            self.descend(&whole, side, solve);
        }
    }

    fn gather(&self, receivers: Vec<Receiver>) -> Block {
        let origins: Vec<Vec3> = receivers.iter().map(|receiver| receiver.origin).collect();
        let shaft = self
            .hull
            .as_ref()
            .map(|hull| LightShaft::new(&origins, receivers[0].normal, hull, self.magnitude));
        let region: &[HalfSpace] = shaft.as_ref().map_or(&[], LightShaft::sides);
        let mut triangles = Vec::new();
        self.casters.each_in(region, |triangle| triangles.push(triangle));
        Block { receivers, triangles }
    }

    fn descend(&self, block: &Block, side: u32, solve: &mut impl FnMut(&Receiver, &Patch)) {
        if block.receivers.len() > 1 && side > 1 && !block.triangles.is_empty() {
            let half = side / 2;
            let quarter = |receiver: &Receiver| {
                let [x, y] = receiver.at.map(|place| usize::from(place & half != 0));
                x + 2 * y
            };
            let mut quarters = [const { Vec::new() }; 4];
            for &receiver in &block.receivers {
                quarters[quarter(&receiver)].push(receiver);
            }
            let parts: Vec<Block> = quarters
                .into_iter()
                .filter(|receivers| !receivers.is_empty())
                .map(|receivers| self.gather(receivers))
                .collect();
            let parted = parts.iter().map(Block::cost).sum::<usize>();
            if block.triangles.len() > MANY || parted < block.cost() {
                for part in &parts {
                    self.descend(part, half, solve);
                }
                return;
            }
        }
        let origins = block.receivers.iter().map(|receiver| receiver.origin);
        let apexes = Apexes::new(self.outline, origins);
        let patch = Patch::new(self.scene, &self.representative, &block.triangles, apexes.as_ref());
        block.receivers.iter().for_each(|receiver| solve(receiver, &patch));
    }
}
