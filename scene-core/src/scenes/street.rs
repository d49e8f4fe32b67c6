//! A long street under a low sun: houses, trees, lamps, cars that drive and two planes that fly along it.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Affine3A, Vec2, Vec3};

use super::plants::{Tree, broadleaf};
use super::random::Random;
use super::shapes::{block, cuboid, hull, lathe, merged, rod};
use super::spec::Values;
use super::stage::turned;
use super::{BuiltIn, Parameter, Stage, camera};
use crate::geometry::ObjectFlags;
use crate::{Light, TriangleMesh};

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "street",
    summary: "a long street under a low sun, with cars that drive and two planes that fly",
    parameters: &[
        Parameter::real("length", 300.0, [60.0, 5000.0], "length of the street, in metres"),
        Parameter::whole("cars", 16, [0, 500], "cars that drive, on both lanes, at most one every 10 m"),
        Parameter::real("elevation", 24.0, [3.0, 80.0], "height of the sun over the horizon, in degrees"),
        Parameter::real("light", 0.27, [0.0, 5.0], "angular radius of the sun, in degrees"),
        Parameter::SEED,
    ],
    counts: None,
    build,
};

/// Half the width of the road, and the far side of the pavement, in metres.
const ROAD: f32 = 6.0;
const PAVEMENT: f32 = 9.5;
const KERB: f32 = 0.15;
/// The street's near end; it runs towards −z.
const NEAR: f32 = 22.0;

fn build(values: &Values<'_>, time: f32) -> Stage {
    let length = values.real("length");
    let mut random = Random::new(values.whole("seed"), 0);
    let (sin, cos) = values.real("elevation").to_radians().sin_cos();
    // From behind and a little from the left: shadows run along the road and reach over half of it.
    let direction = Vec3::new(0.4 * cos, -sin, -0.917 * cos);
    let light = Light::Directional { direction, angular_radius: values.real("light").to_radians() };
    let mut stage =
        Stage::new(camera(Vec3::new(-1.2, 6.0, 20.0), Vec3::new(0.6, 5.4, -20.0), 50.0, 0.3), light);

    let far = NEAR - length;
    stage.add("road", cuboid(Vec3::new(-60.0, -0.3, far - 20.0), Vec3::new(60.0, 0.0, NEAR + 20.0)));
    for (name, side) in [("left pavement", -1.0), ("right pavement", 1.0)] {
        let center = Vec3::new(side * (ROAD + PAVEMENT) * 0.5, KERB * 0.5, (NEAR + far) * 0.5);
        stage.add(name, block(center, Vec3::new(PAVEMENT - ROAD, KERB, length)));
    }
    for side in [-1.0, 1.0] {
        houses(&mut stage, side, far, &mut random);
    }
    planting(&mut stage, far, &mut random);
    parked_cars(&mut stage, far, &mut random);
    traffic(&mut stage, values.whole("cars"), length, time);
    planes(&mut stage, length, time);
    stage
}

fn houses(stage: &mut Stage, side: f32, far: f32, random: &mut Random) {
    let mut near = NEAR;
    while near - 10.0 > far {
        let width = random.range(9.0, 16.0).min(near - far);
        let floors = 2 + random.index(4) as u32;
        let house = house(width, floors, random)
            .transformed(turned(-side * FRAC_PI_2, Vec3::new(side * PAVEMENT, 0.0, near - width * 0.5)));
        stage.add(if side < 0.0 { "left house" } else { "right house" }, house);
        // Alleys let the sun through.
        near -= width + if random.unit() < 0.55 { random.range(2.0, 6.0) } else { 0.0 };
    }
}

/// A house with its front at z = 0, looking along z, of the given width.
fn house(width: f32, floors: u32, random: &mut Random) -> TriangleMesh {
    const FLOOR: f32 = 3.2;
    let height = floors as f32 * FLOOR + 0.6;
    let depth = random.range(8.0, 12.0);
    let mut parts = vec![cuboid(Vec3::new(-width * 0.5, 0.0, -depth), Vec3::new(width * 0.5, height, 0.0))];
    let windows = (width / 2.4) as u32;
    let at = |i: u32| (i as f32 + 0.5) / windows as f32 * (width - 0.8) - (width - 0.8) * 0.5;
    for floor in 0..floors {
        let foot = floor as f32 * FLOOR + 0.6;
        for x in (0..windows).map(at) {
            // A frame of lintel, sill and two jambs stands out from the wall.
            parts.push(block(Vec3::new(x, foot + 0.6, 0.1), Vec3::new(1.4, 0.1, 0.24)));
            parts.push(block(Vec3::new(x, foot + 2.3, 0.08), Vec3::new(1.3, 0.12, 0.18)));
            for jamb in [-0.58, 0.58] {
                parts.push(block(Vec3::new(x + jamb, foot + 1.45, 0.06), Vec3::new(0.12, 1.6, 0.14)));
            }
        }
        if floor > 0 {
            parts.push(block(Vec3::new(0.0, foot - 0.1, 0.04), Vec3::new(width, 0.16, 0.3)));
        }
    }
    // A cornice, and chimneys on the flat roof.
    parts.push(block(Vec3::new(0.0, height, 0.0), Vec3::new(width, 0.4, 0.7)));
    for _ in 0..2 {
        let x = random.range(-0.4, 0.4) * width;
        let z = -random.range(0.2, 0.8) * depth;
        parts.push(block(Vec3::new(x, height + 0.7, z), Vec3::new(0.8, 1.4, 0.6)));
    }
    merged(parts)
}

/// Trees and lamps in turns along both pavements.
fn planting(stage: &mut Stage, far: f32, random: &mut Random) {
    let shape = Tree { height: 6.5, radius: 0.14, bare: 0.36, leaves: 1400, leaf: 0.24 };
    let mut tree = broadleaf(shape, random);
    tree.name = "tree".into();
    let mut lamp = lamp();
    lamp.name = "lamp".into();
    let mut z = 10.0;
    let mut number = 0;
    while z > far + 4.0 {
        for side in [-1.0, 1.0] {
            let place = Vec3::new(side * (ROAD + 0.7), KERB, z);
            let (mesh, angle) =
                if number % 2 == 0 { (&lamp, side * -FRAC_PI_2) } else { (&tree, random.angle()) };
            stage.instance(mesh, turned(angle, place), ObjectFlags::default());
        }
        z -= 11.0;
        number += 1;
    }
}

/// A lamp whose arm reaches along z.
fn lamp() -> TriangleMesh {
    let profile = [[0.11, 0.0], [0.11, 0.5], [0.06, 0.7], [0.045, 5.8], [0.0, 5.85]];
    merged([
        lathe(&profile.map(Vec2::from_array), 12),
        rod(Vec3::new(0.0, 5.7, 0.0), Vec3::new(0.0, 5.9, 1.5), 0.04, 8),
        block(Vec3::new(0.0, 5.88, 1.7), Vec3::new(0.26, 0.1, 0.6)),
    ])
}

fn parked_cars(stage: &mut Stage, far: f32, random: &mut Random) {
    let mut car = car();
    car.name = "parked car".into();
    for (side, turn) in [(-1.0, 0.0), (1.0, PI)] {
        let mut z = 4.0;
        while z > far + 5.0 {
            let place = Vec3::new(side * (ROAD - 1.1), 0.0, z);
            stage.instance(&car, turned(turn, place), ObjectFlags::default());
            z -= random.range(6.0, 28.0);
        }
    }
}

/// Cars keep their distance: all of a lane drive at one speed and start again at the other end.
fn traffic(stage: &mut Stage, cars: u32, length: f32, time: f32) {
    let lanes = [(-1.9, 0.0, 9.0), (1.9, PI, -12.0)];
    let room = (length / 10.0) as u32;
    for (lane, (x, turn, speed)) in lanes.into_iter().enumerate() {
        let count = ((cars + 1 - lane as u32) / 2).min(room);
        for i in 0..count {
            let start = length * (i as f32 + 0.25 * lane as f32) / count as f32;
            let z = NEAR - 24.0 - (start + speed * -time).rem_euclid(length);
            // The lane's cars come towards the camera at +z or leave it.
            stage.moving(
                &format!("car {}", 2 * i + 1 + lane as u32),
                car(),
                turned(turn, Vec3::new(x, 0.0, z)),
            );
        }
    }
}

/// A car that drives along z, 4.2 m long.
fn car() -> TriangleMesh {
    let body =
        [[-2.1, 0.28], [-2.15, 0.6], [-2.0, 0.86], [0.8, 0.9], [1.95, 0.76], [2.1, 0.55], [2.05, 0.28]];
    let cabin = [([-1.8, 0.87], 0.8), ([0.95, 0.89], 0.8), ([-1.25, 1.42], 0.62), ([0.1, 1.44], 0.62)];
    let both = |[z, y]: [f32; 2], x: f32| [Vec3::new(-x, y, z), Vec3::new(x, y, z)];
    let body: Vec<_> = body.into_iter().flat_map(|p| both(p, 0.86)).collect();
    let cabin: Vec<_> = cabin.into_iter().flat_map(|(p, x)| both(p, x)).collect();
    let wheels = [(-0.8, -1.3), (0.8, -1.3), (-0.8, 1.3), (0.8, 1.3)].map(|(x, z)| {
        // A vertex of the tread touches the road.
        rod(Vec3::new(x - 0.11, 0.33, z), Vec3::new(x + 0.11, 0.33, z), 0.33, 20)
    });
    merged([hull(&body), hull(&cabin)].into_iter().chain(wheels))
}

/// One plane follows the street, low enough to throw its shadow on the houses; one crosses it.
fn planes(stage: &mut Stage, length: f32, time: f32) {
    let along = (0.22 * length + 28.0 * time).rem_euclid(length);
    let place = turned(PI, Vec3::new(-5.5, 23.0, NEAR - along)) * Affine3A::from_rotation_z(0.22);
    stage.moving("plane 1", plane(), place);
    let across = (70.0 + 22.0 * time).rem_euclid(240.0) - 120.0;
    let heading = turned(FRAC_PI_2 * 0.8, Vec3::new(across + 64.0, 31.0, NEAR - 82.0));
    stage.moving("plane 2", plane(), heading * Affine3A::from_rotation_z(-0.12));
}

/// A light aircraft that flies along z, 8 m long with wings of 11 m, its middle at the origin.
fn plane() -> TriangleMesh {
    let profile = [
        [0.0, -4.4],
        [0.14, -4.3],
        [0.3, -2.4],
        [0.62, -0.4],
        [0.68, 1.2],
        [0.6, 2.4],
        [0.34, 3.2],
        [0.0, 3.6],
    ];
    let fuselage =
        lathe(&profile.map(Vec2::from_array), 20).transformed(Affine3A::from_rotation_x(FRAC_PI_2));
    let wing = |z: f32, y: f32, half: f32, chord: f32| {
        let root = block(Vec3::new(0.0, y, z), Vec3::new(0.4, 0.16, chord)).positions;
        let tip =
            |x: f32| block(Vec3::new(x, y + 0.25, z - 0.2), Vec3::new(0.04, 0.06, chord * 0.6)).positions;
        merged([-half, half].map(|x| {
            hull(&[root.clone(), tip(x)].concat().into_iter().filter(|p| p.x * x >= -0.5).collect::<Vec<_>>())
        }))
    };
    let fin = hull(
        &[[0.0, -4.4], [0.0, -3.2], [1.4, -4.5], [1.4, -3.9]]
            .into_iter()
            .flat_map(|[y, z]| [-0.06, 0.06].map(|x| Vec3::new(x, y, z)))
            .collect::<Vec<_>>(),
    );
    let propeller = block(Vec3::new(0.0, 0.0, 3.5), Vec3::new(0.14, 2.0, 0.06));
    let legs = [-0.9, 0.9].map(|x| rod(Vec3::new(x * 0.4, -0.4, 0.9), Vec3::new(x, -1.25, 0.9), 0.06, 8));
    let wheels =
        [-0.9, 0.9].map(|x| rod(Vec3::new(x - 0.09, -1.3, 0.9), Vec3::new(x + 0.09, -1.3, 0.9), 0.26, 14));
    let parts = [fuselage, wing(0.7, 0.55, 5.5, 1.5), wing(-3.8, 0.1, 1.9, 0.9), fin, propeller];
    merged(parts.into_iter().chain(legs).chain(wheels))
}
