//! Meshes and scenes to draw.

use glam::{Affine3A, Mat4, Vec2, Vec3};
use gnomon_scene_core::geometry::ObjectFlags;
use gnomon_scene_core::{Camera, Scene, TriangleMesh};

/// A scene of one object.
pub(crate) fn scene_of(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Scene {
    let mut scene = Scene::new();
    add(&mut scene, positions, triangles);
    scene
}

/// Adds one object that casts and receives.
pub(crate) fn add(scene: &mut Scene, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) {
    let mesh = TriangleMesh::new("mesh", positions, triangles);
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a valid mesh");
}

/// A closed mesh: a ball of `slices` × `stacks` facets whose radius is scaled by the noise, so that it folds over
/// itself as seen from outside. Corners run counter-clockwise from outside where the noise is 1.
pub(crate) fn blob(slices: u32, stacks: u32, noise: impl Fn(u32, u32) -> f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut positions = vec![Vec3::Y * noise(0, 0), Vec3::NEG_Y * noise(0, stacks)];
    for stack in 1..stacks {
        for slice in 0..slices {
            let theta = std::f32::consts::PI * stack as f32 / stacks as f32;
            let phi = std::f32::consts::TAU * slice as f32 / slices as f32;
            let unit = Vec3::new(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin());
            positions.push(unit * noise(slice, stack));
        }
    }
    let at = |slice: u32, stack: u32| match stack {
        0 => 0,
        s if s == stacks => 1,
        s => 2 + (s - 1) * slices + slice % slices,
    };
    let mut triangles = Vec::new();
    for stack in 0..stacks {
        for slice in 0..slices {
            let [a, b] = [at(slice, stack), at(slice + 1, stack)];
            let [c, d] = [at(slice, stack + 1), at(slice + 1, stack + 1)];
            if stack + 1 < stacks {
                triangles.push([a, c, d]);
            }
            if stack > 0 {
                triangles.push([a, d, b]);
            }
        }
    }
    (positions, triangles)
}

/// A number in [0, 1) from a seed.
pub(crate) fn hash(seed: u64) -> f32 {
    let mut x = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ (x >> 31)) >> 40) as f32 / (1 << 24) as f32
}

/// A camera in front of the unit ball.
pub(crate) fn camera(width: u32, height: u32) -> Camera {
    Camera {
        eye: Vec3::new(0.7, 0.9, 3.1),
        target: Vec3::new(0.05, -0.02, 0.0),
        up: Vec3::Y,
        fov_y: 0.8,
        near: 0.1,
        far: 50.0,
        width,
        height,
    }
}

/// An orthographic projection that maps the pixel square [0, size]² (y down) of the plane onto the target, z to
/// reversed depth as it is.
pub(crate) fn pixel_space(size: u32) -> Mat4 {
    let size = size as f32;
    Mat4::from_scale_rotation_translation(
        Vec3::new(2.0 / size, -2.0 / size, 1.0),
        glam::Quat::IDENTITY,
        Vec3::new(-1.0, 1.0, 0.0),
    )
}

/// A point of pixel space at depth `z`.
pub(crate) fn flat(p: Vec2, z: f32) -> Vec3 {
    p.extend(z)
}
