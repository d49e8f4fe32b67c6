//! Which triangles reach into a convex region, and whether any does.
//!
//! # Rounding
//!
//! Triangles are held against half-spaces in f64, boxes on the way to them in f32, eight at once. Its normal is scaled so that its coordinates
//! add up to 1 and is rounded (u = 2⁻²⁴ each), products are rounded (u), and so are two sums (2 u): with M the largest
//! coordinate of the tree a height is off by less than 4 u M + O(u²). The offset is rounded (u of itself) and raised by 6 u M,
//! so what is found outside is outside. Where M reaches 2¹²⁰ sums could overflow, and nothing is found outside.

use std::ops::ControlFlow;

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, dispatch, f32x8};
use glam::DVec3;

use super::tree::{Block, Link, Node, WIDTH};
use super::{Bvh, Tree};

/// The points x with `normal · x ≤ offset`, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Away from the half-space; any length.
    pub normal: DVec3,
    /// The largest product with a point inside.
    pub offset: f64,
}

/// Half-spaces that boxes are held against; a region may have more, which only triangles are.
const SIDES: usize = 32;

/// Entries of a walk that are kept on the stack. A tree of a million triangles uses about 60; a deeper one takes memory.
const STACK: usize = 256;

/// Largest coordinates of trees that f32 serves: see the module.
const MAX_COORDINATE: f32 = (1_u128 << 120) as f32;

/// 6 u: see the module.
const ERROR: f64 = 6.0 / (1_u32 << 24) as f64;

/// A half-space made ready: normal scaled and rounded, offset raised.
#[derive(Clone, Copy)]
struct Side {
    normal: [f32; 3],
    offset: f32,
}

/// The sides of a region that tell anything.
struct Region {
    sides: [Side; SIDES],
    count: usize,
}

impl Region {
    fn new(region: &[HalfSpace], magnitude: f32) -> Self {
        let mut sides = Self { sides: [Side { normal: [0.0; 3], offset: f32::INFINITY }; SIDES], count: 0 };
        if magnitude >= MAX_COORDINATE {
            return sides;
        }
        for side in region.iter().take(SIDES) {
            let length = side.normal.abs().element_sum();
            let normal = (side.normal / length).as_vec3();
            let offset = side.offset / length + ERROR * f64::from(magnitude);
            // The smallest f32 that is no less; what is not finite tells nothing.
            if normal.is_finite() && offset.is_finite() {
                sides.sides[sides.count] =
                    Side { normal: normal.to_array(), offset: (offset as f32).next_up() };
                sides.count += 1;
            }
        }
        sides
    }
}

/// Which of eight boxes, given by their corners that lie farthest inside, lie wholly outside a side.
#[inline(always)]
fn above<S: Simd>(simd: S, side: &Side, lo: &[[f32; WIDTH]; 3], hi: &[[f32; WIDTH]; 3]) -> u32 {
    let [x, y, z] = side.normal;
    let pick = |axis: usize| if side.normal[axis] > 0.0 { &lo[axis] } else { &hi[axis] };
    let height = f32x8::load_array_ref(simd, pick(0)) * x;
    let height = f32x8::load_array_ref(simd, pick(1)).mul_add(f32x8::splat(simd, y), height);
    let height = f32x8::load_array_ref(simd, pick(2)).mul_add(f32x8::splat(simd, z), height);
    height.simd_gt(side.offset).to_bitmask() as u32
}

/// The children of a node that may reach into the region, as bits.
#[inline(always)]
fn children<S: Simd>(simd: S, node: &Node, region: &Region) -> u32 {
    let mut left = (1 << node.count) - 1;
    for side in &region.sides[..region.count] {
        left &= !above(simd, side, &node.lo, &node.hi);
        if left == 0 {
            break;
        }
    }
    left
}

/// The triangles of a leaf that may, in f64: what lies on the very plane that a receiver is lifted off is told from it.
#[inline(always)]
fn triangles_of(block: &Block, count: usize, region: &[HalfSpace]) -> u32 {
    let [a, b, c] = &block.corners;
    let mut left = (1_u32 << count) - 1;
    for side in region {
        let [x, y, z] = side.normal.to_array();
        let mut least = [0.0_f64; WIDTH];
        for lane in 0..WIDTH {
            let of_a = x * f64::from(a[0][lane]) + y * f64::from(a[1][lane]) + z * f64::from(a[2][lane]);
            let of_b = x * f64::from(b[0][lane]) + y * f64::from(b[1][lane]) + z * f64::from(b[2][lane]);
            let of_c = x * f64::from(c[0][lane]) + y * f64::from(c[1][lane]) + z * f64::from(c[2][lane]);
            least[lane] = if of_a < of_b { of_a } else { of_b };
            least[lane] = if of_c < least[lane] { of_c } else { least[lane] };
        }
        for (lane, least) in least.into_iter().enumerate() {
            left &= !(u32::from(least > side.offset) << lane);
        }
        if left == 0 {
            break;
        }
    }
    left
}

#[inline(always)]
fn walk<S: Simd>(
    simd: S,
    tree: &Tree,
    root: Link,
    links: &mut [Link],
    (boxes, region): (&Region, &[HalfSpace]),
    visit: &mut impl FnMut(u32) -> ControlFlow<()>,
) -> ControlFlow<()> {
    links[0] = root;
    let mut height = 1;
    while height > 0 {
        height -= 1;
        let link = links[height];
        if link.is_leaf() {
            let ids = &tree.triangles[link.index()];
            let mut left = triangles_of(&tree.blocks[link.index()], link.count(), region);
            while left != 0 {
                visit(ids[left.trailing_zeros() as usize & (WIDTH - 1)])?;
                left &= left - 1;
            }
            continue;
        }
        let node = &tree.nodes[link.index()];
        let mut left = children(simd, node, boxes);
        while left != 0 {
            links[height] = node.links[left.trailing_zeros() as usize & (WIDTH - 1)];
            height += 1;
            left &= left - 1;
        }
    }
    ControlFlow::Continue(())
}

impl Bvh {
    /// Calls `visit` with the triangles (as indices into [`Scene::triangles`](crate::Scene::triangles)) that may reach
    /// into the region that the half-spaces have in common, each once: all but those that lie wholly outside one of them.
    /// Breaks if `visit` does.
    ///
    /// Errs to a visit: a triangle may miss the region and yet not lie outside a single half-space. Products are rounded in
    /// f64; a half-space that is not finite tells nothing.
    pub fn visit_region(
        &self,
        region: &[HalfSpace],
        mut visit: impl FnMut(u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let Some(root) = self.tree.root else { return ControlFlow::Continue(()) };
        let (mut shallow, mut deep) = ([Link::NONE; STACK], Vec::new());
        let links = if self.tree.stack > STACK {
            deep.resize(self.tree.stack, Link::NONE);
            &mut deep[..]
        } else {
            &mut shallow[..]
        };
        let boxes = Region::new(region, self.tree.bounds.magnitude());
        dispatch!(self.level, simd => walk(simd, &self.tree, root, links, (&boxes, region), &mut visit))
    }

    /// Whether every triangle is found wholly outside one of the half-spaces, so that none reaches into the region that
    /// they have in common. Errs to `false`, as [`Bvh::visit_region`] errs to a visit.
    pub fn misses(&self, region: &[HalfSpace]) -> bool {
        self.visit_region(region, |_| ControlFlow::Break(())).is_continue()
    }
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, Vec3};

    use super::*;
    use crate::geometry::{ObjectFlags, Scene, TriangleMesh};

    fn point(i: u32) -> Vec3 {
        let at = |step: f64| ((f64::from(i) * step).fract() * 2.0 - 1.0) as f32;
        Vec3::new(at(0.819_172_513), at(0.671_043_607), at(0.549_700_478))
    }

    /// Nothing that f64 does not find outside is left out, and what is clearly outside is.
    #[test]
    fn what_reaches_in_is_visited_and_what_is_far_out_is_not() {
        let positions: Vec<_> = (0..3000).map(|i| point(i / 3 * 7) + point(i * i) * 0.05).collect();
        let triangles = (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        for offset in [Vec3::ZERO, Vec3::splat(1000.0)] {
            let mut scene = Scene::new();
            let moved = positions.iter().map(|&p| p + offset).collect();
            let mesh = TriangleMesh::new("soup", moved, Vec::clone(&triangles));
            scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
            let bvh = Bvh::all(&scene);
            assert_eq!(bvh.triangle_count(), 1000, "no corners on a line");
            let mut kept = 0;
            for i in 0..200 {
                let region: Vec<_> = (0..1 + i % 5)
                    .map(|side| {
                        let normal = point(900 + 7 * i + side).as_dvec3() * f64::from(i + 1);
                        HalfSpace { normal, offset: normal.dot((offset + 0.3 * point(i)).as_dvec3()) }
                    })
                    .collect();
                let mut found = vec![false; 1000];
                let _ = bvh.visit_region(&region, |id| {
                    assert!(!std::mem::replace(&mut found[id as usize], true), "each once");
                    ControlFlow::Continue(())
                });
                let slack = 8.0 * f64::EPSILON * f64::from(scene.bounds().magnitude());
                for (id, found) in found.into_iter().enumerate() {
                    let outside = |slack: f64| {
                        region.iter().any(|side| {
                            let least = scene.corners(id).map(|c| side.normal.dot(c.as_dvec3()));
                            least.into_iter().fold(f64::INFINITY, f64::min)
                                > side.offset + slack * side.normal.abs().element_sum()
                        })
                    };
                    assert!(found || outside(-slack), "{i} {id}");
                    assert!(!(found && outside(slack)), "{i} {id}");
                    kept += usize::from(found);
                }
            }
            assert!((20_000..180_000).contains(&kept), "{kept}");
        }
    }

    #[test]
    fn broken_half_spaces_tell_nothing() {
        let mut scene = Scene::new();
        let mesh = TriangleMesh::new("", vec![Vec3::X, Vec3::Y, Vec3::Z], vec![[0, 1, 2]]);
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        let bvh = Bvh::all(&scene);
        let outside = HalfSpace { normal: DVec3::X, offset: -1.0 };
        assert!(bvh.misses(&[outside]) && !bvh.misses(&[]));
        for (normal, offset) in [(DVec3::NAN, -1.0), (DVec3::X, f64::NAN), (DVec3::INFINITY, -1.0)] {
            let broken = HalfSpace { normal, offset };
            assert!(!bvh.misses(&[broken]) && bvh.misses(&[broken, outside]));
        }
    }
}
