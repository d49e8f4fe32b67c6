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

/// The solid faces over a view's texels.
#[derive(Clone, Debug)]
pub struct Faces {
    lists: TileLists,
}

impl Faces {
    /// Lists the triangles of `casters` in a view.
    pub fn new(scene: &Scene, casters: &[std::ops::Range<usize>], image: &LightImage) -> Self {
        let triangles: Vec<u32> =
            casters.iter().flat_map(|range| range.clone()).map(|triangle| triangle as u32).collect();
        // Vertices are shared: each is placed once, and only those of the casters are asked.
        let places: Vec<Option<Vec2>> = if triangles.is_empty() {
            Vec::new()
        } else {
            scene.positions().par_iter().map(|&position| image.place(position)).collect()
        };
        let grid = Grid::of_texels(image.size);
        let lists = TileLists::new(grid, triangles.len(), |index, enter| {
            let corners = scene.triangles()[triangles[index] as usize];
            let mut bounds = Bounds::NONE;
            for corner in corners {
                match places[corner as usize] {
                    Some(place) => bounds = bounds.with(place),
                    // It reaches behind the light, and where it is seen is not between its corners' images.
                    None => {
                        bounds = Bounds::ALL;
                        break;
                    }
                }
            }
            // Beside a map of one face of a cube the next one goes on.
            if bounds.grown(SLACK).meets_square(image.size as f32) {
                grid.each_tile(bounds.grown(SLACK), enter);
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
