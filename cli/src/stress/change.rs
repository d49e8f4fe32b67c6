//! Changes of a scene that leave its image as it is: a similarity, or the same surfaces in other triangles.

use glam::{Affine3A, Vec3};
use scene_core::geometry::SceneError;
use scene_core::{Light, Scene, SceneSetup, TriangleMesh};

/// Everything times `scale`, then moved by `offset`.
pub(crate) fn similarity(setup: &SceneSetup, scale: f32, offset: Vec3) -> Result<SceneSetup, SceneError> {
    let place = |point: Vec3| point * scale + offset;
    let mut changed = rebuilt(setup, |_, mesh| {
        for position in &mut mesh.positions {
            *position = place(*position);
        }
    })?;
    let camera = &mut changed.camera;
    (camera.eye, camera.target) = (place(camera.eye), place(camera.target));
    (camera.near, camera.far) = (camera.near * scale, camera.far * scale);
    for light in &mut changed.lights {
        *light = match *light {
            light @ Light::Directional { .. } => light,
            Light::Point { position } => Light::Point { position: place(position) },
            Light::Spot { position, direction, outer, inner } => {
                Light::Spot { position: place(position), direction, outer, inner }
            }
            Light::Sphere { center, radius } => {
                Light::Sphere { center: place(center), radius: radius * scale }
            }
            Light::Rect { center, half_u, half_v } => {
                Light::Rect { center: place(center), half_u: half_u * scale, half_v: half_v * scale }
            }
            Light::Disk { center, normal, radius } => {
                Light::Disk { center: place(center), normal, radius: radius * scale }
            }
        };
    }
    Ok(changed)
}

/// Every object's mesh as `edit` leaves it; `edit` is told the object's number.
pub(crate) fn rebuilt(
    setup: &SceneSetup,
    edit: impl Fn(usize, &mut TriangleMesh),
) -> Result<SceneSetup, SceneError> {
    let mut scene = Scene::new();
    for (number, object) in setup.scene.objects().iter().enumerate() {
        let first = object.vertices.start as u32;
        let mut mesh = TriangleMesh::new(
            object.name.clone(),
            setup.scene.positions()[object.vertices.clone()].to_vec(),
            setup.scene.triangles()[object.triangles.clone()].iter().map(|t| t.map(|i| i - first)).collect(),
        );
        if let Some(mask) = &object.alpha {
            mesh.uvs = setup.scene.uvs()[object.vertices.clone()].to_vec();
            mesh.alpha = Some(mask.clone());
        }
        edit(number, &mut mesh);
        scene.add(&mesh, Affine3A::IDENTITY, object.flags)?;
    }
    Ok(SceneSetup { scene, ..setup.clone() })
}

/// Every triangle twice.
pub(crate) fn duplicated(mesh: &mut TriangleMesh) {
    mesh.triangles.extend_from_within(..);
}

/// Every second triangle wound the other way.
pub(crate) fn inverted(mesh: &mut TriangleMesh) {
    for triangle in mesh.triangles.iter_mut().step_by(2) {
        triangle.swap(1, 2);
    }
}

/// A triangle without area at every triangle.
pub(crate) fn degenerate(mesh: &mut TriangleMesh) {
    let flat: Vec<_> = mesh.triangles.iter().map(|&[a, b, _]| [a, b, a]).collect();
    mesh.triangles.extend(flat);
}

/// Every triangle cut in two from a corner to a point of the other side near its end: one half is a needle. The point is
/// rounded, so the halves may leave the triangle's plane by an ulp.
pub(crate) fn needles(mesh: &mut TriangleMesh) {
    if mesh.alpha.is_some() {
        return;
    }
    for i in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.triangles[i];
        let [from, to] = [b, c].map(|corner| mesh.positions[corner as usize]);
        let cut = mesh.positions.len() as u32;
        mesh.positions.push(from.lerp(to, 1.0 / 4096.0));
        mesh.triangles[i] = [a, cut, c];
        mesh.triangles.push([a, b, cut]);
    }
}

/// On every triangle the one of its sides' middles, in the same plane but for an ulp: two surfaces in one place.
pub(crate) fn overlapping(mesh: &mut TriangleMesh) {
    if mesh.alpha.is_some() {
        return;
    }
    for i in 0..mesh.triangles.len() {
        let corners = mesh.triangles[i].map(|corner| mesh.positions[corner as usize]);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([0, 1, 2].map(|side| corners[side].midpoint(corners[(side + 1) % 3])));
        mesh.triangles.push([first, first + 1, first + 2]);
    }
}

/// A fin without width on every triangle: its first side is shared by a third face, which has no area to throw a shadow with.
pub(crate) fn finned(mesh: &mut TriangleMesh) {
    if mesh.alpha.is_some() {
        return;
    }
    for i in 0..mesh.triangles.len() {
        let [a, b, _] = mesh.triangles[i];
        let tip = mesh.positions.len() as u32;
        mesh.positions.push(mesh.positions[a as usize].midpoint(mesh.positions[b as usize]));
        mesh.triangles.push([b, a, tip]);
    }
}
