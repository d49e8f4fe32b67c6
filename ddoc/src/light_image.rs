//! The light's image: where points of the scene lie in texels of the map, and how far from the light.

use glam::{DVec3, Vec2, Vec3, Vec4};
use gnomon_shadow_map::light_views::LightView;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;

/// Steps a texel that the rasteriser snaps vertices to: coverage is decided on them.
const STEPS: f64 = 256.0;

/// The image of a view of the light.
#[derive(Clone, Copy, Debug)]
pub struct LightImage {
    /// The view.
    pub view: LightView,
    /// Texels a side.
    pub size: u32,
    /// The distance along the view's axis is affine in the point.
    along: Vec4,
}

/// A rectangle of the image in texels; x to the right and y down, as a map's rows run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Top left.
    pub min: Vec2,
    /// Bottom right.
    pub max: Vec2,
}

impl Bounds {
    /// Holds nothing.
    pub const NONE: Self = Self { min: Vec2::INFINITY, max: Vec2::NEG_INFINITY };
    /// Holds everything.
    pub const ALL: Self = Self { min: Vec2::NEG_INFINITY, max: Vec2::INFINITY };

    /// Grows to hold a point.
    #[must_use]
    pub fn with(self, point: Vec2) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// Whether a point lies inside or on the border.
    pub fn holds(&self, point: Vec2) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    /// Whether any of it lies in a square from 0 to `side`.
    pub fn meets_square(&self, side: f32) -> bool {
        self.min.max_element() <= side && self.max.min_element() >= 0.0
    }

    /// Grows on all sides.
    #[must_use]
    pub fn grown(self, by: f32) -> Self {
        Self { min: self.min - by, max: self.max + by }
    }
}

impl LightImage {
    /// Of `view`, in maps of `size` texels a side.
    pub fn new(view: LightView, size: u32) -> Self {
        let rows = view.projection_from_world.transpose();
        // Of a central view w is the distance; a parallel one has w = 1 and a depth that falls with the distance.
        let is_central = rows.w_axis.truncate() != Vec3::ZERO;
        Self { view, size, along: if is_central { rows.w_axis } else { -rows.z_axis } }
    }

    /// Where a point lies, in texels from the top left; also beside the map. `None` behind the light.
    #[inline]
    pub fn place(&self, point: Vec3) -> Option<Vec2> {
        let ndc = self.view.project_beyond(point)?;
        Some(Vec2::new(ndc.x * 0.5 + 0.5, 0.5 - ndc.y * 0.5) * self.size as f32)
    }

    /// Distance along the view's axis; in scene units for a central view, in its depth range for a parallel one.
    #[inline]
    pub fn along(&self, point: Vec3) -> f32 {
        self.along.dot(point.extend(1.0))
    }

    /// What a point's homogeneous image coordinates are divided by.
    #[inline]
    pub fn weight(&self, point: Vec3) -> f32 {
        self.view.projection_from_world.row(3).dot(point.extend(1.0))
    }

    /// Whether all of a box, which is relative to `origin`, lies before the light, beyond any rounding.
    pub fn is_before(&self, bounds: &Aabb, origin: Vec3) -> bool {
        let weights = bounds.corners().map(|corner| self.weight(corner + origin));
        let (least, most) =
            weights.iter().fold((f32::INFINITY, 0.0f32), |(least, most), &w| (least.min(w), most.max(w)));
        least > most * (1.0 / 4096.0)
    }

    /// The change of [`along`](Self::along) with a direction.
    #[inline]
    pub fn along_direction(&self, direction: Vec3) -> f32 {
        self.along.truncate().dot(direction)
    }

    /// Where an edge lies, snapped as the rasteriser snaps its ends; what lies behind the light is cut off. `None` if all
    /// of it does.
    pub fn snapped(&self, ends: [Vec3; 2]) -> Option<[[f64; 2]; 2]> {
        let matrix = self.view.projection_from_world.as_dmat4();
        let [mut a, mut b] = ends.map(|end| matrix * end.as_dvec3().extend(1.0));
        // A thousandth of the farther end's distance before the light's plane is far outside of any map.
        let limit = a.w.max(b.w) * 1e-3;
        if limit.is_nan() || limit <= 0.0 {
            return None;
        }
        if a.w < limit {
            a = a.lerp(b, (limit - a.w) / (b.w - a.w));
        } else if b.w < limit {
            b = b.lerp(a, (limit - b.w) / (a.w - b.w));
        }
        let size = f64::from(self.size);
        let snap = |v: f64| (v * STEPS).round_ties_even() / STEPS;
        Some([a, b].map(|clip| {
            let (x, y) = (clip.x / clip.w, clip.y / clip.w);
            [snap((x * 0.5 + 0.5) * size), snap((0.5 - y * 0.5) * size)]
        }))
    }

    /// How fast the distance grows on the way that the shadow of `point` takes from the light's point `from`: the cosine
    /// between the two. `None` where the two points are one.
    #[inline(always)]
    pub fn rate(&self, point: Vec3, from: LightPoint) -> Option<f64> {
        let axis = self.along.truncate().as_dvec3();
        Some(axis.try_normalize()?.dot(way_of_shadow(point, from).try_normalize()?))
    }

    /// Where the shadow of an edge's point ends: what the light's point `from` throws from `point` to the distance `far`.
    /// `None` if it never gets there.
    #[inline(always)]
    pub fn thrown(&self, point: Vec3, from: LightPoint, far: f32) -> Option<Vec3> {
        let direction = way_of_shadow(point, from);
        let rate = self.along.truncate().as_dvec3().dot(direction);
        let way = f64::from(far) - f64::from(self.along(point));
        let thrown: DVec3 = point.as_dvec3() + direction * (way.max(0.0) / rate);
        (rate > 0.0 && thrown.is_finite()).then(|| thrown.as_vec3())
    }
}

/// The way that the shadow of `point` takes from a point of the light.
fn way_of_shadow(point: Vec3, from: LightPoint) -> DVec3 {
    match from {
        LightPoint::At(place) => point.as_dvec3() - place.as_dvec3(),
        LightPoint::Towards(direction) => -direction.as_dvec3(),
    }
}
