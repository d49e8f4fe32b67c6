//! Step 3, the splat of an edge: the part of the light's image that its penumbra can fall on.
//!
//! The paper splats pixels of the image, as wide as the penumbra is on the far surface. Here an edge (a, b) is splatted.
//! A receiver that it half hides lies at p = q + τ·(q − s) for a point q of the edge, a point s of the light and τ ≥ 0, no
//! farther from the light than the farthest receiver there. For a fixed τ-plane that is a projective map of q and of s
//! each, so that the image of all such p lies in the convex hull of the images of the edge's ends and of what the corners
//! of the light's hull throw from them as far as the farthest receiver: the light's true size and the two depths, nothing
//! else.

use glam::Vec3;
use scene_core::light::LightHull;

use crate::light_image::{Bounds, LightImage};

/// How far beyond its bounds a splat is taken to reach, in texels, for the rounding of f32 positions; that of the
/// image's own coordinates is below a thousandth.
const SLACK: f32 = 0.25;

/// The bounds of a splat in the image for receivers up to the distance `far`; `None` if all of them lie before the edge.
/// Everything where the shadow reaches behind the light's plane.
pub fn splat(image: &LightImage, ends: [Vec3; 2], hull: Option<&LightHull>, far: f32) -> Option<Bounds> {
    let distances = ends.map(|end| image.along(end));
    if distances[0].min(distances[1]) >= far {
        return None;
    }
    let Some(hull) = hull else { return Some(Bounds::ALL) };
    let mut bounds = Bounds::NONE;
    for end in ends {
        match image.place(end) {
            Some(place) => bounds = bounds.with(place),
            None => return Some(Bounds::ALL),
        }
        for &corner in hull.corners() {
            match image.thrown(end, corner, far).and_then(|thrown| image.place(thrown)) {
                Some(place) => bounds = bounds.with(place),
                None => return Some(Bounds::ALL),
            }
        }
    }
    Some(bounds.grown(SLACK))
}
