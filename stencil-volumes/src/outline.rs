//! Silhouette edges on the screen.
//!
//! Counting along the way from the eye to a pixel's surface needs no caps, because no caster lies before the surface
//! that is seen. That holds of the *snapped* triangles that the G-buffer was drawn from, and of the exact ones wherever no
//! silhouette edge is [`CLOSE`]: pixels that are close to one are traced, and nothing is counted from them.
//!
//! # The link of a path around an edge
//! Let P and Q be seen points and E the eye. The ways E→P and E→Q cross no caps. So the caps that the chord P→Q
//! crosses are those of the loop E→P→Q→E, and these are, as the chain of all caps is bounded by the silhouette, the
//! silhouette edges that pass through the triangle E P Q: each ±m. Hence a path between two pixels is counted by
//! silhouette edges alone, however many triangles lie along it.

use glam::DVec3;
use scene_core::Camera;
use scene_core::raster::SnappedView;

use crate::crossing::Edge;

/// In steps, how close a centre may be to an edge for its pixel to be traced instead of counted. Snapping moves a vertex
/// by half a step along x and along y, and a counted place is seen up to [`OFF_CENTER`] beside its pixel's centre: beyond two
/// steps the way from the eye passes the exact edge where the centre passes the snapped one.
pub const CLOSE: f64 = 2.0;

/// In steps, how far beside its pixel's centre a place may be seen, along x and along y. A shadow ray starts off its surface and
/// from a position that f32 has rounded: close by in a large scene, or far from the origin, that is more than a step, and
/// the way from the eye may pass other surfaces than those that the pixel sees. Such a pixel is traced.
pub const OFF_CENTER: f64 = 1.0;

/// An edge on the screen.
#[derive(Clone, Copy, Debug)]
pub struct ScreenEdge {
    /// Ends in steps of the rasteriser, if both have such a place.
    ends: Option<[[f64; 2]; 2]>,
    /// Least and greatest x and y in steps; infinite for an edge that has no such ends.
    min: [f64; 2],
    max: [f64; 2],
    /// The edge's line as a function of x and y in steps: factors, constant, and what rounding may do to it.
    line: [f64; 4],
    /// Normal of the plane through the eye and the edge.
    normal: DVec3,
    /// Depth of the nearer end, along the view direction; negative infinity behind the eye.
    pub depth: f64,
}

/// A point of the image: where its pixel's centre is, in steps, and where its surface is, from the eye.
#[derive(Clone, Copy, Debug)]
pub struct SeenPoint {
    /// The centre.
    pub center: [f64; 2],
    /// The surface.
    pub from_eye: DVec3,
}

/// Projects edges as a camera's G-buffer has them.
#[derive(Clone, Debug)]
pub struct Screen {
    view: SnappedView,
    /// The eye.
    pub eye: DVec3,
    forward: DVec3,
    near: f64,
    /// Ray of the top left corner of the image, and by how much a step to the right and down changes it.
    rays: [DVec3; 3],
}

impl Screen {
    /// For the G-buffers of `camera`.
    pub fn new(camera: &Camera) -> Self {
        let axes = camera.world_from_view_rotation().as_dmat3();
        let tan = camera.tan_half_fov().as_dvec2();
        let step = f64::from(SnappedView::STEPS);
        let right = axes.x_axis * (2.0 * tan.x / (f64::from(camera.width) * step));
        let down = axes.y_axis * (-2.0 * tan.y / (f64::from(camera.height) * step));
        let corner = axes * DVec3::new(-tan.x, tan.y, -1.0);
        Self {
            view: SnappedView::new(camera),
            eye: camera.eye.as_dvec3(),
            forward: camera.forward().as_dvec3(),
            near: f64::from(camera.near),
            rays: [corner, right, down],
        }
    }

    /// Depth of a point given from the eye.
    #[inline(always)]
    pub fn depth(&self, from_eye: DVec3) -> f64 {
        self.forward.dot(from_eye)
    }

    /// Whether a place is seen so far beside its pixel's centre that it cannot be counted.
    #[inline(always)]
    pub fn is_off_center(&self, point: &SeenPoint) -> bool {
        let [corner, right, down] = self.rays;
        let depth = self.depth(point.from_eye);
        let beside = point.from_eye - (corner + right * point.center[0] + down * point.center[1]) * depth;
        let is_near = |axis: DVec3| beside.dot(axis).abs() <= axis.length_squared() * depth * OFF_CENTER;
        !(depth > 0.0 && is_near(right) && is_near(down))
    }

    /// An edge on the screen. Its ends are positions of the scene, which f32 holds.
    pub fn project(&self, edge: &Edge) -> ScreenEdge {
        let depths = [edge.a, edge.b].map(|p| self.depth(p - self.eye));
        let depth = depths[0].min(depths[1]);
        let normal = (edge.a - self.eye).cross(edge.b - self.eye);
        let snapped = [edge.a, edge.b].map(|p| self.view.snap(p.as_vec3()));
        match snapped {
            // Before the near plane nothing is drawn, and caps are counted as they are, not as they are snapped.
            [Some(a), Some(b)] if depth >= self.near => {
                let [a, b] = [a, b].map(|p| p.map(f64::from));
                let fold = |pick: fn(f64, f64) -> f64| [pick(a[0], b[0]), pick(a[1], b[1])];
                let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
                let line = [-dy, dx, dy * a[0] - dx * a[1], 0.0];
                ScreenEdge {
                    ends: Some([a, b]),
                    min: fold(f64::min),
                    max: fold(f64::max),
                    line,
                    normal,
                    depth,
                }
            }
            _ => {
                // All of it behind the eye: it passes no triangle that begins there.
                let is_behind = depths[0].max(depths[1]) <= 0.0;
                let all = if is_behind { f64::NAN } else { f64::INFINITY };
                let [corner, right, down] = self.rays;
                let (x, y) = (normal.dot(right), normal.dot(down));
                // The function is asked of positions, which f32 rounds, and of lifted ones: both are within a pixel.
                let slack = (x.abs() + y.abs()) * f64::from(SnappedView::STEPS);
                let line = [x, y, normal.dot(corner), slack];
                ScreenEdge { ends: None, min: [-all; 2], max: [all; 2], line, normal, depth }
            }
        }
    }
}

impl ScreenEdge {
    /// The ends in steps, if both have such a place.
    #[inline(always)]
    pub fn ends(&self) -> Option<[[f64; 2]; 2]> {
        self.ends
    }

    /// From where to where the edge may pass, in steps along x or y, and as close as [`CLOSE`] to it.
    #[inline(always)]
    pub(crate) fn range(&self, axis: usize) -> [f64; 2] {
        [self.min[axis] - CLOSE, self.max[axis] + CLOSE]
    }

    /// Whether a centre is as close as [`CLOSE`] to the edge's line.
    #[inline(always)]
    pub fn is_close(&self, center: [f64; 2]) -> bool {
        let [x, y, constant, _] = self.line;
        (x * center[0] + y * center[1] + constant).abs() <= (x.abs() + y.abs()) * CLOSE
    }

    /// Whether the edge may pass before something inside a rectangle of centres that is at most `depth` deep, or as close
    /// as [`CLOSE`] to it.
    #[inline(always)]
    pub fn may_pass(&self, min: [f64; 2], max: [f64; 2], depth: f64) -> bool {
        self.min[0] - CLOSE <= max[0]
            && self.max[0] + CLOSE >= min[0]
            && self.min[1] - CLOSE <= max[1]
            && self.max[1] + CLOSE >= min[1]
            && {
                let [x, y, constant, slack] = self.line;
                let (cx, cy) = ((min[0] + max[0]) * 0.5, (min[1] + max[1]) * 0.5);
                let reach = x.abs() * (max[0] - min[0]) * 0.5 + y.abs() * (max[1] - min[1]) * 0.5;
                let close = (x.abs() + y.abs()) * CLOSE;
                (x * cx + y * cy + constant).abs() <= reach + slack + close
            }
            // The depths are exact to 2⁻⁵⁰ and less; a point's own is an f32.
            && self.depth <= depth + depth.abs() * f64::from(f32::EPSILON)
    }

    /// Whether a seen point, given from the eye, lies right of the edge as seen from there.
    #[inline(always)]
    pub fn is_right(&self, from_eye: DVec3) -> bool {
        self.normal.dot(from_eye) >= 0.0
    }

    /// The normal of the plane through the eye and the edge: positive products lie right of it.
    #[inline(always)]
    pub(crate) fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The link of the loop eye → `from` → `to` → eye with this edge, for multiplicity 1; both points are given from the
    /// eye. `beyond_edge` is the sign of μ of the chord from `from` to `to`: see [`crate::crossing`].
    #[inline(always)]
    pub fn link(&self, edge: &Edge, eye: DVec3, from: DVec3, to: DVec3, beyond_edge: bool) -> i32 {
        let from_right = self.is_right(from);
        if from_right == self.is_right(to) || beyond_edge != from_right {
            return 0;
        }
        let right = |v: DVec3| (v - eye).cross(from).dot(to) >= 0.0;
        let (a_right, b_right) = (right(edge.a), right(edge.b));
        i32::from(a_right) - i32::from(b_right)
    }
}
