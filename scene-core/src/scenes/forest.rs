//! A plant ecosystem by instancing: a few plants of each kind, placed many times on hilly ground, outwards
//! from a clearing until the triangles asked for are spent.

use glam::{Affine3A, Quat, Vec2, Vec3};

use super::plants::{Tree, broadleaf, bush, conifer, grass};
use super::random::Random;
use super::spec::Values;
use super::{BuiltIn, Parameter, Stage, camera};
use crate::geometry::ObjectFlags;
use crate::{Light, TriangleMesh};

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "forest",
    summary: "a plant ecosystem by instancing, up to 20 million triangles, under a low sun",
    parameters: &[
        Parameter::whole(
            "triangles",
            1_000_000,
            [1_000, 20_000_000],
            "triangles in all; what is left over is less than a tuft of grass",
        ),
        Parameter::whole(
            "points",
            0,
            [0, 1],
            "1 marks the plants to be drawn as points by techniques that can",
        ),
        Parameter::real("light", 0.27, [0.0, 5.0], "angular radius of the sun, in degrees"),
        Parameter::SEED,
    ],
    counts: None,
    build,
};

/// Squares of the ground a side, at most.
const GROUND: u32 = 64;
/// Triangles of a forest that has them; a smaller one has as large a part of its triangles in its ground.
const WHOLE_GROUND: f32 = 20_000.0;
/// Radius of the clearing, in metres.
const CLEARING: f32 = 7.0;

/// A kind of plant: its variants, how far apart they grow, and where.
struct Species {
    variants: Vec<TriangleMesh>,
    /// Side of the square that one plant has for itself, in metres.
    spacing: f32,
    /// The share of moist ground it likes: from, to.
    moisture: [f32; 2],
    in_clearing: bool,
}

/// A plant to be.
struct Site {
    distance: f32,
    place: Vec2,
    species: usize,
    variant: usize,
    angle: f32,
    scale: f32,
}

fn build(values: &Values<'_>, _time: f32) -> Stage {
    let seed = values.whole("seed");
    let budget = values.whole("triangles") as usize;
    let angular_radius = values.real("light").to_radians();
    let flags = ObjectFlags { points: values.whole("points") == 1, ..Default::default() };
    let light = Light::Directional { direction: Vec3::new(0.75, -0.62, 0.3), angular_radius };
    let mut stage =
        Stage::new(camera(Vec3::new(-3.0, 11.0, 26.0), Vec3::new(0.0, 2.6, -6.0), 46.0, 0.3), light);

    let species = species(seed);
    // Triangles a square metre, if every place were taken: the radius follows, with room for the rest.
    let density: f32 =
        species.iter().map(|s| s.variants[0].triangles.len() as f32 / (s.spacing * s.spacing)).sum();
    let radius = (1.8 * budget as f32 / density / std::f32::consts::PI).sqrt() + 2.0 * CLEARING;
    let squares = GROUND.min((GROUND as f32 * (budget as f32 / WHOLE_GROUND).sqrt()) as u32);
    let ground = ground(radius, squares);
    let mut left = budget - ground.triangles.len();
    stage.add("ground", ground);

    for site in sites(&species, radius, seed) {
        let mesh = &species[site.species].variants[site.variant];
        if mesh.triangles.len() <= left {
            left -= mesh.triangles.len();
            stage.instance(mesh, placed(&site), flags);
        }
    }
    stage
}

fn species(seed: u32) -> Vec<Species> {
    let tree = |height, radius, bare, leaves, leaf| Tree { height, radius, bare, leaves, leaf };
    let grown = |name: &'static str, count: u32, grow: &dyn Fn(&mut Random) -> TriangleMesh| {
        let stream = name.bytes().fold(0, |sum, byte| sum * 31 % 65_521 + u32::from(byte));
        (0..count)
            .map(|i| TriangleMesh { name: name.into(), ..grow(&mut Random::new(seed, stream * 16 + i)) })
            .collect()
    };
    let kind =
        |spacing, moisture, in_clearing, variants| Species { variants, spacing, moisture, in_clearing };
    vec![
        kind(6.5, [0.3, 0.75], false, grown("oak", 3, &|r| broadleaf(tree(8.5, 0.3, 0.3, 3600, 0.26), r))),
        kind(5.0, [0.5, 1.0], false, grown("birch", 3, &|r| broadleaf(tree(9.0, 0.13, 0.4, 1800, 0.22), r))),
        kind(4.2, [0.0, 0.5], false, grown("spruce", 3, &|r| conifer(tree(11.0, 0.2, 0.1, 4000, 0.36), r))),
        kind(3.0, [0.2, 1.0], false, grown("bush", 3, &|r| bush(1.2, 380, 0.16, r))),
        kind(1.7, [0.35, 1.0], true, grown("fern", 2, &|r| bush(0.5, 60, 0.22, r))),
        kind(1.1, [0.0, 1.0], true, grown("grass", 4, &|r| grass(0.6, 0.3, 60, r))),
    ]
}

/// Every place where a plant could grow, nearest to the clearing first.
fn sites(species: &[Species], radius: f32, seed: u32) -> Vec<Site> {
    let mut sites = Vec::new();
    for (index, s) in species.iter().enumerate() {
        let side = (radius / s.spacing).ceil() as i32;
        for (i, j) in (-side..side).flat_map(|j| (-side..side).map(move |i| (i, j))) {
            // A cell has numbers of its own, so that a larger forest is the smaller one and more.
            let mut random = Random::new(seed, cell(index, i, j));
            let jitter = random.square() * 0.42;
            let (angle, scale, variant) =
                (random.angle(), random.range(0.7, 1.2), random.index(s.variants.len()));
            let place = (Vec2::new(i as f32, j as f32) + 0.5 + jitter) * s.spacing;
            let distance = place.length();
            let grows = (s.moisture[0]..=s.moisture[1]).contains(&moisture(place))
                && distance < radius
                && (s.in_clearing || !is_cleared(place));
            if grows {
                sites.push(Site { distance, place, species: index, variant, angle, scale });
            }
        }
    }
    sites.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    sites
}

/// A stream of random numbers for each place of each species.
fn cell(species: usize, i: i32, j: i32) -> u32 {
    let mix = (i as u32).wrapping_mul(0x9E37_79B1) ^ (j as u32).wrapping_mul(0x85EB_CA77).rotate_left(13);
    mix ^ (species as u32 + 1).wrapping_mul(0xC2B2_AE3D)
}

/// A round clearing and the lane along which the camera looks.
fn is_cleared(place: Vec2) -> bool {
    place.length() < CLEARING || (place.y > 0.0 && place.x.abs() < CLEARING && place.y < 24.0)
}

/// A smooth pattern in [0, 1].
fn moisture(p: Vec2) -> f32 {
    let wave = (0.11 * p.x + 0.05 * p.y).sin()
        + (0.08 * p.y - 0.06 * p.x + 1.3).sin()
        + (0.31 * p.x + 2.0).cos() * (0.27 * p.y).cos();
    (0.5 + wave / 6.0).clamp(0.0, 1.0)
}

/// Height of the ground: hills of about 50 m across and 2 m high, level at the clearing.
fn height(p: Vec2) -> f32 {
    let level = (p.length() / 40.0).min(1.0);
    2.0 * level * ((0.13 * p.x).sin() * (0.11 * p.y + 0.5).cos() + 0.4 * (0.05 * p.y).sin())
}

fn ground(radius: f32, squares: u32) -> TriangleMesh {
    let at = |i: u32, j: u32| {
        let p = (Vec2::new(i as f32, j as f32) / squares as f32 * 2.0 - 1.0) * (radius * 1.1);
        Vec3::new(p.x, height(p), p.y)
    };
    let positions = (0..=squares).flat_map(|j| (0..=squares).map(move |i| at(i, j))).collect();
    let triangles = (0..squares)
        .flat_map(|j| (0..squares).map(move |i| j * (squares + 1) + i))
        .flat_map(|a| [[a, a + squares + 1, a + 1], [a + 1, a + squares + 1, a + squares + 2]])
        .collect();
    TriangleMesh::new("", positions, triangles)
}

/// Plants stand upright, a little sunk: on a slope, and where the ground's triangles cut off a hill.
fn placed(site: &Site) -> Affine3A {
    let foot = Vec3::new(site.place.x, height(site.place) - 0.06, site.place.y);
    Affine3A::from_scale_rotation_translation(
        Vec3::splat(site.scale),
        Quat::from_rotation_y(site.angle),
        foot,
    )
}
