//! What stands between a point and a whole light: nothing, one triangle that hides all of it, or something else.
//!
//! The light is given by points around it. Whatever is linear in a ray's end and holds at all of them holds for
//! every end in their convex hull; so the tests of [`super::filter`], with its error bound, at a few points answer
//! for every sample of the light.

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, dispatch, f32x8};
use glam::Vec3;

use super::Bvh;
use super::filter::{Candidates, TINY, cull};
use super::shaft::{Rays, Shaft, ShaftLanes};
use super::tree::{Link, Tree};
use super::walk::Cutout;
use crate::light::LightPoint;

/// Points around a light, at most.
pub const OUTLINE: usize = 16;

/// Leaves that are searched for a triangle that hides all, once it is known that something is in the way.
const PATIENCE: u32 = 32;

/// What a [`Bvh`] knows of the way from a point to a whole light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cover {
    /// No triangle crosses any way to the light.
    Clear,
    /// One triangle without mask crosses every way to the light.
    Covered,
    /// Neither is proved.
    Unknown,
}

/// The leaf that covered a light last. The next point often lies behind the same triangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct LastCover(Option<Link>);

impl Bvh {
    /// What stands between `origin` and the convex hull of `outline`, up to [`OUTLINE`] points of one kind.
    ///
    /// Never in doubt about a ray: if the answer is [`Cover::Clear`] or [`Cover::Covered`], then
    /// [`Bvh::is_occluded`] says the same of every point whose offset from the origin, rounded to f32, lies in the
    /// hull of the outline's. `last` only saves time. Coordinates that are not finite, and a light that surrounds
    /// the origin, give [`Cover::Unknown`].
    pub fn cover(&self, origin: Vec3, outline: &[LightPoint], last: &mut LastCover) -> Cover {
        let mut ends = [[0.0; OUTLINE]; 3];
        let finite = matches!(outline.first(), Some(LightPoint::At(_)));
        let mut usable = !outline.is_empty() && outline.len() <= OUTLINE && origin.is_finite();
        for (ray, &point) in outline.iter().take(OUTLINE).enumerate() {
            let (end, kind) = match point {
                LightPoint::At(point) => (point - origin, true),
                LightPoint::Towards(direction) => (direction, false),
            };
            usable &= kind == finite && end.is_finite();
            for axis in 0..3 {
                ends[axis][ray] = end[axis];
            }
        }
        if !usable || !Shaft::can_reach(origin, self.tree.bounds) {
            return Cover::Unknown;
        }
        let mask = u64::MAX >> (64 - outline.len());
        dispatch!(self.level, simd => {
            match Shaft::new(simd, origin, &ends, mask, finite) {
                Some((shaft, rays)) => walk(simd, &self.tree, self.masks.as_ref(), &shaft, &rays, &mut last.0),
                None => Cover::Unknown,
            }
        })
    }
}

/// Walks the tree with the shaft until a triangle covers all or the search is given up.
#[inline(always)]
fn walk<S: Simd, C: Cutout>(
    simd: S,
    tree: &Tree,
    cutout: Option<C>,
    shaft: &Shaft,
    rays: &Rays<OUTLINE>,
    last: &mut Option<Link>,
) -> Cover {
    let Some(root) = tree.root else { return Cover::Clear };
    /// A tree of a million triangles uses about 60.
    const STACK: usize = 256;
    if tree.stack > STACK {
        return Cover::Unknown;
    }
    let lanes = ShaftLanes::new(simd, shaft);
    let mut spans = [[0.0; super::WIDTH]; 4];
    let mut links = [Link::NONE; STACK];
    links[0] = root;
    let mut height = 1;
    if let Some(link) = *last {
        links[1] = link;
        height = 2;
    }
    let mut patience = PATIENCE;
    let mut is_clear = true;
    while height > 0 {
        height -= 1;
        let link = links[height];
        if !link.is_leaf() {
            let node = &tree.nodes[link.index()];
            let (mut hit, _) = lanes.children::<false>(node, &mut spans);
            while hit != 0 {
                let child = hit.trailing_zeros() as usize;
                hit &= hit - 1;
                links[height] = node.links[child];
                height += 1;
            }
            continue;
        }
        let block = &tree.blocks[link.index()];
        let Some(found) = cull(simd, shaft, &lanes, block, link.count()) else { continue };
        let (crossing, covering) = classify(simd, rays, &found);
        let masked = cutout.map_or(0, |c| c.lanes(link.index()));
        if covering & !masked != 0 {
            *last = Some(link);
            return Cover::Covered;
        }
        if crossing != 0 {
            is_clear = false;
        }
        if !is_clear {
            patience -= 1;
            if patience == 0 {
                return Cover::Unknown;
            }
        }
    }
    if is_clear { Cover::Clear } else { Cover::Unknown }
}

/// The candidates that some ray to the hull may cross, and those that every one crosses.
#[inline(always)]
fn classify<S: Simd>(simd: S, rays: &Rays<OUTLINE>, found: &Candidates<S>) -> (u32, u32) {
    // All lanes, the masks of all of them.
    let (mut outside, mut covering, mut before) = ([u32::MAX; 3], found.lanes, u32::MAX);
    if !rays.finite {
        before = 0;
    }
    let mut waiting = rays.mask;
    while waiting != 0 {
        let ray = waiting.trailing_zeros() as usize & (OUTLINE - 1);
        waiting &= waiting - 1;
        let x = f32x8::splat(simd, rays.slopes[0][ray]);
        let y = f32x8::splat(simd, rays.slopes[1][ray]);
        for (edge, outside) in outside.iter_mut().enumerate() {
            let [a, b, c] = found.edges[edge];
            let inside = x.mul_add(a, y.mul_add(b, c));
            *outside &= inside.simd_lt(0.0).to_bitmask() as u32;
            covering &= inside.simd_gt(found.twice_bound[edge]).to_bitmask() as u32;
        }
        if rays.finite {
            let mut beyond = f32x8::splat(simd, 0.0);
            let mut doubt = f32x8::splat(simd, TINY);
            for axis in 0..3 {
                let past = f32x8::splat(simd, rays.ends[axis][ray]) - found.corner[axis];
                beyond = past.mul_add(found.normal[axis], beyond);
                doubt = past.abs().mul_add(found.normal_error[axis], doubt);
            }
            covering &= beyond.simd_gt(doubt).to_bitmask() as u32;
            before &= beyond.simd_lt(-doubt).to_bitmask() as u32;
        }
    }
    let missed = outside[0] | outside[1] | outside[2] | before;
    (found.lanes & !missed, covering)
}
