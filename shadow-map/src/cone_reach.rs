//! Where `pcss` looks for receivers that a camera sees: bounds of the texels between them and a light of some extent.
//!
//! *Infinitely far lights.* A cone ends where the map's depths do, at its casters' nearest. The cone's rim there is affine in
//! the receiver, so that of the receivers' corners bounds all of them. The pyramid of nearest depths answers by cells of a power of two,
//! so a window goes to the borders of the largest cell that is asked: then each number that is read is that of a map of all.
//!
//! *Faces of a cube.* Let every surface be r or farther from the light's centre c, and every point of the light R or nearer. A
//! place that is looked up is x = p + t·(s − p), p the receiver and s a point of the light. Only t of stored points q that block are
//! taken, on lines of the same kind: r ≤ |q − c| ≤ (1 − t)·|p − c| + R, so |x − c| ≥ (1 − t)·|p − c| − R ≥ r − 2R. From the line between p
//! and c it is R away at most, and lies in a direction from c less than asin(R/(r − 2R)) from the receiver's. What is stored
//! farther to the side is in no cone, and counts neither in the search nor in the filter.
//!
//! The receiver's own texel may stand in for blockers without being in the cone: half a texel's diagonal beside p's direction, up to
//! √2/size·|q − c|. On a light seen at the angle γ from its plane that moves t by as much over sin γ. With sin γ ≥ 1/8, which is asked
//! for, r(1 − 12/size) − 2R takes the place of r − 2R.

use glam::{DVec3, Vec3};
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::relevance::{HalfSpace, Receivers};
use scene_core::{Light, Scene};

use crate::light_cone::LightCone;
use crate::light_maps::Window;
use crate::light_views::LightView;
use crate::view_casters::window_within;

/// The texels of a lone view of a sun that are read for `receivers`. `None` for other lights.
pub(crate) fn read_texels(
    view: &LightView,
    light: &Light,
    receivers: &Receivers,
    map_size: u32,
) -> Option<Window> {
    let Light::Directional { .. } = light else { return None };
    let cone = LightCone::new(light, Vec3::ZERO)?;
    let depth = view.projection_from_world.as_dmat4().row(2);
    let [u, v, w] = [cone.u, cone.v, cone.w].map(Vec3::as_dvec3);
    let rims = |point: DVec3| {
        let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)];
        let rim = corners.map(|(a, b)| {
            let direction = w + u * a + v * b;
            let t = (1.0 - depth.truncate().dot(point) - depth.w) / depth.truncate().dot(direction);
            // What is above all casters has no cone.
            point + direction * t.max(0.0)
        });
        [point, rim[0], rim[1], rim[2], rim[3]]
    };
    // A lookup is moved within a texel.
    let window_of = |points: &mut dyn Iterator<Item = DVec3>| window_within(view, points, map_size, 1.0);
    let window = window_of(&mut receivers.region().vertices().flat_map(rims));
    // Rectangles of one receiver are asked, whose sides are convex in it.
    let sides = receivers.region().vertices().map(|point| window_of(&mut rims(point).into_iter()));
    let extent = sides.flatten().map(|side| side.end - side.start).max().unwrap_or(0);
    let cell = 1u32.checked_shl(u32::BITS - extent.leading_zeros())?;
    Some(window.map(|side| side.start / cell * cell..side.end.next_multiple_of(cell).min(map_size)))
}

/// The greatest sine of the angle between the directions of a receiver and of what is looked up for it, from the centre of a light in
/// `scene`; `None` where there is no bound.
pub(crate) fn sine_beside(scene: &Scene, light: &Light, receivers: &Receivers, map_size: u32) -> Option<f64> {
    let LightPoint::At(center) = light.center() else { return None };
    let radius = match *light {
        // From two radii or farther a sphere's silhouette, brought to the centre's distance, is at most 2/√3 of it.
        Light::Sphere { radius, .. } => f64::from(radius) * 1.155,
        Light::Disk { normal, radius, .. } => {
            is_seen_from_before(receivers, center, normal).then(|| f64::from(radius))?
        }
        Light::Rect { half_u, half_v, .. } => {
            is_seen_from_before(receivers, center, half_u.cross(half_v).normalize_or_zero())
                .then(|| f64::from(half_u.length()) + f64::from(half_v.length()))?
        }
        _ => return None,
    };
    let nearest = nearest_surface(scene, center);
    let least = nearest * (1.0 - 12.0 / f64::from(map_size.max(1))) - 2.0 * radius;
    (least > 0.0).then(|| radius / least)
}

/// The sides of all receivers that are looked up in one face of a cube: the face's, turned outwards by the angle of that sine
/// and by three texels, one for a lookup's place in its texel and two for the receiver's and for rounding. `None` where that is about as
/// wide as half of space.
///
/// A direction d in the face has |x| ≤ w on both axes. One at the angle a beside it has x − w ≤ √2·sin a·|d| and, all within k·w,
/// |d| ≤ √(1 + 2k²)·w: so k = 1 + √2·sin a·√(1 + 2k²), which is solved here.
pub(crate) fn looked_up_in(view: &LightView, sine: f64, map_size: u32) -> Option<Vec<HalfSpace>> {
    let sine = sine + 6.0 / f64::from(map_size.max(1));
    let square = sine * sine;
    (sine < 0.4).then(|| {
        let times = (1.0 + sine * (6.0 - 8.0 * square).sqrt()) / (1.0 - 4.0 * square);
        view.sides(times, 0.0)
    })
}

/// Whether the light's plane is seen at an angle of sine 1/8 or more, from one side, by all receivers.
fn is_seen_from_before(receivers: &Receivers, center: Vec3, normal: Vec3) -> bool {
    let (center, normal) = (center.as_dvec3(), normal.as_dvec3());
    let heights = || receivers.region().vertices().map(|point| normal.dot(point - center));
    let (least, most) = heights().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), h| (a.min(h), b.max(h)));
    let height = least.max(-most);
    height.is_finite() && height * 8.0 >= receivers.farthest_from(center.as_vec3())
}

/// At most the distance from `center` of the nearest triangle: of its box and of its plane the farther one. Seen surfaces count, too.
fn nearest_surface(scene: &Scene, center: Vec3) -> f64 {
    let center = center.as_dvec3();
    let of_box = |bounds: &Aabb| {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        center.distance(center.clamp(min, max))
    };
    let mut objects: Vec<_> = scene.objects().iter().map(|object| (of_box(&object.bounds), object)).collect();
    objects.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut nearest = f64::INFINITY;
    for (distance, object) in objects {
        if distance >= nearest {
            break;
        }
        for triangle in object.triangles.clone() {
            let corners = scene.corners(triangle);
            let of_bounds = of_box(&Aabb::from_points(corners));
            if of_bounds < nearest {
                let [a, b, c] = corners.map(Vec3::as_dvec3);
                let of_plane = (b - a).cross(c - a).normalize_or_zero().dot(center - a).abs();
                nearest = nearest.min(of_bounds.max(of_plane));
            }
        }
    }
    // Positions are exact, and what is above is rounded by a few 2⁻⁵³.
    nearest * (1.0 - 1e-9)
}
