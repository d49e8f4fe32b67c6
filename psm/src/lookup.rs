//! Whether a receiver is in shadow by what the texels around it keep: the triangles that the light sees at their centres.
//!
//! # Surfaces
//! What a texel keeps is known at its centre, and the receiver lies beside that. So the surface that each of the nine texels around
//! shows is followed to the receiver's own ray ([`follow`](crate::follow)): a triangle that the ray meets before the light shadows
//! it, beyond any doubt, and outlines of shadows are the mesh's. What is left to texels is what none of their centres sees. Where
//! the receiver's own texel shows a surface that ends before its ray, that surface is no shadow, but it may be a leaf of many
//! of which the next goes unseen: if all of it would find room within the nine texels, most of them decide.
//!
//! # One texel
//! By the questions of [`gnomon_shadow_map::receiver_plane`]: they need no bias, and no depth. The stored point is where the texel's
//! ray meets its triangle's plane, so nothing here knows how depths are spread in a warped map. What the paper leaves to the user,
//! an offset in post-perspective depth, does not exist.

use glam::{DVec3, Vec3};
use gnomon_shadow_map::light_maps::Receiver;
use gnomon_shadow_map::receiver_plane::{is_behind, is_near, meets, plane_tolerance, rises_above};
use scene_core::geometry::{Aabb, Surfaces};
use scene_core::light::LightPoint;
use scene_core::raster::DEPTH_POSITION_ERROR;
use scene_core::{GBuffer, Light, Scene};

use crate::PsmMap;
use crate::follow::{Followed, follow};

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

/// What the map of a light shows.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its surfaces, where they are to be followed.
    pub surfaces: Option<&'a Surfaces>,
    /// The light's centre.
    pub light: LightPoint,
}

/// The texels around one, nearest first.
const AROUND: [[i32; 2]; 8] = [[-1, 0], [1, 0], [0, -1], [0, 1], [-1, -1], [1, -1], [-1, 1], [1, 1]];

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
    pub fn occluder(&self, seen: &Surroundings<'_>, point: Vec3, texel: [usize; 2]) -> Option<Occluder> {
        let ([column, row], light) = (texel, seen.light);
        let triangle = self.triangle(texel);
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
        let [a, b, c] = seen.scene.corners(triangle as usize).map(Vec3::as_dvec3);
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

    /// Whether `receiver`, which falls into `texel`, is in shadow: by the surfaces that the texels around it show, or without them by
    /// the one texel.
    #[inline]
    pub fn shadows(&self, seen: &Surroundings<'_>, receiver: &Receiver, texel: [usize; 2]) -> bool {
        let asked = (receiver.point, receiver.tolerance);
        self.shadows_by(seen, asked, texel, |texel| self.shadowing(seen, receiver, texel))
    }

    /// Whether a free point, which has no surface of its own, is in shadow.
    pub fn shadows_free(&self, seen: &Surroundings<'_>, asked: (Vec3, f32), texel: [usize; 2]) -> bool {
        self.shadows_by(seen, asked, texel, |texel| self.shadowing_free(seen, asked, texel))
    }

    /// The order of questions for both. `ask` asks one texel for what shadows.
    #[inline]
    fn shadows_by(
        &self,
        seen: &Surroundings<'_>,
        asked: (Vec3, f32),
        texel: [usize; 2],
        ask: impl Fn([usize; 2]) -> Option<Occluder>,
    ) -> bool {
        let Some(surfaces) = seen.surfaces else { return ask(texel).is_some() };
        let own = self.triangle(texel);
        let own_leads = match own {
            GBuffer::NOTHING => Followed::InFront,
            _ => follow(seen.scene, surfaces, own, asked, seen.light),
        };
        if own_leads == Followed::Shadows {
            return true;
        }
        let mut last = own;
        for around in AROUND {
            let triangle = self.triangle(self.beside(texel, around));
            if triangle == GBuffer::NOTHING || triangle == own || triangle == last {
                continue;
            }
            last = triangle;
            if follow(seen.scene, surfaces, triangle, asked, seen.light) == Followed::Shadows {
                return true;
            }
        }
        // Nothing that is seen shadows it but, maybe, what goes on unseen between the texels.
        if own_leads == Followed::InFront {
            return false;
        }
        let Some(occluder) = ask(texel) else { return false };
        if own_leads == Followed::Lost {
            return true;
        }
        // A surface larger than the texels around ends where it is seen to end. One that is smaller may have others beside it, as leaves
        // have, of which no texel's centre sees all: then the texels are asked how many of them are dark.
        if surfaces.of(own as usize).extent >= 3.0 * occluder.texel {
            return false;
        }
        let dark = AROUND.iter().filter(|around| ask(self.beside(texel, **around)).is_some()).count();
        // With its own texel most of nine.
        dark >= AROUND.len() / 2
    }

    /// The triangle that a texel keeps.
    #[inline]
    fn triangle(&self, [column, row]: [usize; 2]) -> u32 {
        self.triangles[row * self.size as usize + column]
    }

    /// The texel beside another; at the map's border that one itself.
    #[inline]
    fn beside(&self, texel: [usize; 2], around: [i32; 2]) -> [usize; 2] {
        let last = self.size as usize - 1;
        [0, 1].map(|i| texel[i].saturating_add_signed(around[i] as isize).min(last))
    }

    /// What `texel` keeps, if it shadows `receiver`.
    #[inline]
    fn shadowing(&self, seen: &Surroundings<'_>, receiver: &Receiver, texel: [usize; 2]) -> Option<Occluder> {
        let Receiver { point, normal, tolerance, .. } = *receiver;
        self.occluder(seen, point, texel).filter(|occluder| {
            let corners = seen.scene.corners(occluder.triangle);
            let snapping = occluder.texel * DEPTH_POSITION_ERROR;
            rises_above(occluder.point, point, normal, tolerance + snapping)
                && is_behind(corners, point, seen.light, tolerance)
                // What is known of the distance is better than half a diagonal of the texel.
                && (!is_near(occluder.point, point, normal, seen.light, 2.0 * occluder.aside + snapping)
                    || meets(corners, point, seen.light))
        })
    }

    /// The same for a free point: the stored point is nearer to the light, and the point lies behind its triangle.
    fn shadowing_free(
        &self,
        seen: &Surroundings<'_>,
        (point, tolerance): (Vec3, f32),
        texel: [usize; 2],
    ) -> Option<Occluder> {
        let (to_light, _) = seen.light.ray_from(point);
        self.occluder(seen, point, texel).filter(|occluder| {
            (occluder.point - point).dot(to_light) > 0.0
                && is_behind(seen.scene.corners(occluder.triangle), point, seen.light, tolerance)
        })
    }
}
