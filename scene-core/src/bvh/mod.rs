//! Ray tracing: closest hits, and packets of shadow rays inside shafts.
//!
//! `obvhs` builds the tree; walking it is our own, because shadow rays come in bundles: all samples of a light
//! seen from one point. A bundle walks the tree once, as a shaft; a vector operation tests eight boxes or eight
//! triangles against the shaft, and as many rays as a vector has lanes against a triangle.
//!
//! # What is exact
//! Whether a ray is blocked is decided without tolerance, after one rounding of each coordinate relative to the
//! ray's origin (see `exact.rs`). f32 filters with a derived error bound answer all but about one in a million
//! tests. So there is no leak along shared edges or through vertices, from either side, and the answer is the
//! same, bit for bit, for a ray alone, in any packet, on any processor and with any number of threads.
//!
//! # Limits
//! Triangles are double-sided. A triangle seen exactly edge-on, or whose corners lie on a line, blocks nothing.
//! Coordinates of any size work; where those relative to a ray's origin exceed 2³⁸ a slow path is taken, and
//! what exceeds the range of f32 blocks nothing.

mod blocks;
mod cover;
mod exact;
mod filter;
mod offset;
mod query;
mod region;
mod shaft;
mod tree;
mod walk;

use std::sync::Arc;

use fearless_simd::Level;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::geometry::{Aabb, AlphaMask, Scene};

use exact::Crossing;
use tree::{Link, Tree, WIDTH};
use walk::Cutout;

pub use blocks::{blocks, blocks_cut_out};
pub use cover::{Cover, LastCover, OUTLINE};
pub(crate) use offset::LIFT;
pub use offset::shadow_origin;
pub use region::HalfSpace;

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The ray's parameter, in units of its direction's length.
    pub t: f32,
    /// The triangle, as an index into [`Scene::triangles`].
    pub triangle: u32,
    /// The weight of the triangle's second corner.
    pub u: f32,
    /// The weight of the triangle's third corner; that of the first is 1 − u − v.
    pub v: f32,
}

/// A triangle with a cut-out mask.
#[derive(Clone, Debug)]
struct Masked {
    uvs: [Vec2; 3],
    mask: Arc<AlphaMask>,
}

/// The masked triangles of a tree.
#[derive(Clone, Debug)]
struct Masks {
    /// Per leaf block: which lanes are masked, and where its first one is in `triangles`.
    blocks: Vec<(u32, u32)>,
    triangles: Vec<Masked>,
}

impl Cutout for &Masks {
    #[inline(always)]
    fn lanes(self, block: usize) -> u32 {
        self.blocks[block].0
    }

    fn is_solid(self, block: usize, lane: usize, crossing: &Crossing) -> bool {
        let (lanes, first) = self.blocks[block];
        let before = (lanes & ((1 << lane) - 1)).count_ones();
        let masked = &self.triangles[(first + before) as usize];
        blocks::is_solid(&masked.mask, masked.uvs, crossing)
    }
}

/// Triangles of a scene, ready to be asked what a ray meets. Holds copies of all it needs.
///
/// Every query takes `&self` and may run on any number of threads. Results do not depend on the order of
/// queries or on how rays are grouped.
#[derive(Clone, Debug)]
pub struct Bvh {
    tree: Tree,
    masks: Option<Masks>,
    level: Level,
}

impl Bvh {
    /// A tree over what throws shadows: the triangles of objects with
    /// [`casts`](crate::geometry::ObjectFlags::casts).
    pub fn casters(scene: &Scene) -> Self {
        let casters = scene.objects().iter().filter(|object| object.flags.casts);
        Self::of_triangles(scene, casters.flat_map(|object| object.triangles.clone()))
    }

    /// A tree over all triangles: what a camera sees.
    pub fn all(scene: &Scene) -> Self {
        Self::of_triangles(scene, 0..scene.triangles().len())
    }

    /// A tree over these of [`Scene::triangles`], each given once.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn of_triangles(scene: &Scene, triangles: impl IntoIterator<Item = usize>) -> Self {
        let ids: Vec<u32> = triangles.into_iter().map(|triangle| triangle as u32).collect();
        let has_area = |&triangle: &u32| !exact::is_degenerate(scene.corners(triangle as usize));
        let ids: Vec<u32> = ids.into_par_iter().filter(has_area).collect();
        let tree = Tree::build(&ids, |id| scene.corners(id as usize));
        let masks = scene.has_alpha().then(|| Masks::new(scene, &tree));
        Self { tree, masks, level: Level::new() }
    }

    /// Triangles in the tree. Those whose corners lie on a line are left out.
    pub fn triangle_count(&self) -> usize {
        self.tree.triangle_count
    }

    /// The box around all triangles; [`Aabb::EMPTY`] for none.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let masks = self.masks.as_ref();
        let masks = masks.map_or(0, |m| size_of_val(&m.blocks[..]) + size_of_val(&m.triangles[..]));
        self.tree.bytes() + masks
    }

    /// Walks the boxes of the tree from the root down: `enter` says of each whether to look inside, `triangle`
    /// is given every triangle (as an index into [`Scene::triangles`]) of the leaves entered.
    pub fn visit(&self, mut enter: impl FnMut(Aabb) -> bool, mut triangle: impl FnMut(u32)) {
        let mut pending: Vec<_> = self.tree.root.map(|root| (root, self.tree.bounds)).into_iter().collect();
        while let Some((link, bounds)) = pending.pop() {
            if !enter(bounds) {
                continue;
            }
            if link.is_leaf() {
                self.tree.triangles[link.index()][..link.count()].iter().for_each(|&id| triangle(id));
            } else {
                let node = &self.tree.nodes[link.index()];
                for slot in (0..node.count as usize).rev() {
                    let corner = |axes: &[[f32; WIDTH]; 3]| Vec3::from_array(axes.map(|axis| axis[slot]));
                    pending.push((node.links[slot], Aabb { min: corner(&node.lo), max: corner(&node.hi) }));
                }
            }
        }
    }
}

impl Masks {
    fn new(scene: &Scene, tree: &Tree) -> Self {
        let mut masks = Self { blocks: vec![(0, 0); tree.blocks.len()], triangles: Vec::new() };
        let mut leaf = |link: Link| {
            let mut lanes = 0;
            let first = masks.triangles.len() as u32;
            for lane in 0..link.count() {
                let triangle = tree.triangles[link.index()][lane] as usize;
                let object = &scene.objects()[scene.object_of(triangle) as usize];
                if let Some(mask) = &object.alpha {
                    let uvs = scene.triangles()[triangle].map(|vertex| scene.uvs()[vertex as usize]);
                    masks.triangles.push(Masked { uvs, mask: mask.clone() });
                    lanes |= 1 << lane;
                }
            }
            masks.blocks[link.index()] = (lanes, first);
        };
        for node in &tree.nodes {
            node.links[..node.count as usize]
                .iter()
                .filter(|link| link.is_leaf())
                .for_each(|&link| leaf(link));
        }
        masks
    }
}
