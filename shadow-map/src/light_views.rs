//! Where the light looks: the projections whose maps together hold every caster that can throw a shadow.
//!
//! A map is fitted to the casters, not to the scene: a receiver outside of it has no caster before it and is
//! lit. Casters behind which there is nothing (the ground under everything) are left out of the fit, which is
//! what makes a small object on a large ground get all the texels.

use glam::{DVec2, DVec3, DVec4, Mat3, Mat4, Vec2, Vec3, Vec4};
use scene_core::geometry::{Aabb, Object};
use scene_core::light::LightPoint;
use scene_core::relevance::HalfSpace;
use scene_core::{Light, Scene};

use crate::light_maps::Window;

/// Tangent of the half angle up to which one perspective view serves. Beyond 60° the middle of the map gets
/// less than a quarter of the texels a radian that its rim gets, and cube faces are the better use of memory.
const MAX_TAN: f32 = 1.732;

/// How far beyond the casters a view reaches, as a fraction of its extent: rounding must not push a caster's
/// outermost vertex over the border (2⁻¹⁶ is 256 ulps of the largest coordinate).
pub(crate) const MARGIN: f32 = 1.0 / 65_536.0;

/// The nearest distance a perspective view sees, as a fraction of its farthest caster's. Reversed floating
/// point depth keeps its relative precision at any distance, so this may be as small as positions themselves
/// are exact (2⁻²⁰).
pub(crate) const NEAR_FRACTION: f32 = 1.0 / 1_048_576.0;

/// A projection of the light's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightView {
    /// World to the light's clip space; x and y of the map lie in [−w, w], depth is reversed.
    pub projection_from_world: Mat4,
    /// Map back to world, for the point a texel's centre and depth stand for.
    pub(crate) unproject: Unprojection,
}

/// Where points lie in a map, in texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TexelBounds {
    /// Least column and row.
    pub(crate) min: DVec2,
    /// Greatest; below the least if there is no point.
    pub(crate) max: DVec2,
    /// What a projection in f32 may differ by.
    pub(crate) error: f64,
}

/// From normalised device coordinates back to world space, without inverting a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Unprojection {
    /// `origin + x·ndc.x + y·ndc.y + z·depth`.
    Parallel { origin: Vec3, x: Vec3, y: Vec3, z: Vec3 },
    /// `eye + (forward + x·ndc.x + y·ndc.y)·near/depth`.
    Central { eye: Vec3, forward: Vec3, x: Vec3, y: Vec3, near: f32 },
}

impl LightView {
    /// Bounds of `points` in the texels of a map of `map_size` texels a side, columns and rows, and how far a projection in
    /// f32 may be off. `None` if one of them may lie behind the view. They hold the points' convex hull: the error is convex in
    /// a point, the depth linear.
    ///
    /// A projection in f32 is four products and three sums, off by 4·2⁻²⁴ of the terms' sizes at most, here four times that; then
    /// a division. Device coordinates are below 2: points lie inside of the view or little beside it.
    pub(crate) fn texel_bounds(
        &self,
        map_size: u32,
        points: impl IntoIterator<Item = DVec3>,
    ) -> Option<TexelBounds> {
        const SHARE: f64 = 1.0 / 1_048_576.0;
        let clip_from_world = self.projection_from_world.as_dmat4();
        let [x, y, w] = [0, 1, 3].map(|row| clip_from_world.row(row));
        let error_of =
            |row: DVec4, point: DVec3| (row.truncate().abs().dot(point.abs()) + row.w.abs()) * SHARE;
        let size = f64::from(map_size);
        let mut bounds = TexelBounds { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY, error: size * SHARE };
        for point in points {
            let at = |row: DVec4| row.truncate().dot(point) + row.w;
            let (depth, error_w) = (at(w), error_of(w, point));
            let texel = (DVec2::new(at(x), -at(y)) / depth * 0.5 + 0.5) * size;
            if !(depth > 16.0 * error_w && texel.is_finite()) {
                return None;
            }
            let error = (error_of(x, point).max(error_of(y, point)) + 2.0 * error_w) / depth * size;
            bounds.error = bounds.error.max(error + size * SHARE);
            (bounds.min, bounds.max) = (bounds.min.min(texel), bounds.max.max(texel));
        }
        Some(bounds)
    }

    /// Parallel light along the unit vector `travel`: covers the box `bounds` given in the axes of `axes`
    /// (columns x, y, −travel; world space).
    pub(crate) fn parallel(axes: Mat3, bounds: Aabb) -> Self {
        let center = bounds.center();
        let half = (bounds.size() * (0.5 + MARGIN)).max(Vec3::splat(smallest_extent(bounds)));
        // Depth is reversed: 1 at the side of the light (largest z), 0 at the far side.
        let scale = Vec3::new(1.0 / half.x, 1.0 / half.y, 0.5 / half.z);
        let shift = Vec3::new(-center.x * scale.x, -center.y * scale.y, 0.5 - center.z * scale.z);
        let rows = axes.transpose();
        let column = |v: Vec3| (v * scale).extend(0.0);
        let projection_from_world =
            Mat4::from_cols(column(rows.x_axis), column(rows.y_axis), column(rows.z_axis), shift.extend(1.0));
        let unproject = Unprojection::Parallel {
            origin: axes * Vec3::new(center.x, center.y, center.z - half.z),
            x: axes.x_axis * half.x,
            y: axes.y_axis * half.y,
            z: axes.z_axis * (2.0 * half.z),
        };
        Self { projection_from_world, unproject }
    }

    /// Light from `eye`: covers the rectangle `min … max` of tangents in the axes of `axes` (columns x, y and
    /// backwards; world space), from the distance `near` to infinity.
    fn central(eye: Vec3, axes: Mat3, min: Vec2, max: Vec2, near: f32) -> Self {
        let center = (min + max) * 0.5;
        let half = ((max - min) * (0.5 + MARGIN)).max(Vec2::splat(MARGIN));
        let view_from_world = axes.transpose();
        let translation = -(view_from_world * eye);
        let view_from_world = Mat4::from_cols(
            view_from_world.x_axis.extend(0.0),
            view_from_world.y_axis.extend(0.0),
            view_from_world.z_axis.extend(0.0),
            translation.extend(1.0),
        );
        let projection_from_view = Mat4::from_cols(
            Vec4::new(1.0 / half.x, 0.0, 0.0, 0.0),
            Vec4::new(0.0, 1.0 / half.y, 0.0, 0.0),
            Vec4::new(center.x / half.x, center.y / half.y, 0.0, -1.0),
            Vec4::new(0.0, 0.0, near, 0.0),
        );
        let unproject = Unprojection::Central {
            eye,
            forward: axes.x_axis * center.x + axes.y_axis * center.y - axes.z_axis,
            x: axes.x_axis * half.x,
            y: axes.y_axis * half.y,
            near,
        };
        Self { projection_from_world: projection_from_view * view_from_world, unproject }
    }

    /// Normalised device coordinates of a world-space point; `None` outside the map or behind the light.
    #[inline]
    pub fn project(&self, point: Vec3) -> Option<Vec2> {
        let clip = self.projection_from_world * point.extend(1.0);
        let inside = clip.w > 0.0 && clip.x.abs() <= clip.w && clip.y.abs() <= clip.w;
        inside.then(|| Vec2::new(clip.x, clip.y) / clip.w)
    }

    /// The four sides of what the map holds, `times` as wide from its middle, moved outwards by `distance`.
    pub(crate) fn sides(&self, times: f64, distance: f64) -> Vec<HalfSpace> {
        self.sides_at([times; 4], distance)
    }

    /// The four sides of some texels of a map of `map_size` a side, and of one more all around for the rasteriser's snapping.
    pub(crate) fn sides_of(&self, window: &Window, map_size: u32) -> Vec<HalfSpace> {
        let texel = 2.0 / f64::from(map_size.max(1));
        let [columns, rows] =
            window.clone().map(|side| [f64::from(side.start) - 1.0, f64::from(side.end) + 1.0]);
        let [left, right] = columns.map(|column| column * texel - 1.0);
        let [top, bottom] = rows.map(|row| 1.0 - row * texel);
        self.sides_at([right, -left, top, -bottom], 0.0)
    }

    /// Half-spaces x ≤ a·w, −x ≤ b·w, y ≤ c·w and −y ≤ d·w, moved outwards by `distance`.
    fn sides_at(&self, ends: [f64; 4], distance: f64) -> Vec<HalfSpace> {
        let rows = self.projection_from_world.as_dmat4().transpose();
        let axes = [rows.x_axis, -rows.x_axis, rows.y_axis, -rows.y_axis];
        let sides = [0, 1, 2, 3].map(|side| axes[side] - rows.w_axis * ends[side]);
        let plane = |side: DVec4| {
            let length = side.truncate().length();
            HalfSpace { normal: side.truncate() / length, offset: distance - side.w / length }
        };
        sides.map(plane).into_iter().filter(|side| side.offset.is_finite()).collect()
    }

    /// The parts of [`unproject`](Self::unproject), for shaders.
    #[cfg(feature = "gpu")]
    pub(crate) fn unprojection(&self) -> Unprojection {
        self.unproject
    }

    /// As [`project`](Self::project), also beside the map; `None` behind the light.
    #[inline]
    pub fn project_beyond(&self, point: Vec3) -> Option<Vec2> {
        let clip = self.projection_from_world * point.extend(1.0);
        let ndc = Vec2::new(clip.x, clip.y) / clip.w;
        (clip.w > 0.0 && ndc.is_finite()).then_some(ndc)
    }

    /// Half the longer diagonal of the map in world units at reversed depth `depth`: what one unit of NDC along
    /// both axes is at most. Times 2/`map_size` it is the diagonal of a texel.
    #[inline]
    pub fn half_diagonal(&self, depth: f32) -> f32 {
        match self.unproject {
            Unprojection::Parallel { x, y, .. } => (x.length_squared() + y.length_squared()).sqrt(),
            Unprojection::Central { x, y, near, .. } => {
                (x.length_squared() + y.length_squared()).sqrt() * (near / depth)
            }
        }
    }

    /// [`half_diagonal`](Self::half_diagonal) at `distance` from the light along the view's axis, in scene units; of
    /// a parallel view it is the same everywhere.
    pub fn half_diagonal_at(&self, distance: f64) -> f64 {
        match self.unproject {
            Unprojection::Parallel { x, y, .. } => f64::from(x.length().hypot(y.length())),
            Unprojection::Central { x, y, .. } => f64::from(x.length().hypot(y.length())) * distance,
        }
    }

    /// Reversed depth of a world-space point before the view: the inverse of [`unproject`](Self::unproject).
    #[inline]
    pub fn depth_of(&self, point: Vec3) -> f32 {
        let clip = self.projection_from_world * point.extend(1.0);
        clip.z / clip.w
    }

    /// The world-space point at normalised device coordinates `ndc` and reversed depth `depth > 0`.
    #[inline]
    pub fn unproject(&self, ndc: Vec2, depth: f32) -> Vec3 {
        match self.unproject {
            Unprojection::Parallel { origin, x, y, z } => origin + x * ndc.x + y * ndc.y + z * depth,
            Unprojection::Central { eye, forward, x, y, near } => {
                eye + (forward + x * ndc.x + y * ndc.y) * (near / depth)
            }
        }
    }
}

/// The views of a light.
#[derive(Clone, Debug, Default)]
pub struct LightViews {
    /// The views; a point lies in at most one but for the shared borders of cube faces.
    pub views: Vec<LightView>,
    /// Cube faces left out because they see no caster.
    pub skipped_faces: u64,
}

/// Chooses the views of `light`: one parallel view for a directional light, one perspective view where the
/// casters fit into 60° around an axis, else the faces of a cube. No casters give no views.
pub fn light_views(scene: &Scene, light: &Light, casters: &[&Object], skip: bool) -> LightViews {
    let mut result = LightViews::default();
    let bounds = casters.iter().fold(Aabb::EMPTY, |bounds, object| bounds.union(object.bounds));
    if bounds.is_empty() {
        return result;
    }
    let points = || casters.iter().flat_map(|object| &scene.positions()[object.vertices.clone()]);
    match light.center() {
        LightPoint::Towards(to_light) => {
            let (x, y) = to_light.any_orthonormal_pair();
            let axes = Mat3::from_cols(x, y, to_light);
            result.views.push(LightView::parallel(axes, bounds_along(scene, axes, casters)));
        }
        LightPoint::At(eye) => {
            let reach = bounds.corners().map(|c| c.distance(eye)).into_iter().fold(0.0, f32::max);
            let near = (reach * NEAR_FRACTION).max(f32::MIN_POSITIVE);
            let (axis, max_tan) = match *light {
                Light::Spot { direction, outer, .. } => (direction, outer.tan()),
                _ => (bounds.center() - eye, MAX_TAN),
            };
            let backwards = (-axis).normalize_or(Vec3::Y);
            let (x, y) = backwards.any_orthonormal_pair();
            let axes = Mat3::from_cols(x, y, backwards);
            let tangents = tangent_bounds(eye, axes, points());
            let cone = matches!(light, Light::Spot { .. }) && (0.0..=MAX_TAN).contains(&max_tan);
            match tangents {
                Some((min, max)) if cone || min.abs().max(max.abs()).max_element() <= MAX_TAN => {
                    // A spot's cone ends where its light does.
                    let limit = if cone { Vec2::splat(max_tan) } else { Vec2::INFINITY };
                    let (min, max) = (min.max(-limit), max.min(limit));
                    if min.cmple(max).all() {
                        result.views.push(LightView::central(eye, axes, min, max, near));
                    }
                }
                None if cone => {
                    let limit = Vec2::splat(max_tan);
                    result.views.push(LightView::central(eye, axes, -limit, limit, near));
                }
                _ => {
                    for axes in cube_faces() {
                        if skip && !face_sees(eye, axes, casters) {
                            result.skipped_faces += 1;
                        } else {
                            result.views.push(LightView::central(eye, axes, Vec2::NEG_ONE, Vec2::ONE, near));
                        }
                    }
                }
            }
        }
    }
    result
}

/// Bounds of `casters` in the axes of `axes` (columns). Vertices of an object whose box lies within what the others take
/// are not asked: with 2⁻¹⁶ of the largest coordinate for the rounding of either, bounds are the same without them.
pub(crate) fn bounds_along(scene: &Scene, axes: Mat3, casters: &[&Object]) -> Aabb {
    let light_from_world = axes.transpose();
    casters.iter().fold(Aabb::EMPTY, |bounds, object| {
        let of_box = Aabb::from_points(object.bounds.corners().map(|corner| light_from_world * corner));
        let slack = Vec3::splat(object.bounds.magnitude() * MARGIN);
        let is_within =
            (of_box.min - slack).cmpge(bounds.min).all() && (of_box.max + slack).cmple(bounds.max).all();
        if is_within {
            return bounds;
        }
        let vertices = &scene.positions()[object.vertices.clone()];
        bounds.union(Aabb::from_points(vertices.iter().map(|&p| light_from_world * p)))
    })
}

/// The rectangle of tangents around `points` as seen from `eye`; `None` if one of them is not in front.
fn tangent_bounds<'a>(eye: Vec3, axes: Mat3, points: impl Iterator<Item = &'a Vec3>) -> Option<(Vec2, Vec2)> {
    let view_from_world = axes.transpose();
    let (mut min, mut max) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    for &point in points {
        let view = view_from_world * (point - eye);
        let distance = -view.z;
        // Beyond this tangent the view is too wide whatever the rest.
        if distance * 1e3 <= view.truncate().abs().max_element() || distance <= 0.0 {
            return None;
        }
        let tangent = view.truncate() / distance;
        min = min.min(tangent);
        max = max.max(tangent);
    }
    Some((min, max))
}

/// Axes (right, up, backwards) of the six faces of a cube.
fn cube_faces() -> [Mat3; 6] {
    [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z].map(|backwards| {
        let (x, y) = backwards.any_orthonormal_pair();
        Mat3::from_cols(x, y, backwards)
    })
}

/// Whether the bounds of some object reach into the pyramid of a cube face: they do not if all corners lie
/// outside one of its four side planes or behind the light.
fn face_sees(eye: Vec3, axes: Mat3, casters: &[&Object]) -> bool {
    let view_from_world = axes.transpose();
    casters.iter().any(|object| {
        let corners = object.bounds.corners().map(|c| view_from_world * (c - eye));
        // −z is the distance along the face's axis; a side plane is |x| = −z or |y| = −z.
        let outside = |side: fn(Vec3) -> f32| corners.iter().all(|&c| side(c) > -c.z * (1.0 + MARGIN));
        !(object.bounds.is_empty()
            || corners.iter().all(|c| c.z >= 0.0)
            || outside(|c| c.x)
            || outside(|c| -c.x)
            || outside(|c| c.y)
            || outside(|c| -c.y))
    })
}

/// A floor for a view's extent, so that a flat or pointlike caster still makes a map: ulps of its place.
fn smallest_extent(bounds: Aabb) -> f32 {
    (bounds.magnitude() * MARGIN).max(f32::MIN_POSITIVE * 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine3A;
    use scene_core::TriangleMesh;
    use scene_core::geometry::ObjectFlags;

    fn quad_at(y: f32, half: f32) -> TriangleMesh {
        let corner = |x: f32, z: f32| Vec3::new(x * half, y, z * half);
        let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        TriangleMesh::new("quad", positions, vec![[0, 1, 2], [0, 2, 3]])
    }

    fn scene_of(meshes: &[TriangleMesh]) -> Scene {
        let mut scene = Scene::new();
        for mesh in meshes {
            scene.add(mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        }
        scene
    }

    const LIGHTS: [Light; 3] = [
        Light::Point { position: Vec3::new(0.5, 9.0, 0.2) },
        Light::Directional { direction: Vec3::new(0.3, -1.0, 0.1), angular_radius: 0.0 },
        Light::Point { position: Vec3::new(0.0, 0.5, 0.0) },
    ];

    #[test]
    fn every_caster_vertex_projects_and_comes_back() {
        let scene = scene_of(&[quad_at(1.0, 2.0), quad_at(0.3, 1.0)]);
        for light in LIGHTS {
            let casters: Vec<_> = scene.objects().iter().collect();
            let views = light_views(&scene, &light, &casters, true).views;
            for &p in scene.positions() {
                let (view, ndc) =
                    views.iter().find_map(|v| v.project(p).map(|ndc| (v, ndc))).expect("outside every view");
                let clip = view.projection_from_world * p.extend(1.0);
                let back = view.unproject(ndc, clip.z / clip.w);
                assert!(back.distance(p) < 1e-5, "{light:?}: {p} came back as {back}");
            }
        }
    }

    #[test]
    fn a_light_among_casters_gets_faces_and_skips_empty_ones() {
        let scene = scene_of(&[quad_at(0.0, 3.0)]);
        let casters: Vec<_> = scene.objects().iter().collect();
        let light = Light::Point { position: Vec3::new(0.0, 1.0, 0.0) };
        let views = light_views(&scene, &light, &casters, true);
        assert_eq!((views.views.len(), views.skipped_faces), (5, 1));
        assert_eq!(light_views(&scene, &light, &casters, false).views.len(), 6);
    }

    #[test]
    fn bounds_are_those_of_every_vertex() {
        let setup = scene_core::scenes::build("forest:triangles=20000", 0.0).expect("a built-in scene");
        let casters: Vec<_> = setup.scene.objects().iter().collect();
        for towards in [Vec3::new(0.3, 1.0, -0.2), Vec3::new(1.0, 0.1, 0.4), Vec3::Y] {
            let (x, y) = towards.normalize().any_orthonormal_pair();
            let axes = Mat3::from_cols(x, y, towards.normalize());
            let all = Aabb::from_points(setup.scene.positions().iter().map(|&p| axes.transpose() * p));
            assert_eq!(bounds_along(&setup.scene, axes, &casters), all);
        }
    }

    #[test]
    fn no_casters_no_views() {
        assert!(light_views(&Scene::new(), &LIGHTS[0], &[], true).views.is_empty());
    }
}
