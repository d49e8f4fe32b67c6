//! Meshes that scenes are made of. Closed shapes are wound counter-clockwise seen from outside and share
//! their vertices, so that they are closed manifolds: V vertices make 2V − 4 triangles.

use std::collections::BTreeSet;
use std::f32::consts::{PI, TAU};

use glam::{Quat, Vec2, Vec3};

use crate::TriangleMesh;

fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> TriangleMesh {
    TriangleMesh::new("", positions, triangles)
}

/// All meshes in one.
pub(super) fn merged(parts: impl IntoIterator<Item = TriangleMesh>) -> TriangleMesh {
    parts.into_iter().fold(TriangleMesh::default(), |mut whole, part| {
        whole.append(&part);
        whole
    })
}

/// A parallelogram with its normal along `half_u` × `half_v`: 4 vertices, 2 triangles.
pub(super) fn quad(center: Vec3, half_u: Vec3, half_v: Vec3) -> TriangleMesh {
    let corners = [-half_u - half_v, half_u - half_v, half_u + half_v, half_v - half_u];
    mesh(corners.map(|c| center + c).to_vec(), vec![[0, 1, 2], [0, 2, 3]])
}

/// A level square around the origin, facing up.
pub(super) fn ground(half: f32) -> TriangleMesh {
    quad(Vec3::ZERO, Vec3::Z * half, Vec3::X * half)
}

/// A box between two corners: 8 vertices, 12 triangles.
pub(super) fn cuboid(min: Vec3, max: Vec3) -> TriangleMesh {
    let corner = |i: u32| {
        let pick = |bit: u32, low: f32, high: f32| if i >> bit & 1 == 1 { high } else { low };
        Vec3::new(pick(0, min.x, max.x), pick(1, min.y, max.y), pick(2, min.z, max.z))
    };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    mesh((0..8).map(corner).collect(), triangles)
}

/// A box by its middle and its edge lengths.
pub(super) fn block(center: Vec3, size: Vec3) -> TriangleMesh {
    cuboid(center - size * 0.5, center + size * 0.5)
}

/// A frustum with flat ends: 2n vertices, 4n − 4 triangles for n `sides`.
pub(super) fn frustum(from: Vec3, from_radius: f32, to: Vec3, to_radius: f32, sides: u32) -> TriangleMesh {
    let turn = Quat::from_rotation_arc(Vec3::Y, (to - from).normalize_or(Vec3::Y));
    let ring =
        |center: Vec3, radius: f32| (0..sides).map(move |i| center + turn * (around(i, sides) * radius));
    let positions = ring(from, from_radius).chain(ring(to, to_radius)).collect();
    let mut triangles = band(0, sides, sides);
    triangles.extend((2..sides).map(|i| [0, i, i - 1]));
    triangles.extend((2..sides).map(|i| [sides, sides + i - 1, sides + i]));
    mesh(positions, triangles)
}

/// A cylinder with flat ends: 2n vertices, 4n − 4 triangles.
pub(super) fn rod(from: Vec3, to: Vec3, radius: f32, sides: u32) -> TriangleMesh {
    frustum(from, radius, to, radius, sides)
}

/// A cone with a flat base: n + 1 vertices, 2n − 2 triangles.
pub(super) fn cone(base: Vec3, radius: f32, apex: Vec3, sides: u32) -> TriangleMesh {
    let turn = Quat::from_rotation_arc(Vec3::Y, (apex - base).normalize_or(Vec3::Y));
    let mut positions: Vec<_> = (0..sides).map(|i| base + turn * (around(i, sides) * radius)).collect();
    positions.push(apex);
    let mut triangles: Vec<_> = (0..sides).map(|i| [i, (i + 1) % sides, sides]).collect();
    triangles.extend((2..sides).map(|i| [0, i, i - 1]));
    mesh(positions, triangles)
}

/// A ball of r `rings` between its poles: n·r + 2 vertices, 2·n·r triangles for n `segments`.
pub(super) fn sphere(center: Vec3, radius: f32, segments: u32, rings: u32) -> TriangleMesh {
    let profile: Vec<_> = (0..rings + 2)
        .map(|i| {
            let (sin, cos) = (PI * i as f32 / (rings + 1) as f32).sin_cos();
            // The poles are exact: sin π is not zero in f32.
            Vec2::new(if i == 0 || i == rings + 1 { 0.0 } else { sin }, -cos) * radius
        })
        .collect();
    let mut ball = lathe(&profile, segments);
    for position in &mut ball.positions {
        *position += center;
    }
    ball
}

/// Turns a profile of (radius, height), from the bottom to the top, about the y axis. A radius of zero at
/// either end makes a pole; an end without one is closed by a flat fan.
pub(super) fn lathe(profile: &[Vec2], segments: u32) -> TriangleMesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let mut below: Option<(u32, bool)> = None;
    for (i, point) in profile.iter().enumerate() {
        let first = positions.len() as u32;
        let pole = point.x == 0.0 && (i == 0 || i + 1 == profile.len());
        let center = Vec3::Y * point.y;
        if pole {
            positions.push(center);
        } else {
            positions.extend((0..segments).map(|k| center + around(k, segments) * point.x));
        }
        match below {
            None if !pole => triangles.extend((2..segments).map(|k| [first, first + k, first + k - 1])),
            None => {}
            Some((start, true)) => {
                triangles.extend((0..segments).map(|k| [start, first + (k + 1) % segments, first + k]));
            }
            Some((start, false)) if pole => {
                triangles.extend((0..segments).map(|k| [start + k, start + (k + 1) % segments, first]));
            }
            Some((start, false)) => triangles.extend(band(start, first, segments)),
        }
        if i + 1 == profile.len() && !pole {
            triangles.extend((2..segments).map(|k| [first, first + k - 1, first + k]));
        }
        below = Some((first, pole));
    }
    mesh(positions, triangles)
}

/// A tube of elliptic rings around a path, closed by flat ends: for p points and n `sides` p·n vertices and
/// 2n(p − 1) + 2n − 4 triangles. `radii` holds per point the radius across (along `side` as far as it is
/// perpendicular to the path) and the radius along the other axis.
pub(super) fn tube(path: &[Vec3], radii: &[Vec2], side: Vec3, sides: u32) -> TriangleMesh {
    let mut positions = Vec::with_capacity(path.len() * sides as usize);
    for (i, &center) in path.iter().enumerate() {
        let before = path[i.saturating_sub(1)];
        let after = path[(i + 1).min(path.len() - 1)];
        let along = (after - before).normalize_or(Vec3::Y);
        let u = (side - along * along.dot(side)).normalize_or(along.any_orthonormal_vector());
        let v = along.cross(u);
        positions.extend((0..sides).map(|k| {
            let (sin, cos) = (TAU * k as f32 / sides as f32).sin_cos();
            center + u * (cos * radii[i].x) + v * (sin * radii[i].y)
        }));
    }
    let rings = path.len() as u32;
    let mut triangles: Vec<_> = (1..rings).flat_map(|r| band((r - 1) * sides, r * sides, sides)).collect();
    triangles.extend((2..sides).map(|k| [0, k, k - 1]));
    let last = (rings - 1) * sides;
    triangles.extend((2..sides).map(|k| [last, last + k - 1, last + k]));
    mesh(positions, triangles)
}

/// A tube around a closed curve, given at `steps` equal steps of its parameter in [0, 1): `steps`·n
/// vertices, twice as many triangles. The frame is carried along without twist and its final turn is spread
/// over the curve.
pub(super) fn loop_tube(curve: impl Fn(f32) -> Vec3, radius: f32, steps: u32, sides: u32) -> TriangleMesh {
    let at = |i: u32| curve(i as f32 / steps as f32);
    let tangent = |i: u32| {
        let h = 0.5 / steps as f32;
        let s = i as f32 / steps as f32;
        (curve(s + h) - curve(s - h)).normalize_or(Vec3::X)
    };
    let start = tangent(0).any_orthonormal_vector();
    let mut frames = Vec::with_capacity(steps as usize + 1);
    let mut u = start;
    for i in 0..=steps {
        let along = tangent(i % steps);
        u = (u - along * along.dot(u)).normalize_or(along.any_orthonormal_vector());
        frames.push((u, along.cross(u)));
    }
    let (end_u, end_v) = frames[steps as usize];
    let twist = start.dot(end_v).atan2(start.dot(end_u));
    let mut positions = Vec::with_capacity((steps * sides) as usize);
    for i in 0..steps {
        let (u, v) = frames[i as usize];
        let turn = twist * i as f32 / steps as f32;
        positions.extend((0..sides).map(|k| {
            let (sin, cos) = (TAU * k as f32 / sides as f32 + turn).sin_cos();
            at(i) + (u * cos + v * sin) * radius
        }));
    }
    let triangles = (0..steps).flat_map(|i| band(i * sides, (i + 1) % steps * sides, sides)).collect();
    mesh(positions, triangles)
}

/// The convex hull of a few points, none of them inside, by trying all planes: for regular solids.
pub(super) fn hull(points: &[Vec3]) -> TriangleMesh {
    let n = points.len();
    let size = points.iter().map(|p| p.length()).fold(0.0, f32::max);
    // Far above the rounding of coordinates, far below the height of any corner over a face.
    let flat = 1e-4 * size;
    let mut faces = BTreeSet::new();
    let mut triangles = Vec::new();
    for (i, j, k) in (0..n).flat_map(|i| (0..n).flat_map(move |j| (0..n).map(move |k| (i, j, k)))) {
        let normal = (points[j] - points[i]).cross(points[k] - points[i]);
        if normal.length() < flat * flat {
            continue;
        }
        let normal = normal.normalize();
        let height = |p: Vec3| normal.dot(p - points[i]);
        if points.iter().any(|&p| height(p) > flat) {
            continue;
        }
        let face: Vec<usize> = (0..n).filter(|&p| height(points[p]).abs() <= flat).collect();
        if faces.insert(face.clone()) {
            let center = face.iter().map(|&p| points[p]).sum::<Vec3>() / face.len() as f32;
            let u = (points[face[0]] - center).normalize();
            let v = normal.cross(u);
            let angle = |p: usize| (points[p] - center).dot(v).atan2((points[p] - center).dot(u));
            let mut order = face;
            order.sort_by(|&a, &b| angle(a).total_cmp(&angle(b)));
            let fan = (2..order.len()).map(|c| [order[0], order[c - 1], order[c]].map(|p| p as u32));
            triangles.extend(fan);
        }
    }
    mesh(points.to_vec(), triangles)
}

/// Texture coordinate `uv` at every vertex.
pub(super) fn with_uv(mut mesh: TriangleMesh, uv: Vec2) -> TriangleMesh {
    mesh.uvs = vec![uv; mesh.positions.len()];
    mesh
}

/// The k-th of n unit vectors around the y axis, from z towards x.
fn around(k: u32, n: u32) -> Vec3 {
    let (sin, cos) = (TAU * k as f32 / n as f32).sin_cos();
    Vec3::new(sin, 0.0, cos)
}

/// Triangles between two rings of n vertices, the upper one starting at `upper`; the rings turn
/// counter-clockwise seen from above.
fn band(lower: u32, upper: u32, n: u32) -> Vec<[u32; 3]> {
    (0..n)
        .flat_map(|k| {
            let next = (k + 1) % n;
            let (a, b, c, d) = (lower + k, lower + next, upper + next, upper + k);
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{EdgeStatistics, EdgeTopology};

    /// Six times the volume: positive if faces point outwards.
    fn volume(mesh: &TriangleMesh) -> f32 {
        let corner = |i: u32| mesh.positions[i as usize];
        mesh.triangles.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c)))).sum()
    }

    #[test]
    fn closed_shapes_are_closed_point_outwards_and_have_their_counts() {
        let (from, to) = (Vec3::new(0.2, 0.1, 0.3), Vec3::new(1.0, 2.0, -0.5));
        let path = [Vec3::ZERO, Vec3::Y, Vec3::new(0.5, 2.0, 0.2)];
        let profile = [Vec2::new(0.6, 0.0), Vec2::new(0.8, 0.5), Vec2::new(0.0, 1.0)];
        let cube: Vec<_> = cuboid(Vec3::NEG_ONE, Vec3::ONE).positions;
        let ring = |s: f32| Vec3::new((TAU * s).cos(), 0.2 * (2.0 * TAU * s).sin(), (TAU * s).sin());
        for (name, mesh, counts) in [
            ("cuboid", cuboid(from, from + Vec3::ONE), (8, 12)),
            ("frustum", frustum(from, 0.5, to, 0.2, 7), (14, 24)),
            ("cone", cone(from, 0.5, to, 7), (8, 12)),
            ("sphere", sphere(from, 2.0, 9, 5), (47, 90)),
            ("lathe", lathe(&profile, 8), (17, 30)),
            ("tube", tube(&path, &[Vec2::new(0.2, 0.3); 3], Vec3::X, 6), (18, 32)),
            ("loop", loop_tube(ring, 0.1, 40, 6), (240, 480)),
            ("hull", hull(&cube), (8, 12)),
        ] {
            assert_eq!((mesh.positions.len(), mesh.triangles.len()), counts, "{name}");
            let statistics = EdgeTopology::new(&mesh.positions, &mesh.triangles).unwrap().statistics();
            let expected = EdgeStatistics { edges: counts.1 * 3 / 2, ..Default::default() };
            assert_eq!(statistics, expected, "{name}");
            assert!(volume(&mesh) > 0.0, "{name} points inwards");
        }
    }

    #[test]
    fn ground_faces_up() {
        let mesh = ground(2.0);
        let [a, b, c] = mesh.triangles[0].map(|i| mesh.positions[i as usize]);
        assert_eq!((b - a).cross(c - a).normalize(), Vec3::Y);
    }
}
