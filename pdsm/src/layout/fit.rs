//! Fitting windows to a scene: which there are, how much of their planes they hold, and the samples of the light.

use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};
use scene_core::geometry::{Aabb, Object};
use scene_core::light::LightPoint;
use scene_core::light::sampling::{LightView, SampleKey, stratified};
use scene_core::{Light, Scene};

use super::cone::Cone;
use super::view::Part;
use super::{Depth, Held, Layout, Placement};

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

/// Texels around what a window must hold, where it is cut to what its light reaches: lookups interpolate from there, too.
const RIM: u32 = 4;

/// Ways that a window is turned about the light's, in which the smallest is looked for.
const TURNS: u32 = 16;

/// What windows are fitted to, beside casters.
#[derive(Clone, Copy, Debug)]
pub struct Fit<'a> {
    /// Receivers, and positions.
    pub scene: &'a Scene,
    /// The light.
    pub light: &'a Light,
    /// Stratified samples a window; a light without extent has one.
    pub views: u32,
    /// Texels a side of the maps.
    pub map_size: u32,
    /// What the samples are drawn from.
    pub seed: u64,
}

impl Fit<'_> {
    /// The windows over `casters`. Those without casters are left out, and counted.
    pub fn layouts(&self, casters: &[&Object]) -> (Vec<Layout>, u64) {
        let bounds = casters.iter().fold(Aabb::EMPTY, |sum, object| sum.union(object.bounds));
        if bounds.is_empty() {
            return (Vec::new(), 0);
        }
        let frames = frames(self.light, bounds);
        let tried = frames.len() as u64;
        let build = Builder::new(self, casters);
        let receivers = build.vertices(self.scene.objects().iter().filter(|object| object.flags.receives));
        let layouts: Vec<_> = frames
            .into_iter()
            .filter_map(|frame| {
                build.layout(frame, &Asked { points: &receivers, corners: &receivers, rim: RIM })
            })
            .collect();
        let skipped = tried - layouts.len() as u64;
        (layouts, skipped)
    }

    /// The window over `casters` for the receivers of `part` alone, with all texels where those are. `None` if no
    /// caster is in their way or one window cannot look at all of them.
    pub fn layout_of_part(&self, casters: &[&Object], part: &Part) -> Option<Layout> {
        let corners = part.bounds.corners();
        let build = Builder::new(self, casters);
        let frame = frame_towards(self.light, part.bounds)?;
        let mut layout = build
            .layout(frame, &Asked { points: &part.points, corners: &corners, rim: part.rim.max(RIM) })?;
        // What lies between the points that were looked at belongs to the part, too, but no texel of the rim does.
        let texels = part.points.iter().filter_map(|&point| layout.project(point)).map(|at| at.texel);
        let [low, high] = texels.fold([Vec2::INFINITY, Vec2::NEG_INFINITY], |[low, high], texel| {
            [low.min(texel), high.max(texel)]
        });
        let rim = Vec2::splat(part.rim as f32);
        let last = Vec2::splat(self.map_size as f32) - rim;
        let between = (high - low) * Part::BETWEEN;
        layout.placement.part = Some(Held {
            bounds: part.bounds,
            texels: [(low - between).max(rim), (high + between).min(last)],
        });
        Some(layout)
    }
}

/// What a window is fitted to: positions whose rays it must hold, the corners of a region that all of them lie in, and
/// texels around them.
struct Asked<'a> {
    points: &'a [Vec3],
    corners: &'a [Vec3],
    rim: u32,
}

/// Axes that look at all of `bounds`; `None` if no window can.
fn frame_towards(light: &Light, bounds: Aabb) -> Option<Frame> {
    let middle = bounds.center().as_dvec3();
    match *light {
        Light::Directional { .. } => frames(light, bounds).pop(),
        Light::Rect { .. } | Light::Disk { .. } => {
            frames(light, bounds).into_iter().find(|frame| frame.local(bounds.center()).z > 0.0)
        }
        Light::Spot { position, .. } | Light::Point { position } | Light::Sphere { center: position, .. } => {
            let to_middle = middle - position.as_dvec3();
            let is_ahead = to_middle.length() * 3f64.sqrt() * 0.5 > 0.5 * f64::from(bounds.diagonal());
            is_ahead.then(|| Frame::new(position.as_dvec3(), to_middle, false, f64::INFINITY))
        }
    }
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
    /// Of all casters.
    vertices: Vec<Vec3>,
    fit: &'a Fit<'a>,
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

impl<'a> Builder<'a> {
    fn new(fit: &'a Fit<'a>, casters: &[&Object]) -> Self {
        let mut build = Self { vertices: Vec::new(), fit };
        build.vertices = build.vertices(casters.iter().copied());
        build
    }

    fn vertices<'o>(&self, objects: impl Iterator<Item = &'o Object>) -> Vec<Vec3> {
        objects.flat_map(|o| &self.fit.scene.positions()[o.vertices.clone()]).copied().collect()
    }

    fn layout(&self, frame: Frame, asked: &Asked<'_>) -> Option<Layout> {
        let local =
            |frame: &Frame, points: &[Vec3]| points.iter().map(|&p| frame.local(p)).collect::<Vec<_>>();
        let (casters, receivers) = (local(&frame, &self.vertices), local(&frame, asked.points));
        let corners = local(&frame, asked.corners);
        let extent = |points: &[DVec3]| {
            points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], p| [a.min(p.z), b.max(p.z)])
        };
        let [near, far] = extent(&casters);
        let [_, far_receiver] = extent(&corners);
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
        let around =
            |offsets: &[DVec2]| offsets.iter().fold(Rect::EMPTY, |sum, &a| sum.with(a, [DVec2::ZERO; 2]));
        let rim = f64::from(asked.rim) / f64::from(self.fit.map_size.max(1));
        let cone = match *self.fit.light {
            Light::Spot { direction, outer, .. } => {
                Some(Cone { axis: direction.as_dvec3().normalize_or_zero(), angle: f64::from(outer) })
            }
            _ => None,
        };
        let at = |turn: Turn| {
            let turned = |points: &[DVec3]| points.iter().map(|&p| turn.of(p)).collect::<Vec<_>>();
            let reach = around(&offsets.iter().map(|&a| turn.of_plane(a)).collect::<Vec<_>>());
            let frame = turn.of_frame(frame);
            let range = DepthRange { focus, near, farthest };
            let window =
                window(&frame, &turned(&casters), &turned(&receivers), &range, reach, cone.as_ref(), rim)?;
            Some((frame, turn, reach, window))
        };
        // The faces of a cube must stay what they are.
        let turns = if frame.max_tan.is_finite() { 1 } else { TURNS };
        let area = |window: &Rect| (window.max - window.min).max(DVec2::ZERO).element_product();
        let (frame, turn, reach, window) = (0..turns)
            .filter_map(|turn| at(Turn::new(turn)))
            .min_by(|a, b| area(&a.3).total_cmp(&area(&b.3)))?;
        let offsets: Vec<_> = offsets.into_iter().map(|a| turn.of_plane(a)).collect();
        let size = (window.max - window.min)
            .max(DVec2::splat(window.max.abs().max(window.min.abs()).max_element() * SMALLEST_SHARE))
            .max(DVec2::splat(1e-30));
        let corner = window.min - size * MARGIN;
        let texels_per_unit = f64::from(self.fit.map_size) / (size * (1.0 + 2.0 * MARGIN));
        let depth = if frame.is_parallel {
            Depth::Parallel { focus: focus as f32, per_unit: per_unit as f32 }
        } else {
            Depth::Central { focus: focus as f32 }
        };
        let placement = Placement {
            origin: frame.origin.as_vec3(),
            axes: [frame.axes.x_axis, frame.axes.y_axis, frame.axes.z_axis].map(|axis| axis.as_vec3()),
            depth,
            corner: corner.as_vec2(),
            texels_per_unit: texels_per_unit.as_vec2(),
            max_tan: frame.max_tan as f32,
            reach: reach.max.max(-reach.min).as_vec2(),
            part: None,
        };
        let layout = Layout {
            placement,
            map_size: self.fit.map_size,
            caster_range: [near, far],
            offsets: offsets.iter().map(|a| a.as_vec2()).collect(),
        };
        let is_finite = placement.corner.is_finite()
            && placement.texels_per_unit.is_finite()
            && layout.t_range().iter().all(|t| t.is_finite());
        is_finite.then_some(layout)
    }

    /// Offsets of the samples in the window's plane: of places, or of directions per unit travelled.
    fn offsets(&self, frame: &Frame, distance: f64) -> Vec<DVec2> {
        // A sphere is taken for a disk: from distance d it is seen as large as a disk of radius r/√(1 − (r/d)²).
        let flat = match *self.fit.light {
            Light::Sphere { center, radius } => {
                let share = (f64::from(radius) / distance).min(0.99);
                let radius = f64::from(radius) / (1.0 - share * share).sqrt();
                Light::Disk { center, normal: frame.axes.z_axis.as_vec3(), radius: radius as f32 }
            }
            light => light,
        };
        let view = LightView::new(&flat, frame.origin.as_vec3());
        let views = if self.fit.light.is_extended() { self.fit.views } else { 1 };
        let mut points = vec![LightPoint::At(Vec3::ZERO); views as usize];
        stratified(&view, SampleKey::new(self.fit.seed, 0), &mut points);
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

/// A rotation of a window about the way of its light, by a share of a quarter turn.
#[derive(Clone, Copy)]
struct Turn {
    sin: f64,
    cos: f64,
}

impl Turn {
    fn new(number: u32) -> Self {
        let (sin, cos) = (f64::from(number) / f64::from(TURNS) * std::f64::consts::FRAC_PI_2).sin_cos();
        Self { sin, cos }
    }

    /// Coordinates in the turned axes.
    fn of_plane(self, p: DVec2) -> DVec2 {
        DVec2::new(self.cos * p.x + self.sin * p.y, self.cos * p.y - self.sin * p.x)
    }

    fn of(self, p: DVec3) -> DVec3 {
        self.of_plane(p.truncate()).extend(p.z)
    }

    fn of_frame(self, frame: Frame) -> Frame {
        let DMat3 { x_axis: x, y_axis: y, z_axis } = frame.axes;
        let axes = DMat3::from_cols(x * self.cos + y * self.sin, y * self.cos - x * self.sin, z_axis);
        Frame { axes, ..frame }
    }
}

/// Distances along the way of the light: of the window, of the nearest caster and of the farthest point.
struct DepthRange {
    focus: f64,
    near: f64,
    farthest: f64,
}

/// The part of the window's plane that must be held: the rays of all `receivers` that a shadow can reach, and what all
/// samples see of the casters on them. `rim` is a share of its extent for what lookups reach around. `None` if there is
/// nothing.
fn window(
    frame: &Frame,
    casters: &[DVec3],
    receivers: &[DVec3],
    range: &DepthRange,
    offsets: Rect,
    cone: Option<&Cone>,
    rim: f64,
) -> Option<Rect> {
    let DepthRange { focus, near, farthest } = *range;
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
    let mut seen = Rect::EMPTY;
    for p in receivers.iter().filter(in_front) {
        seen = seen.with(project(p).0, [DVec2::ZERO; 2]);
    }
    if let Some(cone) = cone {
        let [low, high] = cone.tangents(frame.axes);
        seen = Rect { min: seen.min.max(low * focus), max: seen.max.min(high * focus) };
    }
    let around = (seen.max - seen.min) * rim;
    seen = Rect { min: seen.min - around, max: seen.max + around };
    let at = |z: f64| if frame.is_parallel { focus - z } else { 1.0 - focus / z.max(near) };
    // A ray at q is in the map at q + a·factor; the shadow's rays are the maps' rectangle, less that.
    let mut rays = maps;
    // Where the rays that are asked for meet the maps.
    let mut met = seen;
    for z in [near, farthest] {
        let [low, high] = spread(at(z), -1.0);
        rays = Rect { min: rays.min.min(maps.min + low), max: rays.max.max(maps.max + high) };
        let [low, high] = spread(at(z), 1.0);
        met = Rect { min: met.min.min(seen.min + low), max: met.max.max(seen.max + high) };
    }
    let rays = Rect { min: rays.min.max(seen.min), max: rays.max.min(seen.max) };
    let maps = Rect { min: maps.min.max(met.min), max: maps.max.min(met.max) };
    let is_there = |rect: &Rect| rect.min.cmple(rect.max).all();
    if !is_there(&rays) || !is_there(&maps) {
        return None;
    }
    Some(Rect { min: maps.min.min(rays.min), max: maps.max.max(rays.max) })
}
