//! Step 1 for solid casters: which faces lie between a receiver and the light's centre, exactly.
//!
//! A texel's centre says little of a receiver elsewhere in the texel where casters are small or near. So the map holds no
//! depths: over every texel it lists the faces whose image touches it ([`grid`](crate::grid)), and each is asked by the
//! receiver's own ray. The map's resolution then decides how many faces are asked, and nothing of the answer.
//!
//! A face counts if the receiver lies behind its plane as the light sees it, by more than the tolerance, so that no surface
//! counts before itself, and if the ray passes between its corners: by the sides of its edges, which are those that
//! [`coverage`](crate::coverage) finds, so that a ray through an edge meets one of the faces there and not both.

use glam::{Vec2, Vec3};
use gnomon_shadow_map::light_maps::Receiver;
use gnomon_shadow_map::receiver_plane::is_behind;
use rayon::prelude::*;
use scene_core::Scene;
use scene_core::light::LightPoint;

use crate::coverage::{Site, center_is_left};
use crate::grid::{Grid, TileLists};
use crate::light_image::{Bounds, LightImage};

/// How far beyond its bounds a face is listed, in texels, for the rounding of f32 image coordinates: those of a map of 2¹⁴
/// texels are good to 2⁻⁹ each.
const SLACK: f32 = 1.0 / 64.0;

/// Widths of the map beside it within which a face's tiles are told apart: sides of 2¹⁶ texels are good to SLACK.
const FARTHEST: f32 = 4.0;

/// Whether a triangle comes as near to a tile as SLACK: no side of it has all of the tile beyond. One without area has no sides.
fn touches([a, b, c]: [Vec2; 3], tile: Bounds) -> bool {
    let area = (b - a).perp_dot(c - a);
    let turn = if area > 0.0 { 1.0 } else { -1.0 };
    [(a, b), (b, c), (c, a)].into_iter().all(|(from, to)| {
        let outwards = (from - to).perp() * turn;
        let nearest = Vec2::select(outwards.cmpgt(Vec2::ZERO), tile.min, tile.max) - from;
        // A tile without an end, across a side along it, is 0·∞ and not beyond.
        let beyond = outwards.dot(nearest) > SLACK * (outwards.x.abs() + outwards.y.abs());
        area == 0.0 || !beyond
    })
}

/// The solid faces over a view's texels.
#[derive(Clone, Debug)]
pub struct Faces {
    lists: TileLists,
}

impl Faces {
    /// Lists the triangles of `casters` in a view, by the tiles of the grid that `grid_of` makes for so many.
    pub fn new(
        scene: &Scene,
        casters: &[std::ops::Range<usize>],
        image: &LightImage,
        grid_of: impl Fn(usize) -> Grid,
    ) -> Self {
        let triangles: Vec<u32> =
            casters.iter().flat_map(|range| range.clone()).map(|triangle| triangle as u32).collect();
        // Vertices are shared: each is placed once, and only those of the casters are asked.
        let places: Vec<Option<Vec2>> = if triangles.is_empty() {
            Vec::new()
        } else {
            scene.positions().par_iter().map(|&position| image.place(position)).collect()
        };
        let grid = grid_of(triangles.len());
        let lists = TileLists::new(grid, triangles.len(), |index, enter| {
            let corners = scene.triangles()[triangles[index] as usize];
            let (mut bounds, mut image_corners) = (Bounds::NONE, [Vec2::ZERO; 3]);
            for (corner, at) in corners.into_iter().zip(&mut image_corners) {
                match places[corner as usize] {
                    Some(place) => (bounds, *at) = (bounds.with(place), place),
                    // It reaches behind the light, and where it is seen is not between its corners' images.
                    None => {
                        bounds = Bounds::ALL;
                        break;
                    }
                }
            }
            // Beside a map of one face of a cube the next one goes on.
            if bounds.grown(SLACK).meets_square(image.size as f32) {
                let reach = image.size as f32 * FARTHEST;
                let is_near = -bounds.min.min_element() <= reach && bounds.max.max_element() <= reach;
                let takes = |tile: Bounds| !is_near || touches(image_corners, tile);
                grid.each_tile_that(bounds.grown(SLACK), takes, enter);
            }
        });
        Self { lists: lists.map(|index| triangles[index as usize]) }
    }

    /// Faces between a receiver, whose image is `place`, and the light's `center`. `site` is the receiver's, relative to
    /// `origin`.
    #[inline]
    pub fn before(
        &self,
        scene: &Scene,
        receiver: &Receiver,
        (site, origin): (&Site, Vec3),
        place: Vec2,
        center: LightPoint,
    ) -> i32 {
        let mut count = 0;
        for face in self.lists.of(self.lists.grid().tile(Some(place))) {
            let corners = scene.corners(face as usize);
            let [a, b, c] = corners.map(|corner| site.locate(corner - origin));
            let side = center_is_left(a, b);
            let meets = side == center_is_left(b, c) && side == center_is_left(c, a);
            count += i32::from(meets && is_behind(corners, receiver.point, center, receiver.tolerance));
        }
        count
    }

    /// The lists, of indices into the scene's triangles.
    pub fn lists(&self) -> &TileLists {
        &self.lists
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tile with a point of the triangle is touched, whichever way the triangle is turned; one beyond its longest side is not.
    #[test]
    fn tiles_under_a_triangle_are_touched() {
        let tile = |x: f32, y: f32| Bounds { min: Vec2::new(x, y), max: Vec2::new(x + 1.0, y + 1.0) };
        let [a, b, c] = [Vec2::new(0.2, 0.3), Vec2::new(9.7, 8.1), Vec2::new(1.4, 7.6)];
        for corners in [[a, b, c], [a, c, b], [c, b, a]] {
            let mut untouched = 0;
            for i in 0..100 {
                let (x, y) = ((i % 10) as f32, (i / 10) as f32);
                let inside =
                    (0..=200).flat_map(|j| (0..=200 - j).map(move |k| (j as f32 / 200.0, k as f32 / 200.0)));
                let has_point = inside
                    .map(|(j, k)| corners[0] + (corners[1] - corners[0]) * j + (corners[2] - corners[0]) * k)
                    .any(|point| tile(x, y).holds(point));
                assert!(touches(corners, tile(x, y)) || !has_point, "{x}, {y}");
                untouched += usize::from(!touches(corners, tile(x, y)));
            }
            assert!(untouched > 30, "{untouched}");
        }
        assert!(touches([a, a, b], tile(5.0, 0.0)), "a triangle without area is taken to be anywhere");
        let ends = Bounds { min: Vec2::NEG_INFINITY, max: Vec2::new(1.0, f32::INFINITY) };
        assert!(touches([a, b, c], ends));
    }
}
