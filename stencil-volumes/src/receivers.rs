//! Flat receivers: planes that hold a good part of an object's surface, a slab's six faces as well as a ground's one.
//!
//! A plane is found by its triangles: those of an object are sorted into cells by normal and distance, and the planes of cells
//! with much area are tried from the largest on, each against all triangles of the object. Only planes with at least 1/64 of the
//! object's area become receivers, so that a receiver's drawing is never paid for a facet of a curved surface, and no object
//! has more than 64.
//!
//! Where objects are named as planar receivers ([`ObjectFlags::planar`](scene_core::geometry::ObjectFlags), `planar_receivers` in a
//! scene file), these alone are taken, and of each its 64 largest planes, however small a share of it they are.

use std::collections::HashMap;

use glam::{DVec3, DVec4, Vec3};
use scene_core::geometry::Object;
use scene_core::{Light, Scene};

use crate::crossing::HomogeneousLight;

/// The share of the largest coordinate within which a point counts as on a plane: what a shadow ray's origin is lifted
/// by, for the same reasons ([`scene_core::bvh::shadow_origin`]).
const TOLERANCE: f64 = 1.0 / 2_097_152.0;

/// Planes of an object at most.
const MOST: usize = 64;

/// The share of an object's area that a plane needs to be a receiver, unless the object is named as one.
const SHARE: f64 = 1.0 / MOST as f64;

/// A flat receiver: (n, d) of n·x + d = 0, n of unit length and turned to the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// The object it is part of.
    pub object: u32,
    /// Its plane.
    pub plane: DVec4,
    /// Height of the light; a sine for a light at infinity.
    pub light_height: f64,
    /// Heights up to this are on the plane.
    pub tolerance: f64,
}

/// The flat receivers of a scene, and which triangle belongs to which.
#[derive(Clone, Debug, Default)]
pub struct FlatReceivers {
    /// Those with the light off their plane.
    pub receivers: Vec<Receiver>,
    /// Per triangle of the scene its place in `receivers`, or [`FlatReceivers::NONE`].
    pub of_triangle: Vec<u32>,
}

impl FlatReceivers {
    /// Of a triangle that is part of no flat receiver.
    pub const NONE: u32 = u32::MAX;

    /// The flat surfaces of objects that receive shadows, with the light off their plane; of the named ones alone, if any is.
    pub fn new(scene: &Scene, light: &Light) -> Self {
        let tolerance = f64::from(scene.bounds().magnitude()) * TOLERANCE;
        let homogeneous = HomogeneousLight::from(light.center());
        let l = homogeneous.point.extend(if homogeneous.at_infinity { 0.0 } else { 1.0 });
        let mut found =
            Self { receivers: Vec::new(), of_triangle: vec![Self::NONE; scene.triangles().len()] };
        let named = scene.objects().iter().any(|o| o.flags.planar);
        let objects = (0_u32..).zip(scene.objects());
        for (id, object) in objects.filter(|(_, o)| o.flags.receives && (o.flags.planar || !named)) {
            for (plane, triangles) in planes_of(scene, object, tolerance) {
                let height = plane.dot(l);
                let turned = if height < 0.0 { -plane } else { plane };
                let least = if homogeneous.at_infinity { 0.0 } else { tolerance };
                if height.abs() > least {
                    let index = found.receivers.len() as u32;
                    triangles.into_iter().for_each(|t| found.of_triangle[t] = index);
                    found.receivers.push(Receiver {
                        object: id,
                        plane: turned,
                        light_height: height.abs(),
                        tolerance,
                    });
                }
            }
        }
        found
    }
}

/// A triangle's normal, twice its area long, and its first corner.
fn normal_of(scene: &Scene, triangle: usize) -> (DVec3, DVec3) {
    let [a, b, c] = scene.corners(triangle).map(Vec3::as_dvec3);
    ((b - a).cross(c - a), a)
}

/// The planes of an object with [`SHARE`] of its area, or the [`MOST`] largest of a named one, and the triangles in each.
fn planes_of(scene: &Scene, object: &Object, tolerance: f64) -> Vec<(DVec4, Vec<usize>)> {
    /// Cells a unit of normal, and an extent of the object: a plane's triangles fall into a few neighbouring ones.
    const CELLS: f64 = 256.0;
    /// A plane that falls apart into as many cells as there are corners of a cell in four dimensions is still tried.
    const CORNERS: f64 = 16.0;
    let origin = object.bounds.center().as_dvec3();
    let extent = f64::from(object.bounds.diagonal()).max(f64::MIN_POSITIVE);
    let mut cells: HashMap<[i32; 4], (f64, usize, f64)> = HashMap::new();
    let mut total = 0.0;
    for triangle in object.triangles.clone() {
        let (normal, a) = normal_of(scene, triangle);
        let area = normal.length();
        let Some(unit) = normal.try_normalize() else { continue };
        let unit = if (unit.x, unit.y, unit.z) < (0.0, 0.0, 0.0) { -unit } else { unit };
        let place = unit.extend(unit.dot(a - origin) / extent) * CELLS;
        let key = place.to_array().map(|x| x.floor() as i32);
        total += area;
        let cell = cells.entry(key).or_insert((0.0, triangle, 0.0));
        cell.0 += area;
        // The largest triangle has the best normal.
        if area > cell.2 {
            (cell.1, cell.2) = (triangle, area);
        }
    }
    let share = if object.flags.planar { 0.0 } else { SHARE };
    let mut seeds: Vec<_> = cells.into_values().filter(|cell| cell.0 >= total * share / CORNERS).collect();
    seeds.sort_by(|x, y| y.2.total_cmp(&x.2).then(x.1.cmp(&y.1)));
    if object.flags.planar {
        // Each is tried against all triangles; those that are left have smaller ones than any of these.
        seeds.truncate(MOST * CORNERS as usize);
    }
    let mut taken = vec![false; object.triangles.len()];
    let mut planes = Vec::new();
    for (_, seed, _) in seeds {
        if taken[seed - object.triangles.start] {
            continue;
        }
        let (normal, a) = normal_of(scene, seed);
        let Some(normal) = normal.try_normalize() else { continue };
        let plane = normal.extend(-normal.dot(a));
        let on_plane = |p: Vec3| plane.dot(p.as_dvec3().extend(1.0)).abs() <= tolerance;
        let first = object.triangles.start;
        let triangles: Vec<usize> = object
            .triangles
            .clone()
            .filter(|&t| !taken[t - first] && scene.corners(t).into_iter().all(on_plane))
            .collect();
        let area: f64 = triangles.iter().map(|&t| normal_of(scene, t).0.length()).sum();
        if area >= total * share && area > 0.0 {
            triangles.iter().for_each(|&t| taken[t - first] = true);
            planes.push((area, plane, triangles));
        }
    }
    planes.sort_by(|x, y| y.0.total_cmp(&x.0));
    planes.truncate(MOST);
    planes.into_iter().map(|(_, plane, triangles)| (plane, triangles)).collect()
}

#[cfg(test)]
mod tests {
    use scene_core::scenes;

    use super::*;

    #[test]
    fn a_slab_has_its_faces_and_a_ball_none() {
        let setup = scenes::build("cornell", 0.0).unwrap();
        let light = Light::Directional { direction: Vec3::new(0.3, -1.0, 0.2), angular_radius: 0.0 };
        let found = FlatReceivers::new(&setup.scene, &light);
        // Of flat faces alone: each triangle is part of one, and lies in its plane.
        for (triangle, &index) in found.of_triangle.iter().enumerate() {
            let receiver = found.receivers[index as usize];
            for corner in setup.scene.corners(triangle) {
                assert!(receiver.plane.dot(corner.as_dvec3().extend(1.0)).abs() <= receiver.tolerance);
            }
        }
        let ball = scenes::build("ball", 0.0).unwrap().scene;
        let found = FlatReceivers::new(&ball, &light);
        let (largest, _) =
            (0_u32..).zip(ball.objects()).max_by_key(|(_, object)| object.triangles.len()).unwrap();
        assert!(!found.receivers.is_empty(), "the ground");
        assert!(found.receivers.iter().all(|receiver| receiver.object != largest), "no facet of the ball");
    }

    #[test]
    fn named_receivers_are_taken_alone() {
        let light = Light::Directional { direction: Vec3::new(0.3, -1.0, 0.2), angular_radius: 0.0 };
        let mut scene = scenes::build("cornell", 0.0).unwrap().scene;
        let all = FlatReceivers::new(&scene, &light).receivers;
        let name = scene.objects()[all[0].object as usize].name.clone();
        assert!(scene.mark_planar(&name) > 0 && scene.mark_planar("nobody") == 0);
        let named = FlatReceivers::new(&scene, &light).receivers;
        let expected: Vec<_> =
            all.iter().filter(|r| scene.objects()[r.object as usize].name == name).copied().collect();
        assert!(named == expected && named.len() < all.len(), "{named:?}");
        // A ball that is named has facets, the largest ones.
        let mut ball = scenes::build("ball", 0.0).unwrap().scene;
        let largest = ball.objects().iter().max_by_key(|object| object.triangles.len()).unwrap().name.clone();
        ball.mark_planar(&largest);
        let facets = FlatReceivers::new(&ball, &light).receivers;
        assert_eq!(facets.len(), MOST);
    }
}
