//! A pool under palms, all of it one mesh with one cut-out mask: the Pool scene of Cherry and Kooima's
//! "Multi-pass Gaussian Contact-hardening Soft Shadows" (table 1: 8,463 vertices, 11,003 triangles, 1 mesh).

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};

use super::random::Random;
use super::shapes::{block, cone, cuboid, lathe, merged, quad, rod, sphere, tube, with_uv};
use super::spec::Values;
use super::stage::turned;
use super::{BuiltIn, Counts, Parameter, Stage, camera};
use crate::geometry::{AlphaMask, Wrap};
use crate::{Light, TriangleMesh};

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "pool",
    summary: "a pool under palms whose leaves are cut out by an alpha mask, in one mesh",
    parameters: &[
        Parameter::real("light", 0.8, [0.0, 10.0], "angular radius of the sun, in degrees"),
        Parameter::SEED,
    ],
    counts: Some(Counts { vertices: 8463, triangles: 11_003, meshes: 1 }),
    build,
};

/// The left half of the mask is solid, the right half holds a leaf.
const SOLID: Vec2 = Vec2::new(0.25, 0.5);
/// Half the sides of the deck and of the basin, in tiles of a metre.
const DECK: [i32; 2] = [10, 7];
const BASIN: [i32; 2] = [5, 4];
const PALMS: [[f32; 2]; 8] =
    [[-7.6, -5.4], [-2.6, -5.7], [2.4, -5.3], [7.4, -5.6], [-7.2, 0.4], [7.9, 0.9], [-7.7, 5.4], [7.3, 5.7]];
const FRONDS: u32 = 40;
const FROND_SEGMENTS: u32 = 5;

fn build(values: &Values<'_>, _time: f32) -> Stage {
    let angular_radius = values.real("light").to_radians();
    let light = Light::Directional { direction: Vec3::new(0.55, -1.0, 0.28), angular_radius };
    let mut stage =
        Stage::new(camera(Vec3::new(0.0, 17.0, 23.0), Vec3::new(0.0, 0.9, -0.6), 45.0, 0.5), light);
    let mut random = Random::new(values.whole("seed"), 0);

    let mut pool = with_uv(merged([deck(), basin(), lawn(), furniture()]), SOLID);
    for place in PALMS {
        palm(&mut pool, Vec3::new(place[0], 0.0, place[1]), &mut random);
    }
    pool.alpha = mask();
    stage.add("pool", pool);
    stage
}

/// 200 tiles around the basin.
fn deck() -> TriangleMesh {
    let [across, deep] = DECK;
    let tiles = (-deep..deep).flat_map(|z| (-across..across).map(move |x| (x, z)));
    let outside =
        |&(x, z): &(i32, i32)| !(-BASIN[0]..BASIN[0]).contains(&x) || !(-BASIN[1]..BASIN[1]).contains(&z);
    merged(
        tiles
            .filter(outside)
            .map(|(x, z)| quad(Vec3::new(x as f32 + 0.5, 0.0, z as f32 + 0.5), Vec3::Z * 0.5, Vec3::X * 0.5)),
    )
}

/// An open box: a cuboid without its lid, seen from inside.
fn basin() -> TriangleMesh {
    let [x, z] = BASIN.map(|half| half as f32);
    let mut basin = cuboid(Vec3::new(-x, -1.6, -z), Vec3::new(x, 0.0, z));
    let rim = |i: &u32| basin.positions[*i as usize].y == 0.0;
    basin.triangles =
        basin.triangles.iter().filter(|t| !t.iter().all(rim)).map(|&[a, b, c]| [a, c, b]).collect();
    basin
}

/// Four strips around the deck.
fn lawn() -> TriangleMesh {
    let [x, z] = DECK.map(|half| half as f32);
    let (far, width) = (24.0, 7.0);
    merged([
        quad(Vec3::new(0.0, 0.0, -(z + far) * 0.5), Vec3::Z * ((far - z) * 0.5), Vec3::X * far),
        quad(Vec3::new(0.0, 0.0, (z + far) * 0.5), Vec3::Z * ((far - z) * 0.5), Vec3::X * far),
        quad(Vec3::new(-x - width, 0.0, 0.0), Vec3::Z * z, Vec3::X * width),
        quad(Vec3::new(x + width, 0.0, 0.0), Vec3::Z * z, Vec3::X * width),
    ])
}

fn furniture() -> TriangleMesh {
    let at = |x: f32, z: f32, angle: f32| turned(angle, Vec3::new(x, 0.0, z));
    let mut parts = vec![diving_board(), ladder(), mat()];
    for x in [-4.0, -1.6, 1.6, 4.0] {
        parts.push(lounger().transformed(at(x, 5.6, PI)));
    }
    for x in [-2.8, 2.8] {
        parts.push(rod(Vec3::new(x, 0.0, 5.9), Vec3::new(x, 2.3, 5.9), 0.04, 10));
        parts.push(cone(Vec3::new(x, 2.0, 5.9), 1.3, Vec3::new(x, 2.6, 5.9), 16));
    }
    parts.push(sphere(Vec3::new(6.3, 0.45, 3.2), 0.45, 24, 15));
    for (x, z) in [(-5.6, -4.5), (5.6, -4.5), (-5.6, 4.5), (5.6, 4.5)] {
        parts.push(urn().transformed(at(x, z, 0.0)));
    }
    merged(parts)
}

/// A seat, a raised back and four legs; it looks along z.
fn lounger() -> TriangleMesh {
    let seat = block(Vec3::new(0.0, 0.36, 0.3), Vec3::new(0.7, 0.08, 1.4));
    let back = block(Vec3::new(0.0, 0.0, -0.38), Vec3::new(0.7, 0.08, 0.76)).transformed(
        Affine3A::from_translation(Vec3::new(0.0, 0.38, -0.4)) * Affine3A::from_rotation_x(0.75),
    );
    let legs = [(-0.3, -0.32), (0.3, -0.32), (-0.3, 0.92), (0.3, 0.92)]
        .map(|(x, z)| block(Vec3::new(x, 0.16, z), Vec3::new(0.06, 0.32, 0.06)));
    merged([seat, back].into_iter().chain(legs))
}

/// A board over the basin on two legs.
fn diving_board() -> TriangleMesh {
    let x = -BASIN[0] as f32;
    merged([
        block(Vec3::new(x - 0.2, 0.75, 0.0), Vec3::new(3.0, 0.08, 0.6)),
        block(Vec3::new(x - 1.4, 0.355, 0.0), Vec3::new(0.2, 0.71, 0.5)),
        block(Vec3::new(x - 0.5, 0.355, 0.0), Vec3::new(0.2, 0.71, 0.5)),
    ])
}

/// Two bent rails and four rungs down the basin's right wall.
fn ladder() -> TriangleMesh {
    let x = BASIN[0] as f32;
    let rail = |z: f32| {
        let path: Vec<_> = (0..12)
            .map(|i| match i {
                // Up from the deck, over the edge in half a circle, down the wall.
                0 => Vec3::new(x + 0.3, 0.0, z),
                1..=10 => {
                    let (sin, cos) = (PI * (i - 1) as f32 / 9.0).sin_cos();
                    Vec3::new(x + 0.06 + 0.24 * cos, 0.6 + 0.24 * sin, z)
                }
                _ => Vec3::new(x - 0.18, -1.3, z),
            })
            .collect();
        tube(&path, &[Vec2::splat(0.03); 12], Vec3::Z, 8)
    };
    let rung = |i: i32| {
        let y = -0.15 - 0.3 * i as f32;
        rod(Vec3::new(x - 0.18, y, -0.3), Vec3::new(x - 0.18, y, 0.3), 0.025, 8)
    };
    merged([rail(-0.3), rail(0.3)].into_iter().chain((0..4).map(rung)))
}

/// A sheet of eleven corners, flat on the deck.
fn mat() -> TriangleMesh {
    let corner = |i: u32| {
        let (sin, cos) = (TAU * i as f32 / 11.0).sin_cos();
        Vec3::new(sin * 0.8, 0.005, 5.5 + cos * 0.8)
    };
    TriangleMesh::new("", (0..11).map(corner).collect(), (2..11).map(|i| [0, i - 1, i]).collect())
}

fn urn() -> TriangleMesh {
    let profile = [
        [0.24, 0.0],
        [0.25, 0.06],
        [0.16, 0.1],
        [0.12, 0.16],
        [0.17, 0.24],
        [0.27, 0.36],
        [0.33, 0.5],
        [0.34, 0.62],
        [0.3, 0.74],
        [0.23, 0.84],
        [0.2, 0.92],
        [0.24, 0.99],
        [0.3, 1.04],
        [0.3, 1.08],
        [0.26, 1.08],
        [0.2, 0.98],
    ];
    lathe(&profile.map(Vec2::from_array), 24)
}

/// A bent, ringed trunk and a crown of fronds.
fn palm(pool: &mut TriangleMesh, foot: Vec3, random: &mut Random) {
    let height = random.range(4.2, 6.2);
    let lean = random.square() * 1.1;
    let at = |s: f32| foot + Vec3::new(lean.x * s * s, height * s, lean.y * s * s);
    let path: Vec<_> = (0..14).map(|i| at(i as f32 / 13.0)).collect();
    // Scars of old fronds: every second ring is a little wider.
    let radii: Vec<_> =
        (0..14).map(|i| Vec2::splat(0.2 - 0.006 * i as f32 + if i % 2 == 0 { 0.025 } else { 0.0 })).collect();
    pool.append(&with_uv(tube(&path, &radii, Vec3::X, 12), SOLID));

    let crown = at(1.0);
    let first = random.angle();
    for i in 0..FRONDS {
        // The golden angle spreads them; outer ones hang, inner ones rise.
        let angle = first + 2.399_963_1 * i as f32;
        let rise = 1.25 - 1.5 * (i as f32 / FRONDS as f32) + random.range(-0.1, 0.1);
        let out = Vec3::new(angle.sin(), 0.0, angle.cos());
        pool.append(&frond(crown, out, rise, random.range(2.1, 2.7)));
    }
}

/// A ribbon of quads from `base` outwards that starts at `rise` radians above level and bends down.
fn frond(base: Vec3, out: Vec3, rise: f32, length: f32) -> TriangleMesh {
    let side = out.cross(Vec3::Y) * 0.36;
    let mut point = base;
    let mut mesh = TriangleMesh::default();
    for i in 0..=FROND_SEGMENTS {
        let share = i as f32 / FROND_SEGMENTS as f32;
        for (edge, u) in [(-1.0, 0.5), (1.0, 1.0)] {
            mesh.positions.push(point + side * edge);
            mesh.uvs.push(Vec2::new(u, share));
        }
        let (sin, cos) = (rise - 1.7 * share).sin_cos();
        point += (out * cos + Vec3::Y * sin) * (length / FROND_SEGMENTS as f32);
        if i > 0 {
            let a = 2 * i - 2;
            mesh.triangles.extend([[a, a + 1, a + 3], [a, a + 3, a + 2]]);
        }
    }
    mesh
}

/// A feathered leaf: a midrib and leaflets that point outwards and on.
fn mask() -> Option<Arc<AlphaMask>> {
    let (width, height) = (256u32, 512u32);
    let solid = |x: u32, y: u32| {
        if x < width / 2 {
            return true;
        }
        let across = ((x - width / 2) as f32 + 0.5) / (width / 2) as f32 * 2.0 - 1.0;
        let along = (y as f32 + 0.5) / height as f32;
        // Leaflets are longest in the middle of the frond and a fourteenth of it apart.
        let reach = (PI * (0.08 + 0.9 * along)).sin().powf(0.6);
        let leaflet = ((along - 0.16 * across.abs()) * 26.0).rem_euclid(1.0) < 0.62 - 0.3 * across.abs();
        across.abs() < 0.05 || (across.abs() < reach && along > 0.06 && leaflet)
    };
    let alpha: Vec<u8> =
        (0..height).flat_map(|y| (0..width).map(move |x| 255 * u8::from(solid(x, y)))).collect();
    AlphaMask::from_alpha(width, height, &alpha, 0.5, [Wrap::Clamp; 2]).map(Arc::new)
}
