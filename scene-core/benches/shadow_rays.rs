//! Shadow rays a second and core: packets, single rays and `obvhs`'s own traversal, on the same stored rays.
//!
//! The rays are those of a 256 × 256 image under a rectangular light. The dragon takes part if its mesh is
//! found beside the workspace. The table that is printed first takes the least of several interleaved runs, so
//! that its ratios hold on a machine that others use too.

use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use glam::{Affine3A, Vec3};
use gnomon_scene_core::bvh::{Bvh, shadow_origin};
use gnomon_scene_core::geometry::{ObjectFlags, Scene, TriangleMesh};
use gnomon_scene_core::light::LightPoint;
use obvhs::ray::Ray;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use rayon::prelude::*;

const SIDE: usize = 256;

/// A scene, where it is seen from and its rectangular light.
struct Case {
    name: &'static str,
    scene: Scene,
    eye: Vec3,
    aim: Vec3,
    light: [Vec3; 3],
}

/// Stored rays: per seen pixel an origin and `samples` targets.
struct Rays {
    samples: usize,
    origins: Vec<Vec3>,
    targets: Vec<LightPoint>,
}

fn ball(rings: u32, sectors: u32) -> TriangleMesh {
    let at = |ring: u32, sector: u32| ring * sectors + sector % sectors;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for ring in 0..=rings {
        let (sin, cos) = (std::f32::consts::PI * ring as f32 / rings as f32).sin_cos();
        for sector in 0..sectors {
            let (s, c) = (std::f32::consts::TAU * sector as f32 / sectors as f32).sin_cos();
            positions.push(Vec3::new(sin * c, cos, sin * s));
            if ring < rings {
                let (a, b) = (at(ring, sector), at(ring, sector + 1));
                let (c, d) = (at(ring + 1, sector), at(ring + 1, sector + 1));
                triangles.extend([[a, c, b], [b, c, d]]);
            }
        }
    }
    TriangleMesh::new("ball", positions, triangles)
}

fn ground() -> TriangleMesh {
    let positions = [(-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
    TriangleMesh::new("ground", positions.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
}

fn cases() -> Vec<Case> {
    let scene_of = |mesh: &TriangleMesh, place: Vec3| {
        let mut scene = Scene::new();
        for (mesh, place) in [(mesh, place), (&ground(), Vec3::ZERO)] {
            scene.add(mesh, Affine3A::from_translation(place), ObjectFlags::default()).expect("a valid mesh");
        }
        scene
    };
    let mut cases = vec![Case {
        name: "ball",
        scene: scene_of(&ball(224, 224), Vec3::Y * 1.2),
        eye: Vec3::new(0.0, 3.5, 6.0),
        aim: Vec3::new(0.0, 0.8, 0.0),
        light: [Vec3::new(1.5, 5.0, 1.0), Vec3::X * 0.7, Vec3::Z * 0.7],
    }];
    let dragon = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes/dragon.obj");
    if let Ok((models, _)) = tobj::load_obj(dragon, &tobj::GPU_LOAD_OPTIONS) {
        let mut mesh = TriangleMesh::default();
        for model in models {
            let positions = model.mesh.positions.as_chunks::<3>().0;
            let positions = positions.iter().map(|&p| Vec3::from_array(p)).collect();
            let triangles = model.mesh.indices.as_chunks::<3>().0.to_vec();
            mesh.append(&TriangleMesh::new("dragon", positions, triangles));
        }
        cases.push(Case {
            name: "dragon",
            scene: scene_of(&mesh, Vec3::ZERO),
            eye: Vec3::new(-3.0061, 2.7623, 3.0613),
            aim: Vec3::new(-0.59531, 0.71228, -0.38167),
            light: [
                Vec3::new(1.2987, 3.4351, 1.0898),
                Vec3::new(0.25706, 0.0, -0.30635),
                Vec3::new(-0.2598, 0.21192, -0.218),
            ],
        });
    }
    cases
}

/// A hash as a number in [0, 1).
fn random(seed: u32) -> f32 {
    let mut x = seed.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
    x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    ((x ^ x >> 16) >> 8) as f32 / (1_u32 << 24) as f32
}

/// The rays of an image with a stratified pattern of `side`² samples a pixel.
fn rays(case: &Case, bvh: &Bvh, side: usize) -> Rays {
    let forward = (case.aim - case.eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let half = 20.0_f32.to_radians().tan();
    let magnitude = bvh.bounds().magnitude().max(case.eye.abs().max_element());
    let mut rays = Rays { samples: side * side, origins: Vec::new(), targets: Vec::new() };
    let [center, half_u, half_v] = case.light;
    for pixel in 0..SIDE * SIDE {
        // Pixels in tiles of 8 × 8.
        let (tile, within) = (pixel / 64, pixel % 64);
        let (x, y) = (tile % (SIDE / 8) * 8 + within % 8, tile / (SIDE / 8) * 8 + within / 8);
        let at = |i: usize| (i as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0;
        let direction = forward + right * at(x) * half - up * at(y) * half;
        let Some(hit) = bvh.closest_hit(case.eye, direction, 0.0, f32::INFINITY) else { continue };
        let [a, b, c] = case.scene.corners(hit.triangle as usize);
        let normal = (b - a).cross(c - a).normalize();
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let position = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
        if normal.dot((center - position).normalize()) <= 0.05 {
            continue;
        }
        rays.origins.push(shadow_origin(position, normal, magnitude));
        for sample in 0..side * side {
            let seed = (pixel * side * side + sample) as u32 * 2;
            let place = |cell: usize, seed: u32| (cell as f32 + random(seed)) / side as f32 * 2.0 - 1.0;
            let (u, v) = (place(sample % side, seed), place(sample / side, seed + 1));
            rays.targets.push(LightPoint::At(center + half_u * u + half_v * v));
        }
    }
    rays
}

/// The rival: a binary tree and its triangles in leaf order, as its author recommends.
struct Rival {
    tree: obvhs::bvh2::Bvh2,
    triangles: Vec<RtTriangle>,
}

impl Rival {
    fn new(scene: &Scene) -> Self {
        let triangles: Vec<_> = (0..scene.triangles().len())
            .map(|i| {
                let [v0, v1, v2] = scene.corners(i).map(Into::into);
                Triangle { v0, v1, v2 }
            })
            .collect();
        let params = obvhs::BvhBuildParams::medium_build();
        let tree = obvhs::bvh2::builder::build_bvh2_from_tris(&triangles, params, &mut Duration::default());
        let triangles = tree.primitive_indices.iter().map(|&i| (&triangles[i as usize]).into()).collect();
        Self { tree, triangles }
    }

    fn is_occluded(&self, origin: Vec3, target: LightPoint) -> bool {
        let (direction, end) = target.ray_from(origin);
        let ray = Ray::new(origin.into(), direction.into(), 0.0, end);
        !self.tree.ray_traverse_miss(ray, |ray, id| self.triangles[id].intersect(ray))
    }
}

fn by_rival(rival: &Rival, rays: &Rays) -> usize {
    let pixels = rays.origins.iter().zip(rays.targets.chunks(rays.samples));
    pixels.map(|(&o, targets)| targets.iter().filter(|&&t| rival.is_occluded(o, t)).count()).sum()
}

fn one_by_one(bvh: &Bvh, rays: &Rays) -> usize {
    let pixels = rays.origins.iter().zip(rays.targets.chunks(rays.samples));
    pixels.map(|(&o, targets)| targets.iter().filter(|&&t| bvh.is_occluded(o, t)).count()).sum()
}

fn by_pixel(bvh: &Bvh, rays: &Rays) -> usize {
    let pixels = rays.origins.iter().zip(rays.targets.chunks(rays.samples));
    pixels.map(|(&o, targets)| bvh.occluded_mask(o, targets).count_ones() as usize).sum()
}

fn by_tile(bvh: &Bvh, rays: &Rays) -> usize {
    let tiles = rays.origins.chunks(64).zip(rays.targets.chunks(64));
    tiles
        .map(|(origins, targets)| {
            let mut blocked = [false; 64];
            bvh.occluded_packet(origins, targets, &mut blocked[..origins.len()]);
            blocked.iter().filter(|&&b| b).count()
        })
        .sum()
}

fn by_pixel_parallel(bvh: &Bvh, rays: &Rays) -> usize {
    let pixels = rays.origins.par_iter().zip(rays.targets.par_chunks(rays.samples)).with_min_len(256);
    pixels.map(|(&o, targets)| bvh.occluded_mask(o, targets).count_ones() as usize).sum()
}

/// Seconds this thread has spent on a processor, where the system tells: other programs do not disturb it.
fn processor_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    stat.split_whitespace().next()?.parse::<f64>().ok().map(|nanoseconds| nanoseconds * 1e-9)
}

fn time<R>(run: impl FnOnce() -> R) -> (f64, R) {
    let (start, processor) = (Instant::now(), processor_seconds());
    let result = black_box(run());
    let wall = start.elapsed().as_secs_f64();
    (processor_seconds().zip(processor).map_or(wall, |(end, start)| end - start), result)
}

fn wall_time<R>(run: impl FnOnce() -> R) -> (f64, R) {
    let start = Instant::now();
    let result = black_box(run());
    (start.elapsed().as_secs_f64(), result)
}

fn table(case: &Case, bvh: &Bvh, rival: &Rival) {
    let pool = |n: usize| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
    let (one, two) = (pool(1), pool(2));
    for side in [1, 4, 8] {
        let rays = rays(case, bvh, side);
        let mut least = [f64::INFINITY; 5];
        let mut blocked = [0; 5];
        for _ in 0..7 {
            let runs: [&dyn Fn() -> usize; 5] = [
                &|| by_rival(rival, &rays),
                &|| one_by_one(bvh, &rays),
                &|| if side == 1 { by_tile(bvh, &rays) } else { by_pixel(bvh, &rays) },
                &|| one.install(|| by_pixel_parallel(bvh, &rays)),
                &|| two.install(|| by_pixel_parallel(bvh, &rays)),
            ];
            for (i, run) in runs.into_iter().enumerate() {
                // The thread that waits for a pool uses no processor.
                let (seconds, count) = if i < 3 { time(run) } else { wall_time(run) };
                least[i] = least[i].min(seconds);
                blocked[i] = count;
            }
        }
        assert!(blocked[1..].iter().all(|&b| b == blocked[1]), "packets and single rays agree");
        let count = rays.targets.len();
        let rate = least.map(|seconds| count as f64 / seconds / 1e6);
        println!(
            "{:8} {:3} rays a pixel, {:8} rays, {:4.1} % blocked (obvhs {:4.1} %): obvhs {:5.1} Mrays/s, single {:5.1} \
             ({:.2}x), {} {:5.1} ({:.2}x), two threads {:.2}x of one",
            case.name,
            rays.samples,
            count,
            100.0 * blocked[1] as f64 / count as f64,
            100.0 * blocked[0] as f64 / count as f64,
            rate[0],
            rate[1],
            rate[1] / rate[0],
            if side == 1 { "tile  " } else { "packet" },
            rate[2],
            rate[2] / rate[0],
            rate[4] / rate[3],
        );
    }
}

fn main() {
    let mut criterion = Criterion::default().sample_size(10).configure_from_args();
    for case in cases() {
        let (seconds, bvh) = wall_time(|| Bvh::casters(&case.scene));
        let (rival_seconds, rival) = wall_time(|| Rival::new(&case.scene));
        println!(
            "{:8} {} triangles: built in {:.0} ms (obvhs {:.0} ms), {} bytes a triangle",
            case.name,
            bvh.triangle_count(),
            seconds * 1e3,
            rival_seconds * 1e3,
            bvh.bytes() / bvh.triangle_count()
        );
        table(&case, &bvh, &rival);
        for side in [4, 8] {
            let rays = rays(&case, &bvh, side);
            let mut group = criterion.benchmark_group(format!("{}/{}", case.name, rays.samples));
            group.throughput(Throughput::Elements(rays.targets.len() as u64));
            group.bench_function("packets", |b| b.iter(|| by_pixel(&bvh, &rays)));
            group.bench_function("single", |b| b.iter(|| one_by_one(&bvh, &rays)));
            group.bench_function("obvhs", |b| b.iter(|| by_rival(&rival, &rays)));
            group.finish();
        }
    }
    criterion.final_summary();
}
