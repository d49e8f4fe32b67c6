//! Which casters are solid: closed surfaces, whose inside a line to the light cannot pass.
//!
//! The boundary of a surface is the sum of its faces' directed edges, an edge and its reverse cancelling each other. Where it is
//! zero the surface is closed: every point beside it is wound around a whole number of times. Along a ray from the light that number
//! grows by one with each front face and falls with each back face, so from a front face that the light sees to the nearest back
//! face of any closed surface it is one at least: all between is inside.
//!
//! The sum is taken of random numbers in the place of edges, modulo 2⁶⁴. A surface that is open passes with a chance of 2⁻⁶⁴, give or
//! take what a mixing function of 64 bits falls short of a random one.

use glam::Vec3;
use rayon::prelude::*;
use scene_core::geometry::Object;
use scene_core::{Scene, splitmix};

/// Faces that are summed by one task.
const RUN: usize = 4096;

/// Whether an object is closed and nothing is cut out of it. Vertices at one place are one.
pub fn is_solid(scene: &Scene, object: &Object) -> bool {
    if object.alpha.is_some() || object.triangles.is_empty() {
        return false;
    }
    let faces = scene.triangles().get(object.triangles.clone()).unwrap_or_default();
    let boundary = |run: &[[u32; 3]]| {
        run.iter().fold(0u64, |sum, corners| {
            let [a, b, c] = corners.map(|vertex| name(scene.positions()[vertex as usize]));
            sum.wrapping_add(edge(a, b)).wrapping_add(edge(b, c)).wrapping_add(edge(c, a))
        })
    };
    faces.par_chunks(RUN).map(boundary).reduce(|| 0, u64::wrapping_add) == 0
}

/// A number for a place; zeros of both signs are one place.
fn name(place: Vec3) -> u64 {
    let [x, y, z] = (place + Vec3::ZERO).to_array().map(|at| u64::from(at.to_bits()));
    splitmix::hash(splitmix::hash(x << 32 | y) ^ z)
}

/// A number for a directed edge: that of its reverse, negated.
fn edge(from: u64, to: u64) -> u64 {
    match from.cmp(&to) {
        std::cmp::Ordering::Less => splitmix::hash(from ^ to.rotate_left(32)),
        std::cmp::Ordering::Equal => 0,
        std::cmp::Ordering::Greater => splitmix::hash(to ^ from.rotate_left(32)).wrapping_neg(),
    }
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;
    use scene_core::geometry::{ObjectFlags, TriangleMesh};

    use super::*;

    /// A tetrahedron's outward faces.
    const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

    fn solid(faces: &[[u32; 3]]) -> bool {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, -Vec3::ZERO];
        let mut scene = Scene::new();
        let mesh = TriangleMesh::new("t", corners, faces.to_vec());
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        is_solid(&scene, &scene.objects()[0])
    }

    #[test]
    fn closed_surfaces_are_solid_and_open_or_turned_ones_are_not() {
        assert!(solid(&FACES));
        // Another vertex at the same place.
        assert!(solid(&[[4, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]));
        assert!(!solid(&FACES[..3]));
        let mut turned = FACES;
        turned[1].swap(0, 1);
        assert!(!solid(&turned));
        // A sheet of two sides encloses nothing, and is closed all the same.
        assert!(solid(&[[0, 1, 2], [0, 2, 1]]));
        assert!(!solid(&[]));
    }
}
