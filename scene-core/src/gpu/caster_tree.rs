//! The casters' tree as shaders walk it: nodes in order of depth, each with where its subtree ends, so that a walk needs
//! no stack. Twin of `caster_tree.wesl`.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::Scene;
use crate::bvh::Bvh;
use crate::geometry::Aabb;

/// Triangles a leaf.
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
    /// The casters of `scene`, in the order of its CPU tree, which keeps close what is close, and halved again and again.
    pub fn new(scene: &Scene, tree: &Bvh) -> Self {
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
        let mut trees = Self::default();
        trees.add(scene, &solid);
        trees.solid = trees.nodes.len() as u32;
        trees.add(scene, &masked);
        trees
    }

    /// Adds a subtree of these; returns the box around it.
    fn add(&mut self, scene: &Scene, triangles: &[[u32; 2]]) -> Aabb {
        if triangles.is_empty() {
            return Aabb::EMPTY;
        }
        let own = self.nodes.len();
        self.nodes.push(CasterNode::zeroed());
        let bounds = if triangles.len() <= LEAF {
            self.nodes[own].first = self.leaves.len() as u32;
            self.nodes[own].count = triangles.len() as u32;
            self.leaves.extend(triangles);
            Aabb::from_points(triangles.iter().flat_map(|[triangle, _]| scene.corners(*triangle as usize)))
        } else {
            let (left, right) = triangles.split_at(triangles.len() / 2);
            let (left, right) = (self.add(scene, left), self.add(scene, right));
            Aabb { min: left.min.min(right.min), max: left.max.max(right.max) }
        };
        let skip = self.nodes.len() as u32;
        let node = &mut self.nodes[own];
        (node.low, node.high, node.skip) = (bounds.min, bounds.max, skip);
        bounds
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes;

    #[test]
    fn every_caster_lies_in_one_leaf_and_in_all_boxes_above() {
        let scene = scenes::build("fence", 0.0).unwrap().scene;
        let tree = Bvh::casters(&scene);
        let trees = CasterTrees::new(&scene, &tree);
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
    }
}
