//! Which triangles reach into a convex region, and whether any does.

use std::ops::ControlFlow;

use glam::DVec3;

use super::tree::{Link, WIDTH};
use super::{Bvh, Tree};

/// The points x with `normal · x ≤ offset`, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Away from the half-space; any length.
    pub normal: DVec3,
    /// The largest product with a point inside.
    pub offset: f64,
}

impl HalfSpace {
    fn misses_boxes(&self, lo: &[[f32; WIDTH]; 3], hi: &[[f32; WIDTH]; 3]) -> [bool; WIDTH] {
        // The corner that lies farthest inside.
        let corner = |axis: usize| if self.normal[axis] > 0.0 { &lo[axis] } else { &hi[axis] };
        let [x, y, z] = [0, 1, 2].map(corner);
        std::array::from_fn(|lane| {
            let height = self.normal.x * f64::from(x[lane])
                + self.normal.y * f64::from(y[lane])
                + self.normal.z * f64::from(z[lane]);
            height > self.offset
        })
    }
}

/// Entries of a walk that are kept on the stack. A tree of a million triangles uses about 60; a deeper one takes memory.
const STACK: usize = 256;

impl Bvh {
    /// Calls `visit` with the triangles (as indices into [`Scene::triangles`](crate::Scene::triangles)) that may reach
    /// into the region that the half-spaces have in common: all but those that lie wholly outside one of them, as in
    /// [`Bvh::misses`], each once. Breaks if `visit` does.
    pub fn visit_region(
        &self,
        region: &[HalfSpace],
        mut visit: impl FnMut(u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let Tree { root, nodes, blocks, triangles, stack, .. } = &self.tree;
        let Some(root) = *root else { return ControlFlow::Continue(()) };
        let (mut shallow, mut deep) = ([Link::NONE; STACK], Vec::new());
        let links = if *stack > STACK {
            deep.resize(*stack, Link::NONE);
            &mut deep[..]
        } else {
            &mut shallow[..]
        };
        links[0] = root;
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let link = links[height];
            let mut missed = [false; WIDTH];
            if link.is_leaf() {
                let [a, b, c] = &blocks[link.index()].corners;
                for side in region {
                    let (a, b, c) =
                        (side.misses_boxes(a, a), side.misses_boxes(b, b), side.misses_boxes(c, c));
                    missed = std::array::from_fn(|lane| missed[lane] | (a[lane] & b[lane] & c[lane]));
                }
                for (&triangle, missed) in triangles[link.index()].iter().zip(missed).take(link.count()) {
                    if !missed {
                        visit(triangle)?;
                    }
                }
                continue;
            }
            let node = &nodes[link.index()];
            for side in region {
                let outside = side.misses_boxes(&node.lo, &node.hi);
                missed = std::array::from_fn(|lane| missed[lane] | outside[lane]);
            }
            for (&link, missed) in node.links.iter().zip(missed).take(node.count as usize) {
                if !missed {
                    links[height] = link;
                    height += 1;
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// Whether every triangle lies wholly outside one of the half-spaces, so that none reaches into the region that
    /// they have in common. Errs to `false`: a triangle may miss the region and yet not lie outside a single one.
    /// Products are rounded in f64; a half-space that is not finite tells nothing.
    pub fn misses(&self, region: &[HalfSpace]) -> bool {
        self.visit_region(region, |_| ControlFlow::Break(())).is_continue()
    }
}
