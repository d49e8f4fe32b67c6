//! Walking the tree with a shaft: which rays are blocked, and what a single ray meets first.

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask};
use glam::Vec3;

use super::exact::{self, Crossing};
use super::filter::{Candidates, ERROR, TINY, cull};
use super::shaft::{Rays, Shaft, ShaftLanes};
use super::tree::{Block, Node, Tree};

/// Entries of the stack that need no allocation. A tree of a million triangles uses about 60.
const INLINE_STACK: usize = 128;

/// What a cut-out mask makes of a hit: given leaf block, lane and weights, whether the surface is solid there.
pub(super) trait Cutout: Copy {
    /// The lanes of a block whose triangles have a mask.
    fn lanes(self, block: usize) -> u32;
    /// Whether the surface exists at a point of such a triangle.
    fn is_solid(self, block: usize, lane: usize, crossing: &Crossing) -> bool;
}

/// Runs `walk` with a stack that the tree cannot overflow.
#[inline(always)]
fn with_stack<T: Copy, R>(tree: &Tree, empty: T, walk: impl FnOnce(&mut [T]) -> R) -> R {
    if tree.stack <= INLINE_STACK {
        walk(&mut [empty; INLINE_STACK])
    } else {
        walk(&mut vec![empty; tree.stack])
    }
}

/// Whether one ray, whose end is `end` in the frame of its shaft, is blocked by one triangle: the exact answer.
#[inline(never)]
fn blocks_exactly(
    corners: [Vec3; 3],
    end: Vec3,
    finite: bool,
    solid: impl FnOnce(&Crossing) -> bool,
    masked: bool,
) -> bool {
    let crosses =
        if finite { exact::segment_crosses(corners, end) } else { exact::ray_crosses(corners, end) };
    crosses && (!masked || exact::crossing(corners, end).is_none_or(|crossing| solid(&crossing)))
}

/// The rays of a shaft that something blocks, as bits.
#[inline(always)]
pub(super) fn occluded<S: Simd, C: Cutout>(
    simd: S,
    tree: &Tree,
    cutout: Option<C>,
    shaft: &Shaft,
    rays: &Rays,
) -> u64 {
    let Some(root) = tree.root else { return 0 };
    let lanes = ShaftLanes::new(simd, shaft);
    let mut alive = rays.mask;
    let mut found = Candidates::NONE;
    with_stack(tree, root, |stack| {
        stack[0] = root;
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let link = stack[height];
            if link.is_leaf() {
                let block = &tree.blocks[link.index()];
                cull(simd, shaft, &lanes, block, link.count(), &mut found);
                if found.lanes != 0 {
                    let masked = cutout.map_or(0, |c| c.lanes(link.index()));
                    let solid = |lane: usize, crossing: &Crossing| {
                        cutout.is_none_or(|c| c.is_solid(link.index(), lane, crossing))
                    };
                    alive = test_rays(simd, shaft, rays, block, &found, alive, masked, solid);
                    if alive == 0 {
                        break;
                    }
                }
            } else {
                let node: &Node = &tree.nodes[link.index()];
                let (mut hit, _) = lanes.children(node);
                while hit != 0 {
                    let child = hit.trailing_zeros() as usize;
                    hit &= hit - 1;
                    stack[height] = node.links[child];
                    height += 1;
                }
            }
        }
    });
    rays.mask & !alive
}

/// Tests the rays in `alive` against the candidates of a block and returns those that are still unblocked.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "an inner loop, split off only for reading")]
fn test_rays<S: Simd>(
    simd: S,
    shaft: &Shaft,
    rays: &Rays,
    block: &Block,
    found: &Candidates,
    mut alive: u64,
    masked: u32,
    solid: impl Fn(usize, &Crossing) -> bool,
) -> u64 {
    let width = S::f32s::LEN;
    let every = u64::MAX >> (64 - width);
    let splat = |v: f32| S::f32s::splat(simd, v);
    let mut triangles = found.lanes;
    while triangles != 0 {
        let lane = triangles.trailing_zeros() as usize;
        triangles &= triangles - 1;
        let edges = found.edges.each_ref().map(|edge| edge.each_ref().map(|c| splat(c[lane])));
        for group in 0..(64 - alive.leading_zeros() as usize).div_ceil(width) {
            let at = group * width..(group + 1) * width;
            let waiting = alive >> at.start & every;
            if waiting == 0 {
                continue;
            }
            let x = S::f32s::from_slice(simd, &rays.slopes[0][at.clone()]);
            let y = S::f32s::from_slice(simd, &rays.slopes[1][at.clone()]);
            let inside = edges.map(|[a, b, c]| x.mul_add(a, y.mul_add(b, c)));
            let least = inside[0].min(inside[1]).min(inside[2]);
            let possible = least.simd_ge(0.0).to_bitmask() & waiting;
            if possible == 0 {
                continue;
            }
            // Which of them surely meet the triangle, and surely not before the ray ends.
            let mut sure = 0;
            let mut possible = possible;
            if masked >> lane & 1 == 0 {
                let doubt = |edge: usize| splat(found.twice_bound[edge][lane]);
                let meets =
                    inside[0].simd_gt(doubt(0)) & inside[1].simd_gt(doubt(1)) & inside[2].simd_gt(doubt(2));
                sure = meets.to_bitmask();
                if rays.finite {
                    let mut beyond = splat(0.0);
                    let mut doubt = splat(TINY);
                    for axis in 0..3 {
                        let end = S::f32s::from_slice(simd, &rays.ends[axis][at.clone()]);
                        let past = end - splat(found.corner[axis][lane]);
                        beyond = past.mul_add(splat(found.normal[axis][lane]), beyond);
                        doubt = past.abs().mul_add(splat(found.normal_error[axis][lane]), doubt);
                    }
                    // The normal is turned so that it has a positive product with the first corner: a ray
                    // that ends past the plane has a positive one too.
                    sure &= beyond.simd_gt(doubt).to_bitmask();
                    possible &= !beyond.simd_lt(-doubt).to_bitmask();
                }
            }
            let mut blocked = sure & possible;
            let mut unsure = possible & !sure;
            while unsure != 0 {
                let ray = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                let end = Vec3::from_array(rays.ends.each_ref().map(|axis| axis[at.start + ray]));
                let corners = shaft.corners(block, lane);
                let is_masked = masked >> lane & 1 == 1;
                if blocks_exactly(corners, end, rays.finite, |crossing| solid(lane, crossing), is_masked) {
                    blocked |= 1 << ray;
                }
            }
            alive &= !(blocked << at.start);
        }
        if alive == 0 {
            break;
        }
    }
    alive
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug)]
pub(super) struct First {
    pub(super) crossing: Crossing,
    pub(super) triangle: u32,
}

/// The closest triangle that the single ray of a shaft without end meets within [`t_min`, `t_max`]. Of
/// triangles met at the very same place the one of lowest index.
#[inline(always)]
pub(super) fn closest<S: Simd, C: Cutout>(
    simd: S,
    tree: &Tree,
    cutout: Option<C>,
    shaft: &Shaft,
    rays: &Rays,
    t_min: f64,
    t_max: f64,
) -> Option<First> {
    let root = tree.root?;
    let lanes = ShaftLanes::new(simd, shaft);
    let direction = Vec3::from_array(rays.ends.each_ref().map(|axis| axis[0]));
    let mut found = Candidates::NONE;
    let mut best: Option<First> = None;
    // z grows with t. The bound is one relative ulp wider than the product, which is rounded once.
    let z_of = |t: f64| (t * f64::from(direction.z) * (1.0 + f64::from(ERROR))) as f32;
    let mut z_max = z_of(t_max);
    with_stack(tree, (root, 0.0_f32), |stack| {
        stack[0] = (root, 0.0);
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (link, z) = stack[height];
            if z > z_max {
                continue;
            }
            if !link.is_leaf() {
                let node = &tree.nodes[link.index()];
                let (mut hit, near) = lanes.children(node);
                let near = near.to_array();
                // The nearest child ends on top: insertion into the few that are hit.
                let bottom = height;
                while hit != 0 {
                    let child = hit.trailing_zeros() as usize;
                    hit &= hit - 1;
                    let mut at = height;
                    while at > bottom && stack[at - 1].1 < near[child] {
                        stack[at] = stack[at - 1];
                        at -= 1;
                    }
                    stack[at] = (node.links[child], near[child]);
                    height += 1;
                }
                continue;
            }
            let block = &tree.blocks[link.index()];
            cull(simd, shaft, &lanes, block, link.count(), &mut found);
            let masked = cutout.map_or(0, |c| c.lanes(link.index()));
            while found.lanes != 0 {
                let lane = found.lanes.trailing_zeros() as usize;
                found.lanes &= found.lanes - 1;
                let Some(crossing) = exact::crossing(shaft.corners(block, lane), direction) else { continue };
                let triangle = tree.triangles[link.index()][lane];
                let closer =
                    best.is_none_or(|best| (crossing.t, triangle) < (best.crossing.t, best.triangle));
                let within = (t_min..=t_max).contains(&crossing.t);
                let solid = || {
                    masked >> lane & 1 == 0
                        || cutout.is_none_or(|c| c.is_solid(link.index(), lane, &crossing))
                };
                if within && closer && solid() {
                    best = Some(First { crossing, triangle });
                    z_max = z_of(crossing.t);
                }
            }
        }
    });
    best
}
