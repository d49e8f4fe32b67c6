//! The tree that rays walk: eight children a node, up to eight triangles a leaf, both laid out for SIMD.
//!
//! `obvhs` builds a binary tree (parallel locally-ordered clustering with reinsertion). It is
//! collapsed here to eight children a node, so that one vector operation tests all of them, and every subtree
//! of at most eight triangles becomes one leaf, whose triangles are tested together too.
//!
//! Memory: a leaf block takes 320 bytes and is two thirds full on most meshes, a node 256 bytes for about
//! forty triangles: 60 to 80 bytes a triangle in all. Building takes about four times that for a moment.

use std::collections::VecDeque;
use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use rayon::prelude::*;

use crate::geometry::Aabb;

/// Children of a node and triangles of a leaf.
pub(super) const WIDTH: usize = 8;

/// Where a child leads: to an inner node, or to a leaf block and the count of its triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link(u32);

impl Link {
    /// Leads nowhere in particular: what unused slots hold.
    pub(super) const NONE: Self = Self(0);
    const LEAF: u32 = 1 << 31;
    const COUNT_SHIFT: u32 = 28;
    const INDEX: u32 = (1 << Self::COUNT_SHIFT) - 1;

    fn node(index: usize) -> Self {
        Self(index as u32)
    }

    fn leaf(block: usize, count: usize) -> Self {
        Self(Self::LEAF | (count as u32 - 1) << Self::COUNT_SHIFT | block as u32)
    }

    #[inline(always)]
    pub(super) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The index of the node or of the leaf block.
    #[inline(always)]
    pub(super) fn index(self) -> usize {
        if self.is_leaf() { (self.0 & Self::INDEX) as usize } else { self.0 as usize }
    }

    /// Triangles of a leaf, 1 to 8.
    #[inline(always)]
    pub(super) fn count(self) -> usize {
        (self.0 >> Self::COUNT_SHIFT & 7) as usize + 1
    }
}

/// An inner node: the boxes of its children by coordinate, and where they lead. Slots past `count` are unused.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    pub(super) lo: [[f32; WIDTH]; 3],
    pub(super) hi: [[f32; WIDTH]; 3],
    pub(super) links: [Link; WIDTH],
    pub(super) count: u32,
    /// Which children are leaves, as bits.
    pub(super) leaves: u32,
}

/// The corners of up to eight triangles: `corners[corner][axis][lane]`. Unused lanes are zero.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct Block {
    pub(super) corners: [[[f32; WIDTH]; 3]; 3],
}

impl Block {
    /// The corners of the triangle in one lane.
    #[inline(always)]
    pub(super) fn triangle(&self, lane: usize) -> [Vec3; 3] {
        self.corners.map(|axes| Vec3::new(axes[0][lane], axes[1][lane], axes[2][lane]))
    }
}

/// Nodes and leaves. `root` leads to the first node; it is `None` for a tree without triangles.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: Vec<Block>,
    /// The input's triangle in each lane of each block; unused lanes repeat the first.
    pub(super) triangles: Vec<[u32; WIDTH]>,
    pub(super) root: Option<Link>,
    pub(super) bounds: Aabb,
    /// Entries a depth-first walk may have to remember.
    pub(super) stack: usize,
    pub(super) triangle_count: usize,
}

impl Tree {
    /// A tree over the triangles `ids`, whose corners `corners` gives. At most 2³¹ of them.
    pub(super) fn build(ids: &[u32], corners: impl Fn(u32) -> [Vec3; 3] + Sync) -> Self {
        let bounds =
            ids.par_iter().map(|&id| Aabb::from_points(corners(id))).reduce(|| Aabb::EMPTY, Aabb::union);
        let mut tree = Self {
            nodes: Vec::new(),
            blocks: Vec::new(),
            triangles: Vec::new(),
            root: None,
            bounds,
            stack: 1,
            triangle_count: ids.len(),
        };
        if !ids.is_empty() {
            let binary = build_binary(ids, &corners, bounds);
            let Part { nodes, triangles, stack } = Collapse { binary: &binary, ids, corners: &corners }.run();
            (tree.nodes, tree.triangles, tree.stack) = (nodes, triangles, stack);
            tree.root = Some(Link::node(0));
            tree.blocks = tree
                .triangles
                .par_iter()
                .map(|lanes| {
                    let mut block = Block { corners: [[[0.0; WIDTH]; 3]; 3] };
                    for (lane, &id) in lanes.iter().enumerate() {
                        if lane > 0 && id == lanes[0] {
                            break;
                        }
                        for (corner, position) in corners(id).iter().enumerate() {
                            for axis in 0..3 {
                                block.corners[corner][axis][lane] = position[axis];
                            }
                        }
                    }
                    block
                })
                .collect();
        }
        tree
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.blocks[..]) + size_of_val(&self.triangles[..])
    }
}

/// The binary tree over boxes that are moved and scaled to the unit cube, so that neither tiny nor huge
/// coordinates leave the range of f32 when areas are compared. Only its shape is used.
///
/// The builder pairs each box with the neighbour it fits best; among many equal boxes every one picks the same
/// neighbour, one pair is formed a pass, and the time becomes quadratic. So each box is widened by a little of
/// its own: at most 1/512 of its size, or four ulps of the cube, which has no weight in the tree's quality.
fn build_binary(ids: &[u32], corners: &(impl Fn(u32) -> [Vec3; 3] + Sync), bounds: Aabb) -> Bvh2 {
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let size = (max - min).max_element();
    let scale = if size > 0.0 { 1.0 / size } else { 1.0 };
    let unit = |v: Vec3| ((v.as_dvec3() - min) * scale).as_vec3a();
    let boxes: Vec<_> = ids
        .par_iter()
        .map(|&id| {
            let [a, b, c] = corners(id).map(unit);
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let hash = u64::from(id).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let bits = |shift: u32| (hash >> shift & 0xff) as f32 / 256.0;
            let widen = ((high - low) * (1.0 / 512.0)).max(Vec3A::splat(4.0 * f32::EPSILON / 2.0));
            let low = low - widen * Vec3A::new(bits(16), bits(24), bits(32));
            let high = high + widen * Vec3A::new(bits(40), bits(48), bits(56));
            obvhs::aabb::Aabb::new(low, high)
        })
        .collect();
    // Leaves are formed below, from one triangle a leaf of the builder's. A medium build takes half as long again, and rays of
    // neither are told apart by their time.
    let mut params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::fast_build() };
    // Boxes that cover the whole a thousand times over cannot be parted by any tree, and looking for better
    // places among them takes time with the square of their number.
    let whole = obvhs::aabb::Aabb::new(unit(bounds.min), unit(bounds.max)).half_area();
    let covered: f64 = boxes.iter().map(|b| f64::from(b.half_area())).sum();
    if covered > 1000.0 * f64::from(whole) {
        params.reinsertion_batch_ratio = 0.0;
    }
    build_bvh2(&boxes, params, &mut Duration::default())
}

/// The binary tree on its way to a wide one.
struct Collapse<'a, C> {
    binary: &'a Bvh2,
    ids: &'a [u32],
    corners: &'a C,
}

/// Subtrees that are collapsed side by side, about; not a matter of threads, on which no tree depends.
const PARTS: usize = 64;

/// A wide tree whose first node is its root; a node comes after its parent.
#[derive(Default)]
struct Part {
    nodes: Vec<Node>,
    triangles: Vec<[u32; WIDTH]>,
    stack: usize,
}

/// A binary node that is to become a wide one.
#[derive(Clone, Copy)]
struct Pending {
    binary: usize,
    /// The wide node above it in its part, and its slot there.
    parent: Option<(usize, usize)>,
    depth: usize,
}

/// Up to eight triangles; unused lanes repeat the first.
struct Leaf {
    lanes: [u32; WIDTH],
    count: usize,
}

impl Part {
    /// Takes over another, whose root goes to a slot of a node of this one.
    fn append(&mut self, parent: Option<(usize, usize)>, other: Self) {
        let (nodes, blocks) = (self.nodes.len(), self.triangles.len());
        if let Some((node, slot)) = parent {
            self.nodes[node].links[slot] = Link::node(nodes);
        }
        self.nodes.extend(other.nodes.into_iter().map(|mut node| {
            for link in &mut node.links[..node.count as usize] {
                *link = match link.is_leaf() {
                    true => Link::leaf(link.index() + blocks, link.count()),
                    false => Link::node(link.index() + nodes),
                };
            }
            node
        }));
        self.triangles.extend(other.triangles);
        self.stack = self.stack.max(other.stack);
    }

    /// Takes the boxes of inner nodes from those of their children, of which those of leaves are known.
    fn bound(&mut self) {
        for index in (0..self.nodes.len()).rev() {
            let (before, from) = self.nodes.split_at_mut(index + 1);
            let node = &mut before[index];
            for slot in (0..node.count as usize).filter(|slot| node.leaves >> slot & 1 == 0) {
                let child = &from[node.links[slot].index() - index - 1];
                for axis in 0..3 {
                    node.lo[axis][slot] = child.lo[axis].into_iter().fold(f32::INFINITY, f32::min);
                    node.hi[axis][slot] = child.hi[axis].into_iter().fold(f32::NEG_INFINITY, f32::max);
                }
            }
        }
    }
}

impl<C: Fn(u32) -> [Vec3; 3] + Sync> Collapse<'_, C> {
    fn run(&self) -> Part {
        let mut tree = Part::default();
        let mut pending = VecDeque::from([Pending { binary: 0, parent: None, depth: 1 }]);
        while pending.len() < PARTS
            && let Some(next) = pending.pop_front()
        {
            self.open(&next, &mut tree, |inner| pending.push_back(inner));
        }
        let parts: Vec<_> = pending.into_par_iter().map(|root| (root.parent, self.part(root))).collect();
        for (parent, part) in parts {
            tree.append(parent, part);
        }
        tree.bound();
        tree
    }

    /// All below one node.
    fn part(&self, root: Pending) -> Part {
        let mut part = Part::default();
        let mut pending = vec![Pending { parent: None, ..root }];
        while let Some(next) = pending.pop() {
            self.open(&next, &mut part, |inner| pending.push(inner));
        }
        part
    }

    /// Makes a wide node, its leaves included; `inner` is told of its other children.
    fn open(&self, from: &Pending, part: &mut Part, mut inner: impl FnMut(Pending)) {
        let (index, depth) = (part.nodes.len(), from.depth);
        if let Some((parent, slot)) = from.parent {
            part.nodes[parent].links[slot] = Link::node(index);
        }
        // Each level leaves at most seven siblings behind; one entry more is written before it is known
        // whether it counts.
        part.stack = part.stack.max(depth * (WIDTH - 1) + 2);
        let mut node = Node {
            lo: [[f32::INFINITY; WIDTH]; 3],
            hi: [[f32::NEG_INFINITY; WIDTH]; 3],
            links: [Link::NONE; WIDTH],
            count: 0,
            leaves: 0,
        };
        for (slot, (child, leaf)) in self.children_of(from.binary).into_iter().enumerate() {
            node.count += 1;
            let Some(Leaf { lanes, count }) = leaf else {
                inner(Pending { binary: child, parent: Some((index, slot)), depth: depth + 1 });
                continue;
            };
            let corners = lanes[..count].iter().flat_map(|&id| (self.corners)(id));
            let bounds = Aabb::from_points(corners);
            for axis in 0..3 {
                node.lo[axis][slot] = bounds.min[axis];
                node.hi[axis][slot] = bounds.max[axis];
            }
            node.links[slot] = Link::leaf(part.triangles.len(), count);
            node.leaves |= 1 << slot;
            part.triangles.push(lanes);
        }
        part.nodes.push(node);
    }

    /// Up to eight descendants of a binary node that together hold all its triangles, got by opening the
    /// largest again and again; each with the leaf that it becomes, if one holds it.
    fn children_of(&self, node: usize) -> Vec<(usize, Option<Leaf>)> {
        let with_leaf = |node: usize| (node, self.leaf(node));
        let mut children = Vec::with_capacity(WIDTH);
        children.push(with_leaf(node));
        while children.len() < WIDTH {
            let inner = (0..children.len()).filter(|&child| children[child].1.is_none());
            let area = |&child: &usize| self.binary.nodes[children[child].0].aabb().half_area();
            let Some(largest) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
            let first = self.binary.nodes[children[largest].0].first_index as usize;
            children[largest] = with_leaf(first);
            children.push(with_leaf(first + 1));
        }
        children
    }

    /// All triangles below a binary node; `None` if they are more than a leaf holds.
    fn leaf(&self, node: usize) -> Option<Leaf> {
        let (mut lanes, mut count) = ([0; WIDTH], 0);
        let (mut pending, mut waiting) = ([node; WIDTH + 1], 1);
        while waiting > 0 {
            waiting -= 1;
            let node = &self.binary.nodes[pending[waiting]];
            let first = node.first_index as usize;
            if node.is_leaf() {
                debug_assert_eq!(node.prim_count, 1, "asked of the builder");
                lanes[count] = self.ids[self.binary.primitive_indices[first] as usize];
                count += 1;
            } else {
                pending[waiting..waiting + 2].copy_from_slice(&[first + 1, first]);
                waiting += 2;
            }
            // There is one in each that waits.
            if count + waiting > WIDTH {
                return None;
            }
        }
        let first = lanes[0];
        lanes[count..].fill(first);
        Some(Leaf { lanes, count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(count: u32) -> impl Fn(u32) -> [Vec3; 3] + Sync {
        move |id| {
            let p = Vec3::new((id % 37) as f32, (id / 37 % 41) as f32, (id / 1517) as f32);
            assert!(id < count);
            [p, p + Vec3::X * 0.5, p + Vec3::Y * 0.5]
        }
    }

    /// Every triangle is found in one leaf, inside all boxes on the way.
    fn check(tree: &Tree, ids: &[u32], corners: impl Fn(u32) -> [Vec3; 3]) {
        let mut seen = Vec::new();
        let mut pending: Vec<_> = tree.root.map(|root| (root, tree.bounds, 1)).into_iter().collect();
        let mut widest = 0;
        while let Some((link, bounds, _)) = pending.pop() {
            if link.is_leaf() {
                for lane in 0..link.count() {
                    let id = tree.triangles[link.index()][lane];
                    assert_eq!(tree.blocks[link.index()].triangle(lane), corners(id));
                    assert_eq!(bounds.union(Aabb::from_points(corners(id))), bounds);
                    seen.push(id);
                }
            } else {
                let node = &tree.nodes[link.index()];
                for slot in 0..node.count as usize {
                    let min = Vec3::from_array(node.lo.map(|axis| axis[slot]));
                    let max = Vec3::from_array(node.hi.map(|axis| axis[slot]));
                    assert_eq!(bounds.union(Aabb { min, max }), bounds);
                    pending.push((node.links[slot], Aabb { min, max }, 0));
                }
                widest = widest.max(pending.len());
            }
        }
        assert!(widest <= tree.stack);
        seen.sort_unstable();
        assert_eq!(seen, ids);
    }

    #[test]
    fn every_triangle_is_in_one_leaf_inside_its_boxes() {
        for count in [1, 2, 8, 9, 100, 5000] {
            let ids: Vec<u32> = (0..count).collect();
            let tree = Tree::build(&ids, grid(count));
            assert_eq!(tree.triangle_count, count as usize);
            check(&tree, &ids, grid(count));
        }
    }

    #[test]
    fn an_empty_tree_has_no_root() {
        let tree = Tree::build(&[], grid(0));
        assert!(tree.root.is_none() && tree.bytes() == 0 && tree.bounds.is_empty());
    }

    #[test]
    fn identical_and_huge_triangles_give_a_valid_tree() {
        let ids: Vec<u32> = (0..100_000).collect();
        let same = |_| [Vec3::ZERO, Vec3::X, Vec3::Y];
        check(&Tree::build(&ids, same), &ids, same);
        let huge = |id| [Vec3::splat(f32::MAX), Vec3::splat(f32::MIN), Vec3::X * id as f32];
        check(&Tree::build(&ids[..1000], huge), &ids[..1000], huge);
    }
}
