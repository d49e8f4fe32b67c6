//! A chessboard in the middle of a game under a spot light: turned pieces, thin and tall, close together.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::shapes::{block, cone, cuboid, lathe, merged, sphere, tube};
use super::spec::Values;
use super::stage::turned;
use super::{BuiltIn, Parameter, Stage, camera};
use crate::{Light, TriangleMesh};

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "chess",
    summary: "turned chess pieces on a board under a spot light",
    parameters: &[
        Parameter::whole("segments", 40, [3, 512], "sides of a turned piece"),
        Parameter::whole(
            "position",
            0,
            [0, 2],
            "0 the end of the Immortal Game, 1 the Italian opening, 2 all pieces at their start",
        ),
    ],
    counts: None,
    build,
};

/// Rows of the board from black's side, in the letters of Forsyth's notation.
const POSITIONS: [&str; 3] = [
    "r1bk3r/p2pBpNp/n4n2/1p1NP2P/6P1/3P4/P1P1K3/q5b1",
    "r1bqk1nr/pppp1ppp/2n5/2b1p3/2B1P3/5N2/PPPP1PPP/RNBQK2R",
    "rnbqkbnr/pppppppp/8/8/8/8/PPPPPPPP/RNBQKBNR",
];

/// Side of a square, in metres. The king is 95 mm tall, as tournament pieces are.
const SQUARE: f32 = 0.055;

fn build(values: &Values<'_>, _time: f32) -> Stage {
    let position = Vec3::new(-0.42, 0.62, -0.2);
    let direction = Vec3::new(0.02, 0.0, 0.0) - position;
    let light = Light::Spot { position, direction, outer: 31f32.to_radians(), inner: 24f32.to_radians() };
    let mut stage =
        Stage::new(camera(Vec3::new(0.08, 0.5, 0.62), Vec3::new(0.0, 0.008, 0.005), 41.5, 0.02), light);
    let half = 4.0 * SQUARE;
    stage.add("table", cuboid(Vec3::new(-1.2, -0.06, -1.2), Vec3::new(1.2, -0.03, 1.2)));
    let rim = half + 0.025;
    stage.add("frame", cuboid(Vec3::new(-rim, -0.03, -rim), Vec3::new(rim, -0.005, rim)));
    for (name, parity) in [("light squares", 1), ("dark squares", 0)] {
        let squares = (0..64).filter(|i| (i % 8 + i / 8) % 2 == parity);
        let tile = |i: i32| {
            let min = Vec3::new((i % 8) as f32 * SQUARE - half, -0.005, (i / 8) as f32 * SQUARE - half);
            cuboid(min, min + Vec3::new(SQUARE, 0.005, SQUARE))
        };
        stage.add(name, merged(squares.map(tile)));
    }

    let segments = values.whole("segments");
    for (row, ranks) in POSITIONS[values.whole("position") as usize].split('/').enumerate() {
        let mut column = 0;
        for letter in ranks.chars() {
            if let Some(empty) = letter.to_digit(10) {
                column += empty;
            } else if let Some((name, mesh)) = piece(letter.to_ascii_lowercase(), segments) {
                let white = letter.is_ascii_uppercase();
                let at = |k: u32| (k as f32 + 0.5) * SQUARE - half;
                let place = Vec3::new(at(column), 0.0, at(row as u32));
                // Knights look at the other side, a little aside.
                let turn = if white { PI - 0.35 } else { -0.35 };
                let side = if white { "white" } else { "black" };
                stage.place(&format!("{side} {name}"), mesh, turned(turn, place));
                column += 1;
            }
        }
    }
    stage
}

/// A piece by its letter, standing at the origin; the knight looks along z.
fn piece(letter: char, segments: u32) -> Option<(&'static str, TriangleMesh)> {
    let (name, mesh) = match letter {
        'p' => ("pawn", pawn(segments)),
        'r' => ("rook", rook(segments)),
        'n' => ("knight", knight(segments)),
        'b' => ("bishop", bishop(segments)),
        'q' => ("queen", queen(segments)),
        'k' => ("king", king(segments)),
        _ => return None,
    };
    Some((name, in_metres(mesh)))
}

/// Pieces are drawn in millimetres.
fn in_metres(mut mesh: TriangleMesh) -> TriangleMesh {
    for position in &mut mesh.positions {
        *position *= 1e-3;
    }
    mesh
}

/// Turns a foot of the given radius, then `profile` as (radius, height) pairs.
fn turned_piece(foot: f32, profile: impl IntoIterator<Item = [f32; 2]>, segments: u32) -> TriangleMesh {
    let base =
        [[0.96, 0.0], [1.0, 1.0], [1.0, 3.5], [0.9, 4.5], [0.9, 5.5], [0.94, 6.5], [0.9, 7.8], [0.72, 9.5]];
    let base = base.map(|[r, h]| Vec2::new(r * foot, h));
    let rest = profile.into_iter().map(Vec2::from_array);
    lathe(&base.into_iter().chain(rest).collect::<Vec<_>>(), segments)
}

/// Points of a circle's arc in a profile, up to its pole: angles from `from` (radians above the equator).
fn dome(height: f32, radius: f32, stretch: f32, from: f32) -> Vec<[f32; 2]> {
    let steps = 10;
    (0..=steps)
        .map(|i| {
            let angle = from + (PI * 0.5 - from) * i as f32 / steps as f32;
            let across = if i == steps { 0.0 } else { angle.cos() };
            [across * radius, height + angle.sin() * radius * stretch]
        })
        .collect()
}

fn pawn(segments: u32) -> TriangleMesh {
    let stem = [[9.0, 13.0], [7.0, 18.0], [5.8, 24.0], [5.2, 30.0], [9.5, 31.2], [9.5, 32.8], [5.5, 34.0]];
    turned_piece(15.0, stem.into_iter().chain(dome(40.5, 8.2, 1.0, -0.83)), segments)
}

fn rook(segments: u32) -> TriangleMesh {
    let stem =
        [[12.0, 13.0], [10.2, 19.0], [9.4, 28.0], [9.4, 36.0], [10.5, 39.0], [13.8, 41.0], [13.8, 49.0]];
    let hollow = [[9.6, 49.0], [9.6, 45.5], [0.0, 45.5]];
    let body = turned_piece(17.0, stem.into_iter().chain(hollow), segments);
    // Merlons bend with the wall, over two thirds of its circle.
    let merlon = |k: i32| {
        let steps = 5;
        let path: Vec<_> = (0..=steps)
            .map(|i| {
                let angle = TAU * (k as f32 + i as f32 / steps as f32 * 0.66) / 6.0;
                Vec3::new(angle.sin() * 11.7, 51.0, angle.cos() * 11.7)
            })
            .collect();
        // A four-sided tube stands on its corner; its corners reach √2 beyond its sides.
        tube(&path, &vec![Vec2::new(3.6, 2.1); path.len()], Vec3::Y, 8)
    };
    merged(std::iter::once(body).chain((0..6).map(merlon)))
}

fn knight(segments: u32) -> TriangleMesh {
    let base = turned_piece(17.0, [[13.5, 12.0], [12.0, 14.0], [0.0, 14.5]], segments);
    // The neck rises from the base, arches and falls to the muzzle: (forward, up), half width, half depth.
    let spine = [
        ([-0.5, 13.0], 9.8, 11.5),
        ([-2.0, 20.0], 8.6, 11.6),
        ([-4.2, 28.0], 7.6, 11.8),
        ([-5.2, 36.0], 6.9, 11.4),
        ([-4.2, 43.5], 6.4, 10.6),
        ([-0.6, 49.5], 6.2, 9.6),
        ([4.6, 51.2], 6.3, 8.6),
        ([9.6, 48.4], 5.9, 7.2),
        ([13.6, 44.2], 5.0, 5.6),
        ([16.8, 40.2], 4.5, 4.9),
        ([18.8, 37.6], 3.4, 3.8),
    ];
    let path: Vec<_> = spine.iter().map(|&([z, y], _, _)| Vec3::new(0.0, y, z)).collect();
    let radii: Vec<_> = spine.iter().map(|&(_, across, deep)| Vec2::new(across, deep)).collect();
    let neck = tube(&path, &radii, Vec3::X, (segments / 2).max(8));
    let ear = |x: f32| cone(Vec3::new(x, 53.0, 0.5), 2.4, Vec3::new(x * 1.25, 64.0, 0.0), 8);
    // The mane: a row of plates along the back of the neck.
    let mane = (0..7).map(|i| {
        let (([z, y], _, deep), share) = (spine[i + 1], i as f32);
        let back = Vec2::new(-1.0, 0.05 + 0.12 * share).normalize() * deep;
        block(Vec3::new(0.0, y + back.y, z + back.x), Vec3::new(3.0, 5.0, 3.6))
    });
    merged([base, neck, ear(3.2), ear(-3.2)].into_iter().chain(mane))
}

fn bishop(segments: u32) -> TriangleMesh {
    let stem = [
        [10.0, 13.0],
        [7.6, 20.0],
        [6.0, 30.0],
        [5.4, 39.0],
        [10.4, 40.4],
        [10.4, 42.0],
        [6.6, 43.0],
        [8.4, 44.4],
        [8.4, 45.6],
        [6.0, 46.8],
    ];
    // The mitre: a stretched ball that narrows to its point.
    let mitre = (0..12).map(|i| {
        let t = i as f32 / 12.0;
        [6.0 + 3.4 * (PI * t.powf(0.8)).sin() - 4.0 * t * t, 47.0 + 18.5 * t]
    });
    let finial = dome(67.8, 2.9, 1.0, -0.9);
    turned_piece(16.5, stem.into_iter().chain(mitre).chain(finial), segments)
}

fn queen(segments: u32) -> TriangleMesh {
    let stem = [
        [11.5, 13.0],
        [8.6, 22.0],
        [6.8, 34.0],
        [6.0, 48.0],
        [11.6, 49.6],
        [11.6, 51.6],
        [7.4, 52.8],
        [9.6, 54.2],
        [9.6, 55.4],
        [6.8, 56.8],
        [7.4, 62.0],
        [9.4, 68.0],
        [12.4, 74.5],
        [9.8, 74.5],
        [8.0, 72.6],
    ];
    let body = turned_piece(18.5, stem.into_iter().chain(dome(73.0, 7.6, 0.75, 0.0)), segments);
    let pearl = |k: i32| {
        let angle = TAU * k as f32 / 9.0;
        sphere(Vec3::new(angle.sin() * 11.0, 75.0, angle.cos() * 11.0), 1.9, 10, 7)
    };
    let top = sphere(Vec3::Y * 80.6, 2.9, 14, 9);
    merged([body, top].into_iter().chain((0..9).map(pearl)))
}

fn king(segments: u32) -> TriangleMesh {
    let stem = [
        [12.0, 13.0],
        [9.2, 23.0],
        [7.2, 36.0],
        [6.4, 53.0],
        [12.2, 54.8],
        [12.2, 56.8],
        [7.8, 58.0],
        [10.0, 59.4],
        [10.0, 60.8],
        [7.2, 62.2],
        [8.0, 68.0],
        [10.2, 75.0],
        [11.2, 78.4],
        [10.4, 79.6],
    ];
    let body = turned_piece(19.0, stem.into_iter().chain(dome(79.6, 10.0, 0.42, 0.08)), segments);
    let upright = block(Vec3::Y * 89.0, Vec3::new(3.4, 12.0, 3.0));
    let arm = block(Vec3::Y * 90.4, Vec3::new(9.6, 3.2, 2.6));
    merged([body, upright, arm])
}
