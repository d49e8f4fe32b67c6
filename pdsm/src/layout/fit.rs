//! Fitting windows to a scene: which there are, how much of their planes they hold, and the samples of the light.

use glam::{DMat3, DVec2, DVec3, Vec3};
use scene_core::geometry::{Aabb, Object};
use scene_core::light::LightPoint;
use scene_core::light::sampling::{LightView, SampleKey, stratified};
use scene_core::{Light, Scene};

use super::{Depth, Layout};

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
