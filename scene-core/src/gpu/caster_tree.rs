//! The casters' tree as shaders walk it: nodes in order of depth, each with where its subtree ends, so that a walk needs
//! no stack. Twin of `caster_tree.wesl`.

use std::cmp::Ordering;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::Scene;
use crate::bvh::Bvh;
use crate::geometry::Aabb;

/// Triangles a leaf, at most, where all nodes are bound in one piece.
const LEAF: usize = 4;

/// `Node` of `caster_tree.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct CasterNode {
    /// Lower corner of its box.
    pub low: Vec3,
    /// The node after its subtree.
    pub skip: u32,
    /// Upper corner.
    pub high: Vec3,
    /// Where its triangles start.
    pub first: u32,
    /// How many there are: none but in leaves.
    pub count: u32,
    /// Zero.
    pub padding: [u32; 3],
}

/// A tree of the solid casters and, after it, one of those with masks.
#[derive(Clone, Debug, Default)]
pub struct CasterTrees {
    /// Nodes of both.
    pub nodes: Vec<CasterNode>,
    /// How many are of the solid ones.
    pub solid: u32,
    /// Triangles and their objects.
    pub leaves: Vec<[u32; 2]>,
}

impl CasterTrees {
    /// The casters of `scene`, in the order of its CPU tree, which keeps close what is close, and halved again and again: down to
    /// four triangles, or to so many that the nodes take no more than `limit` bytes, what a device
    /// [binds in one piece](super::binding_limit). What a walk answers is the same.
    pub fn new(scene: &Scene, tree: &Bvh, limit: u64) -> Self {
        let (mut solid, mut masked) = (Vec::new(), Vec::new());
        tree.visit(
            |_| true,
            |triangle| {
                let object = scene.object_of(triangle as usize);
                let list =
                    if scene.objects()[object as usize].alpha.is_some() { &mut masked } else { &mut solid };
                list.push([triangle, object]);
            },
        );
        let leaf = leaf_within([solid.len(), masked.len()], limit);
        let mut trees = Self::default();
        trees.add(scene, &solid, leaf);
        trees.solid = trees.nodes.len() as u32;
        trees.add(scene, &masked, leaf);
        trees
    }

    /// Adds a subtree of these; returns the box around it.
    fn add(&mut self, scene: &Scene, triangles: &[[u32; 2]], leaf: usize) -> Aabb {
        if triangles.is_empty() {
            return Aabb::EMPTY;
        }
        let own = self.nodes.len();
        self.nodes.push(CasterNode::zeroed());
        let bounds = if triangles.len() <= leaf {
            self.nodes[own].first = self.leaves.len() as u32;
            self.nodes[own].count = triangles.len() as u32;
            self.leaves.extend(triangles);
            Aabb::from_points(triangles.iter().flat_map(|[triangle, _]| scene.corners(*triangle as usize)))
        } else {
            let (left, right) = triangles.split_at(triangles.len() / 2);
            let (left, right) = (self.add(scene, left, leaf), self.add(scene, right, leaf));
            Aabb { min: left.min.min(right.min), max: left.max.max(right.max) }
        };
        let skip = self.nodes.len() as u32;
        let node = &mut self.nodes[own];
        (node.low, node.high, node.skip) = (bounds.min, bounds.max, skip);
        bounds
    }
}

/// Triangles a leaf, at most, with which the nodes of two trees of so many triangles fit in `limit` bytes.
fn leaf_within(triangles: [usize; 2], limit: u64) -> usize {
    let bytes = |leaf| triangles.map(|n| node_count(n, leaf) * size_of::<CasterNode>() as u64);
    let mut leaf = LEAF;
    while bytes(leaf).iter().sum::<u64>() > limit && leaf < triangles[0].max(triangles[1]) {
        leaf *= 2;
    }
    leaf
}

/// Nodes of a tree of so many triangles that are halved down to `leaf`.
fn node_count(triangles: usize, leaf: usize) -> u64 {
    let mut inner = 0;
    // Of the 2^level parts of a level some have one triangle more than the others.
    for level in 0..usize::BITS {
        let (least, larger) = (triangles >> level, triangles & ((1 << level) - 1));
        match least.cmp(&leaf) {
            Ordering::Greater => inner += 1_u64 << level,
            Ordering::Equal => inner += larger as u64,
            Ordering::Less => break,
        }
    }
    if triangles == 0 { 0 } else { 2 * inner + 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes;

    #[test]
    fn every_caster_lies_in_one_leaf_and_in_all_boxes_above() {
        holds_every_caster(u64::MAX, 4);
    }

    #[test]
    fn leaves_are_larger_where_nodes_would_not_fit() {
        let bytes = holds_every_caster(u64::MAX, 4);
        assert!(holds_every_caster(bytes, 4) == bytes);
        let fewer = holds_every_caster(bytes - 1, 8);
        assert!(fewer < bytes && holds_every_caster(fewer - 1, 16) < fewer);
        // Nothing is as small as that.
        holds_every_caster(1, usize::MAX);
        // Ten million triangles on a device of WebGPU's default limits.
        assert_eq!(leaf_within([10_000_000, 0], 128 << 20), 16);
    }

    #[test]
    fn nodes_are_counted_before_they_are_made() {
        fn count(triangles: usize, leaf: usize) -> u64 {
            let half = triangles / 2;
            if triangles <= leaf { 1 } else { 1 + count(half, leaf) + count(triangles - half, leaf) }
        }
        assert_eq!(node_count(0, 4), 0);
        for leaf in [4, 8] {
            for triangles in 1..300 {
                assert_eq!(node_count(triangles, leaf), count(triangles, leaf), "{triangles}, {leaf} a leaf");
            }
        }
    }

    /// Checks the trees of fence made for `limit` bytes of nodes; gives their bytes.
    fn holds_every_caster(limit: u64, leaf: usize) -> u64 {
        let scene = scenes::build("fence", 0.0).unwrap().scene;
        let tree = Bvh::casters(&scene);
        let trees = CasterTrees::new(&scene, &tree, limit);
        assert!(trees.nodes.iter().all(|node| node.count as usize <= leaf));
        assert_eq!(trees.leaves.len(), tree.triangle_count());
        let mut found: Vec<u32> = trees.leaves.iter().map(|[triangle, _]| *triangle).collect();
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), trees.leaves.len());
        for (index, node) in trees.nodes.iter().enumerate() {
            assert!(node.skip as usize > index && node.skip as usize <= trees.nodes.len());
            assert_eq!(node.count > 0, node.skip as usize == index + 1, "leaves have no subtree");
            for below in &trees.nodes[index..node.skip as usize] {
                assert!(below.low.cmpge(node.low).all() && below.high.cmple(node.high).all());
                for [triangle, object] in &trees.leaves[below.first as usize..][..below.count as usize] {
                    let inside = |c: Vec3| c.cmpge(node.low).all() && c.cmple(node.high).all();
                    assert!(scene.corners(*triangle as usize).into_iter().all(inside));
                    let is_masked = scene.objects()[*object as usize].alpha.is_some();
                    assert_eq!(is_masked, index >= trees.solid as usize);
                }
            }
        }
        size_of_val(&trees.nodes[..]) as u64
    }
}
