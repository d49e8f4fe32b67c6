//! The receivers of a view, sorted over the window into blocks of sixteen, and a tree of boxes over the blocks.
//!
//! The tree takes the place of the irregular z-buffer's lists of samples a texel: it has no resolution to choose, and
//! where the camera packs many samples into a corner of the window it is as deep as it must be.

use std::sync::atomic::{AtomicU32, Ordering};

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16};
use glam::Vec3;
use rayon::prelude::*;

use super::caster::Caster;
use super::frame::Frame;

/// Receivers of a block, children of a node.
pub(super) const LANES: usize = 16;

/// A block's receivers, by coordinate.
#[derive(Clone, Debug)]
pub(super) struct Block {
    x: [f32; LANES],
    y: [f32; LANES],
    nearness: [f32; LANES],
    ids: [u32; LANES],
}

/// Boxes of sixteen children; those that are not there are empty.
#[derive(Clone, Debug)]
struct Node {
    min: [[f32; LANES]; 2],
    max: [[f32; LANES]; 2],
    /// The nearness of the child's receiver that is farthest from the light.
    farthest: [f32; LANES],
}

impl Node {
    const EMPTY: Self = Self {
        min: [[f32::INFINITY; LANES]; 2],
        max: [[f32::NEG_INFINITY; LANES]; 2],
        farthest: [f32::INFINITY; LANES],
    };
}

/// The receivers of one view.
#[derive(Debug)]
pub(super) struct Receivers {
    blocks: Vec<Block>,
    /// From those over blocks to the root.
    levels: Vec<Vec<Node>>,
    /// A block's receivers that are in shadow, as bits.
    shadowed: Vec<AtomicU32>,
}

/// Interleaves the bits of two numbers of 16 bits.
fn morton(x: u32, y: u32) -> u32 {
    let spread = |v: u32| {
        let v = (v | v << 8) & 0x00ff_00ff;
        let v = (v | v << 4) & 0x0f0f_0f0f;
        let v = (v | v << 2) & 0x3333_3333;
        (v | v << 1) & 0x5555_5555
    };
    spread(x) | spread(y) << 1
}

impl Receivers {
    /// Those of `positions` that `ids` names, as `frame` sees them.
    pub(super) fn new(frame: &Frame, positions: &[Vec3], ids: &[u32]) -> Self {
        let place = |id: u32| {
            let p = frame.homogeneous(positions[id as usize]);
            (p.truncate() / p.w).as_vec3()
        };
        let mut order: Vec<(u32, u32)> = ids
            .par_iter()
            .map(|&id| {
                let cell = ((place(id).truncate() + 1.0) * 32768.0).as_uvec2();
                (morton(cell.x.min(0xffff), cell.y.min(0xffff)), id)
            })
            .collect();
        order.par_sort_unstable();
        let blocks: Vec<Block> = order
            .par_chunks(LANES)
            .map(|receivers| {
                // Lanes that are left are nearer to the light than anything, so that nothing shadows them.
                let mut block = Block {
                    x: [0.0; LANES],
                    y: [0.0; LANES],
                    nearness: [f32::INFINITY; LANES],
                    ids: [u32::MAX; LANES],
                };
                for (lane, &(_, id)) in receivers.iter().enumerate() {
                    let p = place(id);
                    (block.x[lane], block.y[lane], block.nearness[lane]) = (p.x, p.y, p.z);
                    block.ids[lane] = id;
                }
                block
            })
            .collect();
        let leaves = blocks
            .par_chunks(LANES)
            .map(|blocks| {
                let mut node = Node::EMPTY;
                for (lane, block) in blocks.iter().enumerate() {
                    let used = block.ids.iter().take_while(|&&id| id != u32::MAX).count();
                    for i in 0..used {
                        node.grow(lane, [block.x[i]; 2], [block.y[i]; 2], block.nearness[i]);
                    }
                }
                node
            })
            .collect::<Vec<_>>();
        let mut levels = vec![leaves];
        while let Some(below) = levels.last().filter(|level| level.len() > 1) {
            let level = below
                .chunks(LANES)
                .map(|nodes| {
                    let mut node = Node::EMPTY;
                    for (lane, child) in nodes.iter().enumerate() {
                        for i in 0..LANES {
                            let [x, y] = [0, 1].map(|axis: usize| [child.min[axis][i], child.max[axis][i]]);
                            node.grow(lane, x, y, child.farthest[i]);
                        }
                    }
                    node
                })
                .collect();
            levels.push(level);
        }
        let shadowed = blocks.iter().map(|_| AtomicU32::new(0)).collect();
        Self { blocks, levels, shadowed }
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        let nodes: usize = self.levels.iter().map(|level| size_of_val(level.as_slice())).sum();
        size_of_val(self.blocks.as_slice()) + nodes + size_of_val(self.shadowed.as_slice())
    }

    /// Hands on the receivers that are in shadow.
    pub(super) fn for_each_shadowed(&self, mut shadowed: impl FnMut(u32)) {
        for (block, bits) in self.blocks.iter().zip(&self.shadowed) {
            let mut bits = bits.load(Ordering::Relaxed);
            while bits != 0 {
                shadowed(block.ids[bits.trailing_zeros() as usize]);
                bits &= bits - 1;
            }
        }
    }

    /// Marks the receivers that `caster` shadows. What it cannot tell for sure, `exact` says of the receiver's index;
    /// with `ask` it is asked of every one that may be in shadow.
    #[inline(always)]
    pub(super) fn shadow<S: Simd>(
        &self,
        simd: S,
        caster: &Caster,
        ask: bool,
        tally: &mut Tally,
        mut exact: impl FnMut(u32) -> bool,
    ) {
        let lanes = CasterLanes::new(simd, caster);
        // A tree of 2³² receivers has eight levels of nodes; each leaves at most fifteen siblings behind.
        let mut pending = [(0_u32, 0_u32); 8 * LANES];
        let top = self.levels.len() - 1;
        pending[0] = (top as u32, 0);
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (level, index) = pending[height];
            let node = &self.levels[level as usize][index as usize];
            let mut met = lanes.meets(simd, node);
            while met != 0 {
                let child = index * LANES as u32 + met.trailing_zeros();
                met &= met - 1;
                if level > 0 {
                    pending[height] = (level - 1, child);
                    height += 1;
                    continue;
                }
                let (block, shadowed) = (&self.blocks[child as usize], &self.shadowed[child as usize]);
                let dark = shadowed.load(Ordering::Relaxed);
                let (sure, possible) = lanes.shadows(simd, block);
                let mut new = if ask { 0 } else { sure & !dark };
                let mut doubt = possible & !new & !dark;
                tally.tests += 1;
                while doubt != 0 {
                    let lane = doubt.trailing_zeros();
                    doubt &= doubt - 1;
                    tally.exact += 1;
                    let id = block.ids[lane as usize];
                    if id != u32::MAX && exact(id) {
                        new |= 1 << lane;
                    }
                }
                if new != 0 {
                    shadowed.fetch_or(new, Ordering::Relaxed);
                }
            }
        }
    }
}

impl Node {
    fn grow(&mut self, lane: usize, x: [f32; 2], y: [f32; 2], nearness: f32) {
        for (axis, [low, high]) in [x, y].into_iter().enumerate() {
            self.min[axis][lane] = self.min[axis][lane].min(low);
            self.max[axis][lane] = self.max[axis][lane].max(high);
        }
        self.farthest[lane] = self.farthest[lane].min(nearness);
    }
}

/// What it took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    /// Blocks of receivers that a triangle was tested against.
    pub(super) tests: u64,
    /// Pairs that the exact test decided.
    pub(super) exact: u64,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.tests += other.tests;
        self.exact += other.exact;
    }
}

/// A caster, spread over lanes.
struct CasterLanes<S: Simd> {
    edges: [[f32x16<S>; 3]; 3],
    plane: [f32x16<S>; 3],
    nearest: f32x16<S>,
    tau: f32x16<S>,
    plane_tau: f32x16<S>,
    min: [f32x16<S>; 2],
    max: [f32x16<S>; 2],
}

impl<S: Simd> CasterLanes<S> {
    #[inline(always)]
    fn new(simd: S, caster: &Caster) -> Self {
        let all = |value: f32| f32x16::splat(simd, value);
        let [a, b, c] = caster.edges;
        let [p, min, max] =
            [caster.plane, [caster.min[0], caster.min[1], 0.0], [caster.max[0], caster.max[1], 0.0]];
        Self {
            edges: [
                [all(a[0]), all(a[1]), all(a[2])],
                [all(b[0]), all(b[1]), all(b[2])],
                [all(c[0]), all(c[1]), all(c[2])],
            ],
            plane: [all(p[0]), all(p[1]), all(p[2])],
            nearest: all(caster.nearest),
            tau: all(caster.tau),
            plane_tau: all(caster.plane_tau),
            min: [all(min[0]), all(min[1])],
            max: [all(max[0]), all(max[1])],
        }
    }

    /// The children of a node with receivers that the caster may shadow.
    #[inline(always)]
    fn meets(&self, simd: S, node: &Node) -> u32 {
        let load = |values: &[f32; LANES]| f32x16::from_slice(simd, values);
        let [x0, y0, x1, y1] =
            [load(&node.min[0]), load(&node.min[1]), load(&node.max[0]), load(&node.max[1])];
        let mut meets = x0.simd_le(self.max[0])
            & x1.simd_ge(self.min[0])
            & y0.simd_le(self.max[1])
            & y1.simd_ge(self.min[1])
            & load(&node.farthest).simd_le(self.nearest + self.plane_tau);
        if meets.to_bitmask() & (meets.to_bitmask().wrapping_sub(1)) == 0 {
            return meets.to_bitmask() as u32;
        }
        for [a, b, c] in &self.edges {
            // The box's innermost corner.
            let most = (*a * x0).max(*a * x1) + ((*b * y0).max(*b * y1) + *c);
            meets &= !most.simd_lt(-self.tau);
        }
        meets.to_bitmask() as u32
    }

    /// The lanes of a block that are in shadow for sure, and those that may be.
    #[inline(always)]
    fn shadows(&self, simd: S, block: &Block) -> (u32, u32) {
        let x = f32x16::from_slice(simd, &block.x);
        let y = f32x16::from_slice(simd, &block.y);
        let q = f32x16::from_slice(simd, &block.nearness);
        let [a, b, c] = &self.edges;
        let least = (x.mul_add(a[0], y.mul_add(a[1], a[2])))
            .min(x.mul_add(b[0], y.mul_add(b[1], b[2])))
            .min(x.mul_add(c[0], y.mul_add(c[1], c[2])));
        let plane = x.mul_add(self.plane[0], y.mul_add(self.plane[1], self.plane[2])).min(self.nearest);
        let out = least.simd_lt(-self.tau) | q.simd_gt(plane + self.plane_tau);
        let sure = least.simd_gt(self.tau) & q.simd_lt(plane - self.plane_tau);
        (sure.to_bitmask() as u32, !out.to_bitmask() as u32 & 0xffff)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_interleaved() {
        assert_eq!(morton(0xffff, 0), 0x5555_5555);
        assert_eq!(morton(0, 0xffff), 0xaaaa_aaaa);
        assert_eq!(morton(0b101, 0b010), 0b011001);
    }
}
