//! Variants that add layers up, on meshes as users have them: the same surfaces in other triangles give the same image.

mod truth;

use glam::Vec3;
use gnomon_penumbra_wedges::{Variant, WedgeParams};
use scene_core::{Scene, TriangleMesh, scenes};
use truth::{scene_of, shade};

/// Every object's mesh as `edit` leaves it.
fn edited(scene: &Scene, edit: impl Fn(&mut TriangleMesh)) -> Scene {
    let meshes: Vec<TriangleMesh> = scene
        .objects()
        .iter()
        .map(|object| {
            let first = object.vertices.start as u32;
            let triangles = &scene.triangles()[object.triangles.clone()];
            let mut mesh = TriangleMesh::new(
                object.name.clone(),
                scene.positions()[object.vertices.clone()].to_vec(),
                triangles.iter().map(|t| t.map(|i| i - first)).collect(),
            );
            edit(&mut mesh);
            mesh
        })
        .collect();
    scene_of(&meshes)
}

/// Every triangle cut in two, from a corner to a point of the other side.
fn cut(mesh: &mut TriangleMesh, at: f32) {
    for i in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.triangles[i];
        let place = mesh.positions[b as usize].lerp(mesh.positions[c as usize], at);
        let new = mesh.positions.len() as u32;
        mesh.positions.push(place);
        mesh.triangles[i] = [a, new, c];
        mesh.triangles.push([a, b, new]);
    }
}

/// On every triangle the one of its sides' middles.
fn patch(mesh: &mut TriangleMesh) {
    for i in 0..mesh.triangles.len() {
        let corners = mesh.triangles[i].map(|corner| mesh.positions[corner as usize]);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([0, 1, 2].map(|side| corners[side].midpoint(corners[(side + 1) % 3])));
        mesh.triangles.push([first, first + 1, first + 2]);
    }
}

/// A third face without width at the first side of every triangle.
fn fin(mesh: &mut TriangleMesh) {
    for i in 0..mesh.triangles.len() {
        let [a, b, _] = mesh.triangles[i];
        let tip = mesh.positions.len() as u32;
        mesh.positions.push(mesh.positions[a as usize].midpoint(mesh.positions[b as usize]));
        mesh.triangles.push([b, a, tip]);
    }
}

/// What leaves the surfaces where they are, up to rounding.
const EDITS: [Edit; 4] = [
    ("cut in thirds", |mesh| cut(mesh, 1.0 / 3.0)),
    ("needles", |mesh| cut(mesh, 1.0 / 4096.0)),
    ("patches", patch),
    ("fins", fin),
];

/// A name and what is done to each mesh.
type Edit = (&'static str, fn(&mut TriangleMesh));

/// Pixels that differ by more than 1/255, and seen pixels.
fn differing(spec: &str, variant: Variant, edit: impl Fn(&mut TriangleMesh)) -> (usize, usize) {
    let setup = scenes::build(spec, 0.0).expect("a built-in scene");
    let camera = setup.camera.with_size(80, 60);
    let params = WedgeParams { variant, ..Default::default() };
    let image = |scene: &Scene| shade(scene, &setup.lights[0], &camera, params).1.values;
    let (clean, messy) = (image(&edited(&setup.scene, |_| {})), image(&edited(&setup.scene, edit)));
    let seen = clean.iter().filter(|v| !v.is_nan()).count();
    let differ = clean.iter().zip(&messy).filter(|(a, b)| (*a - *b).abs() > 1.0 / 255.0).count();
    (differ, seen)
}

#[test]
fn triangles_twice_or_wound_otherwise_change_nothing() {
    for variant in [Variant::Interpolated, Variant::Coverage] {
        for spec in ["ball", "knot", "quads", "log-cabin"] {
            let twice = differing(spec, variant, |mesh| mesh.triangles.extend_from_within(..));
            let wound = differing(spec, variant, |mesh| {
                mesh.triangles.iter_mut().step_by(2).for_each(|t| t.swap(1, 2));
            });
            println!("{spec}, {variant:?}: {twice:?} twice, {wound:?} wound the other way");
            assert_eq!((twice.0, wound.0), (0, 0), "{spec}, {variant:?}");
        }
    }
}

/// What is cut differs by the rounding of the cuts: an edge's place moves by 2⁻²¹ of a coordinate, its share by much less than 1/255;
/// pixels beside a corner that is moved may see it before or behind them, which no more than a pixel in a thousand does.
#[test]
fn cuts_patches_and_fins_change_nothing_for_coverage() {
    for spec in ["ball", "knot", "quads", "log-cabin"] {
        for (what, edit) in EDITS {
            let (differ, seen) = differing(spec, Variant::Coverage, edit);
            println!("{spec}, {what}: {differ} of {seen}");
            assert!(seen > 1000 && differ * 1000 <= seen, "{spec}, {what}: {differ} of {seen}");
        }
    }
}

#[test]
fn a_sheet_more_is_a_layer_more() {
    // What the tests above could not see: a surface that is really there does count.
    let (differ, seen) = differing("ball", Variant::Coverage, |mesh| {
        let lifted: Vec<Vec3> = mesh.positions.iter().map(|p| *p + Vec3::Y * 0.05).collect();
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(lifted);
        let copies: Vec<_> = mesh.triangles.iter().map(|t| t.map(|i| i + first)).collect();
        mesh.triangles.extend(copies);
    });
    assert!(differ * 50 > seen, "{differ} of {seen}");
}
