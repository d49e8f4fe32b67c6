//! Flat receivers: planes that hold a good part of an object's surface, a slab's six faces as well as a ground's one.
//!
//! A plane is found by its triangles: those of an object are sorted into cells by normal and distance, and the planes of cells
//! with much area are tried from the largest on, each against all triangles of the object. Only planes with at least 1/64 of the
//! object's area become receivers, so that a receiver's drawing is never paid for a facet of a curved surface, and no object
//! has more than 64.

use std::collections::HashMap;

use glam::{DVec3, DVec4, Vec3};
use scene_core::geometry::Object;
use scene_core::{Light, Scene};

use crate::crossing::HomogeneousLight;

/// The share of the largest coordinate within which a point counts as on a plane: what a shadow ray's origin is lifted
/// by, for the same reasons ([`scene_core::bvh::shadow_origin`]).
const TOLERANCE: f64 = 1.0 / 2_097_152.0;

/// The share of an object's area that a plane needs to be a receiver.
const SHARE: f64 = 1.0 / 64.0;

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

    /// The flat surfaces of objects that receive shadows, with the light off their plane.
    pub fn new(scene: &Scene, light: &Light) -> Self {
        let tolerance = f64::from(scene.bounds().magnitude()) * TOLERANCE;
        let homogeneous = HomogeneousLight::from(light.center());
        let l = homogeneous.point.extend(if homogeneous.at_infinity { 0.0 } else { 1.0 });
        let mut found =
            Self { receivers: Vec::new(), of_triangle: vec![Self::NONE; scene.triangles().len()] };
        let objects = (0_u32..).zip(scene.objects()).filter(|(_, o)| o.flags.receives);
        for (id, object) in objects {
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

/// The planes of an object with [`SHARE`] of its area, and the triangles in each.
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
    let mut seeds: Vec<_> = cells.into_values().filter(|cell| cell.0 >= total * SHARE / CORNERS).collect();
    seeds.sort_by(|x, y| y.2.total_cmp(&x.2).then(x.1.cmp(&y.1)));
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
        if area >= total * SHARE && area > 0.0 {
            triangles.iter().for_each(|&t| taken[t - first] = true);
            planes.push((plane, triangles));
        }
    }
    planes
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
}
