//! Plants with real leaves: each leaf is geometry, so that shadows need no mask.

use glam::{Quat, Vec2, Vec3};

use super::random::Random;
use super::shapes::{merged, tube};
use crate::TriangleMesh;

/// What a tree is like. Lengths in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tree {
    /// From the ground to the top, about.
    pub(super) height: f32,
    /// Radius of the trunk at the ground.
    pub(super) radius: f32,
    /// Height of the first branches, relative to the height.
    pub(super) bare: f32,
    /// Leaves; each makes two triangles.
    pub(super) leaves: u32,
    /// Length of a leaf.
    pub(super) leaf: f32,
}

/// A broad-leaved tree: a trunk, two orders of branches, leaves on the twigs.
pub(super) fn broadleaf(tree: Tree, random: &mut Random) -> TriangleMesh {
    let Tree { height, radius, bare, .. } = tree;
    let mut wood = Vec::new();
    let lean = random.square() * (0.05 * height);
    let trunk = |s: f32| Vec3::new(lean.x * s * s, height * 0.8 * s, lean.y * s * s);
    let path: Vec<_> = (0..6).map(|i| trunk(i as f32 / 5.0)).collect();
    let radii: Vec<_> = (0..6).map(|i| Vec2::splat(radius * (1.0 - 0.16 * i as f32))).collect();
    wood.push(tube(&path, &radii, Vec3::X, 8));

    let mut twigs = Vec::new();
    let limbs = 11;
    for i in 0..limbs {
        let share = (i as f32 + random.unit() * 0.5) / limbs as f32;
        let s = bare / 0.8 + (1.0 - bare / 0.8) * share;
        let angle = 2.399_963_1 * i as f32 + random.range(-0.3, 0.3);
        // The crown is a ball: limbs are longest in its middle, and rise towards its top.
        let length = height * (0.22 + 0.2 * (std::f32::consts::PI * (0.15 + 0.75 * share)).sin());
        let rise = 0.35 + 0.9 * share + random.range(-0.15, 0.15);
        let out = Vec3::new(angle.sin() * rise.cos(), rise.sin(), angle.cos() * rise.cos());
        let from = trunk(s.min(1.0));
        let limb = bent(from, out, length, 0.18 * length, 4);
        let thick = radius * 0.42 * (1.0 - 0.6 * share);
        wood.push(tube(&limb, &tapered(thick, 4), Vec3::Y, 5));
        let branches = 7;
        for k in 0..branches {
            let t = 0.3 + 0.7 * (k as f32 + random.unit()) / branches as f32;
            let from = along(&limb, t);
            let turn = Quat::from_axis_angle(out, random.angle());
            let aside = turn * out.any_orthonormal_vector();
            let direction = (out * 0.7 + aside * 0.8 + Vec3::Y * 0.15).normalize();
            let length = length * random.range(0.3, 0.5);
            let twig = bent(from, direction, length, 0.1 * length, 3);
            wood.push(tube(&twig, &tapered(thick * 0.3, 3), Vec3::Y, 3));
            twigs.push(twig);
        }
        twigs.push(limb);
    }
    let mut mesh = merged(wood);
    for i in 0..tree.leaves as usize {
        // Leaves sit around the outer part of a twig, on stalks of a few leaf lengths.
        let twig = &twigs[i % twigs.len()];
        let base = along(twig, random.range(0.25, 1.0));
        let spread = ball(random) * (tree.leaf * 2.6);
        let direction = (ball(random) + Vec3::new(0.0, -0.2, 0.0)).normalize_or(Vec3::X);
        leaf(&mut mesh, base + spread, direction, tree.leaf, random);
    }
    mesh
}

/// A conifer: a straight trunk and whorls of hanging branches, dense with needles in bunches.
pub(super) fn conifer(tree: Tree, random: &mut Random) -> TriangleMesh {
    let Tree { height, radius, bare, .. } = tree;
    let path = [0.0, 0.35, 0.7, 1.0].map(|s| Vec3::Y * (height * s));
    let radii = [1.0, 0.7, 0.36, 0.04].map(|s| Vec2::splat(radius * s));
    let mut wood = vec![tube(&path, &radii, Vec3::X, 7)];
    let mut boughs = Vec::new();
    let count = 60;
    for i in 0..count {
        let share = (i as f32 + random.unit()) / count as f32;
        let y = height * (bare + (0.97 - bare) * share);
        let length = height * 0.24 * (1.0 - share).powf(0.8) + 0.04 * height;
        let angle = 2.399_963_1 * i as f32;
        let droop = 0.25 - 0.35 * share;
        let out = Vec3::new(angle.sin(), -droop, angle.cos()).normalize();
        let bough = bent(Vec3::Y * y, out, length, -0.12 * length, 3);
        wood.push(tube(&bough, &tapered(radius * 0.16 * (1.1 - share), 3), Vec3::Y, 3));
        boughs.push(bough);
    }
    let mut mesh = merged(wood);
    for _ in 0..tree.leaves {
        // Long boughs carry more: the square root spreads bunches evenly over a cone's surface.
        let bough = &boughs[((1.0 - random.unit().sqrt()) * count as f32) as usize % count];
        let t = random.range(0.08, 1.0);
        let out = (bough[2] - bough[0]).normalize();
        let side = out.cross(Vec3::Y) * random.range(-1.0, 1.0);
        let direction = (out * 0.6 + side + Vec3::Y * random.range(-0.45, 0.1)).normalize_or(out);
        leaf(&mut mesh, along(bough, t), direction, tree.leaf, random);
    }
    mesh
}

/// A bush: leaves on stems from one root.
pub(super) fn bush(height: f32, leaves: u32, leaf_length: f32, random: &mut Random) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let stems: Vec<_> = (0..9)
        .map(|_| {
            let side = random.square() * 0.9;
            let out = Vec3::new(side.x, 1.0, side.y).normalize();
            bent(Vec3::ZERO, out, height * random.range(0.7, 1.0), -0.1 * height, 3)
        })
        .collect();
    for stem in &stems {
        mesh.append(&tube(stem, &tapered(0.02 * height, 3), Vec3::X, 3));
    }
    for i in 0..leaves as usize {
        let stem = &stems[i % stems.len()];
        let base = along(stem, random.range(0.2, 1.0)) + ball(random) * (0.2 * height);
        // None below the ground.
        let base = Vec3::new(base.x, base.y.max(leaf_length), base.z);
        let direction = (ball(random) + Vec3::Y * 0.3).normalize_or(Vec3::Y);
        leaf(&mut mesh, base, direction, leaf_length, random);
    }
    mesh
}

/// Blades of grass within a radius, one triangle each.
pub(super) fn grass(radius: f32, height: f32, blades: u32, random: &mut Random) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for _ in 0..blades {
        let (angle, distance) = (random.angle(), random.unit().sqrt() * radius);
        let foot = Vec3::new(angle.sin(), 0.0, angle.cos()) * distance;
        let bend = random.square() * (0.5 * height);
        let tip = foot + Vec3::new(bend.x, height * random.range(0.5, 1.0), bend.y);
        let across = random.angle();
        let side = Vec3::new(across.sin(), 0.0, across.cos()) * (0.045 * height);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([foot - side, foot + side, tip]);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

/// A leaf folded along its midrib: 4 vertices, 2 triangles.
fn leaf(mesh: &mut TriangleMesh, base: Vec3, direction: Vec3, length: f32, random: &mut Random) {
    let across = Quat::from_axis_angle(direction, random.angle()) * direction.any_orthonormal_vector();
    let fold = direction.cross(across) * (0.08 * length);
    let middle = base + direction * (0.45 * length);
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([
        base,
        middle + across * (0.3 * length) + fold,
        base + direction * length,
        middle - across * (0.3 * length) + fold,
    ]);
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
}

/// A path of `points` that sets out in a direction and sags by `bend` at its end (rises, if positive).
fn bent(from: Vec3, direction: Vec3, length: f32, bend: f32, points: u32) -> Vec<Vec3> {
    (0..points)
        .map(|i| {
            let s = i as f32 / (points - 1) as f32;
            from + direction * (length * s) + Vec3::Y * (bend * s * s)
        })
        .collect()
}

fn tapered(radius: f32, points: u32) -> Vec<Vec2> {
    (0..points).map(|i| Vec2::splat(radius * (1.0 - 0.8 * i as f32 / (points - 1) as f32))).collect()
}

/// The point at share `t` of a path.
fn along(path: &[Vec3], t: f32) -> Vec3 {
    let s = t.clamp(0.0, 1.0) * (path.len() - 1) as f32;
    let i = (s as usize).min(path.len() - 2);
    path[i].lerp(path[i + 1], s - i as f32)
}

/// Uniform in the unit ball.
fn ball(random: &mut Random) -> Vec3 {
    loop {
        let (xy, z) = (random.square(), random.range(-1.0, 1.0));
        let p = xy.extend(z);
        if p.length_squared() <= 1.0 {
            return p;
        }
    }
}
