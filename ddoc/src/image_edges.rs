//! `image-edges`: outlines of what one map shows, their directions fitted below the texel.
//!
//! Where the texels of a square of four centres fall into a nearer and a farther part with gaps between all neighbours of
//! the two ([`discontinuity`](crate::discontinuity)), the border of the nearer part is an outline, as marching squares
//! draw it. By the centres alone its directions are multiples of 45°. So where it crosses the segment between two centres
//! follows from the *coverage* of each, the share of near texels in a square of [`WIDTH`]² around it: along a straight
//! edge coverage falls linearly from one centre to the next, whatever the edge's direction, and passes one half on the
//! edge. Where things are thinner than the square the middle is taken.
//!
//! An outline counts for receivers above which its far side does not rise: the near and far z of the paper. Seen from the
//! light it is one layer, with the near side on its left.
//!
//! Limits: what the light's centre does not see throws no penumbra, and corners are rounded by about a texel.

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use crate::cells::outlines;
use crate::discontinuity::{Discontinuities, Surface};
use crate::light_image::LightImage;
use crate::silhouettes::Edge;

/// Side of the square that coverage is taken over, in texels: odd. An edge whose steps are up to this long becomes straight.
pub const WIDTH: i32 = 7;

/// The outlines in a map, relative to `origin`.
pub fn image_edges(map: &Discontinuities<'_>, origin: Vec3) -> Vec<Edge> {
    let size = map.image().size as i32;
    let coverage = Coverage::new(map);
    let rows = (-1..size).into_par_iter().map(|row| {
        let mut edges = Vec::new();
        for column in -1..size {
            let texels = [[column, row], [column + 1, row], [column + 1, row + 1], [column, row + 1]];
            let corners = texels.map(|texel| map.surface(texel));
            for near in corners.iter().flatten() {
                let inside = corners.map(|corner| corner.is_some_and(|corner| corner.along <= near.along));
                // Each part once: by its farthest corner, the first of equal ones.
                let first = corners.iter().flatten().find(|corner| corner.along == near.along);
                if inside == [true; 4] || first != Some(near) || !is_apart(map, &corners, inside) {
                    continue;
                }
                let beyond = corners.iter().flatten().filter(|corner| corner.along > near.along);
                let far = beyond.min_by(|a, b| a.along.total_cmp(&b.along));
                let far = far.map_or(Vec3::NAN, |far| far.point - origin);
                for [from, to] in outlines(inside, |side| coverage.crossing(texels, corners, side)) {
                    let ends = [from, to].map(|at| on_surface(map.image(), at, near));
                    edges.push(Edge { far, ..outline(ends.map(|end| end - origin)) });
                }
            }
        }
        edges
    });
    rows.collect::<Vec<_>>().concat()
}

/// Whether there is a gap between every corner inside and each of its neighbours outside.
fn is_apart(map: &Discontinuities<'_>, corners: &[Option<Surface>; 4], inside: [bool; 4]) -> bool {
    (0..4).all(|i| {
        let j = (i + 1) % 4;
        let (near, far) = if inside[i] { (i, j) } else { (j, i) };
        inside[i] == inside[j] || corners[near].is_some_and(|near| map.is_gap(&near, corners[far].as_ref()))
    })
}

/// An edge of no object: one layer on its left as the light sees it, on its right from below.
pub(crate) fn outline([a, b]: [Vec3; 2]) -> Edge {
    let planes = [Vec4::new(0.0, 0.0, 0.0, 1.0), Vec4::ZERO];
    // Beyond the edge every receiver is on the other side of it than the light: side(f) is −1 where the light has +1.
    Edge { a, b, planes, signs: [-1.0, 0.0], from_center: 1, far: Vec3::NAN }
}

/// The point at a place of the image, as deep as `surface`.
fn on_surface(image: &LightImage, at: Vec2, surface: &Surface) -> Vec3 {
    let middle = at * (2.0 / image.size as f32);
    image.view.unproject(Vec2::new(middle.x - 1.0, 1.0 - middle.y), surface.depth)
}

/// Distances of a map's nearest surfaces, for shares of near texels.
struct Coverage {
    along: Vec<f32>,
    size: i32,
}

impl Coverage {
    fn new(map: &Discontinuities<'_>) -> Self {
        let size = map.image().size as i32;
        let texels = (0..size * size).into_par_iter();
        let along = texels.map(|texel| {
            map.surface([texel % size, texel / size]).map_or(f32::INFINITY, |surface| surface.along)
        });
        Self { along: along.collect(), size }
    }

    /// The share of the texels around one that are nearer than `limit`.
    fn share(&self, [column, row]: [i32; 2], limit: f32) -> f32 {
        let reach = WIDTH / 2;
        let mut near = 0;
        for y in (row - reach).max(0)..=(row + reach).min(self.size - 1) {
            let (first, last) = ((column - reach).max(0), (column + reach).min(self.size - 1));
            if first <= last {
                let row = &self.along[(y * self.size + first) as usize..=(y * self.size + last) as usize];
                near += row.iter().filter(|&&along| along < limit).count();
            }
        }
        near as f32 / (WIDTH * WIDTH) as f32
    }

    /// Where the outline crosses a side of a square, of which one end is inside.
    fn crossing(&self, texels: [[i32; 2]; 4], corners: [Option<Surface>; 4], side: usize) -> Vec2 {
        let along = |i: usize| corners[i].map_or(f32::INFINITY, |corner: Surface| corner.along);
        let (i, j) = (side, (side + 1) % 4);
        let (near, far) = if along(i) < along(j) { (i, j) } else { (j, i) };
        // Halfway between the two depths, so that both squares at a side find the same.
        let limit = if along(far).is_finite() { 0.5 * (along(near) + along(far)) } else { f32::INFINITY };
        let (inside, outside) = (self.share(texels[near], limit), self.share(texels[far], limit));
        let at = if inside > 0.5 && outside < 0.5 { (inside - 0.5) / (inside - outside) } else { 0.5 };
        let center = |i: usize| Vec2::from(texels[i].map(|at| at as f32 + 0.5));
        center(near).lerp(center(far), at.clamp(1.0 / 128.0, 127.0 / 128.0))
    }
}
