//! From the triangle that a texel keeps over its surface to the receiver's own ray.
//!
//! A texel says what the light sees at its centre, and the receiver lies up to half a diagonal beside it. Between the two the
//! surface goes on from triangle to triangle, or it ends: at a boundary, or where it turns from the light. So it is followed over
//! the edge beyond which the ray lies, until a triangle is met by the ray or there is none, and the outline of the shadow is the
//! mesh's, not the texels'.

use glam::Vec3;
use gnomon_shadow_map::receiver_plane::{edge_volumes, is_behind};
use scene_core::Scene;
use scene_core::geometry::{NO_TRIANGLE, Surfaces};
use scene_core::light::LightPoint;

/// Triangles looked at before a surface is given up: of a mesh whose triangles are a fifth of a texel's diagonal wide, as many as
/// lie between a texel's centre and its corner.
pub const STEPS: u32 = 16;

/// Where a surface leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Followed {
    /// The receiver's ray meets it before it reaches the light.
    Shadows,
    /// The receiver's ray meets it where the receiver is not behind it.
    InFront,
    /// It ends before the ray.
    Ends,
    /// Not known: the triangle is in no surface, or the ray is too many triangles away.
    Lost,
}

/// Follows the surface from the triangle `from` to the ray of `point` towards `light`. A receiver is behind a triangle if it is by more
/// than `tolerance`.
pub fn follow(
    scene: &Scene,
    surfaces: &Surfaces,
    from: u32,
    (point, tolerance): (Vec3, f32),
    light: LightPoint,
) -> Followed {
    if surfaces.of(from as usize).extent == 0.0 {
        return Followed::Lost;
    }
    let (mut triangle, mut before, mut facing) = (from, NO_TRIANGLE, 0.0);
    for _ in 0..STEPS {
        let corners = scene.corners(triangle as usize);
        let sides = edge_volumes(corners, point, light);
        let sum: f32 = sides.iter().sum();
        // Turned from the light, or edge-on: here it ends.
        if sum == 0.0 || sum * facing < 0.0 {
            return Followed::Ends;
        }
        facing = sum.signum();
        let sides = sides.map(|side| side * facing);
        if sides.iter().all(|&side| side >= 0.0) {
            let shadows = is_behind(corners, point, light, tolerance);
            return if shadows { Followed::Shadows } else { Followed::InFront };
        }
        // Over the edge that the ray is farthest beyond; not back.
        let across = surfaces.of(triangle as usize).across;
        let (mut farthest, mut next) = (0.0, NO_TRIANGLE);
        for (side, across) in sides.into_iter().zip(across) {
            if side < farthest && (across != before || across == NO_TRIANGLE) {
                (farthest, next) = (side, across);
            }
        }
        if next == NO_TRIANGLE {
            return Followed::Ends;
        }
        (before, triangle) = (triangle, next);
    }
    Followed::Lost
}
