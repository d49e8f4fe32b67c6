//! One comparison a receiver, by the questions of [`gnomon_shadow_map::receiver_plane`]: they need no bias, and no
//! depth. A texel keeps the triangle that the light sees at its centre; the point is where the texel's ray meets that
//! triangle's plane, so nothing here knows how depths are spread in a warped map. What the paper leaves to the user,
//! an offset in post-perspective depth, does not exist.

use glam::{DVec3, Vec3};
use gnomon_shadow_map::light_maps::Receiver;
use gnomon_shadow_map::receiver_plane::{is_behind, is_near, meets, plane_tolerance, rises_above};
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::raster::DEPTH_POSITION_ERROR;
use scene_core::{GBuffer, Light, Scene};

use crate::PsmMap;

/// The stored surface point that a receiver is compared with.
#[derive(Clone, Copy, Debug)]
pub struct Occluder {
    /// Where the ray of the texel's centre meets the plane of the triangle, not beyond its corners along the ray.
    pub point: Vec3,
    /// The triangle, as an index into [`Scene::triangles`].
    pub triangle: usize,
    /// Diagonal of the texel across the ray at the point, world units.
    pub texel: f32,
    /// Distance of the receiver from the ray of the texel's centre, across it; world units.
    pub aside: f32,
}

/// Distance from a plane, in scene units, below which a point counts as on it; see [`plane_tolerance`], whose bound this one is
/// never above.
///
/// That one allows for a stored depth, here the stored point is computed from the triangle's corners. With u = 2⁻²⁴, m the largest
/// absolute coordinate and e the diagonal of `bounds`: the receiver and the stored point are each rounded to f32 once,
/// ≤ √3·u·m; their differences from the anchor and the dot product of three terms are of size e, ≤ 16·u·e. So far from the
/// origin the sum, 2⁻²²·(m + 4e), is an eighth of the other.
pub(crate) fn tolerance(bounds: Aabb, light: &Light) -> f32 {
    let own = (bounds.magnitude() + 4.0 * bounds.size().length()) * (1.0 / 4_194_304.0);
    let other = plane_tolerance(bounds, light);
    // An empty scene has no diagonal.
    if own < other { own } else { other }
}

impl PsmMap {
    /// Column and row of the texel that `point` falls into; `None` outside of the map.
    #[inline]
    pub fn texel_of(&self, point: Vec3) -> Option<[usize; 2]> {
        let ndc = self.view.ndc;
        let w = crate::warp::at(ndc.w, point.as_dvec3());
        let place = ndc.place(point.as_dvec3());
        // NaN is outside.
        if !(w > 0.0 && place.x.abs() <= 1.0 && place.y.abs() <= 1.0) {
            return None;
        }
        let (size, last) = (f64::from(self.size), self.size as usize - 1);
        // Row 0 is on top. Place 1 belongs to the last texel.
        let column = ((place.x * 0.5 + 0.5) * size) as usize;
        let row = ((0.5 - place.y * 0.5) * size) as usize;
        Some([column.min(last), row.min(last)])
    }

    /// What the light sees in the texel `[column, row]` that `point` falls into; `None` if there is nothing.
    #[inline]
    pub fn occluder(
        &self,
        scene: &Scene,
        light: LightPoint,
        point: Vec3,
        texel: [usize; 2],
    ) -> Option<Occluder> {
        let [column, row] = texel;
        let triangle = self.triangles[row * self.size as usize + column];
        if triangle == GBuffer::NOTHING {
            return None;
        }
        let (point, step) = (point.as_dvec3(), 2.0 / f64::from(self.size));
        let center = glam::DVec2::new((column as f64 + 0.5) * step - 1.0, 1.0 - (row as f64 + 0.5) * step);
        let to_light = |from: DVec3| match light {
            LightPoint::At(place) => place.as_dvec3() - from,
            LightPoint::Towards(towards) => towards.as_dvec3(),
        };
        let (to_ray, [x, y]) = self.view.ndc.across(center, point, to_light(point));
        let origin = point + to_ray;
        let direction = to_light(origin);
        let [a, b, c] = scene.corners(triangle as usize).map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a);
        // In units of the direction. Edge-on the plane is no help, the corners are.
        let along = [a, b, c].map(|corner| (corner - origin).dot(direction) / direction.length_squared());
        let (low, high) =
            along.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &t| (l.min(t), h.max(t)));
        let t = (normal.dot(a - origin) / normal.dot(direction)).max(low).min(high);
        let diagonal = (x + y).length_squared().max((x - y).length_squared()).sqrt() * step;
        // Rays from a place lie closer together near it.
        let shrink = match light {
            LightPoint::At(_) => (1.0 - t).abs(),
            LightPoint::Towards(_) => 1.0,
        };
        Some(Occluder {
            point: (origin + direction * t).as_vec3(),
            triangle: triangle as usize,
            texel: (diagonal * shrink) as f32,
            aside: to_ray.length() as f32,
        })
    }

    /// Whether `receiver`, which falls into `texel`, is in shadow.
    #[inline]
    pub fn shadows(&self, scene: &Scene, light: &Light, receiver: &Receiver, texel: [usize; 2]) -> bool {
        let Receiver { point, normal, tolerance, .. } = *receiver;
        let light = light.center();
        self.occluder(scene, light, point, texel).is_some_and(|occluder| {
            let corners = scene.corners(occluder.triangle);
            let snapping = occluder.texel * DEPTH_POSITION_ERROR;
            rises_above(occluder.point, point, normal, tolerance + snapping)
                && is_behind(corners, point, light, tolerance)
                // What is known of the distance is better than half a diagonal of the texel.
                && (!is_near(occluder.point, point, normal, light, 2.0 * occluder.aside + snapping)
                    || meets(corners, point, light))
        })
    }

    /// Whether a free point, which has no surface of its own, is in shadow: the stored point is nearer to the light, and
    /// the point lies behind its triangle.
    pub fn shadows_free(
        &self,
        scene: &Scene,
        light: &Light,
        point: Vec3,
        tolerance: f32,
        texel: [usize; 2],
    ) -> bool {
        let light = light.center();
        let (to_light, _) = light.ray_from(point);
        self.occluder(scene, light, point, texel).is_some_and(|occluder| {
            (occluder.point - point).dot(to_light) > 0.0
                && is_behind(scene.corners(occluder.triangle), point, light, tolerance)
        })
    }
}
