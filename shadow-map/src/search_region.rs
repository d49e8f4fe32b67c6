//! The texels that can hold what blocks a light of some extent: the cone from receiver to light as a view sees it, cut
//! off at the nearest surface stored in it.
//!
//! Of the cone only what is farther from the light than its nearest blocker matters. So the rectangle of texels
//! around the cone up to the nearest surface of the whole map is found first (of a sun's map, fitted to its casters, up to its
//! nearest depth); the nearest surface of that rectangle
//! cuts the cone again, and so on. Each rectangle holds every blocker; most are a few texels wide after two steps.

use glam::{Mat4, Vec4};

use crate::light_cone::LightCone;
use crate::light_views::Unprojection;
use crate::taps::Taps;

/// Cuts of the cone. Each makes the rectangle smaller or ends the search; more than this many gain little.
pub(crate) const CUTS: usize = 4;

/// Where blockers are looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SearchRegion {
    /// Nothing in reach rises above the receiver's plane.
    Clear,
    /// Texels (column and row, inclusive) of the receiver's view, none of them nearer to the light than the depth.
    Texels {
        /// First column and row.
        first: [i32; 2],
        /// Last column and row.
        last: [i32; 2],
        /// Nearest depth among them.
        nearest: f32,
    },
    /// The cone leaves the receiver's view for others.
    Unbounded,
}

/// The cone in a view's clip space, where it is a cone too.
#[derive(Clone, Copy, Debug)]
pub struct ClipCone {
    receiver: Vec4,
    u: Vec4,
    v: Vec4,
    w: Vec4,
    is_parallel: bool,
    near: f32,
}

impl ClipCone {
    /// `cone` as the view of `taps` sees it.
    pub fn new(taps: &Taps<'_>, cone: &LightCone) -> Self {
        let view = &taps.map().view;
        let clip_from_world: Mat4 = view.projection_from_world;
        let [u, v, w] = [cone.u, cone.v, cone.w].map(|axis| clip_from_world * axis.extend(0.0));
        let receiver = clip_from_world * taps.receiver.point.extend(1.0);
        let (is_parallel, near) = match view.unproject {
            Unprojection::Parallel { .. } => (true, 1.0),
            Unprojection::Central { near, .. } => (false, near),
        };
        Self { receiver, u, v, w, is_parallel, near }
    }

    /// From the receiver to the light's point (a, b), in clip space.
    #[inline]
    pub fn direction(&self, a: f32, b: f32) -> Vec4 {
        self.w + self.u * a + self.v * b
    }

    /// Grows towards the light, and is alike for all that has the same depth.
    #[inline]
    fn height(&self, clip: Vec4) -> f32 {
        if self.is_parallel { clip.z } else { -clip.w }
    }

    /// How far along `direction` the receiver's line reaches `depth`: not above 0 if it is there already, infinite if it
    /// never gets there.
    #[inline]
    pub fn reach(&self, direction: Vec4, depth: f32) -> f32 {
        let limit = if self.is_parallel { depth } else { -self.near / depth };
        let climb = self.height(direction);
        let above = limit - self.height(self.receiver);
        if climb > 0.0 { above / climb } else { f32::INFINITY }
    }

    /// Column and row, a texel's centre at one half, of the point `t` along `direction`; `None` behind the view and for a
    /// `t` that is not finite.
    #[inline]
    pub fn texel(&self, direction: Vec4, t: f32, size: f32) -> Option<[f32; 2]> {
        let clip = self.receiver + direction * t;
        let scale = 0.5 * size / clip.w;
        let at = [0.5 * size + clip.x * scale, 0.5 * size - clip.y * scale];
        (clip.w > 0.0 && at.iter().all(|at| at.is_finite())).then_some(at)
    }

    /// The rectangle around the receiver and the cone up to `depth`.
    fn bounds(&self, taps: &Taps<'_>, depth: f32) -> Option<([i32; 2], [i32; 2])> {
        let (mut min, mut max) = (taps.texel, taps.texel);
        let size = taps.map().map.width as f32;
        for (a, b) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let direction = self.direction(a, b);
            let t = self.reach(direction, depth);
            if t > 0.0 {
                let at = self.texel(direction, t, size)?;
                (min, max) = (min.min(at.into()), max.max(at.into()));
            }
        }
        // Far beyond the border is as good as beyond it.
        let cell = |at: f32| at.floor().clamp(-1.0, size) as i32;
        Some((min.to_array().map(cell), max.to_array().map(cell)))
    }
}

/// The texels where blockers of the light over `cone` can be.
pub fn search_region(taps: &Taps<'_>, clip: &ClipCone) -> SearchRegion {
    let end = taps.map().map.width as i32 - 1;
    let (mut first, mut last) = ([0; 2], [end; 2]);
    // No depth of a sun's map is beyond 1. Others are cut by what is stored.
    let of_all = || taps.nearest(first, last).unwrap_or(0.0);
    let mut nearest = if clip.is_parallel { 1.0 } else { of_all() };
    // Without a depth in the face itself there is nothing to cut the cone with.
    if nearest <= 0.0 {
        return if taps.is_lone() { SearchRegion::Clear } else { SearchRegion::Unbounded };
    }
    for _ in 0..CUTS {
        let bounds = clip.bounds(taps, nearest);
        let inside = bounds.and_then(|(min, max)| taps.inside(min, max));
        let (min, max) = match (bounds, inside) {
            (_, Some(inside)) => inside,
            // All of a lone view may hold blockers of a cone that opens behind it, and none of one that misses it.
            (None, None) if taps.is_lone() => break,
            (Some(_), None) if taps.is_lone() => return SearchRegion::Clear,
            _ => return SearchRegion::Unbounded,
        };
        if nearest <= 0.0 {
            return SearchRegion::Clear;
        }
        if (min, max) == (first, last) {
            break;
        }
        (first, last) = (min, max);
        nearest = taps.nearest(first, last).unwrap_or(0.0);
    }
    let corner = |at: [i32; 2]| at.map(|at| at as f32);
    if taps.plane.hides_none(corner(first), corner(last), nearest) {
        SearchRegion::Clear
    } else {
        SearchRegion::Texels { first, last, nearest }
    }
}
