//! What the proofs about a group of receivers need to know of them, gathered in one pass over their pixels.

use glam::{DVec3, Vec3};

use super::TILE;
use crate::bvh::{Bvh, HalfSpace, shadow_origin};
use crate::geometry::Aabb;
use crate::light::LightPoint;
use crate::reference::outline::LightOutline;
use crate::reference::shaft::LightShaft;
use crate::{GBuffer, Light, Scene};

/// Receivers lie within the scene's largest coordinate but for rounding; those farther out are not proved.
const REACH: f32 = 1.0 + 1.0 / 1024.0;

/// 2⁻²⁰: what a light without extent is widened by, relative to the largest coordinate or as an angle. Any size will do:
/// the outline's own margin is above the roundings of its one direction already.
const NO_EXTENT: f32 = 1.0 / (1_u32 << 20) as f32;

/// A light as all receivers of a scene see it.
pub(super) struct Beam {
    light: Light,
    pub(super) outline: LightOutline,
    /// Largest coordinate of the scene.
    pub(super) magnitude: f32,
    /// Middle of the outline, and the distance of its farthest point from there.
    middle: DVec3,
    radius: f64,
    is_distant: bool,
    /// Two points of the outline that lie far apart.
    probes: [LightPoint; 2],
}

/// Receivers of one tile or of several.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReceiverGroup {
    /// Pixels that receive.
    seen: u32,
    /// Those that see nothing of the light whatever the casters: it is below their plane or does not reach them.
    dark: u32,
    /// Those whose plane has all of the light above it.
    above: u32,
    /// Whether there are some for which nothing can be said.
    is_unsound: bool,
    /// Rays to the light that were tried, and those that were blocked.
    probed: u32,
    blocked: u32,
    /// Where the shadow rays of those not dark start.
    origins: Aabb,
    /// The plane under all origins: the first one's normal and the least product with it.
    normal: Vec3,
    lowest: f64,
}

impl ReceiverGroup {
    pub(super) const EMPTY: Self = Self {
        seen: 0,
        dark: 0,
        above: 0,
        is_unsound: false,
        probed: 0,
        blocked: 0,
        origins: Aabb::EMPTY,
        normal: Vec3::ZERO,
        lowest: f64::INFINITY,
    };

    pub(super) fn is_empty(&self) -> bool {
        self.seen == 0
    }

    pub(super) fn is_dark(&self) -> bool {
        self.dark == self.seen && !self.is_unsound
    }

    pub(super) fn may_be_lit(&self) -> bool {
        self.above == self.seen && self.blocked == 0 && !self.is_unsound
    }

    pub(super) fn may_be_umbra(&self) -> bool {
        self.blocked == self.probed && self.probed > 0 && !self.is_unsound
    }

    pub(super) fn origins(&self) -> &Aabb {
        &self.origins
    }

    /// Both together.
    pub(super) fn with(self, other: Self) -> Self {
        if self.origins.is_empty() || other.origins.is_empty() {
            let (mut sum, rest) = if self.origins.is_empty() { (other, self) } else { (self, other) };
            sum.count(&rest);
            return sum;
        }
        let mut sum = self;
        sum.count(&other);
        sum.origins = self.origins.union(other.origins);
        sum.lowest = self.lowest.min(if self.normal == other.normal {
            other.lowest
        } else {
            let along = |corner: Vec3| self.normal.as_dvec3().dot(corner.as_dvec3());
            other.origins.corners().into_iter().map(along).fold(f64::INFINITY, f64::min)
        });
        sum
    }

    fn count(&mut self, other: &Self) {
        self.seen += other.seen;
        self.dark += other.dark;
        self.above += other.above;
        self.is_unsound |= other.is_unsound;
        self.probed += other.probed;
        self.blocked += other.blocked;
    }
}

impl Beam {
    /// `None` for a light that is not finite or too wide, as an outline, for any proof.
    pub(super) fn new(scene: &Scene, light: &Light) -> Option<Self> {
        let magnitude = scene.bounds().magnitude();
        let least = |place: Vec3| place.abs().max_element().max(magnitude) * NO_EXTENT;
        let widened = match *light {
            Light::Point { position } | Light::Spot { position, .. } => {
                Light::Sphere { center: position, radius: least(position).max(f32::MIN_POSITIVE) }
            }
            Light::Directional { direction, angular_radius } => {
                Light::Directional { direction, angular_radius: angular_radius.max(NO_EXTENT) }
            }
            extended => extended,
        };
        // What is farther out is not proved, so this holds for all receivers.
        let outline = LightOutline::of_all(&widened, Vec3::splat(REACH * magnitude), magnitude)?;
        let place = |point: &LightPoint| match *point {
            LightPoint::At(place) | LightPoint::Towards(place) => place.as_dvec3(),
        };
        let points = outline.points();
        let middle = points.iter().map(place).sum::<DVec3>() / points.len() as f64;
        let radius = points.iter().map(|p| place(p).distance(middle)).fold(0.0, f64::max);
        let far = points.iter().max_by(|a, b| {
            let from_first = |p: &LightPoint| place(p).distance_squared(place(&points[0]));
            from_first(a).total_cmp(&from_first(b))
        })?;
        let is_distant = matches!(points[0], LightPoint::Towards(_));
        let probes = [points[0], *far];
        (middle.is_finite() && radius.is_finite()).then_some(Self {
            light: *light,
            outline,
            magnitude,
            middle,
            radius,
            is_distant,
            probes,
        })
    }

    /// The receivers that a tile sees, given by its column and row.
    pub(super) fn gather(
        &self,
        scene: &Scene,
        casters: &Bvh,
        gbuffer: &GBuffer,
        column: u32,
        row: u32,
    ) -> ReceiverGroup {
        let mut group = ReceiverGroup::EMPTY;
        let (x, y) = (column * TILE, row * TILE);
        let (mut first, mut last) = (None, Vec3::ZERO);
        let mut receives = (GBuffer::NOTHING, false);
        for row in y..(y + TILE).min(gbuffer.height) {
            let start = row as usize * gbuffer.width as usize;
            for pixel in start + x as usize..start + (x + TILE).min(gbuffer.width) as usize {
                if !gbuffer.is_seen(pixel) {
                    continue;
                }
                let object = gbuffer.object[pixel];
                if receives.0 != object {
                    receives =
                        (object, scene.objects().get(object as usize).is_none_or(|o| o.flags.receives));
                }
                if !receives.1 {
                    continue;
                }
                group.seen += 1;
                let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
                match self.height(position, normal) {
                    Height::Below => {
                        group.dark += 1;
                        continue;
                    }
                    Height::Above => group.above += 1,
                    Height::Across => {}
                    Height::Unsound => {
                        group.is_unsound = true;
                        continue;
                    }
                }
                let origin = shadow_origin(position, normal, self.magnitude);
                if first.is_none() {
                    first = Some(origin);
                    group.normal = normal;
                }
                let is_near = origin.is_finite() && origin.abs().max_element() <= REACH * self.magnitude;
                group.is_unsound |= !is_near;
                group.origins = group.origins.with_point(origin);
                group.lowest = group.lowest.min(group.normal.as_dvec3().dot(origin.as_dvec3()));
                last = origin;
            }
        }
        // Rays only choose which proof is tried.
        if let Some(first) = first.filter(|_| !group.is_unsound) {
            for origin in [first, last] {
                group.probed += 2;
                group.blocked += casters.occluded_mask(origin, &self.probes).count_ones();
            }
        }
        group
    }

    /// Where the light lies to the tangent plane at a receiver.
    fn height(&self, position: Vec3, normal: Vec3) -> Height {
        if !self.light.reaches(position) {
            return if position.is_finite() { Height::Below } else { Height::Unsound };
        }
        let (at, up) = (position.as_dvec3(), normal.as_dvec3());
        let height = up.dot(if self.is_distant { self.middle } else { self.middle - at });
        // A unit vector of f32 is longer than 1 by less than 2⁻²⁰; the outline's margin is for roundings of samples.
        let reach = self.radius * (1.0 + 1e-6) + self.outline.margin();
        if height > reach {
            return Height::Above;
        }
        if height < -reach {
            return Height::Below;
        }
        if !height.is_finite() {
            return Height::Unsound;
        }
        let (lowest, highest, margin) = self.outline.heights(position, normal);
        if lowest > margin {
            Height::Above
        } else if highest < -margin {
            Height::Below
        } else {
            Height::Across
        }
    }

    /// The shaft from a group's origins to the light.
    pub(super) fn shaft(&self, group: &ReceiverGroup) -> LightShaft {
        let floor = HalfSpace { normal: -group.normal.as_dvec3(), offset: -group.lowest };
        LightShaft::between(&group.origins, floor, &self.outline, self.magnitude)
    }
}

/// Where a whole light lies to a plane.
enum Height {
    Above,
    Across,
    Below,
    /// Nobody knows.
    Unsound,
}
