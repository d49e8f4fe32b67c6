//! The layout of a PDSM: one window that all rays and all shadow maps look through (section 3.1, the planar parallel
//! configuration).
//!
//! Let the samples of the light lie in a plane, C be its middle, z the distance from it and F that of a plane parallel
//! to it, the window's. A point at distance z whose ray from C passes the window at q is projected from the sample
//! C + a onto the window at q + a·t with **t = 1 − F/z**. In a parallel light whose samples travel along n + a, where a
//! is perpendicular to the middle direction n, it is q − a·(z − F): **t = (z − F)/r** for any unit r. In both, depth
//! is t in every map and in the PDSM, planes stay planes, and a ray is q + D·t in the map of the sample with step D.
//!
//! So rect and disk lights and the sun are exact. A sphere is taken for the disk that the middle of the casters sees
//! as large; from inside the casters' bounds six windows stand around it as the faces of a cube.

use glam::{DMat3, DVec2, DVec3, Mat4, Vec2, Vec3, Vec4};
use scene_core::geometry::{Aabb, Object};
use scene_core::light::LightPoint;
use scene_core::light::sampling::{LightView, SampleKey, stratified};
use scene_core::{Light, Scene};

/// Tangent of the half angle beyond which a window sees nothing: rays within 3.6° of a flat light's own plane. Wider
/// windows would have no texel left for what matters.
const MAX_TAN: f64 = 16.0;

/// How far a window reaches beyond what it must hold, as a share of its extent: rounding must not push a caster over the
/// border (2⁻¹⁴ is a sixteenth of a texel at 1024).
const MARGIN: f64 = 1.0 / 16_384.0;

/// The smallest extent that a window is given, as a share of its distance from the axes' origin: positions are not exact
/// below it (2⁻²⁰).
const SMALLEST_SHARE: f64 = 1.0 / 1_048_576.0;

/// Casters nearer to the light's plane than this share of the farthest point are taken to lie there, so that rays have
/// an end to begin at: t = 1 − F/z has none at z = 0.
const NEAR_SHARE: f64 = 1.0 / 1024.0;

/// The window stands at this share of the farthest distance at least. A step of f32 in t is one of z²/F in z: nearer, far
/// points would lose more than two bits.
const FOCUS_SHARE: f64 = 0.25;

/// How distance becomes t.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Depth {
    /// t = 1 − focus/z, from a middle at the origin.
    Central { focus: f32 },
    /// `t = (z − focus)·per_unit`.
    Parallel { focus: f32, per_unit: f32 },
}

/// One window: from world space to texels and t, for the light's middle and for each sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Origin of the axes, world space: the light's middle, or the scene's for parallel light.
    origin: Vec3,
    /// Unit axes: x and y of the window, and the way that light travels.
    axes: [Vec3; 3],
    depth: Depth,
    /// Lower corner of the window on its plane, in the axes' units.
    corner: Vec2,
    /// Texels per unit on the window's plane.
    texels_per_unit: Vec2,
    /// Texels a side.
    map_size: u32,
    /// Only points whose tangents are within this of the axis belong here; infinite but for a cube's faces.
    max_tan: f32,
    /// z of the nearest and of the farthest caster that the maps draw.
    caster_range: [f64; 2],
    /// Samples of the light: offsets a in the window's plane.
    offsets: Vec<Vec2>,
    /// The largest offset along each axis.
    reach: Vec2,
}

/// A point as a layout has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowPoint {
    /// Position on the window, in texels.
    pub texel: Vec2,
    /// Depth along the ray.
    pub t: f32,
}

impl Layout {
    /// Samples of the light, each as the step D in texels per unit of t.
    pub fn steps(&self) -> impl ExactSizeIterator<Item = Vec2> + '_ {
        let scale = match self.depth {
            Depth::Central { .. } => self.texels_per_unit,
            Depth::Parallel { per_unit, .. } => -self.texels_per_unit / per_unit,
        };
        self.offsets.iter().map(move |&offset| offset * scale)
    }

    /// t from before the nearest caster to beyond the farthest point that rays are asked for.
    pub fn t_range(&self) -> [f32; 2] {
        let near = self.caster_range[0];
        match self.depth {
            Depth::Central { focus } => [(1.0 - f64::from(focus) / near) as f32 - 1.0, 1.0],
            // Casters and receivers lie within [−1, 1].
            Depth::Parallel { .. } => [-1.01, 1.01],
        }
    }

    /// World-space coordinates in the axes.
    #[inline]
    fn local(&self, point: Vec3) -> Vec3 {
        let p = point - self.origin;
        Vec3::from_array(self.axes.map(|axis| axis.dot(p)))
    }

    /// Where `point` lies; `None` if this window is not the one that looks at it.
    #[inline]
    pub fn locate(&self, point: Vec3) -> Option<WindowPoint> {
        let local = self.local(point);
        let (on_window, t) = match self.depth {
            Depth::Central { focus } => {
                let belongs = local.z > 0.0
                    && local.x.abs() <= self.max_tan * local.z
                    && local.y.abs() <= self.max_tan * local.z;
                if !belongs {
                    return None;
                }
                let scale = focus / local.z;
                (local.truncate() * scale, 1.0 - scale)
            }
            Depth::Parallel { focus, per_unit } => (local.truncate(), (local.z - focus) * per_unit),
        };
        Some(WindowPoint { texel: (on_window - self.corner) * self.texels_per_unit, t })
    }

    /// How t changes along the plane through `point` with unit normal `normal`: per texel of the window, and per unit
    /// that the plane is moved along its normal.
    ///
    /// The plane N·X = h has 1/z = (N.xy·q/F + N.z)/h, so t = 1 − (N.xy·q + N.z·F)/h is linear in q; in parallel light
    /// z = (h − N.xy·q)/N.z. Infinite where the plane holds the light's middle.
    #[inline]
    pub fn plane_slope(&self, point: Vec3, normal: Vec3, t: f32) -> (Vec2, f32) {
        let n = Vec3::from_array(self.axes.map(|axis| axis.dot(normal)));
        match self.depth {
            Depth::Central { .. } => {
                let h = normal.dot(point - self.origin);
                (-n.truncate() / (h * self.texels_per_unit), ((1.0 - t) / h).abs())
            }
            Depth::Parallel { per_unit, .. } => {
                let scale = per_unit / n.z;
                (-n.truncate() * scale / self.texels_per_unit, scale.abs())
            }
        }
    }

    /// The share of the samples that lie above the plane through `point` with unit normal `normal`.
    #[inline]
    pub fn share_above(&self, point: Vec3, normal: Vec3) -> f32 {
        let n = Vec3::from_array(self.axes.map(|axis| axis.dot(normal)));
        // N·(C + a − P) for a place, −N·(n + a) for a direction of travel.
        let (sign, middle) = match self.depth {
            Depth::Central { .. } => (1.0, normal.dot(self.origin - point)),
            Depth::Parallel { .. } => (-1.0, -n.z),
        };
        // Mostly the plane does not cut the light.
        if middle > n.truncate().abs().dot(self.reach) {
            return 1.0;
        }
        let above = self.offsets.iter().filter(|&&a| middle + sign * n.truncate().dot(a) > 0.0).count();
        above as f32 / self.offsets.len().max(1) as f32
    }

    /// The projection of the map of the sample with step `step`: a texel's x and y in clip space, and reversed depth.
    pub fn map_projection(&self, step: Vec2) -> Mat4 {
        let [x, y, z] = self.axes.map(Vec3::as_dvec3);
        let origin = self.origin.as_dvec3();
        let (scale, corner) = (self.texels_per_unit.as_dvec2(), self.corner.as_dvec2());
        let step = step.as_dvec2();
        let m = f64::from(self.map_size);
        // Rows as functions of world space: a direction and a constant.
        let row =
            |direction: DVec3, constant: f64| (direction.extend(constant - direction.dot(origin))).as_vec4();
        let rows: [Vec4; 4] = match self.depth {
            Depth::Central { focus } => {
                let f = f64::from(focus);
                // Texel·z = (F·x − corner·z)·scale + D·(z − F).
                let texel = |axis: DVec3, scale: f64, corner: f64, d: f64| {
                    (axis * (f * scale) + z * (d - corner * scale), -d * f)
                };
                let (tx, cx) = texel(x, scale.x, corner.x, step.x);
                let (ty, cy) = texel(y, scale.y, corner.y, step.y);
                let near = DVec3::ZERO;
                [
                    row(tx * (2.0 / m) - z, cx * (2.0 / m)),
                    row(z - ty * (2.0 / m), -cy * (2.0 / m)),
                    near.extend(self.caster_range[0]).as_vec4(),
                    row(z, 0.0),
                ]
            }
            Depth::Parallel { focus, per_unit } => {
                let (f, r) = (f64::from(focus), f64::from(per_unit));
                let texel = |axis: DVec3, scale: f64, corner: f64, d: f64| {
                    (axis * scale + z * (d * r), -corner * scale - d * r * f)
                };
                let (tx, cx) = texel(x, scale.x, corner.x, step.x);
                let (ty, cy) = texel(y, scale.y, corner.y, step.y);
                let [near, far] = self.caster_range;
                let per_range = 1.0 / (far - near);
                [
                    row(tx * (2.0 / m), cx * (2.0 / m) - 1.0),
                    row(-ty * (2.0 / m), 1.0 - cy * (2.0 / m)),
                    row(-z * per_range, far * per_range),
                    Vec4::W,
                ]
            }
        };
        Mat4::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose()
    }

    /// t of a depth that [`map_projection`](Self::map_projection) yields; infinite for 0, where nothing is.
    pub fn t_of_depth(&self) -> impl Fn(f32) -> f32 + use<> {
        let [near, far] = self.caster_range;
        let (at_far, per_depth) = match self.depth {
            Depth::Central { focus } => (1.0, (f64::from(focus) / near) as f32),
            Depth::Parallel { focus, per_unit } => {
                let r = f64::from(per_unit);
                (((far - f64::from(focus)) * r) as f32, ((far - near) * r) as f32)
            }
        };
        move |depth| if depth > 0.0 { at_far - depth * per_depth } else { f32::INFINITY }
    }

    /// Texels a side of the maps.
    pub fn map_size(&self) -> u32 {
        self.map_size
    }
}

/// The windows of `light` over `casters`, with `views` stratified samples each, maps of `map_size` texels a side.
/// Windows without casters are left out; `skipped` counts them. A light without extent has one sample.
pub fn layouts(
    scene: &Scene,
    casters: &[&Object],
    light: &Light,
    views: u32,
    map_size: u32,
    seed: u64,
) -> (Vec<Layout>, u64) {
    let bounds = casters.iter().fold(Aabb::EMPTY, |sum, object| sum.union(object.bounds));
    if bounds.is_empty() {
        return (Vec::new(), 0);
    }
    let frames = frames(light, bounds);
    let tried = frames.len() as u64;
    let build =
        Builder { scene, casters, light, views: if light.is_extended() { views } else { 1 }, map_size, seed };
    let layouts: Vec<_> = frames.into_iter().filter_map(|frame| build.layout(frame)).collect();
    let skipped = tried - layouts.len() as u64;
    (layouts, skipped)
}

/// Axes of a window before it is fitted.
#[derive(Clone, Copy, Debug)]
struct Frame {
    origin: DVec3,
    axes: DMat3,
    is_parallel: bool,
    max_tan: f64,
}

impl Frame {
    fn new(origin: DVec3, travel: DVec3, is_parallel: bool, max_tan: f64) -> Self {
        let z = travel.normalize_or(DVec3::NEG_Y);
        let (x, y) = z.any_orthonormal_pair();
        Self { origin, axes: DMat3::from_cols(x, y, z), is_parallel, max_tan }
    }

    fn local(&self, point: Vec3) -> DVec3 {
        self.axes.transpose() * (point.as_dvec3() - self.origin)
    }
}

fn frames(light: &Light, casters: Aabb) -> Vec<Frame> {
    let place = |p: Vec3| p.as_dvec3();
    let both_sides = |center: Vec3, normal: DVec3| {
        [normal, -normal].map(|side| Frame::new(place(center), side, false, f64::INFINITY)).to_vec()
    };
    match *light {
        Light::Directional { direction, .. } => {
            vec![Frame::new(place(casters.center()), place(direction), true, f64::INFINITY)]
        }
        Light::Rect { center, half_u, half_v } => {
            let (u, v) = (place(half_u).normalize_or_zero(), place(half_v).normalize_or_zero());
            both_sides(center, u.cross(v))
        }
        Light::Disk { center, normal, .. } => both_sides(center, place(normal)),
        Light::Spot { position, direction, .. } => {
            vec![Frame::new(place(position), place(direction), false, f64::INFINITY)]
        }
        Light::Point { position } | Light::Sphere { center: position, .. } => {
            let to_middle = place(casters.center()) - place(position);
            let radius = 0.5 * f64::from(casters.diagonal());
            // All casters within 60° of the axis: one window will do.
            if to_middle.length() * 3f64.sqrt() * 0.5 > radius {
                vec![Frame::new(place(position), to_middle, false, f64::INFINITY)]
            } else {
                [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z]
                    .map(|axis| Frame::new(place(position), axis, false, 1.0))
                    .to_vec()
            }
        }
    }
}

struct Builder<'a> {
    scene: &'a Scene,
    casters: &'a [&'a Object],
    light: &'a Light,
    views: u32,
    map_size: u32,
    seed: u64,
}

/// A rectangle on the window's plane.
#[derive(Clone, Copy, Debug)]
struct Rect {
    min: DVec2,
    max: DVec2,
}

impl Rect {
    const EMPTY: Self = Self { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY };

    fn with(self, point: DVec2, reach: [DVec2; 2]) -> Self {
        Self { min: self.min.min(point + reach[0]), max: self.max.max(point + reach[1]) }
    }
}

impl Builder<'_> {
    fn layout(&self, frame: Frame) -> Option<Layout> {
        let vertices = |objects: &[&Object]| {
            objects
                .iter()
                .flat_map(|o| &self.scene.positions()[o.vertices.clone()])
                .map(|&p| frame.local(p))
                .collect::<Vec<_>>()
        };
        let casters = vertices(self.casters);
        let receivers: Vec<_> = self.scene.objects().iter().filter(|o| o.flags.receives).collect();
        let receivers = vertices(&receivers);
        let extent = |points: &[DVec3]| {
            points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], p| [a.min(p.z), b.max(p.z)])
        };
        let [near, far] = extent(&casters);
        let [_, far_receiver] = extent(&receivers);
        let farthest = far.max(far_receiver);
        let (near, focus) = if frame.is_parallel {
            let pad = (far - near).max(farthest.abs().max(near.abs()) * SMALLEST_SHARE) * MARGIN;
            (near - pad, 0.5 * (near + farthest))
        } else {
            if far.is_nan() || far <= 0.0 {
                return None;
            }
            let near = near.max(farthest * NEAR_SHARE) * (1.0 - MARGIN);
            // The harmonic mean: |t| is equal at both ends, so that maps are shifted the least.
            (near, (2.0 * near * farthest / (near + farthest)).max(farthest * FOCUS_SHARE))
        };
        let far = if frame.is_parallel { far + (far - near) * MARGIN } else { far };
        let per_unit = if frame.is_parallel { 2.0 / (farthest - near) } else { 0.0 };
        let offsets = self.offsets(&frame, 0.5 * (near + far));
        let reach = offsets.iter().fold(Rect::EMPTY, |sum, &a| sum.with(a, [DVec2::ZERO; 2]));
        let window = window(&frame, &casters, &receivers, focus, near, farthest, reach)?;
        let size = (window.max - window.min)
            .max(DVec2::splat(window.max.abs().max(window.min.abs()).max_element() * SMALLEST_SHARE))
            .max(DVec2::splat(1e-30));
        let corner = window.min - size * MARGIN;
        let texels_per_unit = f64::from(self.map_size) / (size * (1.0 + 2.0 * MARGIN));
        let depth = if frame.is_parallel {
            Depth::Parallel { focus: focus as f32, per_unit: per_unit as f32 }
        } else {
            Depth::Central { focus: focus as f32 }
        };
        let layout = Layout {
            origin: frame.origin.as_vec3(),
            axes: [frame.axes.x_axis, frame.axes.y_axis, frame.axes.z_axis].map(|axis| axis.as_vec3()),
            depth,
            corner: corner.as_vec2(),
            texels_per_unit: texels_per_unit.as_vec2(),
            map_size: self.map_size,
            max_tan: frame.max_tan as f32,
            caster_range: [near, far],
            offsets: offsets.iter().map(|a| a.as_vec2()).collect(),
            reach: reach.max.max(-reach.min).as_vec2(),
        };
        let is_finite = layout.corner.is_finite()
            && layout.texels_per_unit.is_finite()
            && layout.t_range().iter().all(|t| t.is_finite());
        is_finite.then_some(layout)
    }

    /// Offsets of the samples in the window's plane: of places, or of directions per unit travelled.
    fn offsets(&self, frame: &Frame, distance: f64) -> Vec<DVec2> {
        // A sphere is taken for a disk: from distance d it is seen as large as a disk of radius r/√(1 − (r/d)²).
        let flat = match *self.light {
            Light::Sphere { center, radius } => {
                let share = (f64::from(radius) / distance).min(0.99);
                let radius = f64::from(radius) / (1.0 - share * share).sqrt();
                Light::Disk { center, normal: frame.axes.z_axis.as_vec3(), radius: radius as f32 }
            }
            light => light,
        };
        let view = LightView::new(&flat, frame.origin.as_vec3());
        let mut points = vec![LightPoint::At(Vec3::ZERO); self.views as usize];
        stratified(&view, SampleKey::new(self.seed, 0), &mut points);
        let axes = frame.axes.transpose();
        points
            .iter()
            .map(|point| match *point {
                LightPoint::At(place) => (axes * (place.as_dvec3() - frame.origin)).truncate(),
                LightPoint::Towards(direction) => {
                    let travel = axes * -direction.as_dvec3();
                    travel.truncate() / travel.z
                }
            })
            .collect()
    }
}

/// The part of the window's plane that must be held: the casters as every sample sees them, and the rays of all points
/// that their shadows can reach. `None` if there is nothing.
fn window(
    frame: &Frame,
    casters: &[DVec3],
    receivers: &[DVec3],
    focus: f64,
    near: f64,
    farthest: f64,
    offsets: Rect,
) -> Option<Rect> {
    // Position on the window, and by how much offsets are multiplied there.
    let project = |p: &DVec3| {
        if frame.is_parallel {
            return (p.truncate(), focus - p.z);
        }
        let z = p.z.max(near);
        let tan = frame.max_tan.min(MAX_TAN);
        ((p.truncate() / z).clamp(DVec2::splat(-tan), DVec2::splat(tan)) * focus, 1.0 - focus / z)
    };
    let spread = |factor: f64, sign: f64| {
        let (a, b) = (offsets.min * (factor * sign), offsets.max * (factor * sign));
        [a.min(b), a.max(b)]
    };
    let in_front = |p: &&DVec3| frame.is_parallel || p.z > 0.0;
    let mut maps = Rect::EMPTY;
    for p in casters.iter().filter(in_front) {
        let (q, factor) = project(p);
        maps = maps.with(q, spread(factor, 1.0));
    }
    if maps.min.x > maps.max.x {
        return None;
    }
    let at = |z: f64| if frame.is_parallel { focus - z } else { 1.0 - focus / z.max(near) };
    // A ray at q is in the map at q + a·factor; the shadow's rays are the maps' rectangle, less that.
    let mut rays = maps;
    for z in [near, farthest] {
        let [low, high] = spread(at(z), -1.0);
        rays = Rect { min: rays.min.min(maps.min + low), max: rays.max.max(maps.max + high) };
    }
    let mut seen = Rect::EMPTY;
    for p in receivers.iter().filter(in_front) {
        seen = seen.with(project(p).0, [DVec2::ZERO; 2]);
    }
    let rays = Rect { min: rays.min.max(seen.min), max: rays.max.min(seen.max) };
    Some(Rect { min: maps.min.min(rays.min), max: maps.max.max(rays.max) })
}

#[cfg(test)]
mod tests {
    use scene_core::scenes;

    use super::*;

    fn lights() -> [Light; 5] {
        let center = Vec3::new(0.5, 4.0, 0.25);
        [
            Light::Rect { center, half_u: Vec3::X * 0.5, half_v: Vec3::new(0.0, 0.1, 0.4) },
            Light::Disk { center, normal: Vec3::new(0.1, -1.0, 0.2), radius: 0.5 },
            Light::Sphere { center, radius: 0.4 },
            Light::Directional { direction: Vec3::new(0.3, -1.0, 0.2), angular_radius: 0.05 },
            Light::Point { position: center },
        ]
    }

    /// What makes everything else work: in every map a point lies at q + D·t with the same t.
    #[test]
    fn rays_are_translates_in_every_map() {
        let setup = scenes::build("quads", 0.0).unwrap();
        let casters: Vec<_> = setup.scene.objects().iter().collect();
        for light in lights() {
            let (layouts, _) = layouts(&setup.scene, &casters, &light, 9, 256, 1);
            assert!(!layouts.is_empty(), "{light:?}");
            for layout in &layouts {
                let t_of_depth = layout.t_of_depth();
                for step in layout.steps() {
                    let projection = layout.map_projection(step);
                    for &point in setup.scene.positions().iter().step_by(3) {
                        let Some(at) = layout.locate(point) else { continue };
                        let clip = projection * point.extend(1.0);
                        let (ndc, depth) = (clip.truncate() / clip.w, clip.z / clip.w);
                        let texel = Vec2::new(ndc.x + 1.0, 1.0 - ndc.y) * 128.0;
                        let expected = at.texel + step * at.t;
                        assert!(texel.distance(expected) < 1e-2, "{light:?}: {texel} for {expected}");
                        assert!((t_of_depth(depth) - at.t).abs() < 1e-5, "{light:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_plane_is_linear_in_the_window() {
        let setup = scenes::build("quads", 0.0).unwrap();
        let casters: Vec<_> = setup.scene.objects().iter().collect();
        let normal = Vec3::new(0.3, 0.9, -0.2).normalize();
        let point = Vec3::new(0.1, 0.4, 0.2);
        let (u, v) = normal.any_orthonormal_pair();
        for light in lights() {
            let (layouts, _) = layouts(&setup.scene, &casters, &light, 4, 256, 1);
            for layout in &layouts {
                let Some(here) = layout.locate(point) else { continue };
                let (slope, lift) = layout.plane_slope(point, normal, here.t);
                for along in [u * 0.3, v * 0.2, (u - v) * 0.1] {
                    let Some(there) = layout.locate(point + along) else { continue };
                    let predicted = here.t + slope.dot(there.texel - here.texel);
                    assert!((predicted - there.t).abs() < 1e-4, "{light:?}");
                }
                // Moving the plane by δ moves it along the ray by lift·δ.
                let moved = layout.locate(point + normal * 1e-2).unwrap();
                let change = moved.t - slope.dot(moved.texel - here.texel) - here.t;
                assert!((change.abs() / 1e-2 - lift).abs() < 0.05 * lift, "{light:?}: {change} {lift}");
            }
        }
    }

    #[test]
    fn a_light_in_the_open_has_one_window_and_one_inside_six() {
        let setup = scenes::build("ball", 0.0).unwrap();
        let casters: Vec<_> = setup.scene.objects().iter().collect();
        let count = |position| {
            let light = Light::Sphere { center: position, radius: 0.1 };
            let (layouts, skipped) = layouts(&setup.scene, &casters, &light, 4, 64, 0);
            layouts.len() as u64 + skipped
        };
        let bounds = setup.scene.bounds();
        assert_eq!(count(bounds.center() + Vec3::Y * bounds.diagonal() * 3.0), 1);
        assert_eq!(count(bounds.center()), 6);
    }

    #[test]
    fn no_caster_is_no_window() {
        let scene = Scene::new();
        assert_eq!(layouts(&scene, &[], &lights()[0], 4, 64, 0), (Vec::new(), 0));
    }
}
