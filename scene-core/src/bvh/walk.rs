//! Walking the tree with a shaft: which rays are blocked, and what a single ray meets first.

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use glam::Vec3;

use super::exact::{self, Crossing};
use super::filter::{Candidates, ERROR, TINY, cull};
use super::shaft::{Rays, Shaft, ShaftLanes};
use super::tree::{Block, Link, Node, Tree, WIDTH};

/// Entries of the stack that need no allocation. A tree of a million triangles uses about 60.
const INLINE_STACK: usize = 128;

/// What a cut-out mask makes of a hit: given leaf block, lane and weights, whether the surface is solid there.
pub(super) trait Cutout: Copy {
    /// The lanes of a block whose triangles have a mask.
    fn lanes(self, block: usize) -> u32;
    /// Whether the surface exists at a point of such a triangle.
    fn is_solid(self, block: usize, lane: usize, crossing: &Crossing) -> bool;
}

/// Whether a triangle of a block blocks a ray: the exact answer.
#[inline(never)]
fn blocks_exactly<const N: usize>(
    shaft: &Shaft,
    rays: &Rays<N>,
    block: &Block,
    lane: usize,
    ray: usize,
    masked: u32,
    solid: impl Fn(usize, &Crossing) -> bool,
) -> bool {
    let corners = shaft.corners(block, lane);
    let end = Vec3::new(rays.ends[0][ray], rays.ends[1][ray], rays.ends[2][ray]);
    let crosses =
        if rays.finite { exact::segment_crosses(corners, end) } else { exact::ray_crosses(corners, end) };
    let is_masked = masked >> lane & 1 == 1;
    crosses && (!is_masked || exact::crossing(corners, end).is_none_or(|crossing| solid(lane, &crossing)))
}

/// The rays of a shaft that something blocks, as bits.
///
/// A node is left out if the shaft misses it, or if every ray does that is still unblocked: so a wide shaft does
/// not visit what lies between its rays.
#[inline(always)]
pub(super) fn occluded<S: Simd, C: Cutout, const N: usize>(
    simd: S,
    tree: &Tree,
    cutout: Option<C>,
    shaft: &Shaft,
    rays: &Rays<N>,
) -> u64 {
    let Some(root) = tree.root else { return 0 };
    let lanes = ShaftLanes::new(simd, shaft);
    let mut alive = rays.mask;
    let mut spans = [[0.0; WIDTH]; 4];
    let mut met_leaves = [(Link::NONE, 0_u64); WIDTH];
    // Two plain arrays, as filling one of pairs takes longer than many a walk; and no closure around the walk,
    // as it would not be inlined, and what is not inlined does not use the vector unit.
    let (mut inline_links, mut inline_masks) = ([Link::NONE; INLINE_STACK], [0_u64; INLINE_STACK]);
    let mut allocated;
    let (links, masks) = if tree.stack <= INLINE_STACK {
        (&mut inline_links[..], &mut inline_masks[..])
    } else {
        allocated = (vec![Link::NONE; tree.stack], vec![0; tree.stack]);
        (&mut allocated.0[..], &mut allocated.1[..])
    };
    (links[0], masks[0]) = (root, alive);
    let mut height = 1;
    while height > 0 {
        height -= 1;
        let link = links[height];
        let through = masks[height] & alive;
        if through == 0 {
            continue;
        }
        let node: &Node = &tree.nodes[link.index()];
        let (hit, _) = if N == 1 {
            lanes.children::<false>(node, &mut spans)
        } else {
            lanes.children::<true>(node, &mut spans)
        };
        // Whether a ray meets a child cannot be foreseen, so the two loops that find out do not branch on it.
        let mut inner = hit & !node.leaves;
        while inner != 0 {
            let child = inner.trailing_zeros() as usize;
            inner &= inner - 1;
            let through = if N == 1 { through } else { rays.within(simd, &spans, child, through) };
            (links[height], masks[height]) = (node.links[child], through);
            height += usize::from(through != 0);
        }
        let mut leaves = hit & node.leaves;
        let mut met = 0;
        while leaves != 0 {
            let child = leaves.trailing_zeros() as usize;
            leaves &= leaves - 1;
            let through = if N == 1 { through } else { rays.within(simd, &spans, child, through) };
            met_leaves[met % WIDTH] = (node.links[child], through);
            met += usize::from(through != 0);
        }
        // Leaves at once: what they block need not go on.
        for &(link, through) in met_leaves.iter().take(met) {
            let through = through & alive;
            if through == 0 {
                continue;
            }
            let block = &tree.blocks[link.index()];
            let Some(found) = cull(simd, shaft, &lanes, block, link.count()) else { continue };
            let masked = cutout.map_or(0, |c| c.lanes(link.index()));
            let solid = |lane: usize, crossing: &Crossing| {
                cutout.is_none_or(|c| c.is_solid(link.index(), lane, crossing))
            };
            alive &= !if through.count_ones() < 2 * found.lanes.count_ones() {
                ray_by_ray(simd, shaft, rays, block, &found, through, masked, solid)
            } else {
                triangle_by_triangle(simd, shaft, rays, block, &found, through, masked, solid)
            };
            if alive == 0 {
                return rays.mask;
            }
        }
    }
    rays.mask & !alive
}

/// One lane's value in all lanes.
#[inline(always)]
fn spread<S: Simd>(simd: S, values: &f32x8<S>, lane: usize) -> S::f32s {
    S::f32s::splat(simd, values[lane & (WIDTH - 1)])
}

/// Which of the rays `through` a block are blocked there; a vector holds triangles. For few rays.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "an inner loop, split off only for reading")]
fn ray_by_ray<S: Simd, const N: usize>(
    simd: S,
    shaft: &Shaft,
    rays: &Rays<N>,
    block: &Block,
    found: &Candidates<S>,
    mut through: u64,
    masked: u32,
    solid: impl Fn(usize, &Crossing) -> bool,
) -> u64 {
    let [a, b, c] = found.edges;
    let mut blocked = 0;
    while through != 0 {
        let ray = through.trailing_zeros() as usize & (N - 1);
        through &= through - 1;
        let x = f32x8::splat(simd, rays.slopes[0][ray]);
        let y = f32x8::splat(simd, rays.slopes[1][ray]);
        let inside = [
            x.mul_add(a[0], y.mul_add(a[1], a[2])),
            x.mul_add(b[0], y.mul_add(b[1], b[2])),
            x.mul_add(c[0], y.mul_add(c[1], c[2])),
        ];
        let least = inside[0].min(inside[1]).min(inside[2]);
        let mut possible = least.simd_ge(0.0).to_bitmask() as u32 & found.lanes;
        if possible == 0 {
            continue;
        }
        let meets = inside[0].simd_gt(found.twice_bound[0])
            & inside[1].simd_gt(found.twice_bound[1])
            & inside[2].simd_gt(found.twice_bound[2]);
        let mut sure = meets.to_bitmask() as u32 & !masked;
        if rays.finite {
            let mut beyond = f32x8::splat(simd, 0.0);
            let mut doubt = f32x8::splat(simd, TINY);
            for axis in 0..3 {
                let corner = found.corner[axis];
                let past = f32x8::splat(simd, rays.ends[axis][ray]) - corner;
                beyond = past.mul_add(found.normal[axis], beyond);
                doubt = past.abs().mul_add(found.normal_error[axis], doubt);
            }
            // The normal is turned so that it has a positive product with the first corner: a ray that ends
            // past the plane has a positive one too.
            sure &= beyond.simd_gt(doubt).to_bitmask() as u32;
            possible &= !(beyond.simd_lt(-doubt).to_bitmask() as u32);
        }
        let mut is_blocked = sure & possible != 0;
        while !is_blocked && possible != 0 {
            let lane = possible.trailing_zeros() as usize;
            possible &= possible - 1;
            is_blocked = blocks_exactly(shaft, rays, block, lane, ray, masked, &solid);
        }
        blocked |= u64::from(is_blocked) << ray;
    }
    blocked
}

/// Which of the rays `through` a block are blocked there; a vector holds rays. For many rays.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "an inner loop, split off only for reading")]
fn triangle_by_triangle<S: Simd, const N: usize>(
    simd: S,
    shaft: &Shaft,
    rays: &Rays<N>,
    block: &Block,
    found: &Candidates<S>,
    through: u64,
    masked: u32,
    solid: impl Fn(usize, &Crossing) -> bool,
) -> u64 {
    let width = S::f32s::LEN;
    let every = u64::MAX >> (64 - width);
    let mut waiting = through;
    let mut triangles = found.lanes;
    while triangles != 0 && waiting != 0 {
        let lane = triangles.trailing_zeros() as usize;
        triangles &= triangles - 1;
        let [a, b, c] = &found.edges;
        let a = [spread(simd, &a[0], lane), spread(simd, &a[1], lane), spread(simd, &a[2], lane)];
        let b = [spread(simd, &b[0], lane), spread(simd, &b[1], lane), spread(simd, &b[2], lane)];
        let c = [spread(simd, &c[0], lane), spread(simd, &c[1], lane), spread(simd, &c[2], lane)];
        for group in 0..(64 - waiting.leading_zeros() as usize).div_ceil(width) {
            let at = group * width..(group + 1) * width;
            let x = S::f32s::from_slice(simd, &rays.slopes[0][at.clone()]);
            let y = S::f32s::from_slice(simd, &rays.slopes[1][at.clone()]);
            let inside = [
                x.mul_add(a[0], y.mul_add(a[1], a[2])),
                x.mul_add(b[0], y.mul_add(b[1], b[2])),
                x.mul_add(c[0], y.mul_add(c[1], c[2])),
            ];
            let least = inside[0].min(inside[1]).min(inside[2]);
            let mut possible = least.simd_ge(0.0).to_bitmask() & (waiting >> at.start & every);
            if possible == 0 {
                continue;
            }
            // Which of them surely meet the triangle, and surely not before the ray ends.
            let mut sure = 0;
            if masked >> lane & 1 == 0 {
                let meets = inside[0].simd_gt(spread(simd, &found.twice_bound[0], lane))
                    & inside[1].simd_gt(spread(simd, &found.twice_bound[1], lane))
                    & inside[2].simd_gt(spread(simd, &found.twice_bound[2], lane));
                sure = meets.to_bitmask();
                if rays.finite {
                    let mut beyond = S::f32s::splat(simd, 0.0);
                    let mut doubt = S::f32s::splat(simd, TINY);
                    for axis in 0..3 {
                        let end = S::f32s::from_slice(simd, &rays.ends[axis][at.clone()]);
                        let past = end - spread(simd, &found.corner[axis], lane);
                        beyond = past.mul_add(spread(simd, &found.normal[axis], lane), beyond);
                        doubt = past.abs().mul_add(spread(simd, &found.normal_error[axis], lane), doubt);
                    }
                    sure &= beyond.simd_gt(doubt).to_bitmask();
                    possible &= !beyond.simd_lt(-doubt).to_bitmask();
                }
            }
            let mut blocked = sure & possible;
            let mut unsure = possible & !sure;
            while unsure != 0 {
                let ray = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                if blocks_exactly(shaft, rays, block, lane, at.start + ray, masked, &solid) {
                    blocked |= 1 << ray;
                }
            }
            waiting &= !(blocked << at.start);
        }
    }
    through & !waiting
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
pub(super) fn closest<S: Simd, C: Cutout, const N: usize>(
    simd: S,
    tree: &Tree,
    cutout: Option<C>,
    shaft: &Shaft,
    rays: &Rays<N>,
    t_min: f64,
    t_max: f64,
) -> Option<First> {
    let root = tree.root?;
    let lanes = ShaftLanes::new(simd, shaft);
    let direction = Vec3::from_array(rays.ends.each_ref().map(|axis| axis[0]));
    let mut best: Option<First> = None;
    let mut spans = [[0.0; WIDTH]; 4];
    // z grows with t. The bound is one relative ulp wider than the product, which is rounded once.
    let z_of = |t: f64| (t * f64::from(direction.z) * (1.0 + f64::from(ERROR))) as f32;
    let mut z_max = z_of(t_max);
    let (mut inline_links, mut inline_depths) = ([Link::NONE; INLINE_STACK], [0.0_f32; INLINE_STACK]);
    let mut allocated;
    let (links, depths) = if tree.stack <= INLINE_STACK {
        (&mut inline_links[..], &mut inline_depths[..])
    } else {
        allocated = (vec![Link::NONE; tree.stack], vec![0.0; tree.stack]);
        (&mut allocated.0[..], &mut allocated.1[..])
    };
    links[0] = root;
    let mut height = 1;
    while height > 0 {
        height -= 1;
        let link = links[height];
        if depths[height] > z_max {
            continue;
        }
        if !link.is_leaf() {
            let node = &tree.nodes[link.index()];
            let (mut hit, near) = lanes.children::<false>(node, &mut spans);
            let near = near.to_array();
            // The nearest child ends on top: insertion into the few that are hit.
            let bottom = height;
            while hit != 0 {
                let child = hit.trailing_zeros() as usize;
                hit &= hit - 1;
                let mut at = height;
                while at > bottom && depths[at - 1] < near[child] {
                    (links[at], depths[at]) = (links[at - 1], depths[at - 1]);
                    at -= 1;
                }
                (links[at], depths[at]) = (node.links[child], near[child]);
                height += 1;
            }
            continue;
        }
        let block = &tree.blocks[link.index()];
        let Some(found) = cull(simd, shaft, &lanes, block, link.count()) else { continue };
        let masked = cutout.map_or(0, |c| c.lanes(link.index()));
        let mut left = found.lanes;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let Some(crossing) = exact::crossing(shaft.corners(block, lane), direction) else { continue };
            let triangle = tree.triangles[link.index()][lane];
            let closer = best.is_none_or(|best| (crossing.t, triangle) < (best.crossing.t, best.triangle));
            let within = (t_min..=t_max).contains(&crossing.t);
            let solid = || {
                masked >> lane & 1 == 0 || cutout.is_none_or(|c| c.is_solid(link.index(), lane, &crossing))
            };
            if within && closer && solid() {
                best = Some(First { crossing, triangle });
                z_max = z_of(crossing.t);
            }
        }
    }
    best
}
