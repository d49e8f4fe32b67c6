//! Where the rasteriser puts a vertex: for who must agree with its coverage to the last pixel.

use glam::Vec3;

use super::gbuffer::clip_from_world;
use super::projection::{Projection, SUBPIXELS, flags};
use crate::Camera;

/// The rasteriser's own view of a camera: vertices snapped to 1/256 pixel, and on which side of a snapped edge a
/// pixel's centre lies.
///
/// A G-buffer is what is seen of the *snapped* triangles. Who reasons about what lies before a pixel's surface
/// (a shadow volume's faces, an outline) must use the same vertices and the same rule for ties, or is wrong within
/// 2⁻⁹ pixel of every edge.
#[derive(Clone, Debug)]
pub struct SnappedView {
    projection: Projection,
}

impl SnappedView {
    /// Steps a pixel.
    pub const STEPS: i32 = SUBPIXELS;

    /// The view that [`render_gbuffer`](super::render_gbuffer) draws for `camera`.
    pub fn new(camera: &Camera) -> Self {
        Self { projection: Projection::new(&clip_from_world(camera), camera.width, camera.height, true) }
    }

    /// The snapped place of a vertex in steps of 1/256 pixel, x to the right and y down from the top left corner.
    /// `None` behind the eye and outside the guard band: triangles with such a corner are clipped before they are
    /// snapped.
    pub fn snap(&self, position: Vec3) -> Option<[i32; 2]> {
        let [x, y, _, outside] = self.projection.vertex(position);
        (outside & (flags::GUARD | flags::BEHIND) == 0).then_some([x, y])
    }

    /// The centre of a pixel, in steps.
    pub fn center(x: u32, y: u32) -> [i32; 2] {
        [x as i32 * SUBPIXELS + SUBPIXELS / 2, y as i32 * SUBPIXELS + SUBPIXELS / 2]
    }

    /// Whether a pixel's centre that lies on the line from `a` to `b` counts as right of it: the top-left rule.
    /// It is as if all centres were moved by an infinitesimal step to the right and a far smaller one down.
    pub fn owns([ax, ay]: [i32; 2], [bx, by]: [i32; 2]) -> bool {
        by < ay || (by == ay && bx > ax)
    }
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;

    use super::*;
    use crate::geometry::ObjectFlags;
    use crate::{GBuffer, Scene, TriangleMesh, raster};

    #[test]
    fn coverage_is_told_exactly_by_the_snapped_corners() {
        let camera = Camera {
            eye: Vec3::new(0.3, 0.2, 3.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_y: 0.9,
            near: 0.01,
            far: f32::INFINITY,
            width: 40,
            height: 30,
        };
        // A pixel is 1/15 of the plane z = 0, and corners lie at the centres of pixels: many edges pass others exactly.
        let straight = Camera { eye: Vec3::Z, fov_y: std::f32::consts::FRAC_PI_2, ..camera };
        let mut ties = 0;
        for seed in 0..200_u32 {
            let (camera, steps) = if seed % 2 == 0 { (&camera, 500) } else { (&straight, 15) };
            let view = SnappedView::new(camera);
            let at = |i: u32| {
                let h = (seed * 6 + i).wrapping_mul(2_654_435_761) >> 8;
                ((h % (2 * steps)) as f32 + 0.5) / steps as f32 - 1.0
            };
            let corners = [0, 2, 4].map(|i| Vec3::new(at(i), at(i + 1), 0.0));
            let mut scene = Scene::new();
            let mesh = TriangleMesh::new("t", corners.to_vec(), vec![[0, 1, 2]]);
            scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
            let gbuffer = raster::render_gbuffer(&scene, camera);
            let snapped = corners.map(|c| view.snap(c).unwrap());
            for (x, y) in (0..30).flat_map(|y| (0..40).map(move |x| (x, y))) {
                let c = SnappedView::center(x, y).map(i64::from);
                let mut right = [false; 3];
                for (i, right) in right.iter_mut().enumerate() {
                    let (a, b) = (snapped[i], snapped[(i + 1) % 3]);
                    let [ax, ay] = a.map(i64::from);
                    let [bx, by] = b.map(i64::from);
                    let value = (bx - ax) * (c[1] - ay) - (by - ay) * (c[0] - ax);
                    ties += usize::from(value == 0);
                    *right = value > 0 || (value == 0 && SnappedView::owns(a, b));
                }
                let covered = right == [true; 3] || right == [false; 3];
                let seen = gbuffer.triangle[(y * 40 + x) as usize] != GBuffer::NOTHING;
                assert_eq!(covered, seen, "{corners:?} at {x}, {y}");
            }
        }
        assert!(ties > 0, "the rule for ties is tried");
        assert_eq!(SnappedView::new(&camera).snap(Vec3::Z * 4.0), None);
    }
}
